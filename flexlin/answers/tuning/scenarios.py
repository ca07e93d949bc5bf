"""The growth rate of a loop over a box of scenarios, as a function of its gains, with the exact gradient of the worst one."""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.stats import qmc

from flexlin.answers.sensitivity import integrate_derivatives
from flexlin.answers.spectra import Family, SceneFamily
from flexlin.checks import Array
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.modes import floquet_modes
from flexlin.periodic.floquet.slopes import differentiate_exponents

GRADIENT_TOL = 1e-6
"""Accuracy of the exponents that gradients belong to, in 1/s."""
STEP = 1e-6
"""Relative step of the differences that stand for dA where a loop is given by a function."""


@dataclass
class Worst:
    """The largest growth rate over scenarios (S, V) at gains that are powers between `low` and `high` (G,).

    gain = low (high / low)^u with u = (1 + sin x) / 2: every x is within the limits. `family` takes the gains, then the scenario.
    """

    family: Family
    low: Array
    high: Array
    scenarios: Array

    def gains(self, x: Array) -> Array:
        """The gains that belong to x."""
        return np.asarray(self.low * (self.high / self.low) ** ((1 + np.sin(x)) / 2))

    def position(self, gains: Array) -> Array:
        """An x that belongs to gains within the limits."""
        u = np.log(gains / self.low) / np.log(self.high / self.low)
        return np.arcsin(np.clip(2 * u - 1, -0.999, 0.999))

    @property
    def batched(self) -> bool:
        """Whether many scenarios are computed together, from expressions that keep the numbers."""
        return isinstance(self.family, SceneFamily) and self.family.loop is not None and self.family.loop.kept is None

    def growths(self, gains: Array, scenarios: Array | None = None) -> Array:
        """The growth rate at each scenario, (S,), infinite where there is none."""
        given = self.scenarios if scenarios is None else scenarios
        points = np.concatenate([np.tile(gains, (len(given), 1)), given], axis=1)
        logs = self.family.rough(points).logs
        growth = logs.real.max(axis=1) / self.periods(points)
        return np.where(np.isfinite(growth), growth, np.inf)

    def periods(self, points: Array) -> Array:
        """T in s at points (N, P)."""
        if isinstance(self.family, SceneFamily) and self.family.loop is not None:
            return self.family.loop.periods(points)
        return np.array([self.family.system_at(point).period for point in points])

    def value(self, x: Array) -> float:
        """The largest growth rate, in 1/s."""
        return float(self.growths(self.gains(x)).max())

    def gradient(self, x: Array) -> Array:
        """The derivative of the worst scenario's largest growth rate by x: left and right Floquet vectors, no difference."""
        gains = self.gains(x)
        worst = self.scenarios[int(np.argmax(self.growths(gains)))]
        exponents, slopes = self.slopes(np.concatenate([gains, worst]))
        by_gain = slopes[: len(gains), int(np.argmax(exponents.real))].real
        return by_gain * gains * np.log(self.high / self.low) * np.cos(x) / 2

    def slopes(self, point: Array) -> tuple[Array, Array]:
        """Exponents (n,) and their derivatives by the gains at one point."""
        if self.batched:
            loop = self.family.loop  # type: ignore[attr-defined]
            loop = replace(loop, linearization=loop.at(point))
            system = loop.linearization.periodic_system()
            modes = floquet_modes(system, floquet(system, GRADIENT_TOL))
            return modes.exponents, integrate_derivatives(loop, modes)
        system = self.family.system_at(point)
        modes = floquet_modes(system, floquet(system))
        changes = []
        for i in range(len(self.low)):
            h = STEP * max(abs(float(point[i])), 1e-3)
            sides = [self.family.system_at(point + s * h * np.eye(len(point))[i]).A(modes.times) for s in (1, -1)]
            changes.append((sides[0] - sides[1]) / (2 * h))
        return modes.exponents, differentiate_exponents(modes, np.array(changes))


def lay_scenarios(ranges: Array, each: int) -> Array:
    """A grid of scenarios over ranges (V, 2), ends included; beyond three numbers the corners and as many quasi-random ones."""
    if not len(ranges):
        return np.zeros((1, 0))
    if len(ranges) <= 3:
        return np.array(list(product(*[np.linspace(low, high, each) for low, high in ranges])))
    corners = np.array(list(product(*ranges)))
    return np.concatenate([corners[:256], draw_scenarios(ranges, 8 * each, 1)])


def draw_scenarios(ranges: Array, count: int, seed: int) -> Array:
    """Quasi-random scenarios over ranges (V, 2)."""
    if not len(ranges):
        return np.zeros((1, 0))
    unit = qmc.Halton(len(ranges), seed=seed).random(count)
    return np.asarray(ranges[:, 0] + unit * (ranges[:, 1] - ranges[:, 0]))
