"""Ritz and finite-element shapes against the exact modes of uniform beams, published tapers, and each other."""

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


def test_no_modes():
    assert tapered(0).values(XI).shape == (0, 23)
    assert finite_elements(0).values(XI, 3).shape == (0, 23)


def test_bad_input_is_refused():
    with pytest.raises(ArgumentError, match="too few elements"):
        finite_elements(9, 4)
    with pytest.raises(ArgumentError, match="base"):
        tapered(2, base="glued")
