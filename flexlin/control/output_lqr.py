"""The best static feedback of what is measured: a constant gain on outputs, optimal in the mean over states and times."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize

from flexlin.arguments import checked
from flexlin.checks import SAMPLES, Array, positive, real_array
from flexlin.control.designed_loop import running_cost
from flexlin.control.lqr import periodic_lqr
from flexlin.errors import NotStabilizable, NotStable
from flexlin.periodic.coefficients import MatrixFunction, combine
from flexlin.periodic.interpolation import fourier_nodes
from flexlin.periodic.riccati.linear_quadratic import LinearQuadratic, linear_quadratic
from flexlin.periodic.riccati.riccati import periodic_lyapunov
from flexlin.periodic.riccati.scattering import transpose
from flexlin.periodic.system import PeriodicSystem, as_port, dual_system
from flexlin.precision import LARGEST_LOG_GROWTH, ROOT_EPS, SLIGHT
from flexlin.summary import immutable


def measured_gain(K: Array, C: MatrixFunction) -> MatrixFunction:
    """K C(t) for a constant K (m, p)."""
    return combine(partial(np.matmul, K), C)


@immutable(eq=False)
class OutputDesign:
    """A static output feedback u = -K y, y = C(t) x.

    Attributes
    ----------
    K : array, shape (m, p)
        The gain.
    closed_loop : PeriodicSystem
        x' = (A - B K C) x, for Floquet's verdict.
    cost : float
        The mean over starting times of the cost from states of covariance I.
    change : float
        The last relative change of K: how near to stationary it is.
    status : str
        What to make of it.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [-1.0, -0.1]], 1.0, B=[[0.0], [1.0]])
    >>> made = fl.output_lqr(system, [[0.0, 1.0]], np.eye(2), np.eye(1))
    >>> made.K.round(4).tolist(), fl.floquet(made.closed_loop).verdict
    ([[1.0576]], 'stable')
    """

    K: Array
    closed_loop: PeriodicSystem
    cost: float
    change: float
    status: str


@checked
def output_lqr(
    system: PeriodicSystem,
    C: MatrixFunction | ArrayLike,
    Q: MatrixFunction | ArrayLike,
    R: ArrayLike,
    start: ArrayLike | None = None,
    tol: float = 1e-6,
) -> OutputDesign:
    """Design the constant gain on measurements that minimises a quadratic cost, u = -K C(t) x.

        J = mean over t of trace X,   -X' = Ac' X + X Ac + Q + C' K' R K C,   Ac = A - B K C
        dJ/dK = 2 R K [C P C'] - 2 [B' X P C'],   P' = Ac P + P Ac' + I,   [.] the mean over t

    log J is lowered by the quasi-Newton method of Broyden, Fletcher, Goldfarb and Shanno. What is found is a local optimum: another start
    may lead to another one.

    Parameters
    ----------
    system : PeriodicSystem
        The plant with n states and m inputs.
    C : array_like (p, n), or function of times (N,) -> (N, p, n)
        What is measured.
    Q : array_like (n, n), or function of times (N,) -> (N, n, n)
        Weight of the states.
    R : array_like (m, m)
        Weight of the inputs, positive definite.
    start : array_like (m, p), optional
        A gain that stabilises; by default none at all, or what is nearest to the full state feedback.
    tol : float
        Relative change of K that ends the steps.

    Returns
    -------
    OutputDesign
        The gain, its loop and its cost.

    Raises
    ------
    ArgumentError
        When a matrix does not fit.
    NotStabilizable
        When no start stabilises.

    References
    ----------
    Moerder, Calise, Convergence of a numerical algorithm for calculating optimal output feedback gains, IEEE TAC 30 (1985) 900;
    Rautert, Sachs, Computational design of optimal output feedback controllers, SIAM J. Optim. 7 (1997) 837.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> made = fl.output_lqr(system, np.eye(2), np.eye(2), np.eye(1))
    >>> made.K.round(4).tolist()
    [[1.0, 1.7321]]
    """
    tol = positive("tol", tol)
    posed = linear_quadratic(system, Q, real_array("R", R, (system.m, system.m)))
    output = as_port("C", C, (None, system.n), system.period)
    problem = OutputProblem(system, posed, output)
    first = None if start is None else real_array("start", start, (system.m, output(np.zeros(1)).shape[1]))
    K, J, best = problem.descend(*problem.begin(first), tol)
    change = float(np.abs(best - K).max() / (np.abs(best).max() or 1.0))
    status = (
        "converged to a local optimum"
        if change <= tol
        else f"not converged: the next step would change K by {change:.1g} of it"
    )
    return OutputDesign(K, system.feedback(measured_gain(K, output)), J, change, status)


@dataclass(frozen=True, eq=False)
class Judged:
    """J of a gain, the gain R^-1 [B' X P C'] [C P C']^-1 that its gramians ask for, and [C P C']."""

    cost: float
    wanted: Array
    seen: Array


@dataclass(frozen=True, eq=False)
class OutputProblem:
    """The cost of an output gain, and the gain that its gramians ask for."""

    system: PeriodicSystem
    problem: LinearQuadratic
    C: MatrixFunction

    def judge(self, K: Array) -> Judged | None:
        """The cost of an output gain; none where the loop is not stable."""
        return self.improve(measured_gain(K, self.C))

    def improve(self, gain: MatrixFunction) -> Judged | None:
        """The same of a loop with any gain on the states."""
        system, t = self.system, fourier_nodes(SAMPLES, self.system.period)
        loop = system.feedback(gain)
        try:
            X = periodic_lyapunov(loop, running_cost(self.problem, gain)).X(t)
            P = periodic_lyapunov(dual_system(loop), np.eye(system.n)).X(-t)
        except NotStable:
            return None
        B, C = self.problem.B(t), self.C(t)
        pulled = (transpose(B) @ X @ P @ transpose(C)).mean(axis=0)
        seen = (C @ P @ transpose(C)).mean(axis=0)
        wanted = np.linalg.solve(self.R, pulled @ np.linalg.pinv(seen, hermitian=True))
        return Judged(float(np.trace(X, axis1=1, axis2=2).mean()), wanted, seen)

    @property
    def R(self) -> Array:
        """The weight of the inputs."""
        return self.problem.R(np.zeros(1))[0]

    def descend(self, start: Array, first: Judged, tol: float) -> tuple[Array, float, Array]:
        """A gain of least cost near `start`, its cost and the gain that its gramians ask for.

        K = start + R^(-1/2) Z [C P C']^(-1/2), P that of the start: steepest descent in Z then goes along best - K. Sensors that read
        alike share a gain.
        """
        sizes, V = np.linalg.eigh(first.seen)
        kept = sizes > ROOT_EPS * sizes[-1]
        left, right = np.linalg.inv(np.linalg.cholesky(self.R)).T, (V[:, kept] / np.sqrt(sizes[kept])).T
        if not right.size:
            return start, first.cost, start

        def gain(z: Array) -> Array:
            return start + left @ z.reshape(len(left), -1) @ right

        def value(z: Array) -> tuple[float, Array]:
            K = gain(z)
            found = self.judge(K)
            if found is None:  # the loop is not stable
                return float(np.log(first.cost)) + LARGEST_LOG_GROWTH, np.zeros_like(z)
            slope = 2 * self.R @ (K - found.wanted) @ found.seen / found.cost
            return float(np.log(found.cost)), (left.T @ slope @ right.T).ravel()

        zero = np.zeros(left.shape[0] * right.shape[0])
        K = gain(minimize(value, zero, jac=True, method="BFGS", options={"gtol": SLIGHT * tol}).x)
        last = self.judge(K)
        return (start, first.cost, first.wanted) if last is None else (K, last.cost, last.wanted)

    def begin(self, start: Array | None) -> tuple[Array, Judged]:
        """A gain that stabilises, with its cost. Raises: NotStabilizable."""
        m, p = self.system.m, self.C(np.zeros(1)).shape[1]
        K = np.zeros((m, p)) if start is None else start
        if (found := self.judge(K)) is not None:
            return K, found
        if start is None:
            full = self.improve(periodic_lqr(self.system, self.problem.Q, self.problem.R).K)
            if full is not None and (found := self.judge(full.wanted)) is not None:
                return full.wanted, found
        raise NotStabilizable(
            "no gain on these measurements was found that stabilises",
            got="none at all and the nearest to a state feedback" if start is None else "the given start",
            todo="give a start that stabilises, or measure more (rates beside angles)",
        )
