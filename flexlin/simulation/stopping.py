"""What to say of a simulation that cannot go on."""

from flexlin.checks import Array
from flexlin.errors import SimulationStopped

SHORTEST_STEP = 1e-13
"""A step this short against the whole time is no step any more."""
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
