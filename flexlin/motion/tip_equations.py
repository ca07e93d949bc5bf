"""The equations of inverse kinematics, F(z, phase) = 0, of a path of poses, with their derivatives, and how far out of reach a path is."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from flexlin import symbolic
from flexlin.checks import SUM_ROUNDING, Array
from flexlin.errors import MotionError
from flexlin.lazy import lazy
from flexlin.mechanics.body import rotation_about
from flexlin.mechanics.manipulator import Manipulator
from flexlin.motion.smooth import make_step
from flexlin.precision import CUBE_ROOT_EPS
from flexlin.scene.motion import Circle, Polyline
from flexlin.series.tracking import find_lowest
from flexlin.symbolic import Expressions


@dataclass(frozen=True, eq=False)
class PosePath(Expressions):
    """A closed path: position (3, 1) in m and rotation (3, 3), None where it is free, of the phase; period in s; breaks as phases."""

    phase: ca.SX
    position: ca.SX
    rotation: ca.SX | None
    period: float
    breaks: tuple[float, ...] = ()


def make_circle(table: Circle) -> PosePath:
    """x = c + r (e_1 cos(2 pi phase) + e_2 sin(2 pi phase)) with e_1, e_2 across the normal, e_1 as near to x as can be."""
    phase = ca.SX.sym("phase")
    normal = np.array(table.normal) / np.linalg.norm(table.normal)
    near = np.eye(3)[0] if abs(normal[0]) < 0.9 else np.eye(3)[1]
    first = near - normal @ near * normal
    first /= np.linalg.norm(first)
    turn = 2 * ca.pi * phase
    across = ca.DM(first) * ca.cos(turn) + ca.DM(np.cross(normal, first)) * ca.sin(turn)
    rotation = None if table.rpy is None else ca.SX(Rotation.from_euler("xyz", table.rpy).as_matrix())
    return PosePath(phase, ca.DM(table.centre) + table.radius * across, rotation, table.period)


def make_polyline(table: Polyline) -> PosePath:
    """x = p_0 + sum_i (p_(i+1) - p_i) a_i,   R = R_0 prod_i exp(a_i w_i~),   w_i = log(R_i^T R_(i+1)).

    a_i goes from 0 to 1 in move_time, one stage of move, dwell and blend time after the one before. The last move may reach into the
    next period, of which it is the first move too.
    """
    phase, count = ca.SX.sym("phase"), len(table.points)
    stage = table.move_time + table.dwell_time - table.blend_time
    period = count * stage
    starts = [-stage, *(i * stage for i in range(count))]
    rises = [make_step(table.profile, ca.fmin(ca.fmax((phase * period - t) / table.move_time, 0), 1)) for t in starts]
    rises[0] = rises[0] - 1
    points = np.array(table.points)
    moves = np.roll(points, -1, axis=0) - points
    position = ca.DM(points[0]) + sum((ca.DM(moves[i - 1]) * rise for i, rise in enumerate(rises)), ca.SX(3, 1))
    ends = sorted({t + extra for t in starts for extra in (0.0, table.move_time)})
    breaks = [t / period for t in ends if -SUM_ROUNDING * period < t < period * (1 - SUM_ROUNDING)]
    breaks = [max(at, 0.0) for k, at in enumerate(breaks) if k == 0 or at - breaks[k - 1] > SUM_ROUNDING]
    rotation = turn_between(table.rpy, rises) if table.rpy else None
    return PosePath(phase, position, rotation, period, tuple(breaks))


def turn_between(rpy: Sequence[tuple[float, float, float]], rises: list[ca.SX]) -> ca.SX:
    """The rotation that goes from one orientation to the next as each rise goes from 0 to 1; the first rise is the last move's end."""
    turns = Rotation.from_euler("xyz", np.array(rpy))
    if len(turns) == 1:
        return ca.SX(turns[0].as_matrix())
    steps = [(turns[i].inv() * turns[(i + 1) % len(turns)]).as_rotvec() for i in range(len(turns))]
    rotation = ca.SX(turns[0].as_matrix())
    for i, rise in enumerate(rises):
        step = steps[i - 1]
        size = float(np.linalg.norm(step))
        if size > 0:
            rotation = rotation @ rotation_about(ca.SX(ca.DM(step / size)), size * rise)
    return rotation


@dataclass(frozen=True, eq=False)
class TipEquations(Expressions):
    """F(z, phase) = 0 of the joints that lead the tip of the rigid arm along a path.

        c(y, phase) = [tip(y) - x(phase); orientation; closure of loops] = 0,   y = [q; v]
        F = c where there are as many equations as coordinates y; else F = [W (y - y_0) - (dc/dy)^T l; c],   z = [y; l]

    The second form makes |q - q_0| least at each time, so it depends on the path alone: what solves it is as smooth as the path, and
    periodic.

    W: 1 for the joints, 0 for the joints v that follow from loops.
    Source: Baillieul (1985), Kinematic programming alternatives for redundant manipulators, for the second form.
    """

    z: ca.SX
    phase: ca.SX
    F: ca.SX
    c: ca.SX
    flip: ca.SX
    joints: int
    tips: int

    @property
    def size(self) -> int:
        """The number of unknowns z."""
        return int(self.z.numel())

    @property
    def redundant(self) -> bool:
        """Whether there are more coordinates than equations."""
        return self.c.numel() < self.size

    @property
    def coordinates(self) -> int:
        """The number of coordinates y: those of z that are no multipliers."""
        return self.size - self.c.numel() if self.redundant else self.size

    @lazy
    def slope(self) -> ca.SX:
        """dF/dz, (k, k)."""
        return ca.densify(ca.jacobian(self.F, self.z))

    @lazy
    def first(self) -> ca.Function:
        """z, phase -> F, dF/dz, dF/dphase."""
        along = ca.densify(ca.jacobian(self.F, self.phase))
        return ca.Function("first", [self.z, self.phase], [ca.densify(self.F), self.slope, along])

    @lazy
    def second(self) -> ca.Function:
        """z, dz/dphase, phase -> what d2F/dphase2 has beside dF/dz d2z/dphase2."""
        rate = ca.SX.sym("rate", self.size)
        where, way = ca.vertcat(self.z, self.phase), ca.vertcat(rate, 1)
        return ca.Function(
            "second", [self.z, rate, self.phase], [ca.densify(ca.jtimes(ca.jtimes(self.F, where, way), where, way))]
        )

    @lazy
    def task(self) -> ca.Function:
        """z, phase -> c, dc/dy and what is negative where the tip stands upside down."""
        y = self.z[: self.coordinates]
        return ca.Function("task", [self.z, self.phase], [self.c, ca.densify(ca.jacobian(self.c, y)), self.flip])

    def newton_step(self, phase: float, z: Array, left: Array | float = 0.0) -> Array:
        """F_z^-1 (F - left) at one phase; infinite where that is singular."""
        F, slope, _ = (x.full() for x in self.first(z, phase))
        try:
            return np.asarray(np.linalg.solve(slope, F[:, 0] - left))
        except np.linalg.LinAlgError:
            return np.full(len(z), np.inf)

    def newton_steps(self, phases: Array, z: Array) -> Array:
        """The same at N phases, z (N, k)."""
        F, slope, _ = symbolic.evaluate(self.first, z, phases[:, None])
        return np.asarray(np.linalg.solve(slope, F)[:, :, 0])

    def slopes(self, phases: Array, z: Array) -> Array:
        """dF/dz (N, k, k) at N phases, z (N, k)."""
        return symbolic.evaluate(self.first, z, phases[:, None])[1]

    def rates(self, phases: Array, z: Array) -> tuple[Array, Array]:
        """dz/dphase and d2z/dphase2 of solutions z (N, k), by the implicit function's derivatives."""
        at = phases[:, None]
        _, slope, along = symbolic.evaluate(self.first, z, at)
        rate = -np.linalg.solve(slope, along)[:, :, 0]
        (rest,) = symbolic.evaluate(self.second, z, rate, at)
        return rate, -np.linalg.solve(slope, rest)[:, :, 0]


def make_tip_equations(arm: Manipulator, path: PosePath, follow: Sequence[str], posture: Array) -> TipEquations:
    """The equations of an arm whose elastic coordinates are at rest; posture q_0 (joints,).

    Raises: MotionError when the path does not fit the arm.
    """
    arm = arm.near
    q, loops = ca.SX.sym("q", arm.joints), arm.loops
    tip, rotation = (arm.points, arm.rotation) if loops is None else (loops.tip, loops.rotation)
    if tip is None:
        raise MotionError("a tip path needs to know where the tip is", got="an arm without points")
    v = ca.SX(0, 1) if loops is None else loops.v
    s, p = ca.densify(arm.reference @ q), arm.parameters
    place = tip[:, -1]
    led = ["xyz".index(axis) for axis in choose_components(follow, place, path)]
    c = [place[k] - path.position[k] for k in led]
    turned, flip = compare_rotations(rotation, path, int(place.numel()))
    tips = len(c)
    c = ca.vertcat(*c, turned, *([] if loops is None else [loops.gap]))
    c, flip = ca.substitute([c, flip], [arm.s, p.symbols], [s, ca.DM(p.values)])
    y = ca.vertcat(q, v)
    if c.numel() > y.numel():
        asked = c.numel() - v.numel()
        raise MotionError(
            "the path asks for more than the joints can do",
            got=f"{asked} components of the tip",
            expected=f"at most {arm.joints}, one for each driven joint",
            todo="name fewer components in follow, or leave rpy out",
        )
    z, F = y, c
    if c.numel() < y.numel():
        multipliers = ca.SX.sym("l", c.numel())
        drawn = ca.vertcat(q - ca.DM(posture), ca.SX(v.numel(), 1)) - ca.jtimes(c, y, multipliers, True)
        z, F = ca.vertcat(y, multipliers), ca.vertcat(drawn, c)
    return TipEquations(z, path.phase, ca.densify(F), ca.densify(c), flip, arm.joints, tips)


def choose_components(follow: Sequence[str], place: ca.SX, path: PosePath) -> list[str]:
    """The components of the position that are led. Raises: MotionError for a path that leaves the plane of an arm that cannot."""
    if len(set(follow)) != len(follow):
        raise MotionError("motion.follow names a component twice", got=", ".join(follow))
    if place.numel() == 3:
        return list(follow)
    if not path.position[2].is_zero():
        raise MotionError("the path leaves the arm's plane", got="a z that is not 0", expected="z = 0 all along")
    return [axis for axis in follow if axis != "z"]


def compare_rotations(rotation: ca.SX | None, path: PosePath, dimensions: int) -> tuple[ca.SX, ca.SX]:
    """The orientation's equations, the sines of what is between tip and path, and a cosine; none where the orientation is free."""
    if path.rotation is None:
        return ca.SX(0, 1), ca.SX(1)
    if rotation is None:
        raise MotionError("a path with rpy needs to know how the tip is turned", got="an arm without a rotation")
    E = path.rotation.T @ rotation
    if dimensions == 2:
        upright = ca.evalf(ca.substitute(path.rotation[2, 2], path.phase, 0.3))
        if not path.rotation[2, :2].is_zero() and abs(float(upright) - 1) > 1e-12:
            raise MotionError(
                "the path turns the tip out of the arm's plane", got="roll or pitch", expected="yaw alone"
            )
        return (E[1, 0] - E[0, 1]) / 2, (E[0, 0] + E[1, 1]) / 2
    sines = ca.vertcat(E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]) / 2
    return sines, (ca.trace(E) - 1) / 2


PHASES = 64
CLOSURE_WEIGHT = 1e3
"""Weight of the loops' closure, which must hold, against the tip's distance."""


def refuse_unreachable(equations: TipEquations, start: Array, period: float, at: float | None = None) -> None:
    """Raise with time and distance where the tip cannot reach the path, as far as a search from `start` finds; `at`: phase where it ends.

    The distance is that of the led components of the position; a path whose orientation alone cannot be reached is not this.
    """
    begun, y = 0.0 if at is None else at, start[: equations.coordinates]
    phases, distances, nearest = begun + np.arange(PHASES + 1) / PHASES, list[float](), list[Array]()
    for phase in phases:
        distance, y = find_distance(equations, start, y, float(phase))
        distances.append(distance)
        nearest.append(y)
    size = max(float(np.abs(equations.task(start, 0.0)[1].full()[: equations.tips]).max()), 1e-300)
    k = int(np.argmax(distances))
    if distances[k] <= CUBE_ROOT_EPS * size:
        return
    where, least = find_lowest(
        lambda phase: -find_distance(equations, start, nearest[k], phase)[0],
        phases[k] - 1 / PHASES,
        phases[k] + 1 / PHASES,
    )
    raise MotionError(
        "the path leaves the arm's reach",
        got=f"out of reach from t = {begun * period:.6g} s on, by {-least:.4g} m at t = {where % 1.0 * period:.6g} s",
        todo="move the path nearer, or give another posture",
    )


def find_distance(equations: TipEquations, start: Array, y: Array, phase: float) -> tuple[float, Array]:
    """The least distance of the tip from the path's point near coordinates y, and the coordinates there."""
    from scipy.optimize import least_squares

    n, rest = equations.coordinates, start[equations.coordinates :]
    weights = np.ones(equations.c.numel())
    weights[equations.tips :] = CLOSURE_WEIGHT if equations.joints < n else 1.0

    def miss(y: Array) -> Array:
        return np.asarray(weights * equations.task(np.append(y, rest), phase % 1.0)[0].full()[:, 0])

    def slope(y: Array) -> Array:
        return np.asarray(weights[:, None] * equations.task(np.append(y, rest), phase % 1.0)[1].full())

    best = least_squares(miss, y, slope, xtol=1e-12, ftol=1e-12, gtol=1e-12)
    return float(np.linalg.norm(best.fun[: equations.tips])), best.x
