"""Basic motions: the angles of the joints as functions of the phase t/T, with exact rates."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.checks import Array
from flexlin.expressions import Expressions
from flexlin.mechanics.parameters import Parameters

Angles = tuple[Array, Array, Array]
MOST_HARMONICS, MOST_TURNS = 60, 15.0
"""Harmonics of the angles, and turns of all joints in a period at their fastest, that leave nothing narrower than T/200."""
PROBES = 512
"""Times of a period at which the fastest turning is looked for."""


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion of the joints if the links were rigid.

    `sample(t)` returns q, q', q'' (N, joints) in rad, rad/s, rad/s^2; `period` in s; `breaks` are the times in [0, T) at which q'' or a
    derivative of it jumps; `periodic` is False for a one-way motion, whose period is its duration;
    `prescribed` tells which joints follow their angle exactly and are no coordinates; `harmonics`: of the angles between the breaks, None
    where they are not known; `features`: pairs (time, half-width) in s where the angles change faster than that.
    """

    joints: int
    period: float
    prescribed: tuple[bool, ...]
    breaks: tuple[float, ...] = ()
    periodic: bool = True
    harmonics: int | None = None
    features: tuple[tuple[float, float], ...] = ()

    def sample(self, t: Array) -> Angles:
        """q, q', q'' at the times t (N,)."""
        raise NotImplementedError

    @property
    def complete(self) -> bool:
        """Whether breaks and features name everything in sines and cosines of the angles that is narrower than T/200.

        A sine of an angle that turns N times in a period at its fastest has harmonics up to about N, and products have their sums.
        """
        if self.harmonics is None or self.harmonics > MOST_HARMONICS:
            return False
        rates = np.abs(self.sample(self.period * np.arange(PROBES) / PROBES)[1]).max(axis=0, initial=0.0)
        return bool(rates.sum() * self.period <= 2 * np.pi * MOST_TURNS)


@dataclass(frozen=True, eq=False)
class SymbolicMotion(Expressions, Motion):
    """A motion given as CasADi expression of the phase and of free parameters.

    `angles` (joints, 1) of `phase`; `duration` is the period as expression; `parameters` are its free symbols.
    """

    phase: ca.SX = field(default_factory=lambda: ca.SX.sym("phase"))
    angles: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    duration: ca.SX = field(default_factory=lambda: ca.SX(1))
    parameters: Parameters = field(default_factory=Parameters)

    @cached_property
    def rates(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q, q', q'' as expressions of the phase and the parameters."""
        first = ca.jacobian(self.angles, self.phase)
        second = ca.jacobian(first, self.phase)
        return ca.densify(self.angles), ca.densify(first / self.duration), ca.densify(second / self.duration**2)

    @cached_property
    def _function(self) -> ca.Function:
        return ca.Function(
            "motion", [self.phase, self.parameters.symbols], list(self.rates), ["phase", "p"], ["q", "q1", "q2"]
        )

    def sample(self, t: Array) -> Angles:
        phases = self.phase_of(t)[:, None]
        p = np.broadcast_to(self.parameters.values, (len(t), len(self.parameters.values)))
        q, q1, q2 = symbolic.evaluate(self._function, phases, p)
        return q[:, :, 0], q1[:, :, 0], q2[:, :, 0]

    def phase_of(self, t: Array) -> Array:
        """t/T in [0, 1) for a periodic motion, held in [0, 1] for a one-way motion."""
        phase = np.asarray(t, dtype=float) / self.period
        return phase % 1.0 if self.periodic else np.clip(phase, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class SampledMotion(Motion):
    """A motion given by numbers, such as a spline through a table."""

    sampler: Callable[[Array], Angles] = field(kw_only=True)

    def sample(self, t: Array) -> Angles:
        return self.sampler(np.asarray(t, dtype=float))
