"""The periodic response of a loop, and what it does to the tip."""

from dataclasses import dataclass

import numpy as np

from flexlin.about.law import Law
from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.control.tracking import scene_feedforward, tip_positions
from flexlin.periodic.related import OfPlant
from flexlin.periodic.response.forced import forced_response
from flexlin.periodic.response.result import ForcedResponse
from flexlin.periodic.system import PeriodicSystem


@dataclass(frozen=True)
class Followed:
    """The elastic motion that a feedforward leads along, in the place of a forced response: any stable loop keeps it."""

    error: float
    status: str
    amplification: float = float("nan")


@dataclass(frozen=True)
class Response:
    """The periodic response of a loop: states [y; y'; z] (N, 2n + k), and how far the tip is from its rigid motion, (N, 2) in m.

    `tip_by_bending` is the part of it that is left when only the elastic coordinates deviate; `law` commands the torque where a
    feedforward leads along an elastic motion.
    """

    solution: ForcedResponse | Followed
    states: Array
    tip: Array
    tip_by_bending: Array
    law: Law | None = None

    @property
    def tip_error(self) -> Array:
        """The distance of the tip from its rigid motion, (N,) in m; not a number where the model has no points."""
        return np.linalg.norm(self.tip, axis=1)

    @property
    def sizes(self) -> tuple[float, float]:
        """The largest tip error by bending alone, and the largest of all, in m."""
        return float(np.linalg.norm(self.tip_by_bending, axis=1).max()), float(self.tip_error.max())


def find_response(closed: Linearization, loop: PeriodicSystem, t: Array, tol: float) -> Response:
    """The periodic response to what the rigid motion leaves over, and what it does to the tip."""
    forward = scene_feedforward(closed, tol)
    solution: ForcedResponse | Followed
    if forward is None:
        solution = forced_response(loop, OfPlant(closed.forcing, 2 * closed.n, loop.n), tol)
        states = solution(t)
    else:
        reference = forward.law.reference(t)
        states = np.concatenate([reference, np.zeros((len(t), loop.n - 2 * closed.n))], axis=1)
        solution = Followed(forward.error * float(np.abs(states).max()), forward.status)
    bent = states[:, : 2 * closed.n] * [coordinate.kind == "elastic" for coordinate in closed.coordinates * 2]
    rigid = tip_positions(closed, t, np.zeros_like(states))
    tip, by_bending = (tip_positions(closed, t, x) - rigid for x in (states, bent))
    return Response(solution, states, tip, by_bending, None if forward is None else forward.law)


def response_error(found: Response) -> float:
    """The error of the states, relative to the largest, absolute below 1."""
    return found.solution.error / max(1.0, float(np.abs(found.states).max()))


def arm_length(plant: Linearization) -> float:
    """The length of the arm from the base over its joints to the tip, in m, as the motion begins; not a number where it has no points."""
    if plant.arm.near.points is None:
        return float("nan")
    points = plant.about.near.of_arm("points", np.zeros(1), np.zeros((1, plant.n)))[0]
    return float(np.linalg.norm(np.diff(points, axis=1), axis=0).sum())
