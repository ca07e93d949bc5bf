"""What is known of a gain that was computed from a solution of Riccati's equation."""

from flexlin.errors import ToleranceNotReached
from flexlin.periodic.quadratic.solution import RiccatiSolution


def describe_gain(solution: RiccatiSolution, error: float, tol: float) -> str:
    """The solution's status, or what makes the gain less certain than X.

    Raises: ToleranceNotReached where nothing of the gain is known.
    """
    if error >= 1:
        raise ToleranceNotReached(
            "no digit of the gain is known",
            got=f"error {solution.error:.1g} of X, {error:.1g} of K = R^-1 (B' X + N')",
            expected=f"at most {tol:.1g}",
            todo="bring states, inputs and weights to like sizes: R is small beside B' X B",
        )
    if error <= tol or solution.error > tol:
        return solution.status
    return (
        f"X has converged to {solution.error:.1g}, which K = R^-1 (B' X + N') amplifies: error {error:.1g} of the gain "
        f"above the asked {tol:.1g}; ask for tol={2 * error:.0e}"
    )
