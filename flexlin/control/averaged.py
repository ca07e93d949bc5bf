"""One constant LQR gain for the average of the coefficients over a period."""

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array
from flexlin.control.designed_loop import Design
from flexlin.control.weights import constant_lqr
from flexlin.periodic.coefficients import Constant
from flexlin.periodic.grid import place_edges
from flexlin.periodic.quadratic.linear_quadratic import linear_quadratic
from flexlin.periodic.system import MatrixFunction, PeriodicSystem
from flexlin.periodic.transition.gauss import gauss, place_nodes, sample_at

SEGMENTS, STAGES = 16, 8


def averaged_lqr(
    system: PeriodicSystem,
    Q: MatrixFunction | ArrayLike,
    R: MatrixFunction | ArrayLike,
    N: MatrixFunction | ArrayLike | None = None,
    name: str = "averaged LQR",
) -> Design:
    """Design one constant gain from the coefficients averaged over the period.

        A0 = 1/T int A dt, and so on;   A0' X + X A0 - (X B0 + N0) R0^-1 (B0' X + N0') + Q0 = 0,   u = -K x

    Assumes fast coefficients (averaging): nothing guarantees a stable loop, so look at its Floquet verdict.

    Returns: a design with a constant gain, which is exact: error 0.
    Raises: ArgumentError; NotStabilizable, NotDetectable, naming eigenvalue and direction.
    Source: Sanders, Verhulst, Murdock, Averaging Methods (2007); `control.lqr`.
    """
    problem = linear_quadratic(system, Q, R, N)
    A, B, state, effort, cross = (
        mean(system, coefficient) for coefficient in (problem.A, problem.B, problem.Q, problem.R, problem.N)
    )
    K, _ = constant_lqr(A, B, state, effort, cross, "on average")
    gain = Constant(K)
    status = "one constant gain for the averaged coefficients; the verdict is Floquet's"
    return Design(name, "averaged-lqr", gain, system.feedback(gain), 0.0, status, problem)


def mean(system: PeriodicSystem, coefficient: MatrixFunction) -> Array:
    """Average a coefficient over the period by Gauss quadrature between the breaks."""
    rule, marks = gauss(STAGES), place_edges(system.period, system.breaks, SEGMENTS)
    values = sample_at(coefficient, place_nodes(marks, rule.c))
    return np.einsum("k,s,ksij->ij", np.diff(marks), rule.b, values) / system.period
