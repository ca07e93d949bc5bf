"""Stability over many values of scene parameters: the same equations for all values, evaluated in bounded batches."""

import os
import pickle
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from flexlin.analyses.loops import RebuiltLoop, RedesignedLoop
from flexlin.analyses.sweep.found import Found
from flexlin.analyses.sweep.job import Job, Work, compute_here, prepare_job
from flexlin.analyses.sweep.sharing import share_among_processes, share_among_threads, share_on_cluster
from flexlin.analyses.sweep.store import Store
from flexlin.arguments import checked
from flexlin.checks import whole
from flexlin.errors import ArgumentError
from flexlin.linearization.family import PeriodicFamily
from flexlin.resources import Stopwatch
from flexlin.scene.library import models_folder
from flexlin.scene.scene import Scene

if TYPE_CHECKING:
    import xarray as xr


SECONDS_ALONE = 3.0
"""Seconds of work from which other processes are started, which take about one to load. Results do not depend on it."""


@checked
def sweep(
    scene: Scene | PeriodicFamily,
    values: Mapping[str, ArrayLike],
    tol: float = 1e-8,
    *,
    grid: bool = False,
    loop: str = "own",
    workers: int | None = None,
    client: Any = None,
    store: str | Path | None = None,
) -> "xr.Dataset":
    """Compute the Floquet exponents of a loop on a scene's arm for many values of the scene's numbers.

        M(t, p) y'' + D(t, p) y' + K(t, p) y = 0,   T = T(p),   for p = p_1 ... p_V

    Assumes mode shapes as the scene's own numbers give them.

    Parameters
    ----------
    scene : Scene or PeriodicFamily
        The scene, or a family of systems.
    values : mapping of str to array_like, shape (V,)
        Dotted path, or a symbol's name in a family, -> values; one point of the sweep for each index. A family needs all of its symbols.
    tol : float
        Wanted error of an exponent, in 1/s up to |exponent| = 1/s and relative beyond.
    grid : bool
        Every combination of the values, with one dimension for each path.
    loop : str
        "own": the scene's loop; "open": the arm without feedback; a design's name: its gain as designed with the scene's own numbers, kept
        while they vary, as a function of the phase; "NAME, redone": designed anew at each value.
    workers : int, optional
        Processes that share the work, or threads where compiled code does it; by default one for each core where that saves time. The
        result is the same to the last bit.
    client : distributed.Client or str, optional
        A Dask cluster, or its scheduler's address, that does the work in their place.
    store : str or Path, optional
        A folder that keeps finished blocks; where it exists already, the sweep goes on where it stopped.

    Returns
    -------
    xarray.Dataset
        exponents (..., n) in 1/s by falling real part, error (...) in 1/s (the largest of a value's exponents), verdict, period in s,
        reason (why a verdict is undecided, or failed because the equations break there; else empty), and one_by_one: whether the value
        was left to `floquet`; attrs: loop, tol, segments, one_by_one (how many), repaired (damaged blocks of the
        store, computed again).

    Raises
    ------
    ArgumentError
        For paths and values that do not fit, and for a loop that is not there.
    SceneError
        For a value that the scene's schema refuses, with its key, before anything is computed.

    Notes
    -----
    The expressions are derived once, and compiled code evaluates them for several values at a time. Transition matrices and exponents of
    all values of a block are found together, with an error from three resolutions, for second-order systems of up to 6 coordinates and
    first-order ones of up to 8 states. Values on which that error misses tol, and larger systems, are computed one by one by `floquet`.
    The result takes about 16 n + 60 bytes a value for n states.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> found = fl.sweep(scene, {"effects.payload.mass": [0.0, 0.03, 0.06]}, tol=1e-6)
    >>> found["verdict"].values.tolist(), found["exponents"].shape
    (['stable', 'stable', 'stable'], (3, 6))
    >>> bool((found["error"] < 1e-6 * abs(found["exponents"]).max("mode")).all())
    True
    """
    job = prepare_job(scene, values, tol, grid, loop)
    if store is not None:
        keep_in(store, job)
    job.run(choose_crew(job, workers, client))
    return job.dataset()


def keep_in(store: str | Path, job: Job) -> None:
    """Take over what a store holds of this sweep, and keep there what is computed from now on."""
    kept = Store(store, job)
    job.repaired = kept.repaired
    job.watchers.append(kept)


def choose_crew(
    job: Job, workers: int | None = None, client: Any = None
) -> Callable[[Job], Iterable[tuple[int, Found]]]:
    """Who computes the blocks: this process, several, or a cluster. Results do not depend on it."""
    if client is not None:
        if workers is not None:
            raise ArgumentError("a cluster has its own workers", got=f"workers={workers!r}", expected="client alone")
        need_portable(job.work)
        return partial(share_on_cluster, client=client)
    several = count_cores() if workers is None else min(whole("workers", workers), max(1, len(job.blocks)))
    if several == 1:
        return compute_here
    if job.work.threaded:
        return partial(share_among_threads, workers=several)
    if workers is None and (not is_portable(job.work) or predict_seconds(job) < SECONDS_ALONE):
        return compute_here
    need_portable(job.work)
    return partial(share_among_processes, workers=several)


def predict_seconds(job: Job) -> float:
    """How long the work takes in this process, by its first block, which is computed and entered."""
    if not job.blocks:
        return 0.0
    start, stop = job.blocks[0]
    watch = Stopwatch()
    job.enter(start, job.compute(start, stop))
    return watch.seconds * len(job.blocks)


def is_portable(work: Work) -> bool:
    """Whether the work can be sent to another process, where models that the user has registered are not known."""
    try:
        pickle.dumps(work)
    except (pickle.PicklingError, AttributeError, TypeError):
        return False
    loop = getattr(work, "source", None)
    loop = loop.plant if isinstance(loop, RedesignedLoop) else loop
    model = loop.scene.model if isinstance(loop, RebuiltLoop) else None
    return model is None or (models_folder() / f"{model.replace('-', '_')}.py").exists()


def need_portable(work: Work) -> None:
    """Refuse to send work elsewhere that would not be understood there."""
    if not is_portable(work):
        what, todo = "the loop cannot be sent to other processes", "ask for workers = 1"
        got = "a model that is registered in this process only, or functions that do not pickle"
        raise ArgumentError(what, got=got, todo=todo)


def count_cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
