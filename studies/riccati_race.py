"""What does the periodic Riccati equation cost, here and by SciPy's backward integration of compiled right-hand sides?

The shipped single link with two modes, and a satellite that magnetic torquers turn: its attitude and rates (6 states), and with the
integrals of its attitude (9 states). Every way reaches the same accuracy in one run. SciPy's methods integrate backwards from X = 0
until the start is forgotten, each at the cheaper of the two loosest tolerances that reach tol. They are given how long that takes, and
their right-hand side is machine code for the n (n + 1) / 2 unknowns of the symmetric X, its set-up left out. The solver here makes the
system and resolves its coefficients anew each time; "flexlin, design" is the whole of `periodic_lqr`, with the gain and the closed loop;
"flexlin, set up" is the solution alone, as the others have it. The satellite's field is known to have no narrow features (`complete`);
"flexlin, unknown" is given A and B as plain functions, and looks at them everywhere.

    python studies/riccati_race.py [--size small] [--out DIR]
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from outside.compiled import compile_function
from scipy.integrate import odeint, solve_ivp
from shared.running import least_time, run_study

import flexlin as fl
from flexlin.analyses.accuracy.scipy_methods import FastRate
from flexlin.periodic.coefficient_series.resolve import resolve
from flexlin.periodic.riccati.linear_quadratic import linear_quadratic
from flexlin.periodic.riccati.newton import solve_by_newton
from flexlin.periodic.riccati.riccati import choose_nodes, periodic_riccati, resolve_problem
from flexlin.symbolic import selected

METHODS = ("DOP853", "LSODA", "Radau")
INERTIA = np.array([250.0, 150.0, 100.0])
"""kg m^2 about roll, pitch and yaw."""
GRAVITY, RADIUS, ALTITUDE = 3.986004418e14, 6.378137e6, 657e3
"""m^3/s^2; m; m."""
DIPOLE, INCLINATION = 7.9e15, np.deg2rad(57.0)
"""Wb m of the Earth's field; of the orbit against the magnetic equator."""
ANGLE, MOMENT = np.deg2rad(5.0), 1.0
"""Acceptable angle in rad and moment in A m^2; rates and integrals follow by the orbital rate (Bryson's rule)."""


@dataclass(frozen=True)
class Contest:
    """A system made anew by `make`, the weights of its states and inputs, and the compiled (s, packed X) -> dX/ds, s = -t."""

    make: Callable[[], fl.PeriodicSystem]
    Q: np.ndarray
    R: np.ndarray
    rate: FastRate


def link(modes: int) -> Contest:
    """The shipped single link, which swings from hanging almost down to standing almost up."""
    changes = {"motion.frequency": 0.5, "motion.joints.0.amplitude": 1.2, "links.0.modes": modes, "designs": []}
    scene = fl.load_scene("single-link", {"effects.payload.mass": 0.03, **changes})
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    s, p = ca.SX.sym("s"), lin.arm.parameters.symbols
    M, D, K, B = selected(lin.coefficients, ("M", "D", "K", "B"))(-s / lin.period, p)
    n = M.shape[0]
    solved = ca.ldl_solve(ca.horzcat(K, D, B), *ca.ldl(ca.sparsify(M)))
    A = ca.vertcat(ca.horzcat(ca.SX(n, n), ca.SX.eye(n)), -ca.sparsify(solved[:, : 2 * n]))
    Q, R = np.diag(np.repeat([1.0, 0.01], n)), np.array([[100.0]])
    rate = packed_riccati(
        s, p, lin.arm.parameters.values, A, ca.vertcat(ca.SX(n, B.shape[1]), solved[:, 2 * n :]), Q, R
    )
    return Contest(lambda: replace(lin).periodic_system(), Q, R, rate)


def satellite(integrals: bool) -> Contest:
    """A satellite that points down, turned by three magnetic torquers along the axes of its orbital frame.

        I1 r'' - w c y' + 4 w^2 (I2 - I3) r = T1,   I2 p'' + 3 w^2 (I1 - I3) p = T2,   I3 y'' + w c r' + w^2 (I2 - I1) y = T3

    for small roll r, pitch p and yaw y on a circular orbit at the rate w, c = I1 - I2 + I3; torques T = m x b(t) of the moments m in the
    field of a dipole, b = (mu / a^3) (cos w t sin i, -cos i, 2 sin w t sin i).

    Source: Wie, Space Vehicle Dynamics and Control (1998), ch. 6; Psiaki, Magnetic torquer attitude control via asymptotic periodic linear
    quadratic regulation, J. Guidance, Control, Dynamics 24 (2001) 386; inertia, orbit and dipole as of Yang, An efficient
    algorithm for periodic Riccati equation for spacecraft attitude control using magnetic torques, arXiv 1601.01990 (2016).
    """
    a = RADIUS + ALTITUDE
    w = float(np.sqrt(GRAVITY / a**3))
    first, second, third = INERTIA
    across = w * (first - second + third)
    K = w**2 * np.diag([4 * (second - third), 3 * (first - third), second - first])
    D = np.array([[0.0, 0, -across], [0, 0, 0], [across, 0, 0]])
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-K / INERTIA[:, None], -D / INERTIA[:, None]]])
    weights = np.array([1.0, w**-2]) / ANGLE**2
    Q = np.repeat(weights, 3)
    if integrals:
        A = np.block([[np.zeros((3, 3)), np.eye(3), np.zeros((3, 3))], [np.zeros((6, 3)), A]])
        Q = np.concatenate([np.full(3, weights[0] * w**2), Q])
    n, size = len(A), DIPOLE / a**3

    def field(t: Any, cos: Callable[[Any], Any], sin: Callable[[Any], Any]) -> tuple[Any, Any, Any]:
        return (
            size * np.sin(INCLINATION) * cos(w * t),
            -size * np.cos(INCLINATION),
            2 * size * np.sin(INCLINATION) * sin(w * t),
        )

    def B(t: np.ndarray) -> np.ndarray:
        b1, b2, b3 = field(t, np.cos, np.sin)
        values = np.zeros((len(t), n, 3))
        for i, j, b in ((0, 1, b3), (0, 2, -b2), (1, 0, -b3), (1, 2, b1), (2, 0, b2), (2, 1, -b1)):
            values[:, n - 3 + i, j] = b / INERTIA[i]
        return values

    s, p = ca.SX.sym("s"), ca.SX.sym("p", 0)
    b1, b2, b3 = field(-s, ca.cos, ca.sin)
    torque = ca.vertcat(ca.horzcat(0, b3, -b2), ca.horzcat(-b3, 0, b1), ca.horzcat(b2, -b1, 0))
    rows = ca.vertcat(ca.SX(n - 3, 3), ca.sparsify(torque / ca.repmat(ca.DM(INERTIA), 1, 3)))
    R = np.eye(3) / MOMENT**2
    rate = packed_riccati(s, p, np.zeros(0), ca.sparsify(ca.SX(ca.DM(A))), rows, np.diag(Q), R)
    return Contest(lambda: fl.PeriodicSystem(A, 2 * np.pi / w, B, complete=True), np.diag(Q), R, rate)


def packed_riccati(
    s: ca.SX, p: ca.SX, values: np.ndarray, A: ca.SX, B: ca.SX, Q: np.ndarray, R: np.ndarray
) -> FastRate:
    """(s, lower triangle of X column by column) -> dX/ds, s = -t: n (n + 1) / 2 unknowns, as machine code."""
    n = A.shape[0]
    pairs = [(i, j) for j in range(n) for i in range(j, n)]
    x, X = ca.SX.sym("x", len(pairs)), ca.SX(n, n)
    for k, (i, j) in enumerate(pairs):
        X[i, j] = X[j, i] = x[k]
    product, gain = X @ A, B.T @ X
    rate = product + product.T - gain.T @ ca.DM(np.linalg.inv(R)) @ gain + ca.DM(Q)
    function = ca.Function("riccati", [s, x, p], [ca.densify(ca.vertcat(*[rate[i, j] for i, j in pairs]))])
    return FastRate(compile_function(function) or function, values)


def race(contest: Contest, tol: float, methods: tuple[str, ...], repeats: int) -> dict[str, tuple[float, float]]:
    """CPU seconds and relative error at t = 0 of the periodic solution for each way."""
    Q, R, system = contest.Q, contest.R, contest.make()
    exact = periodic_riccati(system, Q, R, tol=tol / 10)
    X0 = exact.X(np.zeros(1))[0]
    found, seconds = least_time(lambda: periodic_riccati(contest.make(), Q, R, tol=tol), repeats)
    times = {"flexlin": (seconds, error_of(found.X(np.zeros(1))[0], X0))}
    _, seconds = least_time(lambda: fl.periodic_lqr(contest.make(), Q, R, tol=tol), repeats)
    times["flexlin, design"] = (seconds, times["flexlin"][1])
    _, seconds = least_time(lambda: periodic_riccati(unknown(contest.make()), Q, R, tol=tol), repeats)
    times["flexlin, unknown"] = (seconds, times["flexlin"][1])
    times["flexlin, set up"] = (time_set_up(system, Q, R, tol, repeats), times["flexlin"][1])
    rate = float(fl.floquet(system.feedback(exact.K), tol=1e-6 / system.period).exponents.real.max())
    settle = system.period * np.ceil(np.log(0.1 * tol) / (2 * rate * system.period))
    for method in methods:
        runs: list[tuple[float, float]] = []
        for part in (10.0, 1.0, 0.1, 0.01):
            run = partial(integrate_back, contest.rate, method, settle, tol * part, np.abs(X0).max(), len(X0))
            x, seconds = least_time(run, repeats)
            runs.append((seconds, error_of(x, X0)))
            if sum(error <= tol for _, error in runs) == 2:
                break
        reached = [run for run in runs if run[1] <= tol]
        times[method] = min(reached) if reached else min(runs, key=lambda run: run[1])
    return times


def unknown(system: fl.PeriodicSystem) -> fl.PeriodicSystem:
    """The same A(t) and B(t) as plain functions, of which nothing else is known."""
    return fl.PeriodicSystem(system.A, system.period, system.B)


def time_set_up(system: fl.PeriodicSystem, Q: np.ndarray, R: np.ndarray, tol: float, repeats: int) -> float:
    """CPU seconds of the solution where the coefficients are series already."""
    assert system.B is not None
    series = resolve(system.B, system.period, complete=system.complete)
    ready = fl.PeriodicSystem(system.resolved, system.period, series, complete=True)
    problem, edges = resolve_problem(linear_quadratic(ready, Q, R), ready)

    return least_time(lambda: solve_by_newton(problem, choose_nodes(problem, edges, tol), None, tol), repeats)[1]


def integrate_back(rate: FastRate, method: str, settle: float, tol: float, size: float, n: int) -> np.ndarray:
    """X(0) from X(settle) = 0; tol relative to the size of X."""
    start = np.zeros(n * (n + 1) // 2)
    options = {"rtol": max(tol, 3e-14), "atol": 1e-2 * tol * size}
    if method == "LSODA":
        x = odeint(rate, start, (-settle, 0.0), tfirst=True, mxstep=10**7, **options)[-1]
    else:
        x = solve_ivp(rate, (-settle, 0.0), start, method, t_eval=(0.0,), **options).y[:, -1]
    X = np.zeros((n, n))
    X.T[np.triu_indices(n)] = x
    return X + np.tril(X, -1).T


def error_of(X: np.ndarray, exact: np.ndarray) -> float:
    """The largest error of an entry, relative to the largest entry."""
    return float(np.abs(X - exact).max() / np.abs(exact).max())


def draw(times: dict[str, dict[str, tuple[float, float]]], path: Path) -> None:
    """CPU time of each way, systems side by side."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 3), layout="constrained")
    axes = figure.subplots()
    for k, (name, found) in enumerate(times.items()):
        places = np.arange(len(found)) + 0.8 * (k + 0.5) / len(times) - 0.4
        axes.barh(places, [1e3 * seconds for seconds, _ in found.values()], 0.7 / len(times), color=f"C{k}", label=name)
    axes.set_yticks(range(len(found)), found)
    axes.invert_yaxis()
    axes.set(
        xscale="log", xlabel="CPU time in ms", title="The periodic Riccati solution, every way to the same accuracy"
    )
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path)


def main(size: str = "full", out: str | Path = "out/studies") -> dict[str, dict[str, tuple[float, float]]]:
    """Run the race; returns CPU seconds and error by system and way."""
    full = size == "full"
    contests = {
        "link, 2 modes" if full else "link, rigid": link(2 if full else 0),
        "satellite, 6 states": satellite(False),
        **({"satellite, 9 states": satellite(True)} if full else {}),
    }
    times = {}
    for name, contest in contests.items():
        times[name] = race(contest, 1e-10 if full else 1e-4, METHODS, 20 if full else 1)
        own = times[name]["flexlin"][0]
        for way, (seconds, error) in times[name].items():
            print(
                f"{name:>20} {way:>16}: {seconds:8.3f} s, error {error:.1e}, {seconds / own:6.1f} times flexlin's time"
            )
    draw(times, Path(out) / "riccati_race.svg")
    return times


if __name__ == "__main__":
    run_study(main, "two small systems, a looser tolerance")
