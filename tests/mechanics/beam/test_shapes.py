"""Shapes of beams, exact, Ritz's and finite elements': known roots, residuals, conditions at the ends, published tapers, integrals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexlin.errors import ArgumentError
from flexlin.mechanics import (
    Ends,
    Profile,
    clamped_free,
    clamped_with_tip,
    finite_elements,
    pinned_with_hub,
    shape_integrals,
    tapered,
)

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


WRONG = [
    ("rigid body", lambda: clamped_with_tip(2, mass=-1)),
    ("rigid body", lambda: clamped_with_tip(2, inertia=-1)),
    (None, lambda: pinned_with_hub(2, -0.1)),
    ("too few elements", lambda: finite_elements(9, 4)),
    ("base", lambda: tapered(2, base="glued")),
    (None, lambda: Profile.table([0, 1], [1, 0])),
    (None, lambda: Profile.table([0, 0.5], [1, 1])),
    (None, lambda: Profile.table([0, 0.5, 0.5, 1], [1, 1, 1, 1])),
    (None, lambda: Profile.table([0, 1], [1, 1, 1])),
]


@pytest.mark.parametrize(("words", "call"), WRONG)
def test_what_no_beam_has_is_refused(words, call):
    with pytest.raises(ArgumentError, match=words):
        call()


def test_no_modes():
    assert tapered(0).values(XI).shape == finite_elements(0).values(XI, 3).shape == (0, 23)


XI = np.linspace(0, 1, 23)


HUB = Ends(hub_inertia=0.3)


@pytest.mark.parametrize(
    ("shapes", "exact"),
    [
        (tapered(6), clamped_free(6)),
        (tapered(6, ends=Ends(1.0, 0.1)), clamped_with_tip(6, 1.0, 0.1)),
        (tapered(6, ends=HUB, base="pinned"), pinned_with_hub(6, 0.3)),
        (finite_elements(4, 60), clamped_free(4)),
        (finite_elements(4, 60, ends=HUB, base="pinned"), pinned_with_hub(4, 0.3)),
    ],
)
def test_uniform_beams_are_reproduced(shapes, exact):
    """Cubics interpolate X with an error of (beta h)^4 / 384 and X'' with one of (beta h)^2 / 8, times max |X^(d)| / beta^d < 2."""
    n, step = len(exact.beta), exact.beta[:, None] / 60
    bounds = {0: 1e-8, 1: 1e-8, 2: 1e-8} if n == 6 else {0: step**4 / 192 + 1e-12, 2: step**2 / 4 + 1e-12}
    np.testing.assert_allclose(shapes.beta, exact.beta, rtol=1e-10 if n == 6 else 1e-6)
    for d, bound in bounds.items():
        assert np.all(np.abs(shapes.values(XI, d) - exact.values(XI, d)) / exact.beta[:, None] ** d < bound)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(mass=st.floats(-3, 4), gyration=st.floats(-2, 1))
def test_no_root_is_missed_whatever_the_tip_carries(mass, gyration):
    """The roots are found by a scan: Ritz's method counts them, for bodies from specks to a thousand beams, near and far."""
    m, inertia = 10.0**mass, 10.0 ** (mass + 2 * gyration)
    exact, ritz = clamped_with_tip(4, m, inertia), tapered(4, ends=Ends(m, inertia))
    np.testing.assert_allclose(exact.beta, ritz.beta, rtol=1e-7)


def test_wedge():
    """A wedge with mass 1 - a xi and stiffness (1 - a xi)^3; omega of a = 1/2: 3.8238, 18.3173, 47.2648 (Downs 1977; Naguleswaran 1994)."""
    shapes = tapered(3, Profile(lambda x: 1 - x / 2), Profile(lambda x: (1 - x / 2) ** 3))
    np.testing.assert_allclose(shapes.beta**2, [3.8238, 18.3173, 47.2648], atol=6e-5)


def test_taper_by_both_methods():
    mass, stiffness = Profile.table([0, 0.5, 1], [1.5, 1, 0.5]), Profile.table([0, 1], [2, 0.5])
    smooth, elements = tapered(3, mass, stiffness), finite_elements(3, 60, mass, stiffness)
    np.testing.assert_allclose(smooth.beta, elements.beta, rtol=1e-5)
    integrals = shape_integrals(smooth, mass, stiffness)
    np.testing.assert_allclose(integrals.gram, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(np.diag(integrals.bending), smooth.beta**4, rtol=1e-9)


def test_cantilever_constants():
    """Khang, Dat, Tuan (2019) with l = 1: C1, D1, m11, k11, recomputed by SymPy to 8 digits."""
    integrals = shape_integrals(clamped_free(3))
    np.testing.assert_allclose(integrals.tip, [2, -2, 2], rtol=1e-13)
    np.testing.assert_allclose(integrals.mode, [0.78299176, 0.43393590, 0.25442530], atol=6e-9)
    np.testing.assert_allclose(integrals.mode_moment, [0.56882574, 0.09076679, 0.03241637], atol=6e-9)
    assert integrals.bending[0, 0] == pytest.approx(12.36236337, abs=6e-9)
    assert integrals.shortening_moment[0, 0] == pytest.approx(1.1933, abs=6e-5)  # 1/2 int (1 - x^2) X'^2
    np.testing.assert_allclose([integrals.mass, integrals.first, integrals.second], [1, 1 / 2, 1 / 3], rtol=1e-14)


@pytest.mark.parametrize("n", [1, 10, 60])
def test_orthogonality_and_accuracy(n):
    shapes = clamped_free(n)
    integrals = shape_integrals(shapes)
    np.testing.assert_allclose(integrals.gram, np.eye(n), atol=1e-12)
    square = np.outer(shapes.beta**2, shapes.beta**2)
    np.testing.assert_allclose(integrals.bending / square, np.eye(n), atol=1e-12)


def test_modes_with_bodies_are_orthogonal_in_the_whole_mass():
    mass, inertia = 1.0, 0.1
    i = shape_integrals(clamped_with_tip(5, mass, inertia))
    whole = i.gram + mass * np.outer(i.tip, i.tip) + inertia * np.outer(i.tip_slope, i.tip_slope)
    size = np.sqrt(np.outer(np.diag(whole), np.diag(whole)))
    np.testing.assert_allclose(whole / size, np.eye(5), atol=1e-12)
    hub = shape_integrals(pinned_with_hub(5, 0.3))
    np.testing.assert_allclose(hub.mode_moment + 0.3 * hub.base_slope, 0, atol=1e-13)
