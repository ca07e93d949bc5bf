"""How far the loop may be disturbed: the region of attraction that the nonlinear model shows."""

import numpy as np

from flexlin.checks import Array
from flexlin.control.slow_motions import slow_motions
from flexlin.errors import NumericalError
from flexlin.linearization.linear import linearize
from flexlin.linearization.linearization import Linearization
from flexlin.linearization.periodic_motion import periodic_motion
from flexlin.periodic.system import MatrixFunction
from flexlin.simulation.loop import NonlinearLoop
from flexlin.summary import immutable


@immutable
class Attraction:
    """How large a deflection along the slowest Floquet modes still comes back.

    Attributes
    ----------
    directions : array, shape (k, 2n)
        Directions [y; y'] whose linear motions have a largest deflection of 1 (rad or m) over a period.
    inside : array, shape (k,)
        The amplitude that still comes back, in rad or m.
    outside : array, shape (k,)
        The smallest amplitude that does not; inf when every amplitude tried came back.
    status : str
        What to make of it.

    Examples
    --------
    >>> import numpy as np
    >>> from flexlin.simulation import Attraction
    >>> Attraction(np.eye(2), np.array([0.5, 1.0]), np.array([0.6, np.inf]), "a sample").inside.tolist()
    [0.5, 1.0]
    """

    directions: Array
    inside: Array
    outside: Array
    status: str


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

    Parameters
    ----------
    lin : Linearization
        With the loop closed.
    feedback : function of times (N,) -> (N, m, 2n), optional
        Takes the place of the loop's gain.
    modes : int
        How many of the slowest modes.
    largest : float
        The largest amplitude tried, in rad or m.
    periods : float
        Time in which a deflection must come back, in periods.
    halvings : int
        Steps of the bisection.
    tol : float
        Error of the simulations.

    Returns
    -------
    Attraction
        The amplitudes found.

    Raises
    ------
    NumericalError
        When the loop has no periodic motion near the rigid one.

    Examples
    --------
    >>> import flexlin as fl
    >>> from flexlin.simulation import region_of_attraction
    >>> scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": []})
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> found = region_of_attraction(lin, modes=1, largest=0.2, periods=2.0, tol=1e-4)
    >>> found.inside.tolist()
    [0.2]
    """
    law = lin.law if feedback is None else lin.law.with_gain(feedback)
    motion = periodic_motion(lin, law=law)
    loop = lin.periodic_system()
    if feedback is not None:
        loop = linearize(lin.arm, lin.motion).periodic_system().feedback(law.gain)
    directions = slow_motions(loop, modes, coordinates=lin.n).directions
    here, there = motion.loop_state(np.zeros(1))[0], motion.loop_state(np.array([periods * lin.period]))[0]

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
        f"every deflection up to {largest:g} (rad or m) along the slowest modes comes back"
        if smallest >= largest
        else f"deflections up to {smallest:.3g} (rad or m) along the slowest modes come back; beyond, expect the loop to be lost"
    )
    return Attraction(directions, np.array(inside), np.array(outside), status)
