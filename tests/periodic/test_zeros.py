"""Invariant zeros: published examples, turned constant systems beside SciPy's pencil, a plant that jumps."""

import numpy as np
import pytest
from scipy.linalg import eigvals

import flexlin as fl
from tests.periodic.judge import covers
from tests.periodic.systems import turned


def zhou(t):
    s, c = np.sin(2 * t), np.cos(2 * t)
    sine = 0.5 * np.sin(4 * t)
    return np.array([[-1 - s**2, 2 - sine], [-2 - sine, -1 - c**2]]).transpose(2, 0, 1)


@pytest.mark.parametrize("strength", [0.1, 0.4])
def test_published_examples(strength):
    """Zhou, Hagiwara, Automatica 38 (2002): C = [1, 1], zero -3.5; Zhou, IEEE Trans. Automat. Control 54 (2009): C = [0, 1], zero -1.5.

    Both for any strength of the input's waves; also in the tests of PeriodicSystems.jl (Varga), there with 0.5, where the input vanishes.
    """

    def half(t):
        return np.where(np.mod(t, np.pi) < np.pi / 2, np.sin(2 * t), 0.0)

    for wave, C, zero in ((half, [[1.0, 1.0]], -3.5), (lambda t: np.cos(2 * t), [[0.0, 1.0]], -1.5)):
        B = lambda t, wave=wave: (1 - 2 * strength * wave(t))[:, None, None] * np.array([[0.0], [1.0]])  # noqa: E731
        found = fl.invariant_zeros(fl.PeriodicSystem(zhou, np.pi, B), C)
        assert abs(found.exponents.item() - zero) <= found.errors.item() + 1e-13
        assert found.errors.item() < 1e-8
        assert (found.relative_degree, found.verdict) == ((1,), "minimum phase")


@pytest.mark.parametrize("seed", range(8))
def test_turned_constant_systems_have_the_zeros_of_rosenbrocks_pencil(seed):
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(3, 7)), int(rng.integers(1, 3))
    A0, B0, C0 = rng.standard_normal((n, n)), rng.standard_normal((n, m)), rng.standard_normal((m, n))
    if seed % 2:  # relative degree 2
        C0 -= C0 @ B0 @ np.linalg.pinv(B0)
    system, output = turned(A0, B0, C0)
    pencil = np.block([[A0, B0], [C0, np.zeros((m, m))]])
    zeros = eigvals(pencil, np.diag([1.0] * n + [0.0] * m))
    zeros = zeros[np.abs(zeros) < 1e4]
    found = fl.invariant_zeros(system, output)
    assert found.relative_degree == (1 + seed % 2,) * m
    assert len(found.exponents) == len(zeros) == n - sum(found.relative_degree)
    assert covers(found, zeros, system.period, doubt=1e-9 * (1 + np.abs(zeros)))
    assert found.errors.max(initial=0.0) < 1e-6


@pytest.mark.parametrize("plane", [(0, 1), (1, 2)])
def test_rounding_is_no_action_of_an_input(plane):
    """Three integrators and a mode at -1, two states turned: rows of C, A and B vanish by turns, but for roundings.

    What the product of two roundings came to counted as the input's action, one derivative too early; a row of roundings alone could
    not be resolved.
    """
    A0 = np.zeros((4, 4))
    A0[[0, 1, 3], [1, 2, 0]], A0[3, 3] = 1.0, -1.0
    found = fl.invariant_zeros(*turned(A0, np.eye(4)[:, 2:3], np.eye(4)[:1], 1.0, *plane))
    assert found.relative_degree == (3,)
    assert abs(found.exponents.item() + 1) <= found.errors.item() + 1e-12


def test_a_plant_that_jumps():
    """x1' = a x1 + b x2 with x2 the output: the zero is the mean of a(t)."""

    def A(t):
        first, one = np.where(np.mod(t, 2.0) < 0.7, 1.0, -0.3), np.ones_like(t)
        return np.array([[first, np.cos(np.pi * t)], [one, -2 * one]]).transpose(2, 0, 1)

    found = fl.invariant_zeros(fl.PeriodicSystem(A, 2.0, [[0.0], [1.0]]), [[0.0, 1.0]])
    assert abs(found.exponents.item() - (0.7 - 0.3 * 1.3) / 2) <= found.errors.item() < 1e-8
    assert found.verdict == "non-minimum phase"


def test_a_feedthrough_inverts_the_plant():
    system = fl.PeriodicSystem([[0.0, 1.0], [-1.0, -1.0]], 1.0, B=[[0.0], [1.0]])
    found = fl.invariant_zeros(system, [[1.0, 0.0]], [[1.0]])  # A - B C
    np.testing.assert_allclose(np.sort_complex(found.exponents), np.roots([1, 1, 2])[::-1], atol=1e-9)
    far = fl.PeriodicSystem([[0.0, 1.0], [-1.0, -1.0]], 1.0, B=[[1.0], [-1.0]])
    assert "near 2e+12 1/s, growing or not, would be missed" in fl.invariant_zeros(far, [[1.0, 1.0 + 1e-12]]).status
