"""Digital control: the Kalman filter that works from sample to sample, and the loop that it closes with sampled gains."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, positive
from flexlin.control.estimator import as_measurement, said_of_a_filter
from flexlin.control.sampled import SampledDesign, find_round, resolve_beside, state_error
from flexlin.errors import ArgumentError
from flexlin.periodic.coefficients import Constant, MatrixFunction
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.quadratic.linear_quadratic import linear_quadratic
from flexlin.periodic.quadratic.scattering import transpose
from flexlin.periodic.related import with_matrices
from flexlin.periodic.sampled import STAGES, HeldPlant, hold_plant, judge_samples
from flexlin.periodic.sampled_cost import SampledProblem, bound_rounding, solve_samples, spread_noise
from flexlin.periodic.system import PeriodicSystem, as_system
from flexlin.summary import represent


@dataclass(frozen=True, eq=False)
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

    __repr__ = represent

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
        loops = [
            self._loop(hold_plant(self.system, turn.samples, turn.periods, delay, tol, s), design)
            for s in (STAGES, STAGES + 2)
        ]
        return judge_samples(loops[0], loops[1], turn, self.system.period, tol)

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
    system, tol = as_system(system), positive("tol", tol)
    if system.B is None:
        system = with_matrices(system, system.A, Constant(np.zeros((system.n, 1))))
    turn, n = find_round(system, sample_time, 0.0), system.n
    output, p = as_measurement(C, system)
    measured = PeriodicSystem(np.zeros((n, n)), system.period, np.zeros((n, p)))
    posed = linear_quadratic(measured, W, V)
    t = system.period * turn.periods * np.arange(turn.samples) / turn.samples
    seen, noise = output(np.mod(t, system.period)), posed.R(np.mod(t, system.period))
    excited = resolve_beside(system, posed.Q)
    found = []
    for stages in (STAGES, STAGES + 2):
        F, added = spread_noise(system, excited, turn.samples, turn.periods, tol, stages)
        nothing = np.zeros((turn.samples, n, p))
        dual = SampledProblem(transpose(F)[::-1], transpose(seen)[::-1], added[::-1], nothing, noise[::-1], noise)
        with said_of_a_filter():
            X, K = solve_samples(dual)
        found.append((dual, X, K))
    (dual, X, K), (*_, other) = found
    error = state_error(K, other, bound_rounding(dual, X, K))
    P, L = np.roll(X[::-1], 1, axis=0), transpose(K[::-1])
    M = P @ transpose(seen) @ np.linalg.inv(seen @ P @ transpose(seen) + noise)
    return SampledEstimator(system, seen, P, M, L, t, sample_time, error)
