"""Floquet spectra as functions of scene numbers: many at once and cheap, or one by one and exact; a Campbell diagram's frequencies."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from flexlin.analyses.loops import choose_loop
from flexlin.checks import Array, try_to
from flexlin.errors import ArgumentError
from flexlin.lazy import lazy
from flexlin.linearization.family import PeriodicFamily
from flexlin.linearization.free import ParametricLoop, loop_of
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.boundary.spectra import Spectra
from flexlin.periodic.boundary.together import Interpolant, Products, find_together
from flexlin.periodic.circle import assign, measure_distances, wrap_angle
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.modes import floquet_modes
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.interpolation import NODES
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.choose_segments import measure_pace
from flexlin.precision import EPS, MINOR, PARTIAL
from flexlin.scene.loading import check_axes
from flexlin.scene.parameters import get_value
from flexlin.scene.scene import Scene

if TYPE_CHECKING:
    import xarray as xr

    from flexlin.analyses.sweep.together import Together
    from flexlin.periodic.floquet.resonance import Resonance
    from flexlin.periodic.many import Logs

SCAN_ERROR, REPORTED_ERROR = 1e-8, 1e-12
"""Wanted errors of the exponents, in 1/s: of the scan, and of the values that are reported."""
LOOSE_LOG_ERROR = 3e-5
"""A log of a multiplier this uncertain still serves where two meet, as their squared distance is known well."""
STIFF_DECAY = 3000.0
"""Decay of the fastest mode over a period, as a logarithm, beyond which loose spectra of what changes fast are found by a method that only
bounds such a mode: where joints stick."""

MANY_STATES = 8
"""A scan one by one of systems with so many states or more leaves out what it can."""
PILOT_POINTS = 64
"""Points of the ranges at which it is learnt on how many segments spectra are computed together."""

Source = Scene | PeriodicFamily | Callable[..., PeriodicSystem]
"""A scene, a family, or a function of one number for each parameter that returns a system."""
Ranges = Mapping[str, tuple[float, float]]
"""The least and the largest value of each number, by its path or name."""


@dataclass
class Family:
    """Systems that depend on parameters (P,); `own`: their values in the scene, `evaluations`: how many spectra were computed,
    `finest` and `coarsest`: the wanted errors of those that are reported and of those of a scan, in 1/s."""

    make: Callable[[Array], PeriodicSystem]
    own: Array
    evaluations: int = 0
    finest: float = REPORTED_ERROR
    coarsest: float = SCAN_ERROR
    loop: ParametricLoop | None = None
    """The loop on a scene's arm that keeps the numbers as symbols, where it is one."""

    @property
    def batched(self) -> bool:
        """Whether many spectra of such a loop are computed together."""
        return False

    @property
    def slow(self) -> bool:
        """Whether spectra take so long that a scan should leave out what it can."""
        return self.loop is not None and self.loop.states >= MANY_STATES and not self.batched

    def system_at(self, point: Array) -> PeriodicSystem:
        """The system at one point (P,)."""
        return self.make(point)

    def periods(self, points: Array) -> Array:
        """T in s at points (V, P)."""
        return np.array([self.system_at(point).period for point in points])

    def rough(self, points: Array) -> Spectra:
        """Spectra at points (V, P): to LOOSE_LOG_ERROR where all then decays by far more than is not known; else to `coarsest`."""
        found = self.one_by_one(points, LOOSE_LOG_ERROR)
        rough = found.errors > MINOR * np.abs(found.logs.real)
        doubtful = (rough & np.isfinite(found.errors)).any(axis=1) | (found.verdicts >= 0)
        doubtful &= ~(found.errors <= self.coarsest * np.abs(found.logs)).all(axis=1)
        if doubtful.any():
            again = self.one_by_one(points[doubtful], self.coarsest)
            found.logs[doubtful], found.errors[doubtful] = again.logs, again.errors
        return found

    def fine(self, points: Array) -> Spectra:
        """Spectra at points (V, P), to `finest` or as rounding allows."""
        return self.one_by_one(points, self.finest)

    def one_by_one(self, points: Array, tol: float) -> Spectra:
        """Each by `floquet`; not a number where the equations break."""
        self.evaluations += len(points)
        found = [try_to(partial(self.solve_at, point, tol)) for point in points]
        known = {k: one for k, one in enumerate(found) if isinstance(one, FloquetResult)}
        if len(points) and not known:
            self.solve_at(points[0], tol)  # which says why
        logs, errors = blank(len(points), len(next(iter(known.values())).errors) if known else self.states)
        for k, one in known.items():
            logs[k], errors[k] = one.log_multipliers, one.errors * one.period
        return Spectra(logs, errors)

    @property
    def states(self) -> int:
        """The number of states, where it is known without a point."""
        return self.system_at(self.own).n if np.isfinite(self.own).all() else 2

    def solve_at(self, point: Array, tol: float) -> FloquetResult:
        """The exponents at one point."""
        system = self.system_at(point)
        return floquet(system, tol, method="radau" if tol >= LOOSE_LOG_ERROR and is_stiff(system) else "auto")

    def is_constant(self, point: Array) -> bool:
        """Whether A does not depend on time at a point (P,)."""
        return self.system_at(point).resolved.constant

    def slopes(self, point: Array) -> tuple[Array, Array, Array] | None:
        """Exponents (n,) at a point, their errors (n,) and their exact derivatives (P, n); None where those of A are not known."""
        return None

    def resonances(self, point: Array) -> "list[Resonance]":
        """What drives the unstable exponents at a point, fastest growth first."""
        from flexlin.periodic.floquet.resonance import find_resonances

        system = self.system_at(point)
        found = find_resonances(system, floquet_modes(system, floquet(system, self.coarsest)))
        return sorted(found, key=lambda one: -one.exponent.real)


@dataclass
class SymbolicFamily(Family):
    """Systems whose equations keep numbers as symbols, the `source`'s: a point's stand at `places` among them, the others are `nominal`.

    `box` (2, P): ends of the ranges.
    """

    source: ParametricLoop | PeriodicFamily = field(kw_only=True)
    box: Array = field(kw_only=True)
    places: list[int] = field(kw_only=True)
    nominal: Array = field(kw_only=True)

    @property
    def batched(self) -> bool:
        return self.loop is not None and self.together is not None

    @lazy
    def together(self) -> "Together | None":
        """What computes many spectra at once, if there is a kernel for them."""
        from flexlin.analyses.sweep.together import Together

        low, high = self.box
        shares = np.random.default_rng(0).random((PILOT_POINTS, len(low)))
        return Together.prepare(self.source, self.place(low + (high - low) * shares), self.coarsest)

    def place(self, points: Array) -> Array:
        """Points as the source takes them."""
        placed = np.tile(self.nominal, (len(points), 1))
        placed[:, self.places] = points
        return placed

    def system_at(self, point: Array) -> PeriodicSystem:
        return self.source.system_at(self.place(point[None])[0])

    def periods(self, points: Array) -> Array:
        return super().periods(points) if self.loop is None else self.loop.periods(self.place(points))

    def rough(self, points: Array) -> Spectra:
        """Together, as a sweep computes them, where that is accurate enough; else one by one."""
        if self.together is None or not len(points):
            return super().rough(points)
        placed, (logs, errors) = self.place(points), blank(len(points), self.together.kernel.model.states)

        def enter(which: Array, found: "Logs") -> Array:
            logs[which], errors[which] = found.logs, found.errors
            return np.where(serves(found, self.coarsest), 0.0, found.misses(self.coarsest))

        left = self.together.solve(placed, enter)
        self.evaluations += len(points) - len(left)
        if len(left):
            alone = super().rough(points[left])
            logs[left], errors[left] = alone.logs, alone.errors
        return Spectra(logs, errors)

    def slopes(self, point: Array) -> tuple[Array, Array, Array] | None:
        if self.loop is None or self.loop.kept is not None:
            return None
        from flexlin.analyses.sensitivity import integrate_derivatives

        loop = replace(self.loop, linearization=self.loop.at(self.place(point[None])[0]))
        system = loop.linearization.periodic_system()
        modes = floquet_modes(system, floquet(system, self.finest))
        return modes.exponents, modes.errors, integrate_derivatives(loop, modes)[self.places]


def is_stiff(system: PeriodicSystem) -> bool:
    """Whether a mode decays very fast where coefficients change fast."""
    if system.resolved.panels == 1:
        return False
    pace = measure_pace(system)
    return float(pace.length @ pace.spread) > STIFF_DECAY


def serves(found: "Logs", tol: float) -> Array:
    """Which spectra are accurate enough for a scan, (V,): where multipliers lie close together, their squared distance counts."""
    apart = measure_distances(found.logs.T, found.logs.T) + np.diag(np.ones(found.logs.shape[1]))[..., None]
    gap, errors = np.minimum(apart.min(axis=1).T, 1.0), found.errors
    close = (errors <= LOOSE_LOG_ERROR) & (errors * (gap + errors) <= PARTIAL * tol)
    return found.sound & np.asarray((close | (errors <= tol * np.abs(found.logs))).all(axis=1))


@dataclass
class FunctionFamily(Family):
    """Systems that a function makes; of one number in a range, their transition matrices are interpolated where that is known to serve.

    `smooth`: whether those at the ends and in the middle are, but for jumps at equal `phases`, once it is known.
    """

    box: Array = field(kw_only=True)
    smooth: bool | None = None
    phases: tuple[float, ...] = ()

    @lazy
    def interpolant(self) -> Interpolant | None:
        """The transition matrix as a polynomial in the one number, if it is one."""
        if self.box.shape[1] > 1:
            return None
        low, high = self.box[:, 0].tolist()
        found = try_to(lambda: Interpolant.fit(self.products, low, high, self.coarsest))
        return found if isinstance(found, Interpolant) else None

    def products(self, values: Array) -> Products:
        """Together, at values (V,) of the one number, to a part of what is wanted between them."""
        systems = [self.system_at(np.array([value])) for value in values.tolist()]
        self.evaluations += len(systems)
        return find_together(systems, MINOR * self.coarsest, self.phases)

    def look(self, systems: list[PeriodicSystem]) -> None:
        """See whether a few systems are smooth between the same phases."""
        some = [one.resolved for one in systems]
        phases = [np.array(one.breaks) / one.period for one in some]
        alike = all(len(one) == len(phases[0]) and np.allclose(one, phases[0], rtol=0, atol=4 * EPS) for one in phases)
        wide = all(one.panels == 1 or np.diff(one.edges).min() > one.period / NODES for one in some)
        self.smooth, self.phases = alike and wide, tuple(phases[0].tolist())

    def rough(self, points: Array) -> Spectra:
        """Together, where A is smooth and that is accurate enough; else one by one."""
        products = try_to(partial(self.multiply, points)) if len(points) else None
        if not isinstance(products, Products):
            return self.one_by_one(points, self.coarsest)
        found, reached = products.spectra, products.meets(self.coarsest)
        self.evaluations += int(reached.sum())
        if not reached.all():
            alone = self.one_by_one(points[~reached], self.coarsest)
            found.logs[~reached], found.errors[~reached] = alone.logs, alone.errors
        return found

    def multiply(self, points: Array) -> Products | None:
        """The transition matrices of the period at points (V, P); None where A is not smooth."""
        if self.smooth is None:
            self.look([self.system_at(point) for point in points[[0, len(points) // 2, -1]]])
        if not self.smooth:
            return None
        if self.interpolant is not None:
            return self.interpolant.at(points[:, 0])
        return find_together(list(map(self.system_at, points)), self.coarsest, self.phases)


def blank(values: int, states: int) -> tuple[Array, Array]:
    """Logs and errors (V, n) of which nothing is known yet."""
    return np.full((values, states), np.nan + 0j), np.full((values, states), np.inf)


def make_family(
    source: Source, ranges: Ranges, loop: str, known: Linearization | None = None, coarsest: float = SCAN_ERROR
) -> Family:
    """The systems that a scene's loop, or a function, makes of numbers in ranges; `known`: the loop whose equations keep these free.

    Raises: ArgumentError for a source of another kind, and for paths that lead to no free number; SceneError for a range that the schema
    refuses.
    """
    box = np.array(list(ranges.values()), dtype=float).T
    if isinstance(source, Scene):
        check_axes(source, {path: np.array(limits) for path, limits in ranges.items()}, grid=True)
        own = np.array([get_value(source, path) for path in ranges], dtype=float)
        chosen = choose_loop(source, tuple(ranges), loop) if known is None else loop_of(known)
        if not isinstance(chosen, ParametricLoop):
            return Family(chosen.system_at, own, coarsest=coarsest)
        places = [chosen.paths.index(path) for path in ranges] if known is not None else list(range(len(own)))
        inside = chosen.nominal.copy()
        inside[places] = np.where((box[0] < 0) & (box[1] > 0), 0.0, own)
        if not np.isfinite(chosen.periods(inside[None])).all():
            raise ArgumentError("the motion has no period at 0", got=dict(ranges), expected="limits on one side of 0")
        given: dict[str, Any] = {"source": chosen, "box": box, "places": places, "nominal": chosen.nominal}
        return SymbolicFamily(chosen.system_at, own, coarsest=coarsest, loop=chosen, **given)
    unknown = np.full(len(ranges), np.nan)
    if isinstance(source, PeriodicFamily):
        order = source.find_places(ranges, loop)
        given = {"source": source, "box": box, "places": np.argsort(order).tolist(), "nominal": unknown}
        kept = SymbolicFamily(source.system_at, unknown, coarsest=coarsest, **given)
        return (
            kept if kept.together is not None else FunctionFamily(kept.system_at, unknown, coarsest=coarsest, box=box)
        )
    if not callable(source):
        expected = "a scene, a PeriodicFamily, or a function of numbers that returns a PeriodicSystem"
        raise ArgumentError("the source is of another kind", got=repr(source)[:80], expected=expected)
    if loop != "own":
        raise ArgumentError("a function has one loop", got=repr(loop), expected="own")
    return FunctionFamily(lambda point: source(*map(float, point)), unknown, coarsest=coarsest, box=box)


def unfold_frequencies(scene: Scene, path: str, data: "xr.Dataset", loop: str = "own") -> "xr.Dataset | None":
    """Add to the exponents of a sweep over one number whole multiples of the motion's frequency, so that each lies near a mode.

        omega = Im lambda + k 2 pi / T,   k such that omega is nearest to the frequency of a mode of the averaged equations

    Modes and exponents are paired one to one, least distance in all, and again with the averaged modes moved by the median of what they
    were off at 25 neighbouring values. Where two modes are nearer to each other than half the motion's
    frequency modulo that frequency, which is which may be exchanged.

    Parameters: data: of `sweep` over this number alone. Returns: frequency (value, mode) in rad/s, not negative, growth (value, mode), and
    motion (value), the motion's frequency; None for loops whose equations are not known as expressions.
    """
    import xarray as xr
    from scipy.ndimage import median_filter

    chosen = choose_loop(scene, (path,), loop)
    if not isinstance(chosen, ParametricLoop):
        return None
    values = data[path].to_numpy()
    exponents, turn = data["exponents"].to_numpy(), 2 * np.pi / data["period"].to_numpy()
    averaged = find_averaged(chosen, values)
    known = np.flatnonzero(np.isfinite(exponents).all(axis=1) & np.isfinite(averaged).all(axis=1))
    frequency, shift = np.full(exponents.shape, np.nan), np.zeros(exponents.shape)
    for _ in range(2):
        for k in known:
            frequency[k], shift[k] = unfold(exponents[k], averaged[k], float(turn[k]))
        averaged = averaged + 1j * median_filter(shift, size=(25, 1), mode="nearest")
    return xr.Dataset(
        {
            "frequency": (("value", "mode"), np.abs(frequency), {"units": "rad/s"}),
            "growth": (("value", "mode"), exponents.real, {"units": "1/s"}),
            "motion": ("value", turn, {"units": "rad/s"}),
        },
        coords={"value": values},
    )


def find_averaged(loop: ParametricLoop, values: Array) -> Array:
    """Eigenvalues (V, n) of the state matrix averaged over a period."""
    phases = np.arange(64) / 64
    M, D, K = loop.sample(phases, values[:, None])
    n, states = loop.coordinates - loop.memory, loop.states
    blocks = np.linalg.solve(M, np.concatenate([K[:, :, :n], D], axis=2)).reshape(len(phases), len(values), -1, states)
    A = np.zeros((len(values), states, states))
    A[:, :n, n : 2 * n], A[:, n:] = np.eye(n), -blocks.mean(axis=0)
    found = np.linalg.eigvals(A)
    order = np.lexsort((found.real, found.imag), axis=1)
    return np.take_along_axis(found, order, axis=1)


def unfold(exponents: Array, averaged: Array, turn: float) -> tuple[Array, Array]:
    """The imaginary parts (n,) nearest to those of the averaged modes, modulo `turn`, and how far off each averaged mode (n,) was."""
    apart = exponents[:, None] - averaged
    around = wrap_angle(apart.imag * 2 * np.pi / turn) * turn / (2 * np.pi)
    rows, columns = np.arange(len(exponents)), assign(np.hypot(apart.real, around))
    shift = np.empty(len(exponents))
    shift[columns] = around[rows, columns]
    return averaged.imag[columns] + shift[columns], shift
