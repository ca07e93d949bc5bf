"""The optimal periodic state feedback."""

from numpy.typing import ArrayLike

from flexlin.control.designed_loop import Design
from flexlin.control.smooth_gain import smooth_gain
from flexlin.periodic.quadratic.riccati import periodic_riccati
from flexlin.periodic.system import MatrixFunction, PeriodicSystem


def periodic_lqr(
    system: PeriodicSystem,
    Q: MatrixFunction | ArrayLike,
    R: MatrixFunction | ArrayLike,
    N: MatrixFunction | ArrayLike | None = None,
    tol: float = 1e-9,
    name: str = "periodic LQR",
) -> Design:
    """Design the state feedback that minimises a quadratic cost along a periodic motion.

        u = -K(t) x,   K = R^-1 (B' X + N'),   -X' = A' X + X A - (X B + N) R^-1 (B' X + N') + Q

    Assumes what `periodic_riccati` assumes.

    Parameters: Q (n, n), R (m, m), N (n, m): constants or functions (N,) -> (N, ., .); tol: wished relative error of X.
    Returns: a design with X(t), K(t) at any t, closed_loop, cost(x0), error, status.
    Raises: ArgumentError on weights; NotStabilizable, NotDetectable; ToleranceNotReached.
    Source: Bittanti, Colaneri, Periodic Systems (2009), ch. 6.
    """
    solution = periodic_riccati(system, Q, R, N, tol)
    gain, apart = smooth_gain(solution.K, system.period, system.breaks)
    loop = system.feedback(gain)
    return Design(
        name, "periodic-lqr", gain, loop, solution.gain_error + apart, solution.status, solution.problem, solution
    )
