"""A sweep: stability over many values of scene parameters, in blocks that are computed here or elsewhere, and kept in a folder."""

import hashlib
import json
import math
import os
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

import flexlin
from flexlin.analyses.loops import AnyLoop, RebuiltLoop, RedesignedLoop, choose_loop
from flexlin.analyses.sweep.found import MISSING, TAKEN, VERDICTS, Found
from flexlin.analyses.sweep.sharing import share_among_processes, share_among_threads, share_on_cluster
from flexlin.analyses.sweep.together import Together
from flexlin.arguments import checked
from flexlin.bounds import LARGEST_TABLE, read_text, refuse_odd
from flexlin.checks import Array, check_size, positive, real_array, whole
from flexlin.errors import ArgumentError, OutputError
from flexlin.files import replacing, write_text
from flexlin.linearization.family import PeriodicFamily
from flexlin.linearization.free import ParametricLoop
from flexlin.resources import Stopwatch, advance, part
from flexlin.scene.library import models_folder
from flexlin.scene.loading import check_axes, raw_tables
from flexlin.scene.scene import Scene
from flexlin.symbolic import reading_at_once

if TYPE_CHECKING:
    import xarray as xr


DESIGN_TOL = 1e-9
"""Gains of designs are at least as accurate as this."""


@dataclass(frozen=True)
class OneByOne:
    """The computation of values by `floquet`."""

    source: AnyLoop | PeriodicFamily
    tol: float
    block: int = 4
    route = "one by one"
    segments = 0
    threaded = False

    def compute(self, points: Array) -> Found:
        """All values of a block, whose last bits do not depend on what was computed before."""
        found = Found.empty(len(points), self.source.states)
        with reading_at_once():
            for i, point in enumerate(points):
                advance(i / len(points))
                found.put_alone(i, partial(self.source.system_at, point), self.tol)
        return found


Work = Together | OneByOne
"""What computes a block of values; it pickles, so that it can be sent to where the work is done. `threaded`: whether threads of one process
do it as fast as processes."""


@dataclass
class Job:
    """One sweep: `points` (V, P), the work, and what is known of each value so far; `repaired`: blocks that a store held damaged."""

    scene: Scene | PeriodicFamily
    axes: dict[str, Array]
    shape: tuple[int, ...]
    dims: tuple[str, ...]
    loop: str
    tol: float
    points: Array
    work: Work
    found: Found
    watchers: list[Callable[[int, Found], None]] = field(default_factory=list)
    repaired: int = 0

    @property
    def done(self) -> Array:
        """Which values (V,) are known."""
        return self.found.verdict != MISSING

    @property
    def blocks(self) -> list[tuple[int, int]]:
        """First and last-but-one value of each block that is not done."""
        size, done = self.work.block, self.done
        cuts = [(i, min(i + size, len(done))) for i in range(0, len(done), size)]
        return [(start, stop) for start, stop in cuts if not done[start:stop].all()]

    def compute(self, start: int, stop: int) -> Found:
        """A block, in this process and thread."""
        with part(start / len(self.points), stop / len(self.points)):
            return self.work.compute(self.points[start:stop])

    def enter(self, start: int, block: Found) -> None:
        """Take a finished block, and pass it on to the watchers."""
        self.found.place(start, block)
        advance(float(self.done.mean()))
        for watch in self.watchers:
            watch(start, block)

    def run(self, compute: Callable[["Job"], Iterable[tuple[int, Found]]]) -> None:
        """Compute all blocks that are not done; those that are done stay when it is interrupted."""
        for start, block in compute(self):
            self.enter(start, block)

    def dataset(self) -> "xr.Dataset":
        """What is known so far, with names and units; values that are not done have the verdict `missing`."""
        import xarray as xr

        found, shape, dims = self.found, self.shape, self.dims
        names = ("error", "period", "one_by_one", "reason")
        variables: dict[str, Any] = {
            "exponents": ((*dims, "mode"), found.exponents.reshape(*shape, -1), {"units": "1/s"}),
            "verdict": (dims, VERDICTS[found.verdict].reshape(shape)),
            **{name: (dims, getattr(found, name).reshape(shape)) for name in names},
        }
        coords = {path: (path if dims != ("value",) else "value", axis) for path, axis in self.axes.items()}
        about = {"title": self.scene.title, "loop": self.loop, "tol": self.tol, "route": self.work.route}
        about |= {"segments": self.work.segments} | ({"repaired": self.repaired} if self.repaired else {})
        data = xr.Dataset(variables, coords, {**about, "one_by_one": int(found.one_by_one.sum())})
        data["error"].attrs["units"], data["period"].attrs["units"] = "1/s", "s"
        return data


def compute_here(job: Job) -> Iterator[tuple[int, Found]]:
    """One block after another in this process."""
    for start, stop in job.blocks:
        yield start, job.compute(start, stop)


def prepare_job(
    scene: Scene | PeriodicFamily, values: Mapping[str, ArrayLike], tol: float, grid: bool, loop: str
) -> Job:
    """Check what is asked, derive the equations once, and choose how the values are computed; nothing is computed yet.

    Raises: as `sweep`.
    """
    tol = positive("tol", tol)
    axes = {path: real_array(path, value, (None,)) for path, value in values.items()}
    if taken := TAKEN.intersection(axes):
        raise ArgumentError("a result has that name itself", got=min(taken), expected="a parameter of another name")
    count = math.prod(map(len, axes.values())) if grid else max(map(len, axes.values()), default=0)
    check_values(count)
    points, shape, dims = lay_out(axes, grid)
    if isinstance(scene, PeriodicFamily):
        points = points[:, scene.find_places(axes, loop)]
        chosen: AnyLoop | PeriodicFamily = scene
    else:
        check_axes(scene, axes, grid)
        chosen = choose_loop(scene, axes, loop, min(tol, DESIGN_TOL))
    check_values(count, chosen.states)
    found = Found.empty(len(points), chosen.states)
    found.verdict[:], found.reason[:] = MISSING, "not computed"
    together = Together.prepare(chosen, points, tol) if isinstance(chosen, ParametricLoop | PeriodicFamily) else None
    return Job(scene, axes, shape, dims, loop, tol, points, together or OneByOne(chosen, tol), found)


def lay_out(axes: dict[str, Array], grid: bool) -> tuple[Array, tuple[int, ...], tuple[str, ...]]:
    """All points (V, P), the shape of the result and the names of its dimensions."""
    lengths = tuple(len(axis) for axis in axes.values())
    if not axes or 0 in lengths:
        raise ArgumentError("there is nothing to sweep", got=str(lengths), expected="at least one path with values")
    if grid:
        mesh = np.meshgrid(*axes.values(), indexing="ij")
        return np.stack([axis.ravel() for axis in mesh], axis=1), lengths, tuple(axes)
    if len(set(lengths)) > 1:
        expected = "one number, or grid=True"
        raise ArgumentError("the paths have different numbers of values", got=str(lengths), expected=expected)
    return np.stack(list(axes.values()), axis=1), lengths[:1], ("value",)


def check_values(count: int, states: int = 2) -> None:
    """Refuse a sweep of too many values before anything is allocated for them."""
    check_size(f"a sweep of {count} values", count * (16 * states + 60), "ask for fewer values")


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
        Store(store, job)
    job.run(choose_crew(job, workers, client))
    return job.dataset()


def choose_crew(
    job: Job, workers: int | None = None, client: Any = None
) -> Callable[[Job], Iterable[tuple[int, Found]]]:
    """Who computes the blocks: this process, several, or a cluster. Results do not depend on it."""
    if client is not None:
        if workers is not None:
            raise ArgumentError("a cluster has its own workers", got=f"workers={workers!r}", expected="client alone")
        need_portable(job.work)
        return partial(share_on_cluster, client=client)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    several = cores if workers is None else min(whole("workers", workers), max(1, len(job.blocks)))
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


QUESTION = "sweep.json"
"""The file that says which sweep the blocks are of."""
REMOVE = "give another name, or remove the store"


class Store:
    """A folder with one npz file for each finished block of a sweep.

    A file is written whole or not at all, under the checksums of its format, with the first value of its block and a fingerprint of the
    question that it answers: what was changed or exchanged since is computed again, and counted by the sweep. It takes over what the
    folder holds, and keeps there what the sweep computes from now on.
    Raises: OutputError where it cannot be read or written; ArgumentError where another sweep made it, with what differs.
    """

    def __init__(self, path: str | Path, job: Job):
        self.path, made_by = Path(path), describe(job)
        self._question = digest(json.dumps(made_by, sort_keys=True).encode())
        try:
            if not self.path.exists() or all(one.name.startswith(".") for one in self.path.iterdir()):
                write_text(self.path / QUESTION, json.dumps(made_by, indent=1))
            known = json.loads(read_text(self.path / QUESTION, LARGEST_TABLE))
        except (OSError, ValueError, RecursionError) as error:
            got = f"{QUESTION}: {getattr(error, 'strerror', None) or error}"
            raise OutputError(f"{path} cannot be used as a store", got=got, todo=REMOVE) from None
        refuse_other(str(path), known, made_by)
        for start, stop in job.blocks:
            if self._file(start).exists():
                self._take(job, start, stop)
        job.watchers.append(self)

    def _file(self, start: int) -> Path:
        return self.path / f"block-{start:08}.npz"

    def _take(self, job: Job, start: int, stop: int) -> None:
        """Take over a block that is whole."""
        try:
            refuse_odd(self._file(start).stat(), LARGEST_TABLE)
            with self._file(start).open("rb") as file, np.load(file) as kept:
                if sum(part.file_size for part in kept.zip.infolist()) > LARGEST_TABLE:
                    raise ValueError
                same = (str(kept["question"]), int(kept["start"])) == (self._question, start)
                block = Found(**{one.name: kept[one.name] for one in fields(Found)})
            if not same or len(block.verdict) != stop - start:
                raise ValueError
            job.found.place(start, block)
        except Exception:  # whatever the reader of a damaged file meets
            job.repaired += 1

    def __call__(self, start: int, found: Found) -> None:
        """Write a finished block."""
        arrays = {**vars(found), "reason": found.reason.astype(str)}
        with replacing(self._file(start)) as temporary:
            np.savez(temporary, question=self._question, start=start, **arrays)


def describe(job: Job) -> dict[str, str]:
    """All that decides the numbers of a sweep: two sweeps with the same description have the same results, bit for bit."""
    values = {
        f"values of {name}": f"{len(axis)} from {axis[0]} to {axis[-1]} ({digest(axis.tobytes())})"
        for name, axis in job.axes.items()
    }
    if isinstance(job.scene, PeriodicFamily):
        text = job.scene.text
    else:  # limits change no number, tol stands below
        text = json.dumps({**raw_tables(job.scene), "accuracy": None}, sort_keys=True)
    return {
        "version of flexlin": flexlin.__version__,
        "scene": text,
        **values,
        "shape": str(job.shape),
        "loop": job.loop,
        "tol": repr(job.tol),
        "route": f"{job.work.route}, {job.work.segments} segments, blocks of {job.work.block}",
    }


def digest(data: bytes) -> str:
    """A fingerprint."""
    return hashlib.sha256(data).hexdigest()[:8]


def refuse_other(path: str, known: Any, maker: dict[str, str]) -> None:
    """Raise where a store was made by another sweep, saying what differs."""
    if not isinstance(known, dict):
        raise ArgumentError(f"{path} is no store of a sweep", got="no description of one", todo="give another name")
    for key in {**maker, **known}:
        now = maker.get(key, "none")
        if known.get(key) != now:
            got, expected = shorten(str(known.get(key)), now), shorten(now, str(known.get(key)))
            what = f"{path} was made by a sweep that differs in the {key}"
            raise ArgumentError(what, got=got, expected=expected, todo=REMOVE)


def shorten(text: str, other: str) -> str:
    """The text from a little before the place where it differs from the other."""
    same = next((i for i, (a, b) in enumerate(zip(text, other, strict=False)) if a != b), min(len(text), len(other)))
    return text[max(0, same - 40) : same + 60]
