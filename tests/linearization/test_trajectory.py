"""Equations of one's own, a function along a trajectory or a manipulator: against differences and by hand; what does not fit is named."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl

T = 2.0


def draw_problem(seed):
    """x' = f(t, x, u) with a trajectory that solves it, in expressions: f (t, x, u), and x*(t), u*(t).

    Of a free field g(x) and a chosen path x*(t) the field f = g(x) + B(x) u + x*'(t) - g(x*(t)) - B(x*(t)) u*(t) has it as its solution.
    """
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 13)), int(rng.integers(0, 4))
    W, c, V, means, G = (rng.normal(size=shape) for shape in ((n, n), n, (n, n), n, (n, m)))
    t, x, u = ca.SX.sym("t"), ca.SX.sym("x", n), ca.SX.sym("u", m)
    path = means + 0.5 * ca.vertcat(*[ca.sin(2 * np.pi / T * (1 + i % 3) * t + i) for i in range(n)])
    led = ca.vertcat(ca.SX(0, 1), *[ca.cos(2 * np.pi / T * t + j) for j in range(m)])

    def field(x, u):
        return V @ ca.sin(W @ x + c) + (2 + ca.sin(x)) * (G @ u)

    return (t, x, u), field(x, u) - field(path, led) + ca.jacobian(path, t), path, led


def slopes(f, t, x, u):
    """df/dx and df/du by central differences with Richardson's extrapolation."""
    both, n = np.concatenate([x, u]), len(x)

    def central(step):
        high, low = (f(t, *np.split(both + sign * step, [n])).full()[:, 0] for sign in (1, -1))
        return (high - low) / (2 * np.abs(step).max())

    columns = [(64 * central(5e-3 * e) - 20 * central(1e-2 * e) + central(2e-2 * e)) / 45 for e in np.eye(len(both))]
    return np.split(np.array(columns).T, [n], axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_of_random_functions_the_jacobians_are_those_of_differences(seed):
    (t, x, u), f, path, led = draw_problem(seed)
    own = ca.Function("own", [t, x, u][: 2 + (u.numel() > 0)], [f])
    at_times = [ca.Function("at", [t], [part]) for part in (path, led)]
    sampled = [lambda times, of=of: of(np.reshape(times, (1, -1))).full().T for of in at_times]
    given = (path, led, {"t": t}), (*sampled, {})
    trajectories = [fl.Trajectory(x, u if led.numel() else None, period=T, **more) for x, u, more in given]
    systems = [fl.linearize(own, one) for one in trajectories]
    for time in (0.0, 0.37, 1.9):
        here = [of(time).full()[:, 0] for of in at_times]
        A, B = slopes(ca.Function("f", [t, x, u], [f]), time, *here)
        for system in systems:
            np.testing.assert_allclose(system.A(time), A, atol=1e-10 * np.abs(A).max())
            if system.m:
                np.testing.assert_allclose(system.B(np.array([time]))[0], B, atol=1e-10 * np.abs(B).max())
    assert (systems[0].n, systems[0].m) == (x.numel(), u.numel())


def pendulum():
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    return ca.Function("f", [x, u], [ca.vertcat(x[1], 9.81 * ca.sin(x[0]) + u)])


def swing(**changes):
    """A pendulum about its upper rest led along 0.2 sin(2 pi t / T)."""
    t, w = ca.SX.sym("t"), 2 * np.pi / T
    angle = 0.2 * ca.sin(w * t)
    u = -(w**2) * angle - 9.81 * ca.sin(angle)
    given = {"x": ca.vertcat(angle, ca.jacobian(angle, t)), "u": u, "period": T, "t": t} | changes
    return fl.Trajectory(given.pop("x"), given.pop("u"), **given)


def test_a_finite_trajectory_is_a_horizon():
    """Anderson, Moore (1990), ch. 2: for x' = u with unit weights and no cost at the end X = tanh(T - t)."""
    x, u, t = (ca.SX.sym(name) for name in "xut")
    system = fl.linearize(ca.Function("f", [x, u], [u]), fl.Trajectory(t, 1, period=1.0, t=t, periodic=False))
    design = fl.control.finite_horizon_lqr(system, [[1.0]], [[1.0]], end=[[0.0]])
    assert abs(design.X(0.25).item() - np.tanh(0.75)) < 1e-8


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"u": 0}, r"does not solve x' = f.*in x\[1\]"),
        ({"x": ca.DM([0, 0, 0])}, r"f does not fit the trajectory.*\(3, 1\)"),
        ({"u": ca.DM([0, 0])}, r"f does not fit the trajectory"),
        ({"u": None}, r"f does not fit the trajectory.*give fl\.Trajectory\(x, u.*all states x and all inputs u"),
        ({"t": None}, r"x holds symbols that are not known.*got t"),
        ({"x": ca.DM([[0, 0]])}, r"x is no column"),
        ({"breaks": (3.0,)}, r"a break lies outside the trajectory"),
        ({"period": -1.0}, r"period"),
        ({"x": lambda t: np.zeros((3, 2))}, r"x"),
        ({"x": lambda t: np.full((len(t), 2), np.nan)}, r"x.*finite"),
        ({"x": "a path"}, r"x is of another kind"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(change, match):
    with pytest.raises(fl.errors.FlexlinError, match=match):
        fl.linearize(pendulum(), swing(**change))


def test_a_measured_trajectory_may_miss_by_tol():
    rng = np.random.default_rng(3)
    noise = 1e-5 * rng.normal(size=(64, 2))

    def measured(t):
        return swing()(t) + noise[(np.asarray(t) / T * 63.999 % 64).astype(int)]

    with pytest.raises(fl.errors.MotionError, match="give tol="):
        fl.linearize(pendulum(), swing(x=measured))
    assert fl.linearize(pendulum(), swing(x=measured, tol=1e-2)).n == 2


def test_functions_of_other_kinds_are_refused():
    scene = fl.load_scene("single-link")
    for arm, motion, words in (
        (pendulum(), scene.motion, "along a trajectory"),
        (pendulum(), {"kind": "harmonic"}, "along a trajectory"),
        (fl.build_manipulator(scene), swing(), "belongs to a function"),
        (lambda x, u: x, swing(), "another kind"),
    ):
        with pytest.raises(fl.errors.ArgumentError, match=words):
            fl.linearize(arm, motion)


MOTION = {"kind": "harmonic", "frequency": 0.5, "joints": [{"amplitude": 0.3}]}


def cart_with_pole(**given):
    """A cart with a pole that is held up by a spring (5 N m/rad), standing up at zero."""
    s, v = ca.SX.sym("s", 2), ca.SX.sym("v", 2)
    tip = ca.vertcat(v[0] + 0.5 * ca.cos(s[1]) * v[1], -0.5 * ca.sin(s[1]) * v[1])
    T, V = v[0] ** 2 + 0.1 * ca.sumsqr(tip), 0.2 * 9.81 * 0.5 * ca.cos(s[1]) + 2.5 * s[1] ** 2
    return fl.Manipulator.from_lagrangian(s, v, T, V, **{"names": ("x", "phi"), "joints": [0]} | given)


def test_a_wrong_table_is_refused_key_by_key():
    wrong = {"frequncy": 1.0}, {"frequency": -1.0}, {"frequency": 10**400}
    for table, match in (({}, "motion.kind"), *(({**MOTION, **one}, *one) for one in wrong)):
        with pytest.raises(fl.errors.SceneError, match=match):
            fl.linearize(cart_with_pole(), table)


@pytest.mark.parametrize(
    "given",
    [
        {"B": ca.DM([[1], [0]]), "joints": [0, 1]},
        {"B": ca.DM([[0, 0], [1, 1]]), "joints": [0, 1]},
        {"B": ca.DM([[1, 1], [1, 1]]), "joints": [0, 1]},
        {"B": ca.DM([[0], [1]]), "joints": [0]},
        {"joints": [2]},
        {"joints": [0, 0]},
    ],
)
def test_inputs_that_cannot_lead_the_joints_are_refused(given):
    with pytest.raises(fl.errors.ModelError, match="joints"):
        fl.linearize(cart_with_pole(**given), {**MOTION, "joints": [{"amplitude": 0.3}] * len(given["joints"] or ())})


def test_each_joint_has_its_own_input_in_the_order_of_the_joints():
    arm = cart_with_pole(joints=(1, 0))
    lin = fl.linearize(arm, {**MOTION, "joints": [{"amplitude": 0.0}, {"amplitude": 0.3}]})
    np.testing.assert_array_equal(lin.B(0.0), [[0, 1], [1, 0]])
    np.testing.assert_allclose(lin.h(0.3) + lin.B(0.3) @ lin.feedforward(0.3), 0, atol=1e-12)


def test_what_no_input_balances_is_said():
    lin = fl.linearize(cart_with_pole(), MOTION)
    assert "0.296 N in phi that no input balances" in lin.summary()  # 0.1 * 0.3 pi^2, by hand
    rest = fl.linearize(cart_with_pole(), {**MOTION, "joints": [{"amplitude": 0.0}]})
    assert "balances" not in rest.summary()


def test_tables_and_states_say_the_numbers_of_the_equations():
    lin = fl.linearize(cart_with_pole(), MOTION)
    system = lin.periodic_system()
    modes = fl.floquet_modes(system)
    np.testing.assert_array_equal(modes.to_dataframe().growth_rate, modes.exponents.real)
    np.testing.assert_array_equal(lin.to_xarray(3).K.sel(equation="phi", coordinate="x"), lin.K([0, 1, 2])[:, 1, 0])
    for t in (0.3, [0.3]):
        np.testing.assert_array_equal(lin.A(t), system.A(t))
        np.testing.assert_array_equal(np.shape(lin.forcing(t)), (*np.shape(t), 4))


def test_a_control_may_be_a_dict_of_its_keys():
    scene = fl.load_scene("single-link", {"designs": []})
    arm = fl.build_manipulator(scene)
    given = {"feedback": {"kind": "pd", "kp": [3.0], "kd": [0.4]}}
    same = fl.load_scene("single-link", {"designs": [], "control": given})
    made = fl.linearize(arm, scene.motion, given)
    t = np.linspace(0.0, 1.0, 5)
    assert (made.law.gain(t) == fl.linearize(arm, same.motion, same.control).law.gain(t)).all()
    with pytest.raises(fl.errors.SceneError, match=r"control.feedback.kind.*did you mean 'pd'"):
        fl.linearize(arm, scene.motion, {"feedback": {"kind": "pdd"}})
