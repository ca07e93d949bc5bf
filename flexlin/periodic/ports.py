"""What stands beside A(t), as series too: inputs, outputs and weights."""

from collections.abc import Sequence

from flexlin.periodic.coefficients import PROBES, Constant, MatrixFunction
from flexlin.periodic.resolved.matrix import ResolvedMatrix
from flexlin.periodic.resolved.resolve import resolve


def varies(source: MatrixFunction, period: float) -> bool:
    """Whether a coefficient is more than one matrix that is handed out at all times."""
    return not isinstance(source, Constant) and bool(source(period * PROBES).strides[0] != 0)


def resolve_port(
    given: MatrixFunction,
    period: float,
    breaks: Sequence[float],
    features: Sequence[tuple[float, float]],
    complete: bool,
) -> ResolvedMatrix | None:
    """A coefficient (N, rows, columns) as series that agree with it everywhere; nothing where it does not vary.

    Parameters: breaks, features, complete: as of `resolve`.
    """
    if not varies(given, period):
        return None
    return resolve(given, period, breaks, features, complete=complete)
