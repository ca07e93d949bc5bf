"""Exact shapes of uniform beams: known roots, residuals, boundary conditions, orthogonality; up to 60 modes."""

import numpy as np
import pytest

from flexlin.errors import ArgumentError
from flexlin.mechanics import clamped_free, clamped_with_tip, pinned_with_hub

ENDS = np.array([0.0, 1.0])
KINDS = {
    "clamped-free": clamped_free,
    "clamped with tip": lambda n: clamped_with_tip(n, 1.0, 0.1),
    "pinned-free": pinned_with_hub,
    "pinned with hub": lambda n: pinned_with_hub(n, 0.3),
}


@pytest.mark.parametrize(
    ("shapes", "beta"),
    [
        (clamped_free(3), [1.87510407, 4.69409113, 7.85475744]),  # Blevins (1979), Table 8-1
        (pinned_with_hub(3), [3.9266023, 7.0685827, 10.2101761]),  # Blevins (1979), Table 8-1
        (clamped_with_tip(3, 1.0), [1.24792, 4.03114, 7.13413]),  # Laura, Pombo, Susemihl (1974)
        (clamped_with_tip(3, 1.0, 0.1), [1.19567, 2.50506, 4.97510]),  # mpmath, 30 digits, of the frequency equation
    ],
)
def test_known_roots(shapes, beta):
    digits = 10.0 ** -(len(str(beta[0]).split(".")[1]))
    np.testing.assert_allclose(shapes.beta, beta, atol=0.51 * digits)


def test_heavy_tip_tends_to_a_massless_spring():
    """omega^2 = 3 EI / (m l^3), hence beta^4 = 3 / ratio; the beam's own mass is 33/140 of its total (Rayleigh)."""
    errors = [clamped_with_tip(1, ratio).beta[0] ** 4 * ratio / 3 - 1 for ratio in (1e2, 1e3, 1e4)]
    np.testing.assert_allclose(np.diff(np.log10(np.abs(errors))), -1, atol=0.01)
    assert errors[0] == pytest.approx(-33 / 140 / 1e2, rel=0.01)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [1, 12, 60])
def test_shapes_satisfy_the_beam_equation(kind, n):
    """X''' - X'''(0) = beta^4 int X and each derivative is the derivative of the one before, by Gauss quadrature."""
    shapes = KINDS[kind](n)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    for xi in (0.3, 1.0):
        inner, w = xi * (nodes + 1) / 2, xi * weights / 2
        pair = np.array([0.0, xi])
        for d in range(4):
            source = shapes.beta[:, None] ** 4 * shapes.values(inner) if d == 3 else shapes.values(inner, d + 1)
            change = np.diff(shapes.values(pair, d), axis=1)[:, 0]
            np.testing.assert_allclose(source @ w / shapes.beta**d, change / shapes.beta**d, atol=1e-11)


@pytest.mark.parametrize("n", [1, 12, 60])
def test_boundary_conditions_hold(n):
    free, tip, hub = clamped_free(n), clamped_with_tip(n, 1.0, 0.1), pinned_with_hub(n, 0.3)

    def end(shapes, d, which):
        return shapes.values(ENDS, d)[:, which] / shapes.beta**d

    zeros = [(free, 0, 0), (free, 1, 0), (free, 2, 1), (free, 3, 1), (tip, 0, 0), (tip, 1, 0), (hub, 2, 1), (hub, 3, 1)]
    for shapes, d, which in zeros:
        np.testing.assert_allclose(end(shapes, d, which), 0, atol=1e-13)
    np.testing.assert_allclose(end(free, 0, 1), 2 * (-1.0) ** np.arange(n), rtol=1e-13)  # of int X^2 = 1
    np.testing.assert_allclose(end(tip, 2, 1) / tip.beta**3, 0.1 * end(tip, 1, 1), atol=1e-14)  # moment
    np.testing.assert_allclose(-end(tip, 3, 1) / tip.beta, end(tip, 0, 1), atol=1e-13)  # shear
    np.testing.assert_allclose(end(hub, 2, 0) / hub.beta**3, -0.3 * end(hub, 1, 0), atol=1e-14)


@pytest.mark.parametrize("wrong", [{"mass": -1}, {"inertia": -1}])
def test_impossible_bodies_are_refused(wrong):
    with pytest.raises(ArgumentError, match="rigid body"):
        clamped_with_tip(2, **wrong)
    with pytest.raises(ArgumentError):
        pinned_with_hub(2, -0.1)
