"""Floquet spectra as functions of scene numbers: many values at once and cheap, or one by one and as accurate as can be."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from flexlin.about.free import ParametricLoop, parametric_loop
from flexlin.answers.sensitivity import integrate_derivatives
from flexlin.answers.sweep.batches import CHUNK_BYTES, Batches, Plan, choose_plan
from flexlin.answers.sweep.found import Found
from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.periodic.boundary.spectra import Spectra
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.modes import floquet_modes
from flexlin.periodic.floquet.resonance import Resonance, find_resonances
from flexlin.periodic.system import PeriodicSystem
from flexlin.scene.parameters import get_value
from flexlin.scene.scene import Scene

ROUGH, FINE = 1e-8, 1e-12
"""Wanted errors of the exponents, in 1/s: of the scan, and of the values that are reported."""

Source = Scene | Callable[..., PeriodicSystem]
"""A scene, or a function of one number for each parameter that returns a system."""


@dataclass
class Family:
    """Systems that depend on parameters (P,): a function that makes them one by one. `evaluations` counts the spectra."""

    make: Callable[..., PeriodicSystem]
    own: Array
    evaluations: int = 0

    def system_at(self, point: Array) -> PeriodicSystem:
        """The system at one point (P,)."""
        return self.make(*map(float, point))

    def rough(self, points: Array) -> Spectra:
        """Spectra at points (V, P), to ROUGH."""
        return self.one_by_one(points, ROUGH)

    def fine(self, points: Array) -> Spectra:
        """Spectra at points (V, P), to FINE or as rounding allows."""
        return self.one_by_one(points, FINE)

    def one_by_one(self, points: Array, tol: float) -> Spectra:
        """Each by `floquet`."""
        self.evaluations += len(points)
        found = [floquet(self.system_at(point), tol) for point in points]
        logs, errors = [one.log_multipliers for one in found], [one.errors * one.period for one in found]
        return Spectra(np.array(logs), np.array(errors))

    def is_constant(self, point: Array) -> bool:
        """Whether A does not depend on time at a point (P,)."""
        return self.system_at(point).resolved.constant

    def slopes(self, point: Array) -> tuple[Array, Array, Array] | None:
        """Exponents (n,) at a point, their errors (n,) and their exact derivatives (P, n); None where A's are not known."""
        return None

    def resonances(self, point: Array) -> list[Resonance]:
        """What drives the unstable exponents at a point, fastest growth first."""
        system = self.system_at(point)
        found = find_resonances(system, floquet_modes(system, floquet(system, ROUGH)))
        return sorted(found, key=lambda one: -one.exponent.real)


@dataclass
class SceneFamily(Family):
    """The loops of a scene with some of its numbers left free."""

    loop: ParametricLoop | None = None

    @cached_property
    def parametric(self) -> ParametricLoop:
        assert self.loop is not None
        return self.loop

    def system_at(self, point: Array) -> PeriodicSystem:
        return self.parametric.at(point).periodic_system()

    def rough(self, points: Array) -> Spectra:
        """As the sweep computes them: together where that is accurate enough."""
        self.evaluations += len(points)
        batches = Batches(self.parametric, points, ROUGH, CHUNK_BYTES)
        found = Found.empty(len(points), self.parametric.linearization.n * 2)
        size = batches.values_in_chunk(self.plan(points).segments)
        for start in range(0, len(points), size):
            batches.fill(found, np.arange(start, min(start + size, len(points))), self.plan(points))
        T = found.period[:, None]
        return Spectra(found.exponents * T, np.broadcast_to(found.error[:, None] * T, found.exponents.shape))

    def plan(self, points: Array) -> Plan:
        """How batches are computed, chosen once, on the first points."""
        if not hasattr(self, "_plan"):
            self._plan = choose_plan(Batches(self.parametric, points, ROUGH, CHUNK_BYTES))
        return self._plan

    def slopes(self, point: Array) -> tuple[Array, Array, Array] | None:
        loop = replace(self.parametric, linearization=self.parametric.at(point))
        system = loop.linearization.periodic_system()
        modes = floquet_modes(system, floquet(system, FINE))
        return modes.exponents, modes.errors, integrate_derivatives(loop, modes)


def make_family(source: Source, paths: Sequence[str], loop: str) -> Family:
    """The systems that a scene's loop, or a function, makes of the numbers at the paths."""
    if isinstance(source, Scene):
        if loop != "own":
            raise ArgumentError("there is no such loop", got=repr(loop), expected="own")
        own = np.array([get_value(source, path) for path in paths], dtype=float)
        return SceneFamily(lambda: None, own, loop=parametric_loop(source, paths))  # type: ignore[arg-type, return-value]
    if not callable(source):
        expected = "a scene, or a function of numbers that returns a PeriodicSystem"
        raise ArgumentError("the source is of another kind", got=repr(source)[:80], expected=expected)
    return Family(source, np.full(len(paths), np.nan))
