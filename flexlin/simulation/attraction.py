"""How far the loop may be disturbed: the region of attraction that the nonlinear model shows."""

from dataclasses import dataclass

import numpy as np

from flexlin.about.linearization import Linearization
from flexlin.about.periodic_motion import periodic_motion
from flexlin.checks import Array
from flexlin.control.slow_motions import slow_motions
from flexlin.errors import NumericalError
from flexlin.periodic.system import MatrixFunction
from flexlin.simulation.loop import NonlinearLoop
from flexlin.summary import represent


@dataclass(frozen=True)
class Attraction:
    """Along the slowest Floquet modes: directions (k, 2n) whose linear motions have a largest deflection of 1 over a period, the amplitude
    that still comes back, and the smallest that does not (inf when every amplitude up to `largest` came back)."""

    directions: Array
    inside: Array
    outside: Array
    status: str

    __repr__ = represent


def region_of_attraction(
    lin: Linearization,
    feedback: MatrixFunction | None = None,
    modes: int = 2,
    largest: float = 3.0,
    periods: float = 5.0,
    halvings: int = 8,
    tol: float = 1e-6,
) -> Attraction:
    """Bisect the initial deflection along the slowest Floquet modes until the nonlinear loop no longer comes back.

        x(0) = x_p(0) + a v,   back: |x - x_p| after the given periods is below half of its start (and below a)

    x_p is the periodic motion of the loop, v a real Floquet direction, its linear motion scaled to a largest deflection of 1 (rad or m).
    Assumes a stable loop. What is found is a sample of the region's border, no proof of what lies inside.

    Returns: an `Attraction`. Raises: NumericalError when the loop has no periodic motion near the rigid one.
    """
    law = lin.law if feedback is None else lin.law.with_gain(feedback)
    motion = periodic_motion(lin, law=law)
    loop, own = lin.periodic_system(), lin.closed_by
    if feedback is not None:
        loop = loop.feedback(lambda t: law.gain(t) - own.gain(t))
    directions = slow_motions(loop, modes).directions
    here, there = motion.state(np.zeros(1))[0], motion.state(np.array([periods * lin.period]))[0]

    def comes_back(offset: Array) -> bool:
        t = np.array([0.0, periods * lin.period])
        try:
            end = NonlinearLoop(lin, law).integrate(t, here + offset, tol)[-1, :-1]
        except NumericalError:
            return False
        return bool(np.linalg.norm(end - there) < 0.5 * np.linalg.norm(offset))

    inside, outside = [], []
    for v in directions:
        low, high = 0.0, largest
        if comes_back(largest * v):
            low, high = largest, np.inf
        else:
            for _ in range(halvings):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if comes_back(middle * v) else (low, middle)
        inside.append(low)
        outside.append(high)
    smallest = min(inside)
    status = (
        f"every sampled deflection up to {largest:g} came back"
        if smallest >= largest
        else f"deflections up to {smallest:.3g} (rad or m) along the slowest modes come back; beyond, expect the loop to be lost"
    )
    return Attraction(directions, np.array(inside), np.array(outside), status)
