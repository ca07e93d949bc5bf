"""What does a value of a stability chart cost, here and with other programs, and is every value right?

Payload times frequency at 1e-8, for the single link with one and two modes and for two links with two modes each: microseconds of one
processor a value by the kernel, with all exponents and their errors, and the values of a random sample beside
`fl.floquet`. Other programs make only the transition matrix of a period, on the single link with one mode: heyoka's SIMD batch, and
jax.vmap over the fixed steps of DOP853, both compiled, each at the cheapest setting that reaches 1e-8. The programs take turns, and each
time is the least of several, so that ratios hold on a machine that does other work. A million values on all cores, by the clock; and what
sharing them out costs: processor time by threads, processes and a Dask cluster against one process alone.

    python studies/charts_speed.py [--size small] [--out DIR]
"""

import json
import os
import resource
import time
from collections.abc import Callable
from functools import partial, reduce
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from outside.heyoka_taylor import HeyokaTransitions
from outside.jax_batch import prepare_jax
from shared.running import run_study

import flexlin as fl
from flexlin.analyses.sweep.job import compute_here, prepare_job
from flexlin.analyses.sweep.sharing import share_among_processes, share_among_threads, share_on_cluster
from flexlin.analyses.sweep.together import Together
from flexlin.linearization.free import ParametricLoop, parametric_loop
from flexlin.periodic.circle import measure_distances
from flexlin.periodic.transition.choose_segments import Setting, factor_period

TOL = 1e-8
PAYLOAD, FREQUENCY = "effects.payload.mass", "motion.frequency"
SCENES = {
    "1 link, 1 mode": ("single-link", {"links.0.modes": 1, "designs": []}, (0.0, 0.2), (0.3, 1.5)),
    "1 link, 2 modes": ("single-link", {"links.0.modes": 2, "designs": []}, (0.0, 0.2), (0.3, 1.5)),
    "2 links, 2 modes each": ("de-luca-siciliano-1991", {"designs": []}, (0.05, 0.2), (0.1, 0.5)),
}
VALUES = {"full": (16384, 4096, 256), "small": (64, 32, 0)}
SAMPLE = {"full": 40, "small": 2}
ROUNDS = {"full": 5, "small": 1}
SHARED = {"full": 1000, "small": 48}
"""Values on a side of the square that is shared out."""
STEPS = (64, 96, 128, 192, 256, 384, 512)
TOLERANCES = (1e-7, 1e-8, 1e-9, 1e-10, 1e-11)
IDLE = 5.0
"""Seconds in which an idle cluster is watched."""
BATCHED = 256
"""Values of a batch of the other programs."""


def grid(scene: str, values: int) -> tuple[ParametricLoop, np.ndarray]:
    """The loop, and values (V, 2) of payload and frequency spread over a rectangle."""
    name, overrides, *ranges = SCENES[scene]
    loop = parametric_loop(fl.load_scene(name, overrides), [PAYLOAD, FREQUENCY])
    side = int(np.sqrt(values))
    axes = np.meshgrid(*[np.linspace(low, high, side) for low, high in ranges], indexing="ij")
    return loop, np.stack([axis.ravel() for axis in axes], axis=1)


def race(runs: dict[str, Callable[[], Any]], rounds: int) -> dict[str, float]:
    """The least processor time of each in s, the runs taking turns."""
    least = dict.fromkeys(runs, np.inf)
    for _ in range(rounds):
        for name, run in runs.items():
            start = time.process_time()
            run()
            least[name] = min(least[name], time.process_time() - start)
    return least


def judge_sample(loop: ParametricLoop, points: np.ndarray, found: Any, count: int) -> float:
    """The largest distance from `fl.floquet` on a random sample, in units of tol; verdicts must be the same."""
    worst = 0.0
    for i in np.random.default_rng(0).choice(len(points), count, replace=False):
        exact = fl.floquet(loop.system_at(points[i]), 1e-11)
        apart = measure_distances(found.exponents[i] * exact.period, exact.log_multipliers).min(axis=1) / exact.period
        worst = max(worst, float((apart / np.maximum(1.0, np.abs(found.exponents[i]))).max()) / TOL)
        assert {0: "undecided", 1: "stable", 2: "unstable"}[int(found.verdict[i])] == exact.verdict
    return worst


def time_scene(scene: str, values: int, size: str) -> dict[str, Any]:
    """Microseconds a value, and the distance from `fl.floquet`."""
    loop, points = grid(scene, values)
    fast = Together.prepare(loop, points, TOL)
    assert fast is not None
    least = race({"kernel": lambda: fast.compute(points)}, ROUNDS[size])
    found = fast.compute(points)
    return {
        "scene": scene,
        "states": loop.states,
        "segments": fast.segments,
        "compiled_us": 1e6 * least["kernel"] / len(points),
        "one_by_one": int(found.one_by_one.sum()),
        "distance_in_tol": judge_sample(loop, points, found, SAMPLE[size]),
    }


def peer_runs(loop: ParametricLoop, points: np.ndarray) -> dict[str, Callable[[], np.ndarray]]:
    """The other programs that are installed, each at the cheapest setting that reaches tol on these values."""
    runs: dict[str, Callable[[], np.ndarray]] = {}
    T = loop.periods(points)
    units = np.stack([np.r_[np.ones(loop.linearization.n), np.full(loop.linearization.n, t)] for t in T])
    exact = reference(loop, points, units)
    if find_spec("heyoka"):
        for tol in TOLERANCES:
            flow = HeyokaTransitions(loop, tol, 8)

            def batch(flow: Any = flow) -> np.ndarray:
                return np.concatenate([flow(points[i : i + 8]) for i in range(0, len(points), 8)])

            if np.abs(batch() * units[:, :, None] / units[:, None, :] - exact).max() <= TOL * np.abs(exact).max():
                runs["heyoka, batches of 8, transition matrix only"] = batch
                break
    if find_spec("jax"):
        for steps in STEPS:
            flow = prepare_jax(loop, steps)
            if np.abs(flow(points) * units[:, :, None] / units[:, None, :] - exact).max() <= TOL * np.abs(exact).max():
                runs[f"jax.vmap, {steps} steps of DOP853, transition matrix only"] = lambda flow=flow: flow(points)
                break
    return runs


def reference(loop: ParametricLoop, points: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Transition matrices (V, n, n) by Gauss collocation of order 16, in `units` (V, n) of the states."""
    every = [factor_period(loop.system_at(point), Setting("gauss", 16, 96, "")) for point in points]
    P = np.array([reduce(lambda P, F: F @ P, factors) for factors in every])
    return P * units[:, :, None] / units[:, None, :]


def time_million() -> dict[str, float]:
    """1000 x 1000 values of the single link with one mode on all cores, the equations counted."""
    name, overrides, *ranges = SCENES["1 link, 1 mode"]
    values = {
        path: np.linspace(low, high, 1000) for path, (low, high) in zip((PAYLOAD, FREQUENCY), ranges, strict=True)
    }
    begin = time.perf_counter()
    data = fl.sweep(fl.load_scene(name, overrides), values, TOL, grid=True)
    seconds = time.perf_counter() - begin
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {
        "seconds": seconds,
        "memory_mb": own,
        "worker_mb": resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024,
        "load": os.getloadavg()[0],
        "one_by_one": int(data.attrs["one_by_one"]),
    }


def time_sharing(size: str) -> dict[str, float]:
    """Processor time of the same values by two threads, two processes and a Dask cluster of two workers, over that of one process.

    What the cluster takes while nothing is asked of it, in as many seconds by the clock, is left out.
    """
    name, overrides, *ranges = SCENES["1 link, 1 mode"]
    sides = zip((PAYLOAD, FREQUENCY), ranges, strict=True)
    values = {path: np.linspace(low, high, SHARED[size]) for path, (low, high) in sides}
    job = prepare_job(fl.load_scene(name, overrides), values, TOL, True, "own")
    first = job.found.exponents.copy()

    def spend(crew: Any, others: Callable[[], float] = lambda: 0.0, idle: float = 0.0) -> float:
        job.done[:] = False
        before, begin = time.process_time() + others(), time.perf_counter()
        job.run(crew)
        return time.process_time() + others() - before - idle * (time.perf_counter() - begin)

    def children() -> float:
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    alone = spend(compute_here)
    first[:] = job.found.exponents
    times = {
        "two threads": spend(partial(share_among_threads, workers=2)),
        "two processes": spend(partial(share_among_processes, workers=2), children),
    }
    if size == "full" and find_spec("distributed"):
        from distributed import Client, LocalCluster

        options = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
        with LocalCluster(**options) as cluster, Client(cluster) as client:

            def of_cluster() -> float:
                return sum(client.run(time.process_time).values())

            before, begin = time.process_time() + of_cluster(), time.perf_counter()
            time.sleep(IDLE)
            idle = (time.process_time() + of_cluster() - before) / (time.perf_counter() - begin)
            times["Dask, two workers"] = spend(partial(share_on_cluster, client=client), of_cluster, idle)
    assert np.array_equal(first, job.found.exponents), "sharing has changed bits"
    alone = min(alone, spend(compute_here))
    return {"one process, s": alone, **{name: seconds / alone - 1 for name, seconds in times.items()}}


def draw(data: dict[str, Any], out: Path) -> None:
    """Draw the time of a value by each program."""
    from matplotlib.figure import Figure

    bars = {f"{row['scene']}, flexlin": row["compiled_us"] for row in data["rows"]}
    bars |= {f"1 link, 1 mode, {name}": us for name, us in data["peers_us"].items() if not name.startswith("flexlin")}
    figure = Figure(figsize=(9, 0.45 * len(bars) + 1.2), layout="constrained")
    axes = figure.subplots()
    axes.barh(list(bars), list(bars.values()), color=["tab:blue" if "flexlin" in name else "tab:gray" for name in bars])
    axes.invert_yaxis()
    axes.set(xscale="log", xlabel="processor time of a value in µs")
    axes.set_title("A value of a stability chart at 1e-8", loc="left")
    figure.savefig(out / "charts_speed.svg")


def main(size: str = "full", out: Path | str = "out/studies") -> dict[str, Any]:
    """Take all times; print, draw and keep them."""
    data: dict[str, Any] = {"million": time_million()} if size == "full" else {}  # first: its memory is not yet others'
    data["rows"] = [time_scene(scene, n, size) for scene, n in zip(SCENES, VALUES[size], strict=True) if n]
    loop, points = grid("1 link, 1 mode", BATCHED if size == "full" else 16)
    fast = Together.prepare(loop, points, TOL)
    assert fast is not None
    runs = {"flexlin, all exponents": lambda: fast.compute(points), **peer_runs(loop, points)}
    data["peers_us"] = {name: 1e6 * s / len(points) for name, s in race(runs, ROUNDS[size]).items()}
    for row in data["rows"]:
        print(
            f"{row['scene']:22} {row['compiled_us']:8.1f} us a value, largest distance from floquet {row['distance_in_tol']:.2f} tol"
        )
    own = data["peers_us"]["flexlin, all exponents"]
    for name, us in data["peers_us"].items():
        print(f"{name:60} {us:8.1f} us a value, {us / own:6.1f} times")
    data["sharing"] = time_sharing(size)
    for name, value in data["sharing"].items():
        print(
            f"{name:60} {value:8.2f}"
            if name.endswith("s") and name.startswith("one")
            else f"{name:60} {100 * value:7.1f} % more"
        )
    if "million" in data:
        print("a million values: {seconds:.1f} s, {memory_mb:.0f} MB, load {load:.1f}".format(**data["million"]))
    folder = Path(out)
    (folder / "charts_speed.json").write_text(json.dumps(data, indent=1), encoding="utf-8")
    draw(data, folder)
    return data


if __name__ == "__main__":
    run_study(main)
