"""Shapes of beams: known roots, residuals, conditions at the ends, published tapers, integrals; up to 60 modes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexlin.errors import ArgumentError
from flexlin.mechanics import Ends, Profile, bending_shapes, shape_integrals

ENDS = np.array([0.0, 1.0])
CLOSE = (1e-11, 1e-11, 1e-11, 1e-5)
"""Of a derivative: each loses a factor of the polynomials' degree squared, and nothing is made of the third one."""


def clamped_with_tip(n, mass, inertia=0.0):
    return bending_shapes(n, ends=Ends(mass, inertia))


def pinned_with_hub(n, inertia=0.0):
    return bending_shapes(n, ends=Ends(hub_inertia=inertia), pinned=True)


KINDS = {
    "clamped-free": bending_shapes,
    "clamped with tip": lambda n: clamped_with_tip(n, 1.0, 0.1),
    "pinned-free": pinned_with_hub,
    "pinned with hub": lambda n: pinned_with_hub(n, 0.3),
}


@pytest.mark.parametrize(
    ("shapes", "beta"),
    [
        (bending_shapes(3), [1.87510407, 4.69409113, 7.85475744]),  # Blevins (1979), Table 8-1
        (pinned_with_hub(3), [3.9266023, 7.0685827, 10.2101761]),  # Blevins (1979), Table 8-1
        (clamped_with_tip(3, 1.0), [1.24792, 4.03114, 7.13413]),  # Laura, Pombo, Susemihl (1974)
        (clamped_with_tip(3, 1.0, 0.1), [1.19567, 2.50506, 4.97510]),  # mpmath, 30 digits, of the frequency equation
    ],
)
def test_known_roots(shapes, beta):
    digits = 10.0 ** -(len(str(beta[0]).split(".")[1]))
    np.testing.assert_allclose(shapes.beta, beta, atol=0.51 * digits)


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
            np.testing.assert_allclose(source @ w / shapes.beta**d, change / shapes.beta**d, atol=CLOSE[min(d + 1, 3)])


@pytest.mark.parametrize("n", [1, 12, 60])
def test_boundary_conditions_hold(n):
    free, tip, hub = bending_shapes(n), clamped_with_tip(n, 1.0, 0.1), pinned_with_hub(n, 0.3)

    def end(shapes, d, which):
        return shapes.values(ENDS, d)[:, which] / shapes.beta**d

    for shapes, d, which in [(free, 0, 0), (free, 1, 0), (free, 2, 1), (free, 3, 1), (tip, 0, 0), (tip, 1, 0)]:
        np.testing.assert_allclose(end(shapes, d, which), 0, atol=CLOSE[d])
    for d in (2, 3):
        np.testing.assert_allclose(end(hub, d, 1), 0, atol=CLOSE[d])
    np.testing.assert_allclose(end(tip, 2, 1) / tip.beta**3, 0.1 * end(tip, 1, 1), atol=CLOSE[2])  # moment
    np.testing.assert_allclose(-end(tip, 3, 1) / tip.beta, end(tip, 0, 1), atol=CLOSE[3])  # shear
    np.testing.assert_allclose(end(hub, 2, 0) / hub.beta**3, -0.3 * end(hub, 1, 0), atol=CLOSE[2])


def test_cantilever_is_normalised():
    shapes = bending_shapes(60)
    np.testing.assert_allclose(shapes.values(ENDS)[:, 1], 2 * (-1.0) ** np.arange(60), rtol=1e-11)
    assert np.all(shapes.values(ENDS, 2)[:, 0] > 0)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(mass=st.floats(-3, 4), gyration=st.floats(-2, 1))
def test_roots_of_the_frequency_equation_are_enclosed_whatever_the_tip_carries(mass, gyration):
    """Bodies from specks to a thousand beams, near and far: the characteristic function of Laura, Pombo, Susemihl (1974), over cosh."""
    m, inertia = 10.0**mass, 10.0 ** (mass + 2 * gyration)

    def characteristic(b):
        c, s, t, over = np.cos(b), np.sin(b), np.tanh(b), 1 / np.cosh(b)
        bodies = m * b * (c * t - s) - inertia * b**3 * (c * t + s) + m * inertia * b**4 * (over - c)
        return over + c + bodies

    beta = clamped_with_tip(4, m, inertia).beta
    assert np.all(characteristic(beta * (1 - 1e-7)) * characteristic(beta * (1 + 1e-7)) < 0)


@pytest.mark.parametrize("pinned", [False, True])
def test_elements_reproduce_uniform_beams(pinned):
    """Cubics interpolate X with an error of (beta h)^4 / 384 and X'' with one of (beta h)^2 / 8, times max |X^(d)| / beta^d < 2."""
    ends, xi = Ends(hub_inertia=0.3) if pinned else Ends(), np.linspace(0, 1, 23)
    shapes, exact = (bending_shapes(4, ends=ends, pinned=pinned, elements=number) for number in (60, None))
    step = exact.beta[:, None] / 60
    for d, bound in ((0, step**4 / 192), (2, step**2 / 4)):
        assert np.all(np.abs(shapes.values(xi, d) - exact.values(xi, d)) / exact.beta[:, None] ** d < bound + 1e-12)


def test_fewer_elements_than_modes_need_are_refused():
    with pytest.raises(ArgumentError):
        bending_shapes(9, elements=4)


def test_wedge():
    """A wedge with mass 1 - a xi and stiffness (1 - a xi)^3; omega of a = 1/2: 3.8238, 18.3173, 47.2648 (Downs 1977; Naguleswaran 1994)."""
    shapes = bending_shapes(3, Profile(lambda x: 1 - x / 2), Profile(lambda x: (1 - x / 2) ** 3))
    np.testing.assert_allclose(shapes.beta**2, [3.8238, 18.3173, 47.2648], atol=6e-5)


TAPER = Profile.table([0, 0.5, 1], [1.5, 1, 0.5]), Profile.table([0, 1], [2, 0.5])


@pytest.mark.parametrize(
    ("shapes", "profiles", "mass", "inertia"),
    [
        *[(bending_shapes(n), (), 0.0, 0.0) for n in (1, 10, 60)],
        (clamped_with_tip(5, 1.0, 0.1), (), 1.0, 0.1),
        (bending_shapes(3, *TAPER), TAPER, 0.0, 0.0),
    ],
)
def test_modes_are_orthogonal_in_the_whole_mass_and_in_the_stiffness(shapes, profiles, mass, inertia):
    i = shape_integrals(shapes, *profiles)
    whole = i.gram + mass * np.outer(i.tip, i.tip) + inertia * np.outer(i.tip_slope, i.tip_slope)
    size = np.sqrt(np.outer(np.diag(whole), np.diag(whole)))
    np.testing.assert_allclose(whole / size, np.eye(shapes.n), atol=1e-12)
    np.testing.assert_allclose(
        i.bending / np.outer(shapes.beta**2, shapes.beta**2) / size, np.eye(shapes.n), atol=1e-12
    )
    assert mass or np.diag(i.gram) == pytest.approx(1.0, abs=1e-12)


def test_a_mode_on_a_hub_has_no_angular_momentum():
    hub = shape_integrals(pinned_with_hub(5, 0.3))
    np.testing.assert_allclose(hub.mode_moment + 0.3 * hub.base_slope, 0, atol=1e-13)


def test_cantilever_constants():
    """Khang, Dat, Tuan (2019) with l = 1: C1, D1, m11, k11, recomputed by SymPy to 8 digits."""
    integrals = shape_integrals(bending_shapes(3))
    np.testing.assert_allclose(integrals.tip, [2, -2, 2], rtol=1e-13)
    np.testing.assert_allclose(integrals.mode, [0.78299176, 0.43393590, 0.25442530], atol=6e-9)
    np.testing.assert_allclose(integrals.mode_moment, [0.56882574, 0.09076679, 0.03241637], atol=6e-9)
    assert integrals.bending[0, 0] == pytest.approx(12.36236337, abs=6e-9)
    assert integrals.shortening_moment[0, 0] == pytest.approx(1.1933, abs=6e-5)  # 1/2 int (1 - x^2) X'^2
    np.testing.assert_allclose([integrals.mass, integrals.first, integrals.second], [1, 1 / 2, 1 / 3], rtol=1e-14)
