"""Sensors of an arm: what each reads of s, s' and s'', for logs, and of the state [y; y'], with noise and filter, for estimators."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np

from flexlin.arguments import checked
from flexlin.checks import Array
from flexlin.control.estimator import Estimator, kalman_filter
from flexlin.errors import ArgumentError
from flexlin.linearization.linearization import Linearization
from flexlin.mechanics.link_shapes import make_shapes
from flexlin.mechanics.manipulator import Manipulator
from flexlin.periodic.coefficients import Combined, Constant, MatrixFunction, solve_mass
from flexlin.periodic.zeros import InvariantZeros, invariant_zeros
from flexlin.scene.control import EstimatorTable
from flexlin.scene.scene import Scene
from flexlin.scene.units import spread
from flexlin.summary import immutable


def read_encoders(arm: Manipulator, *_: object) -> ca.SX:
    """The motors' encoders, one a joint, in rad or m."""
    return arm.encoders @ arm.s


def read_gyroscopes(arm: Manipulator, *_: object) -> ca.SX:
    """The rates at the motors, one a joint, in rad/s or m/s."""
    return arm.encoders @ arm.s_dot


def read_strain(arm: Manipulator, scene: Scene, link: int | None, at: float) -> ca.SX:
    """The curvature of a link at a place, w'' = sum_k X_k''(x / l) / l^2 w_k, in 1/m."""
    own = [k for k, c in enumerate(arm.coordinates) if (c.kind, c.link, c.direction) == ("elastic", link, "y")]
    if link is None or not own:
        raise ArgumentError(
            "there is no flexible link of that number", got=link, expected=f"0 to {len(scene.links) - 1}"
        )
    if not 0 <= at <= 1:
        raise ArgumentError("the place is not on the link", got=at, expected="0 (joint) to 1 (tip)")
    shapes = make_shapes(scene, link).values(np.array([at]), 2)[:, 0]
    return ca.dot(ca.DM(shapes), arm.s[own]) / arm.parameters.placed_in(scene).links[link].length ** 2


def read_tip(arm: Manipulator, *_: object) -> ca.SX:
    """The tip's place in world axes, in m."""
    return points_of(arm)[:, -1]


def read_tip_acceleration(arm: Manipulator, *_: object) -> ca.SX:
    """The tip's acceleration in world axes, in m/s^2."""
    rate = ca.jtimes(read_tip(arm), arm.s, arm.s_dot)
    return ca.jtimes(rate, arm.s, arm.s_dot) + ca.jtimes(rate, arm.s_dot, arm.s_ddot)


READINGS: dict[str, Callable[..., ca.SX]] = {
    "encoder": read_encoders,
    "gyroscope": read_gyroscopes,
    "strain": read_strain,
    "tip": read_tip,
    "tip-acceleration": read_tip_acceleration,
}
"""Of (arm, scene, link or joint, place on the link): what each kind of sensor reads, a column of expressions of s, s' and s''."""


@checked
def joint_angles(lin: Linearization) -> MatrixFunction:
    """Return what the motors' encoders read.

    Parameters
    ----------
    lin : Linearization
        With n coordinates and m driven joints.

    Returns
    -------
    function of times (N,) -> (N, m, 2n)
        C of the angles in rad (m for sliding joints), constant.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    >>> lin.names
    ('q1', 'w11', 'w12')
    >>> fl.control.joint_angles(lin)(np.zeros(1)).round(6).tolist()
    [[[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]]]
    """
    return linearize_reading(lin, read_encoders(lin.arm.near)[list(lin.driven)])


@checked
def joint_rates(lin: Linearization) -> MatrixFunction:
    """Return what the motors' tachometers read.

    Parameters
    ----------
    lin : Linearization
        With n coordinates and m driven joints.

    Returns
    -------
    function of times (N,) -> (N, m, 2n)
        C of the rates in rad/s (m/s for sliding joints), constant.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    >>> fl.control.joint_rates(lin)(np.zeros(1))[0, :, 3:].round(6).tolist()
    [[1.0, 0.0, 0.0]]
    """
    return linearize_reading(lin, read_gyroscopes(lin.arm.near)[list(lin.driven)])


@checked
def bending(scene: Scene, lin: Linearization, link: int, at: float) -> MatrixFunction:
    """Return what a strain gauge sees: the curvature of a link at a point.

        w''(x) = sum_k X_k''(x / l) / l^2 w_k

    The curvature times half the thickness of the link is the strain.

    Parameters
    ----------
    scene : Scene
        The scene, for the mode shapes of its links.
    lin : Linearization
        Made of that scene, with n coordinates.
    link : int
        Number of the link, from 0.
    at : float
        Place x / l on it, from 0 (joint) to 1 (tip).

    Returns
    -------
    function of times (N,) -> (N, 1, 2n)
        C of the curvature in 1/m, constant.

    Raises
    ------
    ArgumentError
        When the link is rigid or the place is not on it.

    Examples
    --------
    The first mode of a clamped beam bends most at its root, and not at its free end:

    >>> import numpy as np
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    >>> root, tip = (fl.control.bending(scene, lin, 0, at)(np.zeros(1))[0, 0, 1] for at in (0.0, 1.0))
    >>> print(f"{root:.4f} {abs(tip):.4f}")
    7.6302 0.0000
    """
    return linearize_reading(lin, read_strain(lin.arm.near, scene, link, at))


@checked
def tip_position(lin: Linearization) -> MatrixFunction:
    """Return what a camera sees of the tip beside its rigid path.

    Parameters
    ----------
    lin : Linearization
        With n coordinates, of a manipulator that says where its tip is.

    Returns
    -------
    function of times (N,) -> (N, 2, 2n)
        C(t) of the tip's displacement in world axes, in m.

    Raises
    ------
    ArgumentError
        When the manipulator gives no points.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    >>> C = fl.control.tip_position(lin)(np.zeros(1))[0]
    >>> print(f"{np.linalg.norm(C[:, 0]):.2f} m per rad of the joint")
    0.96 m per rad of the joint
    """
    return linearize_reading(lin, read_tip(lin.arm.near))


@checked
def tip_acceleration(lin: Linearization) -> tuple[MatrixFunction, MatrixFunction]:
    """Return what an accelerometer in world axes sees beside the rigid motion.

        a = J y'' + (dp''/ds') y' + (dp''/ds) y,   y'' = M^-1 (B u - D_L y' - K_L y)

    An estimator subtracts D u, which is known, and uses C.

    Parameters
    ----------
    lin : Linearization
        With n coordinates and m inputs, of a manipulator that says where its tip is.

    Returns
    -------
    C : function of times (N,) -> (N, 2, 2n)
        The states' share of the acceleration, in m/s^2.
    D : function of times (N,) -> (N, 2, m)
        The torque's share, in m/s^2 per N m.

    Raises
    ------
    ArgumentError
        When the manipulator gives no points.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    >>> C, D = fl.control.tip_acceleration(lin)
    >>> C(np.zeros(1)).shape, D(np.zeros(1)).shape
    ((1, 2, 6), (1, 2, 1))
    """
    found = ReadingSlopes.of(lin, read_tip_acceleration(lin.arm.near))
    return found, found.by_torque


def tip_zeros(lin: Linearization, tol: float = 1e-9) -> InvariantZeros:
    """The invariant zeros from the motors to the tip's displacement along what they move.

    Where one grows, no controller holds the tip on its path but by an arm that swings ever more.
    Raises: ArgumentError where the tip is not known; NumericalError where motors move it in too few directions.
    """
    joints = [lin.kept.index(joint) for joint in lin.driven]
    output = Combined(partial(along_motors, joints=joints), (tip_position(lin),), complete=True)
    return invariant_zeros(lin.periodic_system(), output, tol=tol)


def along_motors(C: Array, joints: list[int]) -> Array:
    """J' C of the tip's position C: its displacement along what each driven joint moves, as many outputs as inputs (N, m, 2n)."""
    return np.swapaxes(C[:, :, joints], 1, 2) @ C


def encoder_rows(lin: Linearization) -> Array:
    """The encoders' readings of y, (m, n)."""
    return ca.DM(ca.densify(lin.arm.encoders[list(lin.driven), list(lin.kept)])).full()


@dataclass(frozen=True, eq=False)
class ReadingSlopes:
    """C(t) (N, p, 2n) of a reading r: how it changes with [y; y'] along the rigid motion, y'' as the linear equations have it.

    `function`: dr/ds, dr/ds' and, of one that feels accelerations, dr/ds''.
    """

    lin: Linearization
    function: ca.Function

    @classmethod
    def of(cls, lin: Linearization, reading: ca.SX) -> "ReadingSlopes":
        """Of a reading of the arm of the near equations."""
        about = lin.about.near
        by = [about.arm.s, about.arm.s_dot]
        if ca.depends_on(reading, about.arm.s_ddot):
            by.append(about.arm.s_ddot)
        slopes = [ca.jacobian(reading, one)[:, list(about.kept)] for one in by]
        *_, angles = about.symbols()
        return cls(lin, about.function(angles, {}, dict(zip("KDM", about.lift(slopes, angles), strict=False))))

    @property
    def complete(self) -> bool:
        """Whether it is as narrow as the motion at the most, and this says where."""
        places = self.function.n_out() == 2 and self.lin.arm.near.loops is None
        return places and self.lin.motion.complete

    def __call__(self, t: Array) -> Array:
        by_y, by_rate, *J = self.lin.about.evaluate(self.function, t)
        C = np.concatenate([by_y, by_rate], axis=2)
        if not J:
            return C
        M, D, K = self.lin.equations(t)
        return C - J[0] @ solve_mass(M, np.concatenate([K, D], axis=2), t)

    def by_torque(self, t: Array) -> Array:
        """D (N, p, m) of a reading that feels accelerations."""
        *_, J = self.lin.about.evaluate(self.function, t)
        return J @ solve_mass(*self.lin.mass_and_input(t), t)


def linearize_reading(lin: Linearization, reading: ca.SX) -> MatrixFunction:
    """C of a reading of the arm of the near equations; one matrix where nothing in it varies."""
    found, start = ReadingSlopes.of(lin, reading), np.zeros(1)
    varies = any(ca.symvar(one) for one in found.function.call(found.function.sx_in()))
    return found if varies else Constant(found(start)[0])


def points_of(arm: Manipulator) -> ca.SX:
    """The positions (2, k) of joints and tip. Raises: ArgumentError where the arm does not say them."""
    if arm.points is None:
        what, got = "the manipulator does not say where its tip is", "points = None"
        raise ArgumentError(what, got=got, expected="positions (2, k)")
    return arm.points


def excite(B: Array, S: Array) -> Array:
    """B S B', (N, 2n, 2n)."""
    return B @ S @ np.swapaxes(B, 1, 2)


@immutable(eq=False)
class Sensors:
    """What is measured and how well.

    Attributes
    ----------
    C : function of times (N,) -> (N, p, 2n)
        The measurements of the deviation [y; y'].
    V : array, shape (p, p)
        Intensity of their noise.
    W : function of times (N,) -> (N, 2n, 2n)
        Intensity of the noise on x'.
    names : tuple of str
        The p measurements, with their units.

    Examples
    --------
    >>> import flexlin as fl
    >>> from flexlin.scene.control import EstimatorTable
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    >>> table = EstimatorTable.model_validate({"encoders": "0.02 deg", "tip": "1 mm", "torque": "10 mN m"})
    >>> fl.control.scene_sensors(scene, lin, table).names
    ('encoder of q1 in rad', 'tip x in m', 'tip y in m')
    """

    C: MatrixFunction
    V: Array
    W: MatrixFunction
    names: tuple[str, ...]

    def filter(self, lin: Linearization, tol: float = 1e-9) -> Estimator:
        """Return the Kalman filter of these sensors.

        Parameters
        ----------
        lin : Linearization
            The arm without feedback.
        tol : float
            Wanted relative error of the covariance.

        Returns
        -------
        Estimator
            The filter.
        """
        return kalman_filter(lin.periodic_system(), self.C, self.W, self.V, tol)


@checked
def scene_sensors(scene: Scene, lin: Linearization, table: EstimatorTable) -> Sensors:
    """Make the measurements and noises that a design's estimator table speaks of.

        V = diag(sigma^2) sample_time,   W = B diag(sigma_u^2) B' sample_time

    Parameters
    ----------
    scene : Scene
        The scene, for the shapes of its links.
    lin : Linearization
        Of its arm without feedback.
    table : EstimatorTable
        Sensors and noise.

    Returns
    -------
    Sensors
        Measurements, intensities and names.

    Raises
    ------
    ArgumentError
        When a sensor or a unit does not fit the arm.

    Examples
    --------
    >>> import flexlin as fl
    >>> from flexlin.scene.control import EstimatorTable
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    >>> table = EstimatorTable.model_validate({"strain": [{"link": 1, "noise": "0.01 1/m"}], "encoders": 1e-4, "torque": 0.01})
    >>> sensors = fl.control.scene_sensors(scene, lin, table)
    >>> fl.floquet(sensors.filter(lin, tol=1e-6).closed_loop, tol=1e-6).verdict
    'stable'
    """
    if not lin.driven:
        raise ArgumentError("an estimator needs torques", got="no driven joint", expected="at least one")
    angles = ["m" if lin.arm.coordinates[lin.arm.drives[i]].unit == "m" else "rad" for i in lin.driven]
    rates = [f"{unit}/s" for unit in angles]
    arm, parts, sizes, names = lin.arm.near, list[ca.SX](), list[float](), list[str]()
    for what, value, units in (("encoder", table.encoders, angles), ("gyroscope", table.gyroscopes, rates)):
        noise = spread(f"estimator.{what}s", value, units)
        if noise is not None:
            parts.append(READINGS[what](arm)[list(lin.driven)])
            sizes += noise
            names += [f"{what} of {name} in {unit}" for name, unit in zip(lin.inputs, units, strict=True)]
    for gauge in table.strain:
        parts.append(read_strain(arm, scene, gauge.link - 1, gauge.at))
        sizes.append(gauge.noise)
        names.append(f"curvature of link {gauge.link} at {gauge.at:g} in 1/m")
    if table.tip is not None:
        seen = read_tip(arm)
        axes = seen.numel()
        parts.append(seen)
        sizes += [table.tip] * axes
        names += [f"tip {axis} in m" for axis in "xyz"[:axes]]
    torque = np.array(spread("estimator.torque", table.torque, lin.input_units))
    V = np.diag(np.array(sizes) ** 2) * table.sample_time
    W = Combined(partial(excite, S=np.diag(torque**2) * table.sample_time), (lin.input_matrix,), complete=True)
    return Sensors(linearize_reading(lin, ca.vertcat(*parts)), V, W, tuple(names))
