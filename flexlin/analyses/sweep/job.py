"""A sweep as work that can be shared out: what is asked, in which blocks it is done, and what is known so far."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from flexlin.analyses.loops import AnyLoop, choose_loop
from flexlin.analyses.sweep.found import MISSING, TAKEN, VERDICTS, Found
from flexlin.analyses.sweep.together import Together
from flexlin.checks import Array, check_size, positive, real_array
from flexlin.errors import ArgumentError
from flexlin.linearization.family import PeriodicFamily
from flexlin.linearization.free import ParametricLoop
from flexlin.resources import advance, part
from flexlin.scene.loading import check_axes
from flexlin.scene.scene import Scene

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
        """All values of a block."""
        found = Found.empty(len(points), self.source.states)
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
        about: dict[str, str | float] = {
            "title": self.scene.title,
            "loop": self.loop,
            "tol": self.tol,
            "route": self.work.route,
        }
        about |= {"segments": self.work.segments, **({"repaired": self.repaired} if self.repaired else {})}
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
        raise ArgumentError(
            "the paths have different numbers of values", got=str(lengths), expected="one number, or grid=True"
        )
    return np.stack(list(axes.values()), axis=1), lengths[:1], ("value",)


def check_values(count: int, states: int = 2) -> None:
    """Refuse a sweep of too many values before anything is allocated for them."""
    check_size(f"a sweep of {count} values", count * (16 * states + 60), "ask for fewer values")
