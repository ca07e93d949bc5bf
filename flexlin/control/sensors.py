"""The sensors and the noise of a scene's estimator, and the filter made of them."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.control.estimator import Estimator, kalman_filter
from flexlin.control.measurement import bending, joint_angles, joint_rates, tip_position
from flexlin.errors import ArgumentError
from flexlin.periodic.coefficients import Combined, MatrixFunction
from flexlin.scene.control import EstimatorTable
from flexlin.scene.scene import Scene
from flexlin.scene.units import spread
from flexlin.summary import represent


def stack(*parts: Array) -> Array:
    """The rows of several measurements, (N, p, 2n)."""
    return np.concatenate(parts, axis=1)


def excite(B: Array, S: Array) -> Array:
    """B S B', (N, 2n, 2n)."""
    return B @ S @ np.swapaxes(B, 1, 2)


@dataclass(frozen=True, eq=False)
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

    __repr__ = represent

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
    parts, sizes, names = list[MatrixFunction](), list[float](), list[str]()
    for what, value, units, rows in (
        ("encoder", table.encoders, angles, joint_angles),
        ("gyroscope", table.gyroscopes, rates, joint_rates),
    ):
        noise = spread(f"estimator.{what}s", value, units)
        if noise is not None:
            parts.append(rows(lin))
            sizes += noise
            names += [f"{what} of {name} in {unit}" for name, unit in zip(lin.inputs, units, strict=True)]
    for gauge in table.strain:
        parts.append(bending(scene, lin, gauge.link - 1, gauge.at))
        sizes.append(gauge.noise)
        names.append(f"curvature of link {gauge.link} at {gauge.at:g} in 1/m")
    if table.tip is not None:
        seen = tip_position(lin)
        axes = seen(np.zeros(1)).shape[1]
        parts.append(seen)
        sizes += [table.tip] * axes
        names += [f"tip {axis} in m" for axis in "xyz"[:axes]]
    torque = np.array(spread("estimator.torque", table.torque, lin.input_units))
    V = np.diag(np.array(sizes) ** 2) * table.sample_time
    W = Combined(partial(excite, S=np.diag(torque**2) * table.sample_time), (lin.input_matrix,), complete=True)
    return Sensors(Combined(stack, tuple(parts), complete=True), V, W, tuple(names))
