"""Digital control: the optimal periodic gains of an input that is held from sample to sample, and the Kalman filter beside them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, positive
from flexlin.control.designed_loop import Design
from flexlin.control.estimator import said_of_a_filter
from flexlin.errors import ArgumentError, counted
from flexlin.linearization.law import Law
from flexlin.periodic.coefficients import Constant, MatrixFunction
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.interpolation import ChebyshevPanels
from flexlin.periodic.riccati.linear_quadratic import linear_quadratic
from flexlin.periodic.riccati.scattering import transpose
from flexlin.periodic.sampled import (
    STEP_STAGES,
    HeldPlant,
    Round,
    find_rounds,
    hold_plant,
    judge_samples,
    sampled_floquet,
)
from flexlin.periodic.sampled_cost import SampledProblem, solve_balanced, spread_noise, weigh_samples
from flexlin.periodic.system import PeriodicSystem, as_port, resolve_beside, with_matrices
from flexlin.summary import immutable


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


@immutable(eq=False)
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
    tol = positive("tol", tol)
    turn = find_round(system, sample_time, delay)
    posed = linear_quadratic(system, Q, R)
    weights = resolve_beside(system, posed.Q), resolve_beside(system, posed.R)
    problems = [
        weigh_samples(system, *weights, turn, delay / sample_time, tol, stages)
        for stages in (STEP_STAGES, STEP_STAGES + 2)
    ]
    X, K, error = solve_balanced(*problems)
    if delay:
        X[:, system.n :, system.n :] += problems[0].late
    return SampledDesign(system, K, X, turn.instants, sample_time, delay, error)


@immutable(eq=False)
class SampledEstimator:
    """A Kalman filter that works from sample to sample, z = x:

        corrected = predicted + M_k (y_k - C_k predicted),   next predicted = F_k corrected + G_k u_k

    Attributes
    ----------
    system : PeriodicSystem
        The plant with n states and m inputs.
    C : array, shape (N, p, n)
        What is measured at the instants.
    P : array, shape (N, n, n)
        Covariance of the error before the measurement of each instant.
    M : array, shape (N, n, p)
        What a measurement corrects.
    L : array, shape (N, n, p)
        F_k M_k, the gain of the next prediction.
    instants : array, shape (N,)
        t_k = k h in s, over the q periods that N samples fill.
    sample_time : float
        In s.
    error : float
        Of L, relative to its largest entry.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> made = fl.sampled_estimator(system, [[1.0, 0.0]], np.eye(2), 0.01, 0.1)
    >>> made.L.shape, made.floquet().verdict
    ((10, 2, 1), 'stable')
    """

    system: PeriodicSystem
    C: Array
    P: Array
    M: Array
    L: Array
    instants: Array
    sample_time: float
    error: float

    def floquet(self, design: SampledDesign | None = None, tol: float = 1e-9) -> FloquetResult:
        """Return Floquet's verdict on the error of the estimate, or on a design that feeds back the corrected estimate.

        Parameters
        ----------
        design : SampledDesign, optional
            Of the same plant and samples; its delay may be any.
        tol : float
            Wanted error of the exponents, in 1/s.

        Returns
        -------
        FloquetResult
            Of F_k (I - M_k C_k), or of the whole loop [z; predicted].

        Raises
        ------
        ArgumentError
            When the design has other samples.
        """
        if design is not None and (design.system.n, len(design.K)) != (self.system.n, len(self.L)):
            raise ArgumentError(
                "design and estimator do not fit each other",
                got=f"{len(design.K)} and {len(self.L)} samples",
                expected="the same plant and sampling time",
            )
        turn = find_round(self.system, self.sample_time, 0.0)
        delay = 0.0 if design is None else design.delay / self.sample_time

        def close(turn: Round, stages: int) -> Array:
            """The steps of the loop."""
            return self._loop(hold_plant(self.system, turn, delay, tol, stages), design)

        return judge_samples(close, (turn,), tol)

    def _loop(self, plant: HeldPlant, design: SampledDesign | None) -> Array:
        """The steps (N, r, r) of the estimate's error, or (N, r + n, r + n) of [z; predicted]."""
        n, see = self.system.n, self.M @ self.C
        if design is None:
            return plant.F @ (np.eye(n) - see)
        r = plant.F.shape[1]
        corrected = np.concatenate([see, np.zeros((len(see), n, r - n)), np.eye(n) - see], axis=2)
        held = np.zeros((len(see), r - n, r + n))
        held[:, :, n:r] = np.eye(r - n)
        known = np.concatenate([corrected, held], axis=1)
        u = -design.K @ known
        z = np.concatenate([plant.F, np.zeros((len(see), r, n))], axis=2) + plant.G @ u
        return np.concatenate([z, (plant.F @ known + plant.G @ u)[:, :n]], axis=1)


@checked
def sampled_estimator(
    system: PeriodicSystem,
    C: MatrixFunction | ArrayLike,
    W: MatrixFunction | ArrayLike,
    V: MatrixFunction | ArrayLike,
    sample_time: float,
    tol: float = 1e-9,
) -> SampledEstimator:
    """Design the Kalman filter of measurements C x + v at samples.

        P_(k+1) = F (P - P C' (C P C' + V)^-1 C P) F' + W_k,   M = P C' (C P C' + V)^-1,   P_(k+N) = P_k

    W_k is what the noise on x' adds up to over a sample. Assumes that N samples fill q periods.

    Parameters
    ----------
    system : PeriodicSystem
        The plant with n states and m inputs.
    C : array_like (p, n), or function of times (N,) -> (N, p, n)
        What is measured.
    W : array_like (n, n), or function of times (N,) -> (N, n, n)
        Intensity of white noise on x'.
    V : array_like (p, p), or function of times (N,) -> (N, p, p)
        Covariance of the noise of one measurement.
    sample_time : float
        h, in s.
    tol : float
        Wanted relative error of the transition matrices.

    Returns
    -------
    SampledEstimator
        Gains and covariances of all samples.

    Raises
    ------
    ArgumentError
        When C, a covariance or the sampling time does not fit.
    NotDetectable, NotStabilizable
        When a mode that does not decay is not measured, or not excited by the noise.

    References
    ----------
    Bittanti, Colaneri, Periodic Systems (2009), ch. 7.

    Examples
    --------
    x' = w measured once a second with as much noise as is added: P = V (1 + sqrt(5)) / 2.

    >>> import flexlin as fl
    >>> made = fl.sampled_estimator(fl.PeriodicSystem([[0.0]], 1.0), [[1.0]], [[1.0]], [[1.0]], 1.0)
    >>> print(f"{made.P.item():.6f}")
    1.618034
    """
    tol = positive("tol", tol)
    if system.B is None:
        system = with_matrices(system, system.A, Constant(np.zeros((system.n, 1))))
    turn, n = find_round(system, sample_time, 0.0), system.n
    output = as_port("C", C, (None, n), system.period)
    p = output(np.zeros(1)).shape[1]
    measured = PeriodicSystem(np.zeros((n, n)), system.period, np.zeros((n, p)))
    posed = linear_quadratic(measured, W, V)
    t = turn.instants
    seen, noise = output(np.mod(t, system.period)), posed.R(np.mod(t, system.period))
    excited = resolve_beside(system, posed.Q)
    found = []
    for stages in (STEP_STAGES, STEP_STAGES + 2):
        F, added = spread_noise(system, excited, turn, tol, stages)
        nothing = np.zeros((turn.samples, n, p))
        found.append(
            SampledProblem(transpose(F)[::-1], transpose(seen)[::-1], added[::-1], nothing, noise[::-1], noise)
        )
    with said_of_a_filter():
        X, K, error = solve_balanced(*found)
    P, L = np.roll(X[::-1], 1, axis=0), transpose(K[::-1])
    M = P @ transpose(seen) @ np.linalg.inv(seen @ P @ transpose(seen) + noise)
    return SampledEstimator(system, seen, P, M, L, t, sample_time, error)


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
