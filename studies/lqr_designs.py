"""Which design survives which speed and payload? And what does the periodic Riccati equation cost?

The shipped single link carries more and swings faster. Every design is made for the light, slow arm it was tuned on (robustness) and
for each arm anew (performance), and Floquet judges each loop. Then the periodic Riccati equation is solved by flexlin and by SciPy's
backward integration of a compiled right-hand side to the same accuracy, in one run.

    python studies/lqr_designs.py [--small] [--out DIR]
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import odeint, solve_ivp

import flexlin as fl
from flexlin.answers.peers.compiled import compile_function
from flexlin.answers.peers.right_hand_sides import FastRate
from flexlin.control import averaged_lqr, frozen_lqr, periodic_lqr
from flexlin.periodic.quadratic.riccati import periodic_riccati
from flexlin.symbolic import selected

R = np.array([[100.0]])
AMPLITUDE = 1.2
"""Swing of the joint in rad: from hanging almost down to standing almost up, where gravity helps and hinders."""
DESIGNS = {"averaged": averaged_lqr, "frozen": frozen_lqr, "periodic": periodic_lqr}


@dataclass(frozen=True)
class Survival:
    """Largest real part of the exponents (1/s) for each design over payloads (rows) and frequencies (columns)."""

    payloads: np.ndarray
    frequencies: np.ndarray
    own: dict[str, np.ndarray]
    kept: dict[str, np.ndarray]


def weigh(system: fl.PeriodicSystem) -> np.ndarray:
    """Q: deflections and angles weigh 1, their rates 0.01."""
    return np.diag(np.repeat([1.0, 0.01], system.n // 2))


def linearized(payload: float, frequency: float, modes: int = 2) -> fl.Linearization:
    """The linear equations of the arm without a loop."""
    scene = loaded(payload, modes, frequency)
    return fl.linearize(built(payload, modes), scene.motion)


def loaded(payload: float, modes: int, frequency: float = 1.0) -> fl.Scene:
    """The shipped single link with another payload, as many modes, and a wide swing."""
    changes = {
        "effects.payload.mass": float(payload),
        "motion.frequency": float(frequency),
        "motion.joints.0.amplitude": AMPLITUDE,
        "links.0.modes": modes,
        "designs": [],
    }
    return fl.load_scene("single-link", changes)


@cache
def built(payload: float, modes: int) -> fl.Manipulator:
    """The arm, which serves for every speed."""
    return fl.build_manipulator(loaded(payload, modes))


def plant(payload: float, frequency: float, modes: int = 2) -> fl.PeriodicSystem:
    """The arm without a loop."""
    return linearized(payload, frequency, modes).periodic_system()


def survival(payloads: np.ndarray, frequencies: np.ndarray, modes: int = 2, phases: int = 16) -> Survival:
    """Judge designs made for each arm, and designs of the first arm kept (their gains follow the phase); `phases` of the frozen one."""
    designs = {**DESIGNS, "frozen": partial(frozen_lqr, phases=phases)}
    shape = (len(payloads), len(frequencies))
    own, kept = ({name: np.empty(shape) for name in DESIGNS} for _ in range(2))
    first = {}
    for i, payload in enumerate(payloads):
        for j, frequency in enumerate(frequencies):
            system, stretch = plant(payload, frequency, modes), frequency / frequencies[0]
            for name, make in designs.items():
                made = make(system, weigh(system), R)
                own[name][i, j] = growth(made.closed_loop)
                gain = first.setdefault(name, made).K
                kept[name][i, j] = growth(system.feedback(lambda t, k=gain, s=stretch: k(t * s)))
    return Survival(payloads, frequencies, own, kept)


def growth(loop: fl.PeriodicSystem) -> float:
    """The largest real part of the exponents."""
    return float(fl.floquet(loop, tol=1e-6).exponents.real.max())


def race(
    tol: float = 1e-10, methods: tuple[str, ...] = ("DOP853", "LSODA", "Radau"), modes: int = 2, repeats: int = 3
) -> dict[str, tuple[float, float]]:
    """CPU seconds and relative error at t = 0 of the periodic Riccati solution on the shipped link, for each way.

    The solver here resolves the coefficients anew each time. SciPy's methods integrate backwards from X = 0 until the start is forgotten,
    each at the loosest of the tolerances that reaches tol; their right-hand side is compiled, its set-up left out.
    """
    lin = linearized(0.03, 0.5, modes)
    system = lin.periodic_system()
    Q = weigh(system)
    exact = periodic_riccati(system, Q, R, tol=tol / 10)
    X0 = exact.X(np.zeros(1))[0]
    found, seconds = least_time(lambda: periodic_riccati(replace(lin).periodic_system(), Q, R, tol=tol), repeats)
    times = {"flexlin": (seconds, error_of(found.X(np.zeros(1))[0], X0))}
    settle = system.period * np.ceil(-np.log(0.1 * tol) / (-2 * growth(system.feedback(exact.K)) * system.period))
    rate = packed_riccati(lin, Q)
    for method in methods:
        runs = []
        for part in (10.0, 1.0, 0.1, 0.01):
            x, seconds = least_time(partial(integrate_back, rate, method, settle, tol * part, len(X0)), repeats)
            runs.append((seconds, error_of(x, X0)))
            if runs[-1][1] <= tol:
                break
        times[method] = runs[-1] if runs[-1][1] <= tol else min(runs, key=lambda run: run[1])
    return times


def least_time(call: Callable[[], Any], repeats: int) -> tuple[Any, float]:
    """The result and the least CPU time in s of several runs; what takes long is run once."""
    times: list[float] = []
    while len(times) < repeats and (not times or times[0] < 2.0):
        begin = time.process_time()
        result = call()
        times.append(time.process_time() - begin)
    return result, min(times)


def packed_riccati(lin: fl.Linearization, Q: np.ndarray) -> FastRate:
    """(s, lower triangle of X column by column) -> dX/ds, s = -t: n (n + 1) / 2 unknowns, as machine code."""
    s, p = ca.SX.sym("s"), lin.arm.parameters.symbols
    M, D, K, B = selected(lin.coefficients, ("M", "D", "K", "B"))(-s / lin.period, p)
    n = M.shape[0]
    solved = ca.ldl_solve(ca.horzcat(K, D, B), *ca.ldl(ca.sparsify(M)))
    A = ca.vertcat(ca.horzcat(ca.SX(n, n), ca.SX.eye(n)), -ca.sparsify(solved[:, : 2 * n]))
    pairs = [(i, j) for j in range(2 * n) for i in range(j, 2 * n)]
    x, X = ca.SX.sym("x", len(pairs)), ca.SX(2 * n, 2 * n)
    for k, (i, j) in enumerate(pairs):
        X[i, j] = X[j, i] = x[k]
    product, gain = X @ A, ca.vertcat(ca.SX(n, B.shape[1]), solved[:, 2 * n :]).T @ X
    rate = product + product.T - gain.T @ ca.DM(np.linalg.inv(R)) @ gain + ca.DM(Q)
    packed = ca.vertcat(*[rate[i, j] for i, j in pairs])
    function = ca.Function("riccati", [s, x, p], [packed])
    return FastRate(compile_function(function) or function, lin.arm.parameters.values)


def integrate_back(rate: FastRate, method: str, settle: float, tol: float, n: int) -> np.ndarray:
    """X(0) from X(settle) = 0."""
    start = np.zeros(n * (n + 1) // 2)
    options = {"rtol": max(tol, 3e-14), "atol": 1e-2 * tol}
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


def draw(data: Survival, path: Path) -> None:
    """Growth rate of each design over payload and frequency."""
    from matplotlib.colors import SymLogNorm
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.subplots(2, len(DESIGNS), sharex=True, sharey=True)
    norm = SymLogNorm(0.1, vmin=-3, vmax=3)
    for row, (label, part) in zip(
        axes, (("made for each arm", data.own), ("kept from the first arm", data.kept)), strict=True
    ):
        for cell, name in zip(row, DESIGNS, strict=True):
            shown = cell.pcolormesh(data.frequencies, 1e3 * data.payloads, part[name], cmap="RdBu_r", norm=norm)
            if np.any(part[name] > 0) and np.any(part[name] < 0):
                cell.contour(data.frequencies, 1e3 * data.payloads, part[name], [0.0], colors="k")
            cell.set_title(f"{name}, {label}", fontsize="small")
        row[0].set_ylabel("payload in g")
    for cell in axes[-1]:
        cell.set(xlabel="frequency in Hz", xscale="log")
        cell.set_xticks([0.2, 0.5, 1.0, 2.0], ["0.2", "0.5", "1", "2"])
        cell.set_xticks([], minor=True)
    figure.colorbar(shown, ax=axes, label="largest real part of the exponents in 1/s")
    figure.suptitle("Which loop survives (blue: stable)")
    figure.savefig(path)


def main(size: str = "full", out: str | Path = "out/studies") -> dict[str, object]:
    """Run the study; returns growth rates and times."""
    full = size == "full"
    frequencies = np.geomspace(0.2, 3.0, 9) if full else np.array([0.5, 3.0])
    data = survival(np.linspace(0.03, 0.5, 6 if full else 2), frequencies, *((2, 16) if full else (1, 4)))
    print(
        f"{'design':>10} {'made for each arm':>24} {'kept from the first':>24}   (stable cases of {data.own['frozen'].size})"
    )
    for name in DESIGNS:
        print(f"{name:>10} {int((data.own[name] < 0).sum()):>24} {int((data.kept[name] < 0).sum()):>24}")
    times = race() if full else race(1e-4, modes=0, repeats=1)
    for way, (seconds, error) in times.items():
        print(
            f"{way:>10}: {seconds:8.3f} s, error {error:.1e}, {seconds / times['flexlin'][0]:6.1f} times flexlin's time"
        )
    Path(out).mkdir(parents=True, exist_ok=True)
    draw(data, Path(out) / "lqr_designs.svg")
    return {"survival": data, "times": times}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--small", action="store_true", help="few cases and phases, one mode, a looser tolerance")
    parser.add_argument("--out", default="out/studies", help="folder for the picture")
    options = parser.parse_args()
    main("small" if options.small else "full", options.out)
