"""Boundary curves and critical values of scenes and of functions, against Mathieu's characteristic values and bisection by `floquet`."""

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b

import flexlin as fl
from flexlin import analyses
from flexlin.errors import ArgumentError, SceneError
from flexlin.scene import replace_value, revise_scene
from tests.closed_arm import control_loop
from tests.mechanics.scenes import clamped_constants, linear, plain_scene, swinging
from tests.periodic.boundary.test_crossings import meissner, trace_roots
from tests.periodic.systems import mathieu_second_order


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


@pytest.mark.slow
def test_a_curve_says_whether_it_is_as_near_as_was_asked():
    """The claims of a curve are below tol as far as rounding of the spectra lets them."""

    ranges, damped = {"a": (0.9, 1.3), "q": (0.15, 0.3)}, lambda a, q: mathieu_second_order(a, q, 0.1)
    for curve in fl.stability_boundary(damped, ranges, 1e-5, cells=6):
        assert curve.error.max() <= 0.4e-5  # of a range of 0.4
        assert curve.status == f"every point lies within {curve.error.max():.1e} of the boundary"
    for curve in fl.stability_boundary(damped, ranges, 1e-10, cells=6):
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


@pytest.mark.slow
def test_the_spinning_link_meets_mathieus_characteristic_values():
    scene = fl.load_scene("spinning-link", {"effects.gravity.acceleration": 3.0})
    found = fl.critical_values(scene, "motion.joints.0.rate", (1.7, 12.0), tol=1e-9)
    assert len(found) == 6
    for one in found:
        assert distances(np.array([[one.value, 3.0]])) <= one.error + 1e-12 < 1e-9
        assert one.distance == one.value - 2.0
        assert not one.touching
    assert [one.kind for one in found] == ["onset", "recovery"] * 3
    assert [one.resonance[:30] for one in found[::2]] == [f"principal resonance of order {k}" for k in (4, 3, 2)]


DAMPED = [
    ("khang-2019", "motion.frequency", 2.0, 3.0),
    ("arm-on-carriage", "control.feedback.kp.0", 0.05, 1.0),
    ("three-link", "control.feedback.kp.0", 1.0, 4.0),
    ("single-link", "effects.payload.mass", 0.3, 0.8),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "path", "low", "high"), DAMPED)
def test_damped_scenes_agree_with_bisection_by_floquet(name, path, low, high):
    scene = fl.load_scene(name)

    def growth(value):
        loop = control_loop(replace_value(scene, path, float(value)))
        return fl.floquet(loop.periodic_system(), 1e-12).exponents.real.max()

    (found,) = fl.critical_values(scene, path, (low, high), tol=1e-8, samples=17)
    assert name != "khang-2019" or found.resonance.startswith("flutter near 2.")  # 2 w: 31 rad/s
    exact = brentq(growth, low, high, xtol=1e-12)
    assert abs(found.value - exact) <= found.error + 1e-11
    assert found.error < 1e-8
    assert (found.kind == "onset") == (growth(high) > 0)
    h = 1e-5 * abs(exact)
    assert found.slope == pytest.approx((growth(exact + h) - growth(exact - h)) / (2 * h), rel=1e-4)


def test_a_value_that_is_hardly_known_has_a_slope():
    """Ten times the error below it the motion would run backward, and has no period between."""
    scene, path = fl.load_scene("khang-2019"), "motion.frequency"
    rough = analyses.CriticalValue(path, 2.476, 0.3, "onset", "", 0.0, np.inf)
    found = analyses.boundary.add_slope(rough, analyses.make_family(scene, {path: (0.2, 3.0)}, "own"))
    assert (found.slope > 0, found.error) == (True, 0.3)


def test_a_stable_scene_and_a_constant_system_have_none():
    scene = fl.load_scene("flexible-joint-link")
    assert fl.critical_values(scene, "motion.frequency", (0.5, 2.0), samples=17) == []
    scene = fl.load_scene("spinning-link", {"effects.gravity.acceleration": 0.0})
    assert fl.critical_values(scene, "motion.joints.0.rate", (1.0, 8.0), samples=65) == []


def test_what_does_not_fit_is_refused():
    scene, rate = fl.load_scene("spinning-link"), {"motion.joints.0.rate": (1.0, 2.0)}
    for path, limits, loop in (("links.0.x", (1.0, 2.0), "own"), (*rate, (1.0, 2.0), "no"), (*rate, (2.0, 1.0), "own")):
        with pytest.raises(ArgumentError):
            fl.critical_values(scene, path, limits, loop=loop)
    for other, error in (
        ({}, ArgumentError),
        ({"effects.gravity.acceleration": (2.0, 1.0)}, ArgumentError),
        ({"links.0.length": (-1.0, 1.0)}, SceneError),
    ):
        with pytest.raises(error):
            fl.stability_boundary(scene, rate | other)


def test_a_spring_that_jumps():
    """Meissner's equation with damping."""

    def system(a):
        spring = lambda t: (a + np.where(np.mod(t, 2 * np.pi) < np.pi, 0.6, -0.6))[:, None, None]  # noqa: E731
        return fl.PeriodicSystem.from_second_order([[1.0]], [[0.05]], spring, 2 * np.pi, breaks=(0.0, np.pi))

    found, exact = fl.critical_values(system, "a", (0.1, 3.0), tol=1e-7), trace_roots(0.6, 0.1, 3.0, 0.05)
    assert [one.value for one in found] == pytest.approx(exact, abs=1e-7)
    unstable_behind = meissner(0.6, 0.05)(exact + 1e-3).verdicts > 0
    assert [one.kind == "onset" for one in found] == unstable_behind.tolist()


@pytest.mark.parametrize("bend", [np.abs, lambda p: np.where(p < 0, 0.2, 1.0) * p])
def test_a_function_with_a_kink_in_its_number(bend):
    """No polynomial in the number serves across the kink: Mathieu's equation in |p|, and in a number that counts less below zero."""

    found = fl.critical_values(lambda p: mathieu_second_order(float(bend(p)), 0.2), "p", (-1.0, 1.5), samples=257)
    above = [0.795124, 1.194874]
    assert [one.value for one in found if one.value > 0.5] == pytest.approx(above, abs=2e-6)
    if bend is np.abs:
        assert found[0].value == pytest.approx(-above[0], abs=2e-6)


def test_a_tongue_that_begins_where_the_mean_is_unstable_is_still_a_parametric_resonance():
    """y'' + (a - 2 cos 2t) y = 0 at a = b_1(1) < 0: the growing mode changes its sign each period, w / 2 = 1 rad/s."""
    t, a = ca.SX.sym("t"), ca.SX.sym("a")
    family = fl.PeriodicFamily(ca.blockcat([[0, 1], [-(a - 2 * ca.cos(2 * t)), 0]]), t, [a], np.pi)
    onset = next(one for one in fl.critical_values(family, "a", (-1.0, 1.0)) if one.kind == "onset")
    assert onset.value == pytest.approx(mathieu_b(1, 1.0), abs=1e-7)
    assert onset.resonance.startswith("parametric resonance at w / 2 = 1 rad/s")


@pytest.mark.slow
def test_a_free_rigid_motion_does_not_blur_a_critical_value():
    """Its exponents are zero on both sides and were taken for those that cross: the onset was said to be known to 132 Hz."""
    link = {"length": 0.8, "mass_per_length": 0.324, "bending_stiffness": 6.2, "modes": 2, "mode_shapes": "pinned-hub"}
    effects = {"hub": {"inertia": 0.01}, "payload": {"mass": 0.05}, "modal_damping": {"ratio": 0.01}}
    scene = plain_scene([link], swinging({"amplitude": 0.35}), effects=effects)

    def growth(frequency):
        lin = linear(replace_value(scene, "motion.frequency", float(frequency)))
        exponents = fl.floquet(lin.periodic_system()).exponents
        return np.sort(exponents[np.abs(exponents) > 1e-6].real)[-1]

    onset, recovery = fl.critical_values(scene, "motion.frequency", (7.5, 8.0), samples=17)
    assert [one.kind for one in (onset, recovery)] == ["onset", "recovery"]
    for one in (onset, recovery):
        assert one.error < 1e-3
        assert growth(one.value - one.error) * growth(one.value + one.error) < 0
