"""Boundary curves of scenes and of functions, against Mathieu's characteristic values."""

import numpy as np
import pytest
from scipy.special import mathieu_a, mathieu_b

import flexlin as fl
from flexlin.errors import ArgumentError, SceneError
from tests.test_critical_values import clamped_constants


def distances(points):
    """Distance (N,) of points (rate, gravity) of the spinning link from the nearest boundary of Mathieu's tongues, by a Newton step."""
    k11, G, H = clamped_constants()

    def excess(rate, gravity, n, characteristic):
        return 4 * (k11 / rate**2 + G - 1) - characteristic(n, 2 * gravity * H / rate**2)

    (rate, gravity), h, every = points.T, 1e-6, []
    for n in range(1, 8):
        for one in (mathieu_a, mathieu_b):
            slopes = (
                excess(rate + h, gravity, n, one) - excess(rate - h, gravity, n, one),
                excess(rate, gravity + h, n, one) - excess(rate, gravity - h, n, one),
            )
            every.append(2 * h * np.abs(excess(rate, gravity, n, one)) / np.hypot(*slopes))
    return np.min(every, axis=0)


@pytest.mark.slow
def test_tongues_of_the_spinning_link_lie_on_mathieus_curves():
    ranges = {"motion.joints.0.rate": (2.2, 4.5), "effects.gravity.acceleration": (1.0, 6.0)}
    curves = fl.stability_boundary(fl.load_scene("spinning-link"), ranges, cells=12)
    assert len(curves) == 4
    for curve in curves:
        between = (curve.points[1:] + curve.points[:-1]) / 2
        assert np.all(distances(curve.points) <= curve.error + 1e-9)
        assert max(distances(curve.points).max(), distances(between).max()) < 1e-6
        assert not curve.closed
    assert curves[0].evaluations < 30_000
    orders = sorted(curve.resonance[:30] for curve in curves)
    assert orders == ["principal resonance of order 2"] * 2 + ["principal resonance of order 3"] * 2


@pytest.mark.parametrize(
    ("ranges", "error"),
    [
        ({"motion.joints.0.rate": (1.0, 2.0)}, ArgumentError),
        ({"motion.joints.0.rate": (2.0, 1.0), "effects.gravity.acceleration": (1.0, 2.0)}, ArgumentError),
        ({"motion.joints.0.rate": (1.0, 2.0), "links.0.length": (-1.0, 1.0)}, SceneError),
    ],
)
def test_ranges_that_do_not_fit_are_refused(ranges, error):
    with pytest.raises(error):
        fl.stability_boundary(fl.load_scene("spinning-link"), ranges)
