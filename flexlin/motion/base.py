"""Basic motions: the angles of the joints as functions of the phase t/T, with exact rates."""

from collections.abc import Callable
from dataclasses import field, replace

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.checks import Array
from flexlin.lazy import lazy
from flexlin.mechanics.coordinates import Parameters
from flexlin.summary import immutable
from flexlin.symbolic import Expressions

Angles = tuple[Array, Array, Array]
MOST_HARMONICS, MOST_TURNS = 60, 15.0
"""Harmonics of the angles, and turns of all joints in a period at their fastest, that leave nothing narrower than T/200."""
MOTION_NODES = 512
"""Times of a period at which a motion is looked at, or kept."""


@immutable(eq=False)
class Motion:
    """The motion of the joints if the links were rigid.

    Attributes
    ----------
    joints : int
        Number of joints.
    period : float
        Period in s; of a one-way motion its duration.
    prescribed : tuple of bool
        Which joints follow their angle exactly and are no coordinates.
    breaks : tuple of float
        Times in [0, T), in s, at which q'' or a derivative of it jumps.
    periodic : bool
        False for a one-way motion.
    harmonics : int or None
        Highest harmonic of the angles between the breaks, None where it is not known.
    features : tuple of pairs of float
        Times and half-widths, in s, where the angles change faster than that.
    origin : str
        Of a measured motion: what it was made from, and what was left out, in words.

    Examples
    --------
    >>> import flexlin as fl
    >>> motion = fl.build_motion(fl.load_scene("pick-and-place").motion, joints=2)
    >>> motion.joints, motion.periodic, len(motion.breaks)
    (2, True, 8)
    """

    joints: int
    period: float
    prescribed: tuple[bool, ...]
    breaks: tuple[float, ...] = ()
    periodic: bool = True
    harmonics: int | None = None
    features: tuple[tuple[float, float], ...] = ()
    origin: str = ""

    def sample(self, t: Array) -> Angles:
        """Return angles, rates and accelerations.

        Parameters
        ----------
        t : array, shape (N,)
            Times in s.

        Returns
        -------
        tuple of array, each of shape (N, joints)
            q, q', q'' in rad, rad/s, rad/s^2 (m for sliding joints).
        """
        raise NotImplementedError

    def phase_of(self, t: Array) -> Array:
        """Return the phase of times: t/T in [0, 1) for a periodic motion, held in [0, 1] for a one-way motion.

        Parameters
        ----------
        t : array, shape (N,)
            Times in s.

        Returns
        -------
        array, shape (N,)
            The phases.
        """
        phase = np.asarray(t, dtype=float) / self.period
        return phase % 1.0 if self.periodic else np.clip(phase, 0.0, 1.0)

    @property
    def complete(self) -> bool:
        """Whether breaks and features name everything in sines and cosines of the angles that is narrower than T/200.

        A sine of an angle that turns N times in a period at its fastest has harmonics up to about N, and products have their sums.
        """
        if self.harmonics is None or self.harmonics > MOST_HARMONICS:
            return False
        rates = np.abs(self.sample(self.period * np.arange(MOTION_NODES) / MOTION_NODES)[1]).max(axis=0, initial=0.0)
        return bool(rates.sum() * self.period <= 2 * np.pi * MOST_TURNS)


@immutable(eq=False)
class SymbolicMotion(Expressions, Motion):
    """A motion given as a CasADi expression of the phase t/T and of free parameters.

    Attributes
    ----------
    phase : casadi.SX
        The symbol of t/T.
    angles : casadi.SX, shape (joints, 1)
        q as expression of the phase, in rad or m.
    duration : casadi.SX
        The period as expression, in s.
    parameters : Parameters
        The free symbols, with their values.

    Examples
    --------
    >>> import flexlin as fl
    >>> motion = fl.build_motion(fl.load_scene("single-link").motion, joints=1)
    >>> motion.angles
    SX((0.5*sin((6.28319*phase))))
    """

    phase: ca.SX = field(default_factory=lambda: ca.SX.sym("phase"))
    angles: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    duration: ca.SX = field(default_factory=lambda: ca.SX(1))
    parameters: Parameters = field(default_factory=Parameters)

    @lazy
    def rates(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q, q', q'' as expressions of the phase and the parameters."""
        first = ca.jacobian(self.angles, self.phase)
        second = ca.jacobian(first, self.phase)
        return ca.densify(self.angles), ca.densify(first / self.duration), ca.densify(second / self.duration**2)

    @lazy
    def _function(self) -> ca.Function:
        return ca.Function(
            "motion", [self.phase, self.parameters.symbols], list(self.rates), ["phase", "p"], ["q", "q1", "q2"]
        )

    @lazy
    def _moving(self) -> list[int]:
        """The places of the parameters that the motion depends on."""
        motion = ca.vertcat(self.angles, self.duration)
        return np.flatnonzero(ca.which_depends(motion, self.parameters.symbols)).tolist()

    def at_numbers(self, values: Array, period: float) -> "SymbolicMotion":
        """Return the same motion with other values of its free numbers.

        Parameters
        ----------
        values : array, shape (P,)
            The values of `parameters`.
        period : float
            The period that they make, in s.

        Returns
        -------
        SymbolicMotion
            The motion, with nothing derived anew; itself where none of its own numbers changes.
        """
        if np.array_equal(values[self._moving], self.parameters.values[self._moving]):
            return self
        breaks = tuple(period * t / self.period for t in self.breaks)
        moved = replace(self, period=period, breaks=breaks, parameters=replace(self.parameters, values=values))
        vars(moved).update(rates=self.rates, _function=self._function, _moving=self._moving)
        return moved

    def sample(self, t: Array) -> Angles:
        """Return angles, rates and accelerations.

        Parameters
        ----------
        t : array, shape (N,)
            Times in s.

        Returns
        -------
        tuple of array, each of shape (N, joints)
            q, q', q'' in rad, rad/s, rad/s^2 (m for sliding joints).
        """
        phases = self.phase_of(t)[:, None]
        p = np.broadcast_to(self.parameters.values, (len(t), len(self.parameters.values)))
        q, q1, q2 = symbolic.evaluate(self._function, phases, p)
        return q[:, :, 0], q1[:, :, 0], q2[:, :, 0]


@immutable(eq=False)
class SampledMotion(Motion):
    """A motion given by numbers, such as a spline through a table.

    Attributes
    ----------
    sampler : callable
        Times (N,) -> q, q', q'', each (N, joints).

    Examples
    --------
    >>> import numpy as np
    >>> from flexlin.motion import SampledMotion
    >>> def sampler(t):
    ...     return np.sin(t)[:, None], np.cos(t)[:, None], -np.sin(t)[:, None]
    >>> motion = SampledMotion(1, 2 * np.pi, (False,), sampler=sampler)
    >>> motion.sample(np.zeros(1))[1].tolist()
    [[1.0]]
    """

    sampler: Callable[[Array], Angles] = field(kw_only=True)

    def sample(self, t: Array) -> Angles:
        """Return angles, rates and accelerations.

        Parameters
        ----------
        t : array, shape (N,)
            Times in s.

        Returns
        -------
        tuple of array, each of shape (N, joints)
            q, q', q'' in rad, rad/s, rad/s^2 (m for sliding joints).
        """
        return self.sampler(np.asarray(t, dtype=float))
