"""What a loop asks of the drives: torque, speed, power and current along a motion, against what the drives can give."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexlin.arguments import checked
from flexlin.checks import Array
from flexlin.linearization.law import Law
from flexlin.linearization.linearization import Linearization
from flexlin.mechanics.effects import effects_of
from flexlin.scene.control import Drives
from flexlin.scene.units import spread
from flexlin.summary import immutable

UNITS = {"N": ("N", "m/s", "N/A"), "N m": ("N m", "rad/s", "N m/A")}
"""Units of a joint's torque, speed and torque constant by that of its torque."""


@dataclass(frozen=True)
class Demand:
    """One figure of a loop: what it is, of which joint, its value and its limit (None where there is none), both in `unit`."""

    what: str
    joint: str
    value: float
    limit: float | None
    unit: str

    @property
    def exceeds(self) -> bool:
        """Whether the drive cannot give this."""
        return self.limit is not None and not self.value <= self.limit


@immutable
class DriveLoad:
    """What a loop asks of the drives along a motion.

    Attributes
    ----------
    joints : tuple of str
        Names of the m driven coordinates.
    torque, speed, power : array, shape (N, m)
        At the joints, in N m, rad/s and W (N and m/s where they slide).
    current : array, shape (N, m), or None
        Of the motors, in A, where the torque constants are known.
    demands : tuple of Demand
        The largest and the root mean square values over the motion, with the limits.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link", {"drives": {"torque": {"peak": "0.4 N m"}}})
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> t = np.array([0.0, 0.5, 1.0, 1.5])
    >>> load = fl.control.drive_load(lin, t, lin.law.reference(t), lin.law, scene.drives)
    >>> [(demand.what, round(demand.value, 2), demand.limit) for demand in load.exceeded]
    [('peak torque', 1.28, 0.4)]
    """

    joints: tuple[str, ...]
    torque: Array
    speed: Array
    power: Array
    current: Array | None
    demands: tuple[Demand, ...]

    @property
    def exceeded(self) -> tuple[Demand, ...]:
        """The demands above their limits, the worst first."""
        over = [demand for demand in self.demands if demand.exceeds]
        return tuple(sorted(over, key=lambda demand: -demand.value / (demand.limit or 1.0)))


@checked
def drive_load(lin: Linearization, t: Array, states: Array, law: Law, drives: Drives | None = None) -> DriveLoad:
    """Find what the drives have to do along a motion of the arm.

        torque = forward(t) - K(t) ([y; y'] - reference(t)),   speed = q_R' + y',   power = torque speed

    Behind a motor the input is its voltage u: current = (u - k N q') / R, torque = k N current.

    Parameters
    ----------
    lin : Linearization
        The arm and its motion, with n coordinates.
    t : array, shape (N,)
        Times in s, equally spaced over whole periods without the end, so that means are means over a period.
    states : array, shape (N, 2n + k)
        Deviations [y; y'] from the rigid motion, and the k states of the law's controller.
    law : Law
        What commands the torque.
    drives : Drives, optional
        The limits.

    Returns
    -------
    DriveLoad
        Torque, speed, power and current, and the figures that limits are held against.

    Raises
    ------
    ArgumentError
        When the limits do not fit the arm.

    Examples
    --------
    The rigid motion's own torque, of an arm that does not deviate from it:

    >>> import numpy as np
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    >>> load = fl.control.drive_load(lin, np.arange(0.0, 2.0, 0.1), np.zeros((20, 6)), lin.law)
    >>> bool(np.allclose(load.torque, lin.feedforward(np.arange(0.0, 2.0, 0.1))))
    True
    """
    t = np.asarray(t, dtype=float)
    command, n = law.torque(t, states), lin.n
    speed = lin.about.positions(t, states[:, :n], states[:, n : 2 * n])[1][:, [lin.arm.drives[i] for i in lin.driven]]
    torque, current = torque_and_current(lin, command, speed, drives)
    units = [UNITS["N" if lin.arm.coordinates[lin.arm.drives[i]].unit == "m" else "N m"] for i in lin.driven]
    demands = list_demands(lin.inputs, units, torque, speed, current, drives or Drives())
    return DriveLoad(lin.inputs, torque, speed, torque * speed, current, tuple(demands))


def torque_and_current(
    lin: Linearization, command: Array, speed: Array, drives: Drives | None
) -> tuple[Array, Array | None]:
    """The torques at the joints (N, m), and the motors' currents where they are known."""
    tables = lin.arm.effects
    motor: Any = None if tables is None else next((e for e in effects_of(tables) if e.input_unit == "V"), None)
    if motor is not None:
        given = motor.resistance
        resistance = np.array([float(given[i] if isinstance(given, tuple) else given) for i in lin.driven])
        constant = np.array([float(motor.input_gain(i)) for i in lin.driven]) * resistance
        current = (command - constant * speed) / resistance
        return constant * current, current
    units = [UNITS["N" if unit == "N" else "N m"][2] for unit in lin.input_units]
    known = None if drives is None else spread("drives.torque_constant", drives.torque_constant, units)
    return command, None if known is None else command / np.array(known)


def list_demands(
    joints: tuple[str, ...],
    units: list[tuple[str, str, str]],
    torque: Array,
    speed: Array,
    current: Array | None,
    drives: Drives,
) -> list[Demand]:
    """Every figure of every joint, with its limit if there is one."""
    moment, rate, amperes, watts = [u[0] for u in units], [u[1] for u in units], ["A"] * len(units), ["W"] * len(units)
    rows: list[tuple[str, Array | None, Any, str, list[str]]] = [
        ("peak torque", torque, drives.torque.peak, "torque.peak", moment),
        ("RMS torque", torque, drives.torque.continuous, "torque.continuous", moment),
        ("peak speed", speed, drives.speed, "speed", rate),
        ("peak power", torque * speed, drives.power, "power", watts),
        ("peak current", current, drives.current.peak, "current.peak", amperes),
        ("RMS current", current, drives.current.continuous, "current.continuous", amperes),
    ]
    found = []
    for what, values, wanted, key, of in rows:
        if values is not None:
            size = np.abs(values).max(axis=0) if what.startswith("peak") else np.sqrt((values**2).mean(axis=0))
            limits: Sequence[float | None] = spread(f"drives.{key}", wanted, of) or (None,) * len(joints)
            found += [Demand(what, *one) for one in zip(joints, size.tolist(), limits, of, strict=True)]
    return found
