"""Step by step through time: a trial that leaves the model's range shortens the step, only accepted states count."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from flexlin.checks import Array
from flexlin.errors import SimulationStopped

if TYPE_CHECKING:
    from scipy.integrate import OdeSolver

Skips = Callable[[float, float, Callable[[Array], Array]], bool]
"""Begin and end of a step, and its polynomial times (N,) -> states (n, N): whether it passed over something unseen."""

UNSEEN = "each passes over a force that saturates within a smaller rate"
SHORTENED = 0.1
"""What is left of a step after a trial that left the range."""
SHORTEST = 1e-13
"""A step this short against the whole time is no step any more."""


class TrialLeftRange(Exception):
    """A trial evaluation of the integrator has no meaning there; the solution itself need not come that far."""


def march(
    make: Callable[[float, Array, float | None], "OdeSolver"],
    z: Array,
    begin: float,
    end: float,
    stops: Array,
    accept: Callable[[Array, Array], None],
    skips: Skips,
    first: float | None = None,
) -> tuple[Array, Array]:
    """Integrate from `begin` to `end`: the state there, and the states (N, n) at the stops (N,), begin < stops <= end.

    Parameters: make: (t, z, first step or None) -> solver; accept: looks at accepted times (N,) and states (N, n), and raises if it must
    not be so; skips: whether a step passed over something, and has to be shorter.
    Raises: SimulationStopped when no step is short enough, naming the last accepted time.
    """
    slack, values = 1e-12 * (end - begin), np.empty((len(stops), len(z)))
    now, step, done = begin, end - begin if first is None else first, 0
    solver: OdeSolver | None = None
    while now < end:
        try:
            solver = solver or make(now, z, first)
            message = solver.step()
        except TrialLeftRange as reason:
            step = shorten(step, end - begin, now, f"a trial beyond it fails ({reason})", z[:-1])
            first, solver = min(step, end - now), None
            continue
        if solver.status == "failed":
            raise stopped(now, message, z[:-1])
        if skips(now, solver.t, solver.dense_output()):
            first, solver = shorten(solver.t - now, end - begin, now, UNSEEN, z[:-1]), None
            continue
        accept(np.array([solver.t]), solver.y[None])
        upto = int(np.searchsorted(stops, solver.t + slack, side="right"))
        if upto > done:
            values[done:upto] = solver.dense_output()(np.minimum(stops[done:upto], solver.t)).T
            done = upto
        step, now, z = solver.t - now, solver.t, solver.y
    return z, values


def shorten(step: float, whole: float, now: float, why: str, reached: Array) -> float:
    """What is tried after a step that failed. Raises: SimulationStopped where that is no step any more against the whole time."""
    if SHORTENED * step <= SHORTEST * whole:
        raise stopped(now, f"no step is short enough: {why}", reached) from None
    return SHORTENED * step


GENTLER = "slow the motion down, stiffen the links or raise the gains; or simulate fewer periods"
"""What helps where a step is too hard; where there are only too many, SHORTER does."""
SHORTER = "simulate fewer periods, or ask for a larger tol"


def stopped(t: float, why: str, reached: Array | None = None, todo: str = GENTLER) -> SimulationStopped:
    """What to say when the integrator cannot go on from an accepted state; `reached` (2n,) is that state."""
    return SimulationStopped(
        f"the nonlinear simulation stopped at t = {t:.4g} s",
        got=why,
        todo=todo,
        t=t,
        reached=reached,
    )
