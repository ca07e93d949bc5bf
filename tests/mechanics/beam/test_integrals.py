"""Integrals of the shapes: the cantilever's known constants, identities, profiles with a kink."""

import numpy as np
import pytest

from flexlin.errors import ArgumentError
from flexlin.mechanics import Profile, clamped_free, clamped_with_tip, pinned_with_hub, shape_integrals


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


@pytest.mark.parametrize(
    ("xi", "values"), [([0, 1], [1, 0]), ([0, 0.5], [1, 1]), ([0, 0.5, 0.5, 1], [1, 1, 1, 1]), ([0, 1], [1, 1, 1])]
)
def test_bad_tables_are_refused(xi, values):
    with pytest.raises(ArgumentError):
        Profile.table(xi, values)
