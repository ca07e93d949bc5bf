"""Spectra of many plain systems together: as `floquet` has them one by one, or not said to be accurate."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b

import flexlin as fl
from flexlin.periodic import find_together, match_logs
from flexlin.periodic.boundary.together import multiply_up
from tests.periodic.systems import lyapunov_transformed, mathieu_second_order


def agree(systems, tol):
    """How many systems meet tol; each of them lies within both errors of what `floquet` says, and its verdict is the same."""
    products = find_together(systems, tol)
    found, reached = products.spectra, products.meets(tol)
    for k in np.flatnonzero(reached):
        one = fl.floquet(systems[k], 1e-11)
        partner, apart = match_logs(found.logs[k], one.log_multipliers)
        known = np.isfinite(one.errors[partner])
        assert np.all(apart[known] <= (found.errors[k] + one.errors[partner] * one.period)[known])
        verdict = found.at(np.array([k])).verdicts[0]
        assert verdict in (0, {"stable": -1, "unstable": 1, "undecided": 0}[one.verdict])
    return int(reached.sum())


def test_tongues_of_mathieus_equation():
    """Anywhere, on the edges of tongues and a little beside them, with and without damping."""
    rng, systems = np.random.default_rng(0), []
    for q in np.repeat(10 ** rng.uniform(-3, 0.5, 12), 2):
        edge = float(rng.choice([mathieu_a, mathieu_b])(int(rng.integers(1, 5)), q))
        beside = edge + rng.choice([-1, 1]) * 10 ** rng.uniform(-9, -3)
        systems += [mathieu_second_order(a, q) for a in (edge, beside)]
    systems += [mathieu_second_order(a, 0.4, 0.02) for a in rng.uniform(0.1, 12, 12)]
    assert agree(systems, 1e-5) > 50


@pytest.mark.parametrize("seed", range(3))
def test_non_normal_systems(seed):
    rng, systems = np.random.default_rng(seed), []
    for _ in range(8):
        constant = np.diag(rng.uniform(-2, 0.3, 3)) + np.triu(3 * rng.standard_normal((3, 3)), 1)
        systems.append(fl.PeriodicSystem(lyapunov_transformed(constant, 2.0, 2, rng), np.pi))
    assert agree(systems, 1e-8) > 5


def test_what_the_segments_do_not_follow_is_not_called_accurate():
    """Fast modes, a jump that nobody named, and multipliers that lie 1e40 apart."""

    def jump(t):
        return np.where(np.mod(t, 1.0) < 0.4142, -1.0, 0.7)[:, None, None] * np.eye(2)

    def apart(t):
        return np.array([[1.0, 5.0], [0.0, -90.0]]) + 0.1 * np.sin(2 * np.pi * t)[:, None, None]

    systems = [fl.PeriodicSystem(A, 1.0) for A in (np.diag([-1.0, -1e5]), jump, apart)]
    assert not find_together(systems, 1e-8).meets(1e-8).any()


@pytest.mark.parametrize("seed", [0, 3, 6, 9])
def test_products_are_no_farther_off_than_their_bound(seed):
    """Of turning, shearing, decaying factors, against the same product with 11 more bits; the bound is not much too large."""
    rng, n = np.random.default_rng(seed), 2 + seed
    noise = rng.standard_normal((100, n, n))
    turning, shear = np.linalg.qr(noise)[0], np.eye(n) + 0.3 * np.triu(noise, 1)
    factors = np.array([turning, shear, 0.9 * turning @ shear])
    made, bound = multiply_up(factors)
    exact = np.broadcast_to(np.eye(n, dtype=np.longdouble), made.shape)
    for k in range(100):
        exact = factors[:, k].astype(np.longdouble) @ exact
    off = np.abs(made - exact)
    assert np.all(off <= bound)
    assert np.all(bound.max(axis=(1, 2)) < 1e4 * off.max(axis=(1, 2)))


def test_a_frequency_is_searched_on_few_systems():
    """y'' + (1 - 0.4 cos pt) y = 0: Mathieu's equation of a = 4 / p^2, q = a / 5; SciPy knows its edges."""
    asked = []

    def system(p):
        asked.append(p)
        stiffness = lambda t: (1 - 0.4 * np.cos(p * t))[:, None, None]  # noqa: E731
        return fl.PeriodicSystem.from_second_order([[1.0]], [[0.0]], stiffness, 2 * np.pi / p)

    found = [one.value for one in fl.critical_values(system, "p", (0.45, 3.0), tol=1e-8)]
    edges = [(edge, n) for n in range(1, 5) for edge in (mathieu_a, mathieu_b)]
    exact = sorted(2 / np.sqrt(brentq(lambda a, e=e, n=n: a - e(n, a / 5), n**2 / 2, 2 * n**2)) for e, n in edges)
    np.testing.assert_allclose(found, exact, atol=1e-8)
    assert len(asked) < 250
