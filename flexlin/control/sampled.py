"""Digital control: the optimal periodic gains of an input that is held from sample to sample."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.about.law import Law
from flexlin.arguments import checked
from flexlin.checks import Array, positive
from flexlin.control.designed_loop import Design
from flexlin.errors import ArgumentError, counted
from flexlin.periodic.coefficients import Constant, MatrixFunction, has_nothing_narrow
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.interpolation import ChebyshevPanels
from flexlin.periodic.precision import SAFETY
from flexlin.periodic.quadratic.linear_quadratic import linear_quadratic
from flexlin.periodic.resolved.matrix import ResolvedMatrix
from flexlin.periodic.resolved.resolve import resolve_port
from flexlin.periodic.sampled import STAGES, Round, find_rounds, sampled_floquet
from flexlin.periodic.sampled_cost import bound_rounding, solve_samples, weigh_samples
from flexlin.periodic.system import PeriodicSystem, as_system
from flexlin.summary import represent


@dataclass(frozen=True, eq=False)
class SampledGain:
    """The gain of the sample at each phase, as a function of time: gains (N, m, r) of the instants k h, whose phases are j T / N."""

    gains: Array
    instants: Array
    period: float

    @property
    def in_order(self) -> Array:
        """The gains at the phases 0, 1/N, 2/N ..."""
        return np.asarray(self.gains[np.argsort(np.mod(self.instants / self.period + 0.5 / len(self.instants), 1.0))])

    @property
    def series(self) -> ChebyshevPanels:
        """The gain of the nearest sample at every time of a period."""
        count = len(self.gains)
        edges = np.concatenate([[0.0], (np.arange(count) + 0.5) / count, [1.0]]) * self.period
        return ChebyshevPanels(edges, np.append(self.in_order, self.in_order[:1], axis=0)[:, None])

    def __call__(self, t: Array) -> Array:
        place = np.rint(np.asarray(t) / self.period * len(self.gains)).astype(int) % len(self.gains)
        return np.asarray(self.in_order[place])


@dataclass(frozen=True, eq=False)
class SampledDesign:
    """A state feedback that is computed at samples and held, u(t) = -K_k z_k for t_k + delay <= t < t_(k+1) + delay.

    Attributes
    ----------
    system : PeriodicSystem
        The plant with n states and m inputs.
    K : array, shape (N, m, r)
        The gains at the instants, of z = x (r = n), or of z = [x; u_(k-1)] (r = n + m) where the input comes late.
    X : array, shape (N, r, r)
        The cost z' X_k z of all that comes after an instant.
    instants : array, shape (N,)
        t_k = k h in s, over the q periods that N samples fill.
    sample_time, delay : float
        In s.
    error : float
        Of K, relative to its largest entry.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> made = fl.sampled_lqr(system, np.eye(2), np.eye(1), 0.1)
    >>> made.K.shape, made.floquet().verdict
    ((10, 1, 2), 'stable')
    """

    system: PeriodicSystem
    K: Array
    X: Array
    instants: Array
    sample_time: float
    delay: float
    error: float

    __repr__ = represent

    @property
    def gain(self) -> MatrixFunction:
        """The gain as a function of time, read at the instants."""
        return SampledGain(self.K, self.instants, self.system.period)

    @property
    def law(self) -> Law:
        """The design as a control law without feedforward, for a simulation whose drive samples; raises ArgumentError beside a delay."""
        if self.delay:
            raise ArgumentError(
                "a gain of the input held before is no law of the state", got=f"delay = {self.delay:g} s", expected="0"
            )
        m, n = self.K.shape[1:]
        return Law("none", Constant(np.zeros(m)), self.gain, Constant(np.zeros(n)))

    def named(self, name: str) -> Design:
        """Return the design as those of other kinds, for reports and exports.

        Parameters
        ----------
        name : str
            Name in reports.

        Returns
        -------
        Design
            With the gains, their error and the sample time.
        """
        status = f"gains of {counted(len(self.K), 'sample')}, held for {self.sample_time:.6g} s each"
        law, plant = self.law, self.system
        return Design(name, "sampled-lqr", law.gain, plant, self.error, status, sample_time=self.sample_time)

    def floquet(self, tol: float = 1e-9) -> FloquetResult:
        """Return Floquet's verdict on the sampled loop.

        Parameters
        ----------
        tol : float
            Wanted error of the exponents, in 1/s.

        Returns
        -------
        FloquetResult
            What `sampled_floquet` says of these gains.
        """
        return sampled_floquet(self.system, self.gain, self.sample_time, self.delay, tol)


@checked
def sampled_lqr(
    system: PeriodicSystem,
    Q: MatrixFunction | ArrayLike,
    R: MatrixFunction | ArrayLike,
    sample_time: float,
    delay: float = 0.0,
    tol: float = 1e-9,
) -> SampledDesign:
    """Design the state feedback of a held input that minimises the continuous cost, also between the samples.

        integral of x' Q x + u' R u dt = sum of z' Q_k z + 2 z' N_k u_k + u_k' R_k u_k,   z_(k+1) = F_k z_k + G_k u_k
        X_k = Q_k + F' X_(k+1) F - K_k' (R_k + G' X_(k+1) G) K_k,   X_(k+N) = X_k

    F, G, Q_k, N_k, R_k are exact for the held input. Assumes that N samples fill q periods.

    Parameters
    ----------
    system : PeriodicSystem
        The plant with n states and m inputs.
    Q : array_like (n, n), or function of times (N,) -> (N, n, n)
        Weight of the states.
    R : array_like (m, m), or function of times (N,) -> (N, m, m)
        Weight of the inputs.
    sample_time : float
        h, in s.
    delay : float
        Time from measuring to the input taking effect, 0 to h, in s; the input held before is then fed back too.
    tol : float
        Wanted relative error of the transition matrices.

    Returns
    -------
    SampledDesign
        Gains of all samples, the cost and the error.

    Raises
    ------
    ArgumentError
        When a weight or the sampling time does not fit.
    NotStabilizable, NotDetectable
        When a mode that does not decay is not reached by the held input, or not seen by the weight.

    References
    ----------
    Chen, Francis, Optimal Sampled-Data Control Systems (1995), ch. 3; Bittanti, Colaneri, Periodic Systems (2009), ch. 6.

    Examples
    --------
    x' = u with unit weights, h = 1: the sum of x^2 + x u + 4/3 u^2 along x + u, so X = sqrt(13/12), K = (1/2 + X) / (4/3 + X).

    >>> import flexlin as fl
    >>> made = fl.sampled_lqr(fl.PeriodicSystem([[0.0]], 1.0, B=[[1.0]]), 1.0, 1.0, 1.0)
    >>> print(f"{made.K.item():.6f}")
    0.649000
    """
    system, tol = as_system(system), positive("tol", tol)
    turn = find_round(system, sample_time, delay)
    posed = linear_quadratic(system, Q, R)
    weights = resolve_beside(system, posed.Q), resolve_beside(system, posed.R)
    problems = [
        weigh_samples(system, *weights, turn.samples, turn.periods, delay / sample_time, tol, stages)
        for stages in (STAGES, STAGES + 2)
    ]
    (X, K), (_, other) = (solve_samples(problem) for problem in problems)
    error = state_error(K, other, bound_rounding(problems[0], X, K))
    if delay:
        X[:, system.n :, system.n :] += problems[0].late
    t = system.period * turn.periods * np.arange(turn.samples) / turn.samples
    return SampledDesign(system, K, X, t, sample_time, delay, error)


def find_round(system: PeriodicSystem, sample_time: float, delay: float) -> Round:
    """The samples that fill whole periods. Raises: ArgumentError where none do, or the delay is longer than a sample."""
    h = positive("sample_time", sample_time)
    turn = find_rounds(system.period, h)[0]
    if turn.off > 0 or not 0 <= delay <= h:
        raise ArgumentError(
            "samples and periods do not begin anew together, or the delay is longer than a sample",
            got=f"sample_time = {h:g} s, delay = {delay:g} s, period = {system.period:g} s",
            expected=f"such as sample_time = {system.period * turn.periods / turn.samples:.9g} s",
        )
    return turn


def resolve_beside(system: PeriodicSystem, given: MatrixFunction) -> ResolvedMatrix:
    """A weight as series, beside the corners of the system."""
    complete = system.complete and has_nothing_narrow(given)
    return resolve_port(given, system.period, system.breaks, system.features, complete)


def state_error(K: Array, better: Array, rounding: float) -> float:
    """The error of gains, relative to the largest: what two more stages change, and rounding."""
    return float(SAFETY * np.abs(better - K).max() / (np.abs(K).max() or 1.0) + rounding)
