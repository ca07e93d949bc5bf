"""Boundary curves of scenes and of functions, against Mathieu's characteristic values."""

import numpy as np
import pytest
from scipy.special import mathieu_a, mathieu_b

import flexlin as fl
from flexlin.errors import ArgumentError, SceneError
from flexlin.scene import revise_scene
from tests.periodic.systems import mathieu_second_order
from tests.test_critical_values import clamped_constants


def distances(points):
    """Distance (N,) of points (rate, gravity) of the spinning link from the nearest boundary of Mathieu's tongues, by a Newton step."""
    k11, G, H = clamped_constants()

    def excess(rate, gravity, n, characteristic):
        return 4 * (k11 / rate**2 + G - 1) - characteristic(n, 2 * gravity * H / rate**2)

    (rate, gravity), h, every = points.T, 1e-6, []
    for curve in ((n, one) for n in range(1, 8) for one in (mathieu_a, mathieu_b)):
        along = excess(rate + h, gravity, *curve) - excess(rate - h, gravity, *curve)
        across = excess(rate, gravity + h, *curve) - excess(rate, gravity - h, *curve)
        every.append(2 * h * np.abs(excess(rate, gravity, *curve)) / np.hypot(along, across))
    return np.min(every, axis=0)


def test_verdicts_of_the_spinning_link_are_those_of_mathieus_chart():
    """Unstable exactly between b_n(q) and a_n(q) for some n. Source: McLachlan (1947), through scipy.special.

    a = 4 (k11 + (G - m11) W^2)/(m11 W^2), q = 2 g H/(m11 W^2); constants of the first clamped mode.
    """
    axes = {"motion.joints.0.rate": np.linspace(1.5, 4.5, 31), "effects.gravity.acceleration": np.linspace(1.0, 6.0, 6)}
    data = fl.sweep(fl.load_scene("spinning-link"), axes, grid=True)
    rate, gravity = np.meshgrid(*axes.values(), indexing="ij")
    k11, G, H = clamped_constants()
    a, q = 4 * (k11 + (G - 1) * rate**2) / rate**2, 2 * gravity * H / rate**2
    inside = np.any([(mathieu_b(n, q) < a) & (a < mathieu_a(n, q)) for n in range(1, 12)], axis=0)
    np.testing.assert_array_equal(data["verdict"].values == "unstable", inside)
    assert 10 < inside.sum() < inside.size / 2


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


def test_ranges_that_do_not_fit_are_refused():
    scene, rate = fl.load_scene("spinning-link"), {"motion.joints.0.rate": (1.0, 2.0)}
    for ranges, error in (
        (rate, ArgumentError),
        ({"motion.joints.0.rate": (2.0, 1.0), "effects.gravity.acceleration": (1.0, 2.0)}, ArgumentError),
        (rate | {"links.0.length": (-1.0, 1.0)}, SceneError),
    ):
        with pytest.raises(error):
            fl.stability_boundary(scene, ranges)


@pytest.mark.slow
def test_a_curve_says_whether_it_is_as_near_as_was_asked():
    """The claims of a curve are below tol as far as rounding of the spectra lets them."""

    def find(tol):
        ranges = {"a": (0.9, 1.3), "q": (0.15, 0.3)}
        return fl.stability_boundary(lambda a, q: mathieu_second_order(a, q, 0.1), ranges, tol, cells=6)

    for curve in find(1e-5):
        assert curve.error.max() <= 0.4e-5  # of a range of 0.4
        assert curve.status == f"every point lies within {curve.error.max():.1e} of the boundary"
    for curve in find(1e-10):
        (a, q), far = curve.points[curve.error.argmax()], (curve.error > 0.4e-10).sum()
        assert far
        assert curve.status.startswith(f"{far} of {len(curve.points)} points may lie further")
        assert f"4.0e-11 asked for, up to {curve.error.max():.1e} at a = {a:.6g}, q = {q:.6g}; ask for" in curve.status


STRIP = {
    "links": [{"length": 1.0, "mass_per_length": 0.162, "bending_stiffness": 1.4, "modes": 3}],
    "effects": {"gravity": {}, "hub": {"inertia": 0.05}, "payload": {"mass": 0.1}, "modal_damping": {"ratio": 0.005}},
    "motion.frequency": 1.0,
    "control.feedback": {"kind": "pd", "kp": [20], "kd": [2]},
    "designs": [],
}
RANGES = {"motion.frequency": (0.5, 12.0), "effects.payload.mass": (0.0, 2.0)}


@pytest.mark.slow
def test_no_tongue_of_a_strip_is_lost_between_lattice_lines(monkeypatch):
    """In a cell of 0.36 Hz multipliers turn several times round; critical values along other lines are those of the curves."""
    scene = fl.load_scene("single-link", STRIP)
    curves = fl.stability_boundary(scene, RANGES, tol=1e-4)
    assert not any(len(curve.lost) for curve in curves)
    for mass in (0.17, 0.23):
        exact = fl.critical_values(revise_scene(scene, {"effects.payload.mass": mass}), "motion.frequency", (0.5, 12.0))
        found = [crossed for curve in curves for crossed in cross(curve.points, mass)]
        np.testing.assert_allclose(sorted(found), [one.value for one in exact], atol=5e-3)
    monkeypatch.setattr("flexlin.periodic.boundary.crossings.LINE_HALVINGS", 0)
    broken = [curve for curve in fl.stability_boundary(scene, RANGES, tol=1e-4) if len(curve.lost)]
    assert broken
    assert all("it was lost at motion.frequency = " in curve.status for curve in broken)


def cross(points, height):
    """Where a polyline crosses a level of its second coordinate."""
    above = points[:, 1] - height
    k = np.flatnonzero(above[1:] * above[:-1] < 0)
    return points[k, 0] + (points[k + 1, 0] - points[k, 0]) * above[k] / (above[k] - above[k + 1])
