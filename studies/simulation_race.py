"""What does a simulation cost, here and by LSODA, DOP853 and Radau on compiled right-hand sides, at the same true error?

One period of the shipped single link with two modes and of the three-link arm, from rest on the rigid motion, under the scenes' own
loops. The peers give the states at 256 times; `fl.simulate` gives these with their error, the linear answer with its own, tips,
torques, peaks and the energy. Their right-hand side is one CasADi expression of the accelerations, evaluated by CasADi and as machine
code; what makes it and compiles it is left out. True errors are against DOP853 at 1e-13 on the machine code, begun anew at each time,
relative to the largest state. Each peer runs at the cheapest of its tolerances whose true error is no larger than that of `simulate` at
its tol; the least CPU time of several runs in one process.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python studies/simulation_race.py [--size small] [--out DIR]
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from outside.compiled import compile_function
from outside.scipy_ode import integrate, integrate_loop
from shared.running import least_time, run_study

import flexlin as fl
from flexlin.analyses.accuracy.result import compare_arrays
from flexlin.analyses.accuracy.scipy_methods import FastRate, Rate, derive_loop_rate
from flexlin.checks import SAMPLES, Array

ARMS = ("single-link", "three-link")
TOLS = (1e-4, 1e-6, 1e-8)
PEERS = {
    "LSODA": 10.0 ** -np.arange(3.0, 12.51, 0.5),
    "DOP853": 10.0 ** -np.arange(4.0, 12.1),
    "Radau": 10.0 ** -np.arange(3.0, 7.1),
}
LONG = 0.2
"""Seconds after which a program is not tried at a smaller tolerance, nor run again."""
OWN = "flexlin, with its error"


@dataclass(frozen=True)
class Row:
    """A program at one tolerance: its true error and least CPU time."""

    arm: str
    program: str
    tol: float
    error: float
    milliseconds: float


def run_arm(
    name: str, changes: dict[str, Any], tols: tuple[float, ...], peers: dict[str, Array], repetitions: int
) -> list[Row]:
    """Every program at every tolerance; of what gives up at one there is no row."""
    scene = fl.load_scene(name, {"designs": [], **changes})
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    rate, values, states = derive_loop_rate(lin), lin.arm.parameters.values, 2 * lin.n
    compiled = compile_function(rate)
    sides = {"CasADi": FastRate(rate, values)}
    if compiled is not None:
        sides["machine code"] = FastRate(compiled, values)
    exact = follow_exactly(list(sides.values())[-1], states)
    rows = []

    def add(program: str, tol: float, run: Callable[[], Array]) -> float:
        try:
            found, seconds = least_time(run, repetitions + 1, LONG)
        except RuntimeError:
            return 0.0
        rows.append(Row(name, program, tol, compare_arrays(found, exact), 1e3 * seconds))
        return seconds

    def simulate(tol: float) -> Array:
        return fl.simulate(lin, 1.0, tol=tol, points_per_period=SAMPLES).nonlinear

    for tol in tols:
        add(OWN, tol, partial(simulate, tol))
    for side, function in sides.items():
        for method, theirs in peers.items():
            for tol in theirs:
                if add(f"{method}, {side}", tol, partial(integrate_loop, function, states, method, tol)) > LONG:
                    break
    return rows


def follow_exactly(rate: Rate, states: int) -> Array:
    """States (N, 2n) over a period from rest, each where an integration ends: DOP853's polynomial between steps is of lower order."""
    found = [np.zeros(states)]
    for times in pairwise(np.linspace(0.0, 1.0, SAMPLES + 1)):
        found.append(integrate(rate, found[-1], np.array(times), "DOP853", 1e-13)[-1])
    return np.array(found)


def compare(rows: list[Row]) -> list[dict[str, Any]]:
    """Of each own row the times of the peers' cheapest settings that are no less accurate, and how many times as long it takes itself."""
    found = []
    for own in (row for row in rows if row.program == OWN):
        theirs = [row for row in rows if row.arm == own.arm and row.program != OWN and row.error <= own.error]
        least: dict[str, float] = {}
        for row in theirs:
            least[row.program] = min(row.milliseconds, least.get(row.program, np.inf))
        found.append({**asdict(own), "peers": least})
    return found


def draw(rows: list[Row], path: Path) -> None:
    """CPU time over true error, a line for each program, an arm in each panel."""
    from matplotlib.figure import Figure

    arms = list(dict.fromkeys(row.arm for row in rows))
    figure = Figure(figsize=(5 * len(arms), 4.4), layout="constrained")
    for panel, arm in zip(np.ravel(figure.subplots(1, len(arms))), arms, strict=True):
        for program in dict.fromkeys(row.program for row in rows if row.arm == arm):
            mine = [row for row in rows if (row.arm, row.program) == (arm, program)]
            style = "k-D" if program == OWN else "--" if program.endswith("CasADi") else "-"
            panel.plot([row.error for row in mine], [row.milliseconds for row in mine], style, label=program)
        panel.set(title=arm, xscale="log", yscale="log", xlabel="true error", ylabel="CPU time in ms")
    figure.legend(*panel.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    figure.savefig(path)


def main(size: str = "full", out: str | Path = "out/studies") -> dict[str, Any]:
    """Run the race, print and draw it; returns rows and comparisons."""
    full = size == "full"
    changes: dict[str, Any] = {} if full else {"links.0.modes": 1}
    peers = PEERS if full else {"LSODA": np.array([1e-6, 1e-12])}
    rows = []
    for arm in ARMS if full else ARMS[:1]:
        rows += run_arm(arm, changes, TOLS if full else TOLS[:1], peers, 5 if full else 0)
    compared = compare(rows)
    for own in compared:
        print(f"{own['arm']}, tol {own['tol']:.0e}: error {own['error']:.1e}, {own['milliseconds']:.1f} ms")
        for program, milliseconds in own["peers"].items():
            print(f"    {program:24s} {milliseconds:9.1f} ms: here {own['milliseconds'] / milliseconds:.2f} times")
    draw(rows, Path(out) / "simulation_race.svg")
    return {"rows": [asdict(row) for row in rows], "compared": compared}


if __name__ == "__main__":
    run_study(main, "one arm with one mode, one tolerance")
