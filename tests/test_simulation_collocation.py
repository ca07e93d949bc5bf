"""The integrator of the nonlinear loop: its order, its errors against independent codes, stiffness, and where it must give up."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flexlin.errors import NumericalError
from flexlin.simulation import Drive, NonlinearLoop, simulate
from flexlin.simulation.equations import NonlinearEquations
from flexlin.simulation.sweeps import Rigid, Start, solve_window
from flexlin.simulation.window import Grid
from tests.closed_arm import closed


def independent(lin, start, t, method="DOP853", rtol=1e-11):
    """The loop by SciPy from the arm's own functions: s'' by a dense solve at one time after another."""
    functions, law, E = lin.arm.functions, lin.law, lin.arm.reference.full()
    kept, n, p = list(lin.kept), lin.n, []
    B = lin.arm.B[:, list(lin.driven)]
    inputs = ca.Function("B", [lin.arm.s], [ca.densify(B)])

    def rate(time, x):
        now = np.array([time])
        s, s1, s2 = (E @ part[0] for part in lin.motion.sample(now))
        s[kept] += x[:n]
        s1[kept] += x[n:]
        left = np.array(functions["residual"](s, s1, s2, p)).ravel()
        M = np.array(functions["M"](s, p))
        torque = law.torque(now, x[None])[0]
        force = (inputs(s).full() @ torque - left)[kept]
        return np.concatenate([x[n:], np.linalg.solve(M[np.ix_(kept, kept)], force)])

    return solve_ivp(rate, (t[0], t[-1]), start, method=method, t_eval=t, rtol=rtol, atol=1e-13).y.T


RUNS = [
    ("single-link", None, 0.1, 1e-5, 128),
    ("three-link", None, 0.05, 1e-8, 128),
    ("pick-and-place", None, 0.03, 1e-8, 128),
    ("single-link", [0.3, 0.006, 0.0, 0.3, 0.0, 0.0], 0.1, 1e-7, 128),
    ("single-link", [1.5, 0.03, 0.0, 1.5, 0.0, 0.0], 0.1, 1e-7, 128),
    ("single-link", [0.0, 0.0, 1e-3, 0.0, 0.0, 0.0], 0.04, 1e-7, 25),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "start", "share", "tol", "points"), RUNS)
def test_states_agree_with_an_independent_integrator_within_the_stated_error(name, start, share, tol, points):
    """Far beyond the linear model the slopes of the rigid motion lead nowhere, and others take their place. Of modes that ring between
    few outputs the estimate must let no long first step damp anything away."""
    lin = closed(name)
    run = simulate(lin, share, initial=start, tol=tol, points_per_period=points)
    expected = independent(lin, np.zeros(2 * lin.n) if start is None else start, run.t, rtol=1e-13)
    assert np.abs(run.nonlinear - expected).max() <= (run.error + 1e-9) * max(1.0, np.abs(expected).max())
    assert run.error <= 10 * tol
    assert run.energy_error < max(1e-6, tol)


@pytest.mark.slow
@pytest.mark.parametrize("stages", [2, 3, 4, 5])
def test_fixed_steps_converge_with_the_order_of_the_method(stages):
    """Radau IIA: 2 s - 1 at the edges."""
    lin = closed("khang-2019")
    equations, end = NonlinearEquations(lin, lin.law), 0.4 * lin.period
    start = np.array([0.3, 0.1, 0.0, 0.0])
    assert len(start) == 2 * lin.n

    def last(count):
        x, before = start, np.zeros(lin.n)
        for k in range(count):
            grid = Grid(end * np.array([k, k + 1]) / count, stages)
            rigid = Rigid.of(equations, grid, 0.0)
            x = solve_window(equations, rigid, x, before, np.ones(4), 1e-14, Start.NEWTON).path.x[-1]
        return x

    exact = independent(lin, start, np.array([0.0, end]), rtol=1e-13)[-1]
    counts = (32, 64) if stages == 5 else (64, 128)
    rough, fine = (np.abs(last(count) - exact).max() for count in counts)
    assert np.log2(rough / fine) == pytest.approx(2 * stages - 1, abs=0.6)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "size"), [("single-link", 0.9), ("pick-and-place", 1e-3)])
def test_the_linear_answer_is_that_of_the_matrices(name, size):
    """Far from the rigid motion too, where the sweeps' matrices are not the rigid ones; and behind breaks."""
    lin = closed(name)
    x = size * np.random.default_rng(9).standard_normal(2 * lin.n)
    run = simulate(lin, 0.25, x, tol=1e-9)

    def rate(t, x):
        now = np.array([t])
        return lin.A(now)[0] @ x + lin.forcing(now)[0]

    def slope(t, x):
        return lin.A(np.array([t]))[0]

    exactly = {"method": "LSODA", "rtol": 1e-10, "atol": 1e-13, "jac": slope}
    for begin, end in pairwise([0.0, *[b for b in lin.breaks if 0 < b < run.t[-1]], run.t[-1]]):
        inside = (run.t > begin) & (run.t <= end)
        found = solve_ivp(rate, (begin, end), x, t_eval=np.unique([*run.t[inside], end]), **exactly).y.T
        assert np.abs(run.linear[inside] - found[: inside.sum()]).max() < 1e-7 * max(1.0, np.abs(run.linear).max())
        x = found[-1]
    assert run.linear_error < 1e-8


def test_a_torque_that_is_cut_changes_the_integrator_and_not_the_answer():
    """A limit just above what is commanded is the free loop; step by step it is the same loop too."""
    lin = closed()
    free = simulate(lin, 0.3, tol=1e-8)
    limit = 1.0005 * np.abs(free.torque).max()
    near = simulate(lin, 0.3, tol=1e-8, drive=Drive(limit=(limit,)))
    np.testing.assert_allclose(near.nonlinear, free.nonlinear, atol=1e-6)


@pytest.mark.parametrize("t", [[0.0], [0.0, 0.0], [0.0, 0.0, 0.01]])
def test_times_may_begin_with_the_start_several_times_or_be_the_start_alone(t):
    lin, start = closed("khang-2019"), np.full(4, 0.01)
    found = NonlinearLoop(lin, lin.law).integrate(np.array(t), start, 1e-6)
    at_start = np.array(t) == 0.0
    np.testing.assert_array_equal(found[at_start], np.append(start, 0.0) + np.zeros((at_start.sum(), 1)))
    assert np.isfinite(found).all()
    assert np.abs(found[~at_start, :4] - start).max(initial=0.1) > 1e-6


@pytest.mark.slow
def test_steps_that_cannot_suffice_are_foreseen_and_fewer_periods_are_the_advice():
    with pytest.raises(NumericalError, match=r"about \S+ steps would be needed.*simulate fewer periods") as caught:
        simulate(closed("single-link"), 1e5, tol=1e-9, points_per_period=1)
    assert caught.value.t < 1000
