"""Families of systems from expressions: against Mathieu's functions, `floquet` at each value, SciPy; what does not fit."""

import casadi as ca
import numpy as np
import pytest
from scipy.special import mathieu_a, mathieu_b

import flexlin as fl
from flexlin.periodic import measure_distances
from tests.thinned import thin

t, a, q = ca.SX.sym("t"), ca.SX.sym("a"), ca.SX.sym("q")
STIFFNESS = a - 2 * q * ca.cos(2 * t)


def mathieu(damping=0.0):
    return fl.PeriodicFamily.from_second_order(1, damping, STIFFNESS, t, [a, q], np.pi)


def random_family(n, seed, period=1.7):
    """Two harmonics, two parameters, and an input."""
    C, w = np.random.default_rng(seed).standard_normal((5, n, n)), 2 * np.pi / period
    A = C[0] - 2 * np.eye(n) + a * (C[1] * ca.cos(w * t) + C[2] * ca.sin(w * t)) + q * C[3] * ca.cos(2 * w * t) ** 2
    return fl.PeriodicFamily(A + a * q * C[4], t, ca.vertcat(a, q), period, B=np.ones((n, 1)) * ca.sin(w * t))


def assert_within(found, i, exact):
    """Exponents of a sweep, both ways, within the errors that are stated."""
    apart = measure_distances(found.exponents.values[i] * exact.period, exact.log_multipliers) / exact.period
    assert max(apart.min(axis=1).max(), apart.min(axis=0).max()) <= float(found.error[i]) + exact.error


def test_tongues_of_mathieus_equation():
    """Boundaries of the first two tongues at q = 0.2 are characteristic values a_k, b_k."""
    only = fl.PeriodicFamily(ca.blockcat([[0, 1], [-ca.substitute(STIFFNESS, q, 0.2), 0]]), t, a, np.pi)
    found = fl.critical_values(only, "a", (0.5, 4.5), tol=1e-9, samples=65)
    assert [one.kind for one in found] == ["onset", "recovery", "onset", "recovery"]
    exact = [mathieu_b(1, 0.2), mathieu_a(1, 0.2), mathieu_b(2, 0.2), mathieu_a(2, 0.2)]
    for one, value in zip(found, exact, strict=True):
        assert abs(one.value - value) <= min(1e-8, one.error + 1e-10)


def test_a_boundary_of_mathieus_equation_with_damping():
    (curve,) = fl.stability_boundary(mathieu(0.2), {"q": (0.0, 0.3), "a": (0.6, 1.4)}, tol=1e-3, cells=4)
    assert curve.paths == ("q", "a")
    assert abs(curve.points[:, 0].min() - 0.2) < 2e-3


@pytest.mark.parametrize("n", thin([4, 1, 2, 3, 5, 8, 9]))
def test_sweeps_of_random_families_agree_with_floquet(n):
    family, rng = random_family(n, n), np.random.default_rng(0)
    values = {"q": rng.uniform(-1, 1, 20), "a": rng.uniform(0, 2, 20)}
    found = fl.sweep(family, values)
    assert found.attrs["route"] == ("one by one" if n in (1, 9) else "together")
    for i in (0, 13, 19):
        system = family.at([values["a"][i], values["q"][i]])
        exact = fl.floquet(system, 1e-11)
        assert (system.n, system.m) == (n, 1)
        assert_within(found, i, exact)
        assert str(found.verdict.values[i]) == exact.verdict


def test_periods_and_breaks_that_are_expressions():
    """A Meissner equation whose period 2 pi/a moves with its break: phases stay, so it is computed together; a break that moves is not."""

    def grow(end, period, values):
        A = ca.blockcat([[0, 1], [-1 + 0.2 * ca.if_else(t < end, 1, -1), 0]])
        found = fl.sweep(fl.PeriodicFamily(A, t, [a], period, breaks=[0.0, end]), {"a": values}, tol=1e-9)
        i = len(values) // 2
        assert abs(found.exponents.values[i].real.max() - 0.04137974466122074514) <= float(found.error[i])
        return found

    found = grow(2 * np.pi / (3 * a), 2 * ca.pi / a, [1.9, 2.0, 2.1])
    assert found.attrs["route"] == "together"
    assert np.allclose(found.period, 2 * np.pi / np.array([1.9, 2.0, 2.1]))
    assert grow(a, np.pi, [np.pi / 3]).attrs["route"] == "one by one"


def test_a_pulse_that_the_kernel_would_step_over_is_seen():
    """A pulse of a thousandth of the period: `floquet` finds it at a few values, and so takes all."""
    pulse = 40 * ca.exp(-(((t - 0.4321) / 0.0007) ** 2))
    family = fl.PeriodicFamily(ca.blockcat([[-0.1, 1], [-a - a * pulse, -0.1]]), t, [a], 1.0)
    found = fl.sweep(family, {"a": [1.0, 2.0]}, tol=1e-8)
    assert_within(found, 1, fl.floquet(family.at([2.0]), 1e-10))


def test_values_with_no_answer_do_not_disturb_the_others():
    """sqrt(a) is no number below zero; the mass matrix is singular at q = 1."""
    M = ca.blockcat([[1, q], [q, 1]])
    K = (2 + ca.sqrt(a) * ca.cos(t)) * SQUARE
    family = fl.PeriodicFamily.from_second_order(M, 0.1 * SQUARE, K, t, [a, q], 2 * np.pi)
    found = fl.sweep(family, {"a": [1.0, -1.0, 1.0, 0.5], "q": [0.2, 0.2, 1.0, 0.3]})
    assert found.verdict.values[1:3].tolist() == ["failed", "failed"]
    assert np.isfinite(found.error.values[[0, 3]]).all()


SQUARE = ca.SX.eye(2)
BAD = {
    "not square": lambda: fl.PeriodicFamily(ca.SX(2, 3), t, [a], 1.0),
    "empty": lambda: fl.PeriodicFamily(ca.SX(0, 0), t, [a], 1.0),
    "a stranger": lambda: fl.PeriodicFamily(SQUARE * q, t, [a], 1.0),
    "a stranger in the period": lambda: fl.PeriodicFamily(SQUARE * a, t, [a], q),
    "a period of the time": lambda: fl.PeriodicFamily(SQUARE * a, t, [a], 1 + t),
    "no period": lambda: fl.PeriodicFamily(SQUARE * a, t, [a], 0.0),
    "numbers that are none": lambda: fl.PeriodicFamily(np.array([[np.nan]]), t, [a], 1.0),
    "no parameters": lambda: fl.PeriodicFamily(SQUARE, t, [], 1.0),
    "a parameter twice": lambda: fl.PeriodicFamily(SQUARE * a, t, [a, a], 1.0),
    "the time as a parameter": lambda: fl.PeriodicFamily(SQUARE * a, t, [a, t], 1.0),
    "no symbol for the time": lambda: fl.PeriodicFamily(SQUARE * a, 2 * t, [a], 1.0),
    "an expression as a parameter": lambda: fl.PeriodicFamily(SQUARE * a, t, [2 * a], 1.0),
    "B of other rows": lambda: fl.PeriodicFamily(SQUARE * a, t, [a], 1.0, B=ca.SX(3, 1)),
    "a break that is a matrix": lambda: fl.PeriodicFamily(SQUARE * a, t, [a], 1.0, breaks=[SQUARE]),
    "shapes that differ": lambda: fl.PeriodicFamily.from_second_order(SQUARE, SQUARE, ca.SX.eye(3), t, [a], 1.0),
    "a missing value": lambda: mathieu().at({"a": 1.0}),
    "a value that is no number": lambda: mathieu().at([1.0, np.nan]),
    "a period that vanishes": lambda: fl.PeriodicFamily(SQUARE * a, t, [a], a).at([0.0]),
    "a break outside": lambda: fl.PeriodicFamily(SQUARE * a, t, [a], 1.0, breaks=[a]).at([2.0]),
    "a sweep with a missing name": lambda: fl.sweep(mathieu(), {"a": [1.0]}),
    "another loop": lambda: fl.sweep(mathieu(), {"a": [1.0], "q": [0.1]}, loop="open"),
    "a critical value with a free symbol": lambda: fl.critical_values(mathieu(), "a", (0.5, 1.0)),
}


@pytest.mark.parametrize("name", BAD)
def test_what_does_not_fit_is_refused(name):
    with pytest.raises(fl.errors.ArgumentError):
        BAD[name]()
