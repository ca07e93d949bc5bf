"""Floquet spectra as functions of scene numbers: many values at once and cheap, or one by one and as accurate as can be."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flexlin.about.free import ParametricLoop, loop_of
from flexlin.about.linearization import Linearization
from flexlin.answers.loops import choose_loop
from flexlin.answers.sweep.axes import check_axes
from flexlin.checks import Array
from flexlin.errors import ArgumentError, FlexlinError, TimeLimit
from flexlin.periodic.boundary.spectra import Spectra
from flexlin.periodic.circle import measure_distances
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.modes import solve_floquet_modes
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.system import PeriodicSystem
from flexlin.scene.parameters import get_value
from flexlin.scene.scene import Scene

if TYPE_CHECKING:
    from flexlin.answers.sweep.batches import Batches
    from flexlin.answers.sweep.compiled import CompiledBatches
    from flexlin.answers.sweep.plan import Plan
    from flexlin.periodic.floquet.resonance import Resonance

ROUGH, FINE = 1e-8, 1e-12
"""Wanted errors of the exponents, in 1/s: of the scan, and of the values that are reported."""
LOOSE, SQUARED = 3e-5, 3e-9
"""A log of a multiplier this uncertain still serves where two meet, as their squared distance is known that well."""

FINER, SMALL = (1, 4, 16), 4
"""Segments of a batch, in those that the pilot chose: where multipliers meet, more are needed; for so many states that beats `floquet`."""

TOGETHER, MIDDLE, WIDE = 25, 6, 8
"""Up to so many values of a loop with MIDDLE states or more are computed one by one: a batch's pilot alone would take longer; a scan of
a loop with WIDE states or more leaves out what it can."""
MANY, MOST = 64, 0.7
"""So few values with fewer states are computed one by one where a batch of most of them needs more segments than this."""
LARGE = 12
"""With so many states or more all values are: scans are sparse, and a batch's fixed number of segments suits few of the values."""

Source = Scene | Callable[..., PeriodicSystem]
"""A scene, or a function of one number for each parameter that returns a system."""


@dataclass
class Family:
    """Systems that depend on parameters (P,); `own`: their values in the scene, `evaluations`: how many spectra were computed,
    `finest`: the wanted error of those that are reported, in 1/s."""

    make: Callable[[Array], PeriodicSystem]
    own: Array
    evaluations: int = 0
    finest: float = FINE

    @property
    def slow(self) -> bool:
        """Whether spectra take so long that a scan should leave out what it can."""
        return False

    def system_at(self, point: Array) -> PeriodicSystem:
        """The system at one point (P,)."""
        return self.make(point)

    def rough(self, points: Array) -> Spectra:
        """Spectra at points (V, P), to ROUGH."""
        return self.one_by_one(points, ROUGH)

    def fine(self, points: Array) -> Spectra:
        """Spectra at points (V, P), to `finest` or as rounding allows."""
        return self.one_by_one(points, self.finest)

    def one_by_one(self, points: Array, tol: float) -> Spectra:
        """Each by `floquet`; not a number where the equations break."""
        self.evaluations += len(points)
        found = [self.try_at(point, tol) for point in points]
        known = [one for one in found if one is not None]
        if not known:
            return self.unknown(points, tol)
        states = len(known[0].exponents)
        none = np.full(states, np.nan + 0j), np.full(states, np.inf)
        pairs = [none if one is None else (one.log_multipliers, one.errors * one.period) for one in found]
        return Spectra(np.array([logs for logs, _ in pairs]), np.array([errors for _, errors in pairs]))

    def try_at(self, point: Array, tol: float) -> FloquetResult | None:
        """The exponents at one point, none where the equations break."""
        try:
            return floquet(self.system_at(point), tol)
        except TimeLimit:
            raise
        except (FlexlinError, np.linalg.LinAlgError):
            return None

    def unknown(self, points: Array, tol: float) -> Spectra:
        """No spectrum at any of the points: that of the first says why, unless there is none to ask for."""
        if len(points):
            floquet(self.system_at(points[0]), tol)
        states = self.system_at(self.own).n if np.isfinite(self.own).all() else 2
        return Spectra(np.full((len(points), states), np.nan + 0j), np.full((len(points), states), np.inf))

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
        found = find_resonances(system, solve_floquet_modes(system, floquet(system, ROUGH), quick=True))
        return sorted(found, key=lambda one: -one.exponent.real)


@dataclass
class SceneFamily(Family):
    """A loop on a scene's arm whose equations keep the numbers as symbols."""

    loop: ParametricLoop | None = None
    plan: "Plan | None" = None
    compiled: "CompiledBatches | None" = None
    alone: bool = False

    def compile(self, points: Array, values: int) -> None:
        """Compile the loop where so many values, some of them at points (V, P), are worth it."""
        from flexlin.answers.sweep.compiled import CompiledBatches, pays

        if self.loop is not None and self.loop.kept is None and pays(self.loop, values):
            self.compiled = CompiledBatches.prepare(self.loop, points, ROUGH)
            self.plan = None if self.compiled is None else self.compiled.plan

    @property
    def slow(self) -> bool:
        return self.loop is not None and self.loop.states >= WIDE

    def rough(self, points: Array) -> Spectra:
        """Together, as a sweep computes them, where that is accurate enough; else one by one."""
        assert self.loop is not None
        if not len(points):
            return self.unknown(points, ROUGH)
        if self.prefers_one_by_one(points):
            return self.one_by_one(points, ROUGH)
        from flexlin.answers.sweep.batches import CHUNK_BYTES, Batches, choose_plan

        batches = Batches(self.loop, points, ROUGH, CHUNK_BYTES)
        self.plan = self.plan or choose_plan(batches)
        states, narrow = self.loop.states, batches.find_narrow(np.arange(len(points)))
        logs, errors = np.full((len(points), states), np.nan + 0j), np.full((len(points), states), np.inf)
        left = np.flatnonzero(~narrow)
        for finer in FINER if states <= SMALL or self.compiled else FINER[:1]:
            plan = replace(self.plan, segments=finer * self.plan.segments)
            size = batches.values_in_chunk(plan.segments)
            for part in [left[i : i + size] for i in range(0, len(left), size)]:
                logs[part], errors[part], narrow[part] = self.together(batches, part, plan)
            left = left[narrow[left]]
        self.evaluations += len(points) - int(narrow.sum())
        if narrow.any():
            alone = self.one_by_one(points[narrow], ROUGH)
            logs[narrow], errors[narrow] = alone.logs, alone.errors
        return Spectra(logs, errors)

    def prefers_one_by_one(self, points: Array) -> bool:
        """Whether `floquet` takes less time: for few values of many states, or of a period that a batch divides finely; finds the plan."""
        assert self.loop is not None
        few = self.plan is None and len(points) <= TOGETHER
        if not self.loop.linearization.complete or not (few or self.loop.states >= LARGE):
            return False
        if few and not self.alone and self.loop.states < MIDDLE:
            from flexlin.answers.sweep.batches import CHUNK_BYTES, Batches, try_plans

            self.plan = try_plans(Batches(self.loop, points, ROUGH, CHUNK_BYTES), MANY, MOST)
            self.alone = self.plan is None
            return self.alone
        return True

    def together(self, batches: "Batches", part: Array, plan: "Plan") -> tuple[Array, Array, Array]:
        """Logs and errors (V, n) of a batch, and which of its values are not accurate enough, (V,)."""
        if self.compiled is None:
            logs, errors, reached, _ = batches.batch(part, plan)
        else:
            logs, errors, reached = self.compiled.spectra(batches.points[part], plan.segments)
        apart = measure_distances(logs.T, logs.T) + np.diag(np.ones(logs.shape[1]))[..., None]
        gap = np.minimum(apart.min(axis=1).T, 1.0)
        met = ((errors <= LOOSE) & (errors * (gap + errors) <= SQUARED)) | (errors <= ROUGH * np.abs(logs))
        return logs, errors, ~(reached | met.all(axis=1))

    def slopes(self, point: Array) -> tuple[Array, Array, Array] | None:
        assert self.loop is not None
        if self.loop.kept is not None:
            return None
        from flexlin.answers.sensitivity import integrate_derivatives

        loop = replace(self.loop, linearization=self.loop.at(point))
        system = loop.linearization.periodic_system()
        modes = solve_floquet_modes(system, floquet(system, self.finest), quick=True)
        return modes.exponents, modes.errors, integrate_derivatives(loop, modes)


@dataclass
class OneOfSeveral(Family):
    """Systems that depend on one of several numbers that a family leaves free; the others keep the scene's values."""

    family: SceneFamily | None = None
    index: int = 0

    @classmethod
    def of(cls, family: SceneFamily, index: int) -> "OneOfSeveral":
        """The number at a place among the family's; its batches are planned anew."""
        alone = replace(family, plan=None, alone=False)
        return cls(family.make, family.own[index : index + 1], finest=family.finest, family=alone, index=index)

    @property
    def slow(self) -> bool:
        return self.family is not None and self.family.slow

    def place(self, points: Array) -> tuple[SceneFamily, Array]:
        """The family, and its points (V, P) for values (V, 1) of the number."""
        assert self.family is not None
        placed = np.tile(self.family.own, (len(points), 1))
        placed[:, self.index] = points[:, 0]
        return self.family, placed

    def system_at(self, point: Array) -> PeriodicSystem:
        family, placed = self.place(point[None])
        return family.system_at(placed[0])

    def rough(self, points: Array) -> Spectra:
        family, placed = self.place(points)
        return family.rough(placed)

    def slopes(self, point: Array) -> tuple[Array, Array, Array] | None:
        family, placed = self.place(point[None])
        found = family.slopes(placed[0])
        return None if found is None else (*found[:2], found[2][self.index : self.index + 1])


def make_family(
    source: Source, ranges: dict[str, tuple[float, float]], loop: str, known: Linearization | None = None
) -> Family:
    """The systems that a scene's loop, or a function, makes of numbers in ranges; `known`: the loop whose equations keep these free.

    Raises: ArgumentError for a source of another kind, and for paths that lead to no free number; SceneError for a range that the schema
    refuses.
    """
    if isinstance(source, Scene):
        check_axes(source, {path: np.array(limits) for path, limits in ranges.items()}, grid=True)
        own = np.array([get_value(source, path) for path in ranges], dtype=float)
        chosen = choose_loop(source, tuple(ranges), loop) if known is None else loop_of(known)
        if isinstance(chosen, ParametricLoop):
            return SceneFamily(chosen.system_at, own, loop=chosen)
        return Family(chosen.system_at, own)
    if not callable(source):
        expected = "a scene, or a function of numbers that returns a PeriodicSystem"
        raise ArgumentError("the source is of another kind", got=repr(source)[:80], expected=expected)
    if loop != "own":
        raise ArgumentError("a function has one loop", got=repr(loop), expected="own")
    return Family(Positional(source), np.full(len(ranges), np.nan))


@dataclass(frozen=True)
class Positional:
    """A function of numbers as a function of a point."""

    source: Callable[..., PeriodicSystem]

    def __call__(self, point: Array) -> PeriodicSystem:
        return self.source(*map(float, point))
