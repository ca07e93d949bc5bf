"""The deviation in expressions and in numbers, control laws, times given alone; numbers left free for later."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import analyse, build_with_free, find_margin
from tests.closed_arm import closed


@pytest.fixture(scope="module")
def lin():
    return closed()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["single-link", "flexible-joint-link", "spinning-link", "de-luca-siciliano-1991"])
def test_expressions_and_numbers_agree_on_where_the_arm_is(name):
    """A lifted function of s, s', s'' at random deviations equals the same function of the lifted numbers."""
    about, rng = closed(name).about, np.random.default_rng(3)
    arm, t = about.arm, np.array([0.1, 0.4])
    *moved, angles = about.symbols()
    probe = ca.vertcat(ca.sin(arm.s), arm.s * arm.s_dot, arm.s_ddot - arm.s)
    names, lifted = dict(zip(("y", "y1", "y2"), moved, strict=True)), about.lift([probe], angles, *moved)[0]
    function = about.function(angles, names, {"probe": lifted})
    parts = [rng.normal(size=(2, about.n)) for _ in range(3)]
    s, s_dot, s_ddot = about.positions(t, *parts)
    expected = np.concatenate([np.sin(s), s * s_dot, s_ddot - s], axis=1)
    np.testing.assert_allclose(about.evaluate(function, t, *parts)[0][:, :, 0], expected, rtol=1e-14, atol=1e-14)


def test_one_time_gives_one_matrix(lin):
    for name, shape in (("M", (3, 3)), ("D", (3, 3)), ("K", (3, 3)), ("B", (3, 1)), ("h", (3,)), ("feedforward", (1,))):
        alone, many = getattr(lin, name)(0.5), getattr(lin, name)([0.5, 0.6])
        assert alone.shape == shape
        np.testing.assert_array_equal(alone, many[0])
    np.testing.assert_array_equal(lin.K([0.5, 0.6]), lin.sample(np.array([0.5, 0.6])).K)
    motion = fl.control.periodic_motion(lin)
    assert motion(0.5).shape == (3,)
    assert motion.state(0.5).shape == (6,)
    assert fl.control.feedforward(lin, "rigid").torque(0.5).shape == (1,)
    with pytest.raises(fl.errors.ArgumentError, match="not finite"):
        lin.M(np.nan)


def test_the_scenes_law_is_what_the_linear_equations_hold(lin):
    """D_L, K_L and h_L of the closed loop differ from the plant's by B times the law, and by nothing else."""
    plant, t, n = fl.linearize(lin.arm, lin.motion), np.array([0.1, 0.9]), lin.n
    law = lin.closed_by
    gain, torque = law.gain(t), law.forward(t)
    scale = np.abs(lin.K(t)).max()
    np.testing.assert_allclose(lin.K(t) - plant.K(t), plant.B(t) @ gain[:, :, :n], atol=1e-13 * scale)
    np.testing.assert_allclose(lin.D(t) - plant.D(t), plant.B(t) @ gain[:, :, n:], atol=1e-13 * scale)
    np.testing.assert_allclose(lin.h(t) - plant.h(t), np.einsum("tij,tj->ti", plant.B(t), torque), atol=1e-12)
    assert law.feedforward == "rigid"
    assert plant.closed_by.feedforward == "none"
    assert not plant.closed_by.gain(t).any()


def test_a_gain_left_free_has_its_own_value_in_the_law():
    scene = fl.load_scene("single-link")
    arm = fl.build_manipulator(scene, ["control.feedback.kp.0"])
    law = fl.linearize(arm, scene.motion, scene.control).law
    assert law.gain(np.zeros(1))[0, 0, 0] == scene.control.feedback.kp[0]


def test_a_gain_that_does_not_fit_is_refused(lin):
    with pytest.raises(fl.errors.ArgumentError, match="gain does not fit"):
        lin.law.with_gain(np.ones((2, 6)))


def test_the_periodic_motion_of_a_feedforwards_law_is_its_reference(lin):
    """With the joint-exact torque and reference in the law, the loop's periodic motion is the reference, whatever the gain."""
    made = fl.control.feedforward(lin, "joint-exact")
    found = fl.control.periodic_motion(lin, law=made.law)
    t = np.linspace(0.0, lin.period, 9)
    np.testing.assert_allclose(found.state(t), made.reference(t), atol=1e-7 * np.abs(made.reference(t)).max())


@pytest.mark.slow
def test_numbers_left_free_move_no_answer():
    scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": []})
    ranges = {"motion.frequency": (0.125, 4.0), "effects.payload.mass": (0.01, 0.2)}
    free, plain = analyse(scene, free=tuple(ranges)), analyse(scene)
    assert free.plant.arm.parameters.paths == tuple(ranges)
    np.testing.assert_allclose(free.own.floquet.exponents, plain.own.floquet.exponents, atol=1e-9)
    np.testing.assert_allclose(free.linear_range.amplitudes, plain.linear_range.amplitudes, rtol=1e-3)
    for path, limits in ranges.items():
        alone = find_margin(scene, path, limits)
        shared = find_margin(scene, path, limits, known=free.closed)
        assert [one.kind for one in shared.critical] == [one.kind for one in alone.critical]
        np.testing.assert_allclose([o.value for o in shared.critical], [o.value for o in alone.critical], rtol=1e-6)


def test_what_cannot_stay_free_is_derived_as_before():
    unfit = ("single-link", "links.0.modes"), ("khang-2019", "parameters.payload_mass"), ("single-link", "no")
    for name, free in unfit:
        assert build_with_free(fl.load_scene(name), [free]).parameters.paths == ()
    one_way = {"kind": "point-to-point", "course": "one-way", "move_time": 0.6, "joints": [{"waypoints": [-1.2, -0.4]}]}
    scene = fl.load_scene("single-link", {"motion": one_way, "designs": []})
    assert build_with_free(scene, ["effects.payload.mass"]).parameters.paths == ()
