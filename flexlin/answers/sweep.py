"""Stability over many values of scene parameters: the same equations for all values, evaluated in bounded batches."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from flexlin.about.free import ParametricLoop, parametric_loop
from flexlin.checks import Array, check_size, positive, real_array
from flexlin.errors import ArgumentError
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.fourier import FourierSeries
from flexlin.periodic.many import batched_exponents
from flexlin.periodic.many.algebra import solve_positive
from flexlin.periodic.many.romberg import measure_spread
from flexlin.scene.scene import Scene

CHUNK_BYTES = 2**26
"""Working memory of one batch."""
STARTS = (8, 12, 16, 24, 32, 48, 64, 96, 128)
"""Numbers of segments among which the pilot chooses."""
SLACK = 1.1
"""The spread of the moduli may exceed the pilot's by this factor."""
PILOTS, ENOUGH = 24, 0.9
"""Values on which the pilot runs, and the share of them that must reach the tolerance."""
HARMONICS = (6, 8, 10, 12, 16, 24, 32, 48, 64)
"""Harmonics of the period with which the coefficients may be represented."""
TAIL = 1e-4
"""The two highest harmonics of a representation must be this small against the coefficients, in units of the tolerance."""
VERDICTS = np.array(["undecided", "stable", "unstable"])


def sweep(
    scene: Scene,
    values: Mapping[str, ArrayLike],
    tol: float = 1e-8,
    *,
    grid: bool = False,
    chunk_bytes: int = CHUNK_BYTES,
) -> xr.Dataset:
    """Compute the Floquet exponents of a scene's own loop for many values of its numbers.

        M(t, p) y'' + D(t, p) y' + K(t, p) y = 0,   T = T(p),   for p = p_1 ... p_V

    Assumes mode shapes as the scene's own numbers give them.

    Parameters
    ----------
    scene : Scene
        The scene.
    values : mapping of str to array_like, shape (V,)
        Dotted path -> values; one point of the sweep for each index.
    tol : float
        Wanted error of an exponent, in 1/s up to |exponent| = 1/s and relative beyond.
    grid : bool
        Every combination of the values, with one dimension for each path.
    chunk_bytes : int
        Working memory of a batch, in bytes. A batch holds one value at the least.

    Returns
    -------
    xarray.Dataset
        exponents (..., n) in 1/s by falling real part, error (...) in 1/s (the largest of a value's exponents), verdict, period in s,
        and one_by_one: whether the value was left to `floquet`; attrs: tol, segments, one_by_one (how many).

    Raises
    ------
    ArgumentError
        For paths and values that do not fit.

    Notes
    -----
    The expressions are derived once. Coefficients are sampled at a few phases and carried to the nodes by their Fourier series;
    transition matrices and exponents of all values of a batch are found together, with an error from three resolutions. Values on
    which that error misses tol are computed again one by one by `floquet`. The result takes about 16 n + 60 bytes a value for n states.

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
    tol = positive("tol", tol)
    axes = {path: real_array(path, value, (None,)) for path, value in values.items()}
    if any(path.startswith("accuracy.") for path in axes):
        got, expected = ", ".join(axes), "a number of the links, effects, motion or control"
        raise ArgumentError("what is asked of the answer is no number of the arm", got=got, expected=expected)
    count = math.prod(map(len, axes.values())) if grid else max(map(len, axes.values()), default=0)
    check_values(count)
    points, shape, dims = lay_out(axes, grid)
    loop = parametric_loop(scene, axes)
    check_values(count, 2 * loop.linearization.n)
    points, shape, dims = lay_out(axes, grid)
    batches = Batches(loop, points, tol, chunk_bytes)
    plan = choose_plan(batches)
    size = batches.values_in_chunk(plan.segments)
    found = Found.empty(len(points), 2 * loop.linearization.n)
    for start in range(0, len(points), size):
        batches.fill(found, np.arange(start, min(start + size, len(points))), plan)
    return build_dataset(scene, axes, found, shape, dims, tol, plan.segments)


def check_values(count: int, states: int = 2) -> None:
    """Refuse a sweep of too many values before anything is allocated for them."""
    check_size(f"a sweep of {count} values", count * (16 * states + 60), "ask for fewer values")


def worst_error(data: xr.Dataset) -> float:
    """The largest error of a sweep, in 1/s up to |exponent| = 1/s and relative beyond; values with unresolved exponents are left out."""
    size = np.abs(data["exponents"].values).max(axis=-1, initial=1.0)
    errors = data["error"].values / size
    return float(errors[np.isfinite(errors)].max(initial=0.0))


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


@dataclass
class Found:
    """What is known of each value so far."""

    exponents: Array
    error: Array
    verdict: Array
    period: Array
    one_by_one: Array

    @classmethod
    def empty(cls, values: int, states: int) -> "Found":
        code, flag = np.zeros(values, dtype=np.int8), np.zeros(values, dtype=bool)
        return cls(np.empty((values, states), dtype=complex), np.full(values, np.nan), code, np.empty(values), flag)

    def put(self, which: Array, exponents: Array, errors: Array) -> None:
        """Enter exponents and errors (V, n): unordered, and judge them."""
        order = np.argsort(-exponents.real, axis=1, kind="stable")
        self.exponents[which] = np.take_along_axis(exponents, order, axis=1)
        self.error[which] = errors.max(axis=1)
        growth = exponents.real
        self.verdict[which] = np.where((growth > errors).any(axis=1), 2, np.where((growth < -errors).all(axis=1), 1, 0))


@dataclass(frozen=True)
class Batches:
    """The batched computation over chosen points."""

    loop: ParametricLoop
    points: Array
    tol: float
    chunk_bytes: int

    def fill(self, found: Found, which: Array, plan: "Plan") -> None:
        """Compute the values `which`: together, those that missed tol again on twice the segments, and the rest one by one."""
        found.period[which] = self.loop.periods(self.points[which])
        narrow = self.find_narrow(which)
        alone, which = which[narrow], which[~narrow]
        for trial in (plan, replace(plan, segments=2 * plan.segments)) if len(which) else ():
            size = self.values_in_chunk(trial.segments)
            parts = [which[i : i + size] for i in range(0, len(which), size)]
            left = [self.try_together(found, part, trial) for part in parts]
            which = np.concatenate([which[:0], *left])
        for i in (*alone, *which):
            result = floquet(self.loop.at(self.points[i]).periodic_system(), self.tol)
            found.put(np.array([i]), result.exponents[None], result.errors[None])
            found.one_by_one[i] = True

    def find_narrow(self, which: Array) -> Array:
        """Which values have coefficients with narrow features, which a batch would step over."""
        if not self.loop.linearization.may_be_narrow:
            return np.zeros(len(which), dtype=bool)
        return np.array([bool(self.loop.at(self.points[i]).features) for i in which], dtype=bool)

    def try_together(self, found: Found, which: Array, plan: "Plan") -> Array:
        """Enter the values that reach tol; return those that do not."""
        logs, errors, reached, _ = self.batch(which, plan)
        T = found.period[which, None]
        found.put(which[reached], (logs / T)[reached], (errors / T)[reached])
        return which[~reached]

    def batch(self, which: Array, plan: "Plan") -> tuple[Array, Array, Array, "Plan"]:
        """Logs (V, n) of the multipliers, their errors, whether they meet tol, and the plan with what was learnt."""
        points = self.points[which]
        T = self.loop.periods(points)
        coefficients, usable, harmonics = prepare_coefficients(self.loop, points, T, plan, self.tol)
        result = batched_exponents(
            coefficients, plan.segments, self.loop.phase_breaks, self.tol / 100, SLACK * plan.spread
        )
        logs, errors = result.logs.T, result.errors.T
        allowed = self.tol * np.maximum(T[:, None], np.abs(logs))
        reached = usable & result.sound & np.all(errors <= allowed, axis=1)
        learnt = replace(plan, harmonics=harmonics, spread=measure_spread(result.logs[:, reached]))
        return logs, errors, reached, learnt

    def values_in_chunk(self, segments: int) -> int:
        """How many values a batch may hold: coefficients at the nodes of the finest resolution, its factors, and copies of both."""
        n, pieces = self.loop.linearization.n, segments + len(self.loop.phase_breaks)
        nodes, factors = 8 * pieces, 4 * pieces
        return max(1, int(self.chunk_bytes // (8 * (3 * nodes * 2 * n * n + 5 * factors * 4 * n * n))))


@dataclass(frozen=True)
class Plan:
    """How a batch is computed: segments of the coarsest resolution, harmonics tried first, expected spread of the moduli."""

    segments: int
    harmonics: int = HARMONICS[0]
    spread: float = np.inf


def choose_plan(batches: Batches) -> Plan:
    """The least number of segments on which a few values, spread over all, reach the tolerance."""
    plan = Plan(STARTS[0])
    for segments in STARTS:
        some = min(PILOTS, batches.values_in_chunk(segments))
        which = np.unique(np.linspace(0, len(batches.points) - 1, some).round().astype(int))
        reached, plan = batches.batch(which, replace(plan, segments=segments, spread=np.inf))[2:]
        if reached.mean() >= ENOUGH:
            break
    return plan


def prepare_coefficients(
    loop: ParametricLoop, points: Array, T: Array, plan: Plan, tol: float
) -> tuple[Callable[[Array], tuple[Array, Array]], Array, int]:
    """X = -T^2 M^-1 K, Y = -T M^-1 D as function phases (N,) -> (N, n, n, V), where they are finite (V,), and the harmonics it took.

    Without breaks they are sampled at 2 H + 1 phases and interpolated by their Fourier series of H harmonics, once the two highest
    harmonics have vanished; else, or when that needs more samples than there are nodes, they are evaluated at each phase asked.
    """
    n = loop.linearization.n

    def exact(phases: Array) -> Array:
        M, D, K = (
            np.moveaxis(A.reshape(len(phases), len(points), n, n), (0, 1), (2, 3)) for A in loop.sample(phases, points)
        )
        stacked = np.concatenate([T * K, D], axis=1).reshape(n, 2 * n, -1)
        Z = solve_positive(M.reshape(n, n, -1), stacked)
        return np.moveaxis(Z.reshape(n, 2 * n, len(phases), -1), 2, 0) * -T

    def split(Z: Array) -> tuple[Array, Array]:
        return Z[:, :, :n], Z[:, :, n:]

    usable: Array = np.ones(len(points), dtype=bool)
    if not loop.phase_breaks:
        for harmonics in (h for h in HARMONICS if plan.harmonics <= h < 4 * plan.segments):
            Z = exact(np.arange(2 * harmonics + 1) / (2 * harmonics + 1))
            usable = np.asarray(np.isfinite(Z).all(axis=(0, 1, 2)))
            Z[..., ~usable] = 0.0
            series = FourierSeries.through(Z, 1.0)
            if series.tail <= max(TAIL * tol, 3e-15):
                return lambda phases, series=series: split(series(phases)), usable, harmonics
    return lambda phases: split(np.nan_to_num(exact(phases))), usable, HARMONICS[-1]


def build_dataset(
    scene: Scene,
    axes: dict[str, Array],
    found: Found,
    shape: tuple[int, ...],
    dims: tuple[str, ...],
    tol: float,
    segments: int,
) -> xr.Dataset:
    """The result with names and units."""
    each = {name: (dims, getattr(found, name).reshape(shape)) for name in ("error", "period", "one_by_one")}
    coords = {path: (path if dims != ("value",) else "value", axis) for path, axis in axes.items()}
    data = xr.Dataset(
        {
            "exponents": ((*dims, "mode"), found.exponents.reshape(*shape, -1), {"units": "1/s"}),
            "verdict": (dims, VERDICTS[found.verdict].reshape(shape)),
            **each,
        },
        coords=coords,
        attrs={"title": scene.title, "tol": tol, "segments": segments, "one_by_one": int(found.one_by_one.sum())},
    )
    data["error"].attrs["units"], data["period"].attrs["units"] = "1/s", "s"
    return data
