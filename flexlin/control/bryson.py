"""From the largest acceptable deviations to the weights of a linear-quadratic problem (Bryson's rule)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from flexlin.about.compensator import INTEGRAL
from flexlin.about.law import Controller
from flexlin.about.linearization import Linearization
from flexlin.arguments import checked
from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.mechanics.coordinates import Coordinate
from flexlin.periodic.coefficients import Constant, has_nothing_narrow
from flexlin.periodic.system import MatrixFunction
from flexlin.scene.control import RATE, Weights
from flexlin.scene.units import in_si, spread

TURNING = ("joint", "motor")
"""Coordinates that `joints` and `rates` speak of."""


@dataclass(frozen=True, eq=False)
class WeightWithTip:
    """Q(t) = fixed + C(t)' C(t) / d^2 with the tip's map C(t) (N, 2, 2n)."""

    fixed: Array
    tip: MatrixFunction
    size: float

    complete: ClassVar[bool] = True

    def __call__(self, t: Array) -> Array:
        C = self.tip(t) / self.size
        return self.fixed + np.swapaxes(C, 1, 2) @ C


@dataclass(frozen=True, eq=False)
class Widened:
    """diag(Q(t), more): weights of the states of an arm, and of more behind them."""

    weight: MatrixFunction
    more: Array

    def __call__(self, t: Array) -> Array:
        Q, k = self.weight(t), len(self.more)
        out = np.zeros((len(t), Q.shape[1] + k, Q.shape[1] + k))
        out[:, : Q.shape[1], : Q.shape[1]], out[:, Q.shape[1] :, Q.shape[1] :] = Q, self.more
        return out

    @property
    def complete(self) -> bool:
        return has_nothing_narrow(self.weight)


@checked
def physical_weights(lin: Linearization, weights: Weights) -> tuple[MatrixFunction, Array]:
    """Make the weights Q(t) and R of deviations that are all as bad as each other.

        Q(t) = diag(1 / d_i^2) + C_tip(t)' C_tip(t) / d_tip^2,   R = diag(1 / d_u^2)

    C_tip(t) is the slope of the tip's position along the rigid motion. So Q grows with the number of modes, and the sizes stay.

    Parameters
    ----------
    lin : Linearization
        With n coordinates and m inputs.
    weights : Weights
        The sizes, as a scene's `[[designs]]` gives them.

    Returns
    -------
    Q : function of times (N,) -> (N, 2n, 2n)
        Weight of the states [y; y'], in their inverse squared units.
    R : array, shape (m, m)
        Weight of the inputs, in their inverse squared units.

    Raises
    ------
    ArgumentError
        When a size has not the unit of its coordinate, a name is no coordinate, or the arm has no tip.

    References
    ----------
    Bryson, Ho, Applied Optimal Control (1975), section 5.2.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> from flexlin.scene.control import Weights
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    >>> weights = Weights.model_validate({"joints": 0.1, "w11": "5 mm", "q1_rate": "1 rad/s", "input": "0.5 N m"})
    >>> Q, R = fl.control.physical_weights(lin, weights)
    >>> Q(np.zeros(1))[0].diagonal().round(6).tolist(), R.tolist()
    ([100.0, 40000.0, 0.0, 1.0, 0.0, 0.0], [[4.0]])
    """
    fixed = np.diag([0.0 if size is None else size**-2.0 for size in state_sizes(lin, weights)])
    R = np.diag([size**-2.0 for size in spread("weights.input", weights.input, lin.input_units) or ()])
    if weights.tip is None:
        return Constant(fixed), R
    from flexlin.control.measurement import tip_position

    return WeightWithTip(fixed, tip_position(lin), float(weights.tip)), R


def joint_integrals(lin: Linearization, weights: Weights) -> tuple[Controller, Array]:
    """The integrals of what the motors' encoders read as states, z' = C [y; y'], and their acceptable sizes (m,).

    Raises: ArgumentError when a size has not the unit of its joint.
    """
    from flexlin.control.measurement import joint_angles

    driven = [lin.arm.coordinates[lin.arm.drives[i]] for i in lin.driven]
    units = tuple(f"{coordinate.unit} s" for coordinate in driven)
    sizes = spread("weights.integrals", weights.integrals, units)
    C, m = joint_angles(lin)(np.zeros(1))[0], len(driven)
    names = tuple(coordinate.name + INTEGRAL for coordinate in driven)
    return Controller(np.hstack([C, np.zeros((m, m))]), np.zeros((m, m)), names, units), np.array(sizes)


def state_sizes(lin: Linearization, weights: Weights) -> list[float | None]:
    """The acceptable size of each state of [y; y'], None where nothing is said."""
    own, used = weights.coordinates, set[str]()
    sizes: list[float | None] = []
    for mark, per_second, turning, bending in (
        ("", "", weights.joints, weights.deflection),
        (RATE, "/s", weights.rates, weights.deflection_rates),
    ):
        group = "rates" if mark else "joints"
        for coordinate in lin.coordinates:
            name, unit = coordinate.name + mark, coordinate.unit + per_second
            if name in own:
                used.add(name)
                sizes.append(size_in(name, own[name], unit))
            elif coordinate.kind in TURNING:
                sizes.append(size_in(group, of_joint(lin, group, turning, coordinate), unit))
            else:
                sizes.append(bending if coordinate.unit == "m" else None)
    unknown = sorted(set(own) - used)
    if unknown:
        names = [name + mark for mark in ("", RATE) for name in lin.names]
        expected = f"one of {', '.join([*type(weights).model_fields, *names])}"
        raise ArgumentError("weights: an unknown key", got=unknown[0], expected=expected)
    return sizes


def of_joint(lin: Linearization, key: str, value: Any, coordinate: Coordinate) -> Any:
    """The part of a size that belongs to a joint: the size itself, or its entry of a list over the joints."""
    if not isinstance(value, Sequence) or isinstance(value, str):
        return value
    joints = list(dict.fromkeys(c.link for c in lin.coordinates if c.kind in TURNING))
    if len(value) != len(joints):
        raise ArgumentError(
            f"weights.{key} does not fit the arm", got=f"{len(value)} sizes", expected=f"{len(joints)}, one a joint"
        )
    return value[joints.index(coordinate.link)]


def size_in(key: str, value: Any, unit: str) -> float | None:
    """A size in SI units; raises ArgumentError when it has another dimension than its coordinate."""
    if value is None:
        return None
    try:
        return in_si(value, unit)
    except ValueError as error:
        raise ArgumentError(
            f"weights.{key} has another unit than the coordinate", got=repr(value), expected=str(error)
        ) from None
