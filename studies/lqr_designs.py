"""Which design survives which speed and payload? And what does the periodic Riccati equation cost?

The shipped single link carries more and swings faster. Every design is made for the light, slow arm it was tuned on (robustness) and
for each arm anew (performance), and Floquet judges each loop. Then the periodic Riccati equation is solved by flexlin and by SciPy's
backward integration (compiled as C) to the same accuracy, in one run.

    python studies/lqr_designs.py [--small] [--out DIR]
"""

import argparse
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
from scipy.integrate import odeint, solve_ivp

import flexlin as fl
from flexlin.control import averaged_lqr, frozen_lqr, periodic_lqr
from flexlin.periodic.fourier import FourierSeries, fourier_nodes
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.quadratic.riccati import periodic_riccati

Q, R = np.diag([1.0, 1.0, 1.0, 0.01, 0.01, 0.01]), np.array([[100.0]])
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


def plant(payload: float, frequency: float, modes: int = 2) -> fl.PeriodicSystem:
    """The arm without a loop."""
    scene = fl.load_scene(
        "single-link",
        {
            "effects.payload.mass": float(payload),
            "motion.frequency": float(frequency),
            "motion.joints.0.amplitude": AMPLITUDE,
            "links.0.modes": modes,
            "designs": [],
        },
    )
    return fl.linearize(fl.build_manipulator(scene), scene.motion).periodic_system()


def survival(payloads: np.ndarray, frequencies: np.ndarray) -> Survival:
    """Judge designs made for each arm, and designs of the first arm kept (their gains follow the phase)."""
    shape = (len(payloads), len(frequencies))
    own, kept = ({name: np.empty(shape) for name in DESIGNS} for _ in range(2))
    first = {name: make(plant(payloads[0], frequencies[0]), Q, R) for name, make in DESIGNS.items()}
    for i, payload in enumerate(payloads):
        for j, frequency in enumerate(frequencies):
            system = plant(payload, frequency)
            for name, make in DESIGNS.items():
                own[name][i, j] = growth(make(system, Q, R).closed_loop)
                stretch = frequency / frequencies[0]
                gain = first[name].K
                kept[name][i, j] = growth(system.feedback(lambda t, k=gain, s=stretch: k(t * s)))
    return Survival(payloads, frequencies, own, kept)


def growth(loop: fl.PeriodicSystem) -> float:
    """The largest real part of the exponents."""
    return float(fl.floquet(loop, tol=1e-6).exponents.real.max())


def race(
    tol: float = 1e-10, methods: tuple[str, ...] = ("DOP853", "LSODA"), modes: int = 2
) -> dict[str, tuple[float, float]]:
    """Seconds and relative error at t = 0 of the periodic Riccati solution on the shipped link, for each way."""
    system = plant(0.03, 0.5, modes)
    return race_on(system, np.diag(np.repeat([1.0, 0.01], system.n // 2)), R, tol, methods)


def race_on(
    system: fl.PeriodicSystem, Q: np.ndarray, R: np.ndarray, tol: float, methods: tuple[str, ...] = ("LSODA",)
) -> dict[str, tuple[float, float]]:
    """Race on any smooth system: flexlin's X(t) with its error against X(0) by SciPy, whose right-hand side is compiled as C."""
    exact = periodic_riccati(system, Q, R, tol=tol / 10)
    X0 = exact.X(np.zeros(1))[0]
    begin = time.perf_counter()
    found = periodic_riccati(system, Q, R, tol=tol)
    times = {"flexlin": (time.perf_counter() - begin, error_of(found.X(np.zeros(1))[0], X0))}
    settle = system.period * np.ceil(
        -np.log(tol) / (-2 * growth(periodic_lqr(system, Q, R, tol=tol).closed_loop) * system.period)
    )
    with tempfile.TemporaryDirectory() as folder:
        rate = compile_rate(exact.problem, system.period, Path(folder))
        for method in methods:
            begin = time.perf_counter()
            last = integrate_back(rate, settle, X0.size, method, 0.1 * tol)
            times[method] = (time.perf_counter() - begin, error_of(last.reshape(X0.shape), X0))
    return times


def integrate_back(
    rate: Callable[[float, np.ndarray], np.ndarray], settle: float, size: int, method: str, rtol: float
) -> np.ndarray:
    """X(0) by SciPy from X = 0 at the time `settle`; LSODA by `odeint`, whose steps are not Python's."""
    if method == "LSODA":
        run = odeint(rate, np.zeros(size), [settle, 0.0], tfirst=True, rtol=rtol, atol=1e-2 * rtol, mxstep=10**7)
        return run[-1]
    return solve_ivp(rate, (settle, 0.0), np.zeros(size), method, rtol=rtol, atol=1e-2 * rtol).y[:, -1]


def compile_rate(problem: LinearQuadratic, period: float, folder: Path) -> Callable[[float, np.ndarray], np.ndarray]:
    """X' of the Riccati equation from the Fourier series of its coefficients, as C where there is a compiler."""
    series = FourierSeries.through(np.concatenate(problem.reduced(fourier_nodes(513, period)), axis=2), period)
    n, H, c = problem.A(np.zeros(1)).shape[1], series.harmonics, series.coefficients
    size = np.hypot(c[1 : H + 1], c[H + 1 :]) / np.maximum(np.abs(c[0]), 1e-300)
    keep = int(np.count_nonzero(np.cumsum(size.max(axis=(1, 2))[::-1])[::-1] > 1e-14))
    t, x = ca.SX.sym("t"), ca.SX.sym("x", n * n)
    turn, wave, sum_ = (ca.cos(2 * np.pi / period * t), ca.sin(2 * np.pi / period * t)), (1, 0), ca.DM(c[0])
    for k in range(1, keep + 1):
        wave = (wave[0] * turn[0] - wave[1] * turn[1], wave[0] * turn[1] + wave[1] * turn[0])
        sum_ = sum_ + ca.DM(c[k]) * wave[0] + ca.DM(c[H + k]) * wave[1]
    A, S, Q = ca.horzsplit(sum_, n)
    X = ca.reshape(x, n, n)
    product = X @ A
    made = ca.Function("rate", [t, x], [ca.vec(-(product + product.T - X @ S @ X + Q))])
    function = compile_function(made, folder)
    buffer, call = function.buffer()
    time_now, state, slope = np.zeros(1), np.zeros(n * n), np.zeros(n * n)
    buffer.set_arg(0, memoryview(time_now))
    buffer.set_arg(1, memoryview(state))
    buffer.set_res(0, memoryview(slope))

    def rate(now: float, at: np.ndarray, owner: ca.Function = function, kept: object = buffer) -> np.ndarray:
        time_now[0], state[:] = now, at
        call()
        return slope.copy()

    return rate


def compile_function(function: ca.Function, folder: Path) -> ca.Function:
    """The function as C, or as it is where there is no C compiler."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        return function
    code = ca.CodeGenerator(f"{function.name()}.c")
    code.add(function)
    source, library = code.generate(f"{folder}/"), f"{folder}/{function.name()}.so"
    subprocess.run([compiler, "-O2", "-shared", "-fPIC", source, "-o", library], check=True)
    return ca.external(function.name(), library)


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
    data = survival(
        np.linspace(0.03, 0.5, 6 if full else 2), np.geomspace(0.2, 3.0, 9) if full else np.array([0.5, 3.0])
    )
    print(
        f"{'design':>10} {'made for each arm':>24} {'kept from the first':>24}   (stable cases of {data.own['frozen'].size})"
    )
    for name in DESIGNS:
        print(f"{name:>10} {int((data.own[name] < 0).sum()):>24} {int((data.kept[name] < 0).sum()):>24}")
    times = race() if full else race(1e-4, modes=0)
    for way, (seconds, error) in times.items():
        print(
            f"{way:>10}: {seconds:8.3f} s, error {error:.1e}, {seconds / times['flexlin'][0]:6.1f} times flexlin's time"
        )
    Path(out).mkdir(parents=True, exist_ok=True)
    draw(data, Path(out) / "lqr_designs.svg")
    return {"survival": data, "times": times}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--small", action="store_true", help="few cases, a looser tolerance")
    parser.add_argument("--out", default="out/studies", help="folder for the picture")
    options = parser.parse_args()
    main("small" if options.small else "full", options.out)
