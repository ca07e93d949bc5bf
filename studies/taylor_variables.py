"""What does a Taylor polynomial in many variables cost, beside daceypy's?

The tip of a planar arm of twelve joints by `fl.taylor` and by daceypy (where installed): the same expression, point and order, expanded for
the first time in a fresh process, tables and initialization counted. Time is the CPU's; memory is what the process grew by.

Run: python studies/taylor_variables.py [--size small] [--out DIR]
"""

import resource
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import product
from math import comb
from multiprocessing import get_context
from pathlib import Path

import casadi as ca
import numpy as np
from shared.running import run_study

import flexlin as fl


@dataclass(frozen=True)
class Cost:
    """One tool at one size: CPU seconds to expand and to evaluate, bytes the process grew by, error of the tip in m."""

    tool: str
    joints: int
    order: int
    expand: float
    evaluate: float
    bytes: int
    error: float


def planar_tip(q: list, cos: Callable, sin: Callable) -> list:
    """Return the tip of a planar arm with links of 0.9^i m."""
    angle, x, y = q[0], cos(q[0]), sin(q[0])
    for i in range(1, len(q)):
        angle = angle + q[i]
        x, y = x + 0.9**i * cos(angle), y + 0.9**i * sin(angle)
    return [x, y]


def measure(tool: str, joints: int, order: int) -> Cost:
    """Expand the tip of a planar arm for the first time in this process, tables and initialization counted (CPU seconds)."""
    if tool == "daceypy":
        from daceypy import DA
    variable = ca.SX.sym("q")
    fl.taylor(variable, variable, [0.0], 0)  # loading either program is not counted
    point, step = 0.1 * np.arange(joints), 0.02 * np.sin(np.arange(joints))
    before, begin = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    if tool == "daceypy":
        DA.init(order, joints)
        tip = planar_tip([value + DA(i + 1) for i, value in enumerate(point)], lambda a: a.cos(), lambda a: a.sin())
    else:
        q = ca.SX.sym("q", joints)
        P = fl.taylor(ca.vertcat(*planar_tip(ca.vertsplit(q), ca.cos, ca.sin)), q, point, order)
    expand = time.process_time() - begin
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    evaluate = (lambda: [one.eval(step) for one in tip]) if tool == "daceypy" else (lambda: P(step).ravel().tolist())
    error = np.subtract(evaluate(), planar_tip(list(point + step), np.cos, np.sin))
    seconds = min(clock(evaluate) for _ in range(5))
    return Cost(tool, joints, order, expand, seconds, grown, float(np.linalg.norm(error)))


def clock(call: Callable[[], object]) -> float:
    """Return the CPU seconds of one call."""
    begin = time.process_time()
    call()
    return time.process_time() - begin


def main(size: str = "full", out: Path | None = None) -> list[Cost]:
    """Measure both tools; `full` takes the least of three runs, each in a process of its own."""
    tools = ["series", *(["daceypy"] if find_spec("daceypy") else [])]
    if size == "small":
        costs = [measure(*case) for case in product(tools, (6,), (3, 4, 5))]
    else:
        costs = []
        for case in product(tools, (12,), (4, 6, 8)):
            runs = []
            for _ in range(3):
                with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
                    runs.append(pool.submit(measure, *case).result())
            costs.append(min(runs, key=lambda cost: cost.expand))
    if out is not None:
        draw(costs, Path(out))
    return costs


def draw(costs: list[Cost], out: Path) -> None:
    """Draw time and memory against the number of coefficients."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.5), layout="tight")
    axes = figure.subplots(1, 2)
    for tool in dict.fromkeys(cost.tool for cost in costs):
        mine = [cost for cost in costs if cost.tool == tool]
        sizes = [comb(cost.joints + cost.order, cost.order) for cost in mine]
        axes[0].loglog(sizes, [cost.expand for cost in mine], "o-", label=tool)
        axes[1].loglog(sizes, [max(cost.bytes, 4096) for cost in mine], "o-", label=tool)
    axes[0].set(xlabel="coefficients of an output", ylabel="CPU seconds of the first expansion")
    axes[1].set(xlabel="coefficients of an output", ylabel="bytes the process grew by")
    axes[0].legend()
    figure.savefig(out / "taylor_variables.png", dpi=110)


if __name__ == "__main__":
    print("tool       joints order   expand s   evaluate ms        MB       error")
    for cost in run_study(main):
        times = f"{cost.expand:10.3f} {1e3 * cost.evaluate:13.3f}"
        print(f"{cost.tool:10s} {cost.joints:6d} {cost.order:5d} {times} {cost.bytes / 1e6:9.1f}  {cost.error:.2e}")
