"""Charts: the values computed with progress shown, thinned for the pictures, with what is drawn and written beside them."""

import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import product
from math import prod
from pathlib import Path

import numpy as np
import xarray

from flexlin.analyses.boundary import BoundaryCurve, CriticalValue, find_margin, search_boundary
from flexlin.analyses.clock import Clock
from flexlin.analyses.judging import SMALL_SHARE, find_bending
from flexlin.analyses.spectra import unfold_frequencies
from flexlin.analyses.sweep.found import VERDICTS, Found, worst_error
from flexlin.analyses.sweep.job import Job, Store, check_values, choose_crew, prepare_job
from flexlin.errors import InputError, TimeLimit
from flexlin.periodic.boundary.crossings import CELLS
from flexlin.periodic.boundary.spectra import Effort
from flexlin.report.figures import Picture
from flexlin.report.figures.chart import Chart, describe_chart, draw_campbell, draw_chart, label_value, thin
from flexlin.report.wording import units_of_scene, with_unit_of
from flexlin.scene.loading import revise_scene
from flexlin.scene.names import label_number, name_number, name_unit
from flexlin.scene.scene import Scene

BOUNDARY_SHARE = 0.18
"""Of a command's time: after it, no more tongues are searched for; a strip with three modes has dozens of their tips."""


def find_boundary(
    scene: Scene, ranges: dict[str, tuple[float, float]], data: xarray.Dataset, clock: Clock, loop: str = "own"
) -> tuple[list[CriticalValue], list[BoundaryCurve]]:
    """The critical values of a chart over one number, or the boundary curves of one over two.

    Of what meets a limit there is none, and `data.attrs["search"]` says why.
    """
    seconds = BOUNDARY_SHARE * scene.accuracy.seconds
    if len(ranges) == 1:
        ((path, limits),) = ranges.items()
        find = partial(find_margin, scene, path, limits, seconds, loop=loop)
        margin, problem = clock.attempt("critical values", find)
        if margin is not None and margin.gap:
            gap = with_unit_of(scene, path, f"{margin.gap:.3g}")
            problem = f"the {margin.values} values that time allowed leave gaps of up to {gap}"
        data.attrs["search"] = problem
        return [] if margin is None else list(margin.critical), []
    effort = Effort(seconds)
    tol = 2e-4 * max(1.0, *(high - low for low, high in ranges.values()))  # a fifth of what a picture shows
    follow = partial(search_boundary, scene, ranges, tol, loop, CELLS, effort)
    curves, problem = clock.attempt("boundary of stability", follow)
    problems = [f"the boundary was not followed to its end in {effort.seconds:.3g} s" if effort.unfinished else problem]
    if lost := [place for curve in curves or () for place in curve.lost]:
        where = ", ".join(label_value(scene, path, value) for path, value in zip(ranges, lost[0], strict=True))
        problems.append(f"the boundary was lost at {where}: ask for narrower ranges around that place")
    data.attrs["search"] = "; ".join(filter(None, problems))
    return [], curves or []


def say_bending(
    scene: Scene, ranges: dict[str, tuple[float, float]], critical: Sequence[CriticalValue], clock: Clock
) -> str:
    """Where, of a chart's corners and critical values, links bend so far that linear equations may not hold; empty where none does."""
    corners = [dict(zip(ranges, place, strict=True)) for place in product(*ranges.values())]
    places = [*({one.path: one.value} for one in critical), *corners]

    def work() -> list[float]:
        shares = np.zeros(len(places))
        for k, place in enumerate(places):
            with suppress(InputError):  # the chart says of its values which ones make no scene
                shares[k] = find_bending(revise_scene(scene, place))
        return list(shares)

    seconds = BOUNDARY_SHARE * scene.accuracy.seconds
    shares, problem = clock.attempt("bending of the links", work, at_most=seconds)
    if shares is None:
        return f"How far the links bend was not found ({problem})."
    far = dict[str, list[str]]()
    for place, share in zip(places, shares, strict=True):
        if share > SMALL_SHARE:
            where = ", ".join(label_value(scene, *number) for number in place.items())
            size = f"by {100 * share:.3g} % of its length" if share < 1 else "by more than its length"
            far.setdefault(size, []).append(where)
    if not far:
        return ""
    bends = "; ".join(f"{size} at {' and at '.join(where)}" for size, where in far.items())
    return (
        f"A link bends {bends}: so far that linear equations may not hold. "
        "There the chart speaks of the linear model alone; stiffen the link, or compare with a simulation."
    )


def draw_charts(chart: Chart) -> list[Picture]:
    """The chart, and over one number the Campbell diagram."""
    data, paths = chart.data, chart.paths
    with units_of_scene(chart.scene):
        pictures = [draw_chart(chart)]
        if len(paths) == 1:
            unfolded = unfold_frequencies(chart.scene, paths[0], thin(data), str(data.attrs.get("loop", "own")))
            if unfolded is not None:
                error = float(np.nan_to_num(data["error"].to_numpy(), posinf=0.0).max(initial=0.0))
                pictures.append(draw_campbell(label_number(chart.scene, paths[0]), unfolded, error))
        return pictures


def say_without_picture(chart: Chart, why: object) -> list[Picture]:
    """All that is known, where there is no picture."""
    with units_of_scene(chart.scene):
        said = f"{describe_chart(chart)}\nThe picture was not drawn ({why}); all numbers are written."
    return [Picture("chart", "Stability chart", said)]


def chart_dataset(chart: Chart) -> xarray.Dataset:
    """The sweep under plain names with units, and the critical values or the boundary beside it."""
    scene, data, critical, curves = chart.scene, chart.data, chart.critical, chart.curves
    plain = {path: name_number(path).replace(" ", "_") for path in chart.paths}
    data = data.rename({path: name for path, name in plain.items() if path in data.coords or path in data.dims})
    units = {path: {"units": name_unit(scene, path)} for path in plain}
    for path, name in plain.items():
        data[name].attrs |= units[path] | {"long_name": name_number(path), "path": path}
    if len(plain) == 1:
        (unit,) = units.values()
        for name, kind in {"value": "f8", "error": "f8", "kind": "U8", "resonance": "U120"}.items():
            values = np.array([getattr(one, name) for one in critical], dtype=kind)
            data[f"critical_{name}"] = ("critical", values, unit if kind == "f8" else {})
        return data
    count = [len(curve.points) for curve in curves]
    data["boundary_curve"] = ("point", np.repeat(np.arange(len(curves)), count).astype(np.int32))
    for k, (path, name) in enumerate(plain.items()):
        points = np.concatenate([np.zeros(0), *(curve.points[:, k] for curve in curves)])
        data[f"boundary_{name}"] = ("point", points, units[path])
    return data


def compute_chart(
    scene: Scene,
    axes: Sequence[tuple[str, float, float, int]],
    clock: Clock,
    show: Callable[[str], None],
    *,
    loop: str = "own",
    workers: int | None = None,
    scheduler: str | None = None,
    store: Path | None = None,
) -> tuple[xarray.Dataset, str]:
    """The sweep over a grid of values, and why it is not complete, if it is not.

    Parameters: axes: one or two numbers of the scene, each with its limits and how many values it has.
    Raises: as `sweep`; KeyboardInterrupt and TimeLimit only where nothing was computed.
    """
    jobs = list[Job]()

    def work() -> xarray.Dataset:
        check_values(prod(count for *_, count in axes))
        values = {path: np.linspace(low, high, count) for path, low, high, count in axes}
        job = prepare_job(scene, values, scene.accuracy.tol, grid=len(values) > 1, loop=loop)
        jobs.append(job)
        if store is not None:
            Store(store, job)
        job.watchers.append(count_values(job, show))
        job.run(choose_crew(job, workers, scheduler))
        return job.dataset()

    try:
        return clock.stage("exponents of all values", work, worst_error), ""
    except (KeyboardInterrupt, TimeLimit) as error:
        if not jobs or not jobs[0].done.any():
            raise
        data = jobs[0].dataset()
        # the stage has an answer, if not all of it
        clock.steps[-1] = replace(clock.steps[-1], problem="", reached=worst_error(data))
        return data, say_what_is_missing(jobs[0], error, store, scene.accuracy.seconds)


def say_what_is_missing(job: Job, error: BaseException, store: Path | None, seconds: float) -> str:
    """Why a chart is not complete, and what to do."""
    late, longer = isinstance(error, TimeLimit), error.todo if isinstance(error, TimeLimit) else ""
    why = f"stopped at the time limit of {seconds:g} s" if late else "interrupted"
    known = f"The chart is not complete: {why}, with {int(job.done.sum()):,} of {len(job.points):,} values"
    if store is not None:
        return f"{known}; the same command goes on from {store}, also with another --limit-seconds"
    return f"{known}; {longer}{', or ' if late else ''}add --store FOLDER, from which the same command goes on"


def count_values(job: Job, show: Callable[[str], None]) -> Callable[[int, Found], None]:
    """What counts the finished values of a sweep, each block by a call; `show` takes the line."""
    begun, counts = time.monotonic(), np.zeros(len(VERDICTS), dtype=int)
    if known := int(job.done.sum()):
        print(f"flexlin: {known:,} of {len(job.points):,} values are there already", file=sys.stderr, flush=True)

    def count(start: int, block: Found) -> None:
        np.add.at(counts, block.verdict, 1)
        rate = counts.sum() / max(time.monotonic() - begun, 1e-9)
        said = ", ".join(f"{n:,} {word}" for n, word in zip(counts, VERDICTS, strict=True) if n)
        show(f"exponents of all values, {rate:,.0f} a second: {said}")

    return count
