"""The linear prediction of a simulation, with its own error."""

import numpy as np

from flexlin.about.law import Law
from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.errors import NumericalError
from flexlin.simulation.collocation import Collocation
from flexlin.simulation.equations import LinearEquations, from_coordinates, to_coordinates, with_controller
from flexlin.simulation.marks import find_rough_times, with_breaks
from flexlin.simulation.mesh import Trail

ROUNDING = 1e-12
"""A tolerance below this is not asked of a run."""
RUNS = ((7, 0.25), (8, 0.025))
"""Stages and share of the tolerance of the two runs that are compared: other steps, other places of the stages, another order.

Over some periods the errors of the steps add up to two or three times the tolerance that each keeps."""


def predict(lin: Linearization, t: Array, start: Array, law: Law, tol: float) -> tuple[Array, Array]:
    """Compute the linear answer from a start, twice: on finer and on coarser steps.

        M_L y'' + D_L y' + K_L y = h_L + B_L torque

    Integrated as the nonlinear equations are, by collocation on steps that follow the motion and cross no break of it.
    Saturation and sampling are left out: they are not linear. States that outgrow all numbers are not numbers.

    Parameters
    ----------
    lin : Linearization
        With n coordinates.
    t : array, shape (N,)
        Times in s; the first is that of the start.
    start : array, shape (2n + k,)
        State [y; y'; z] at the first time, z being what the law's controller remembers.
    law : Law
        What commands the torque.
    tol : float
        Wanted difference of the two.

    Returns
    -------
    fine : array, shape (N, 2n + k)
        States of the finer run.
    coarse : array, shape (N, 2n + k)
        States of the coarser run.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> from flexlin.simulation import predict
    >>> scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": []})
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> fine, coarse = predict(lin, np.linspace(0.0, 0.1, 3), np.zeros(4), lin.law, 1e-8)
    >>> fine.shape, bool(np.abs(fine - coarse).max() < 1e-8)
    ((3, 4), True)
    """
    marks = with_breaks(t[[0, -1]], lin, find_rough_times(law, lin))
    equations = with_controller(LinearEquations(lin, law.direct), law)
    n, k = lin.n, law.memory

    def run(stages: int, share: float, trail: Trail | None = None) -> tuple[Array, Trail | None]:
        integrator = Collocation(equations, lin.period, stages, max(share * tol, ROUNDING))
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                found, trail = integrator.integrate(t, to_coordinates(start, n), marks, trail=trail)
                return from_coordinates(found[:, :-1], n, k), trail
        except NumericalError:
            return np.full((len(t), len(start)), np.nan), trail

    coarse, trail = run(*RUNS[0])
    fine, _ = run(*RUNS[1], trail)
    return fine, coarse


def distance(fine: Array, coarse: Array) -> float:
    """The largest difference of two resolutions, relative to the largest |x| (at least 1); infinite where one is lost."""
    apart = float(np.abs(fine - coarse).max() / max(1.0, np.abs(fine).max()))
    return apart if np.isfinite(apart) else np.inf
