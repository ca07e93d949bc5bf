"""From a scene's design table to a design, whose weights come from the largest deviations that one may have."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from flexlin.arguments import checked
from flexlin.checks import Array, real_array
from flexlin.control.designed_loop import Design
from flexlin.control.lqr import averaged_lqr, finite_horizon_lqr, frozen_lqr, horizon_system, periodic_lqr
from flexlin.control.sampled import find_round, sampled_lqr
from flexlin.control.sensors import joint_angles, tip_position
from flexlin.errors import ArgumentError, counted
from flexlin.linearization.law import INTEGRAL, Controller
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.coefficients import Combined, Constant, combine
from flexlin.periodic.system import MatrixFunction, PeriodicSystem, extend_system
from flexlin.scene.control import RATE, DesignTable, Weights
from flexlin.scene.units import spread

TURNING = ("joint", "motor")
"""Coordinates that `joints` and `rates` speak of."""


@checked
def design(plant: Linearization | PeriodicSystem, table: DesignTable, tol: float = 1e-9) -> Design:
    """Make the design that a table of a scene asks for.

    Where its weights name `integrals`, the integrals of the joints' errors are states behind the arm's (LQI): u = -K(t) [y; y'; z].

    Parameters
    ----------
    plant : Linearization or PeriodicSystem
        The arm without feedback, x = [y; y']; weights in physical sizes need the arm's own linearization.
    table : DesignTable
        One of the scene's `[[designs]]`.
    tol : float
        Wanted relative error of periodic gains.

    Returns
    -------
    Design
        The design, which bears the table's name.

    Raises
    ------
    ArgumentError
        For an unknown kind, or weights that do not fit.

    See Also
    --------
    periodic_lqr, sampled_lqr, frozen_lqr, averaged_lqr, finite_horizon_lqr : What they raise comes through.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> plant = fl.linearize(fl.build_manipulator(scene), scene.motion)
    >>> made = fl.control.design(plant, scene.designs[1], tol=1e-6)
    >>> made.kind, made.error < 1e-6
    ('periodic-lqr', True)
    """
    system, Q, R = pose_design(plant, table)
    if isinstance(plant, PeriodicSystem) or table.weights is None or table.weights.integrals is None:
        return solve_design(system, Q, R, table, tol)
    controller, sizes = joint_integrals(plant, table.weights)
    wide = combine(partial(widen, more=np.diag(sizes**-2.0)), Q)
    return replace(solve_design(extend_system(system, controller.rates), wide, R, table, tol), controller=controller)


def pose_design(
    plant: Linearization | PeriodicSystem, table: DesignTable
) -> tuple[PeriodicSystem, MatrixFunction, MatrixFunction]:
    """The system of a table's design, Q(t) and R(t); raises ArgumentError for what does not fit, before anything is solved."""
    system = plant if isinstance(plant, PeriodicSystem) else system_of(plant, table.kind)
    if table.sample_time is not None:
        find_round(system, table.sample_time, 0.0)
    return system, *design_weights(plant, system, table)


def solve_design(
    system: PeriodicSystem, Q: MatrixFunction, R: MatrixFunction, table: DesignTable, tol: float
) -> Design:
    """The design of a table's kind; raises ArgumentError for an unknown one."""
    if table.sample_time is not None:
        return sampled_lqr(system, Q, R, table.sample_time, tol=tol).named(table.name)
    ways: dict[str, Callable[..., Design]] = {
        "periodic-lqr": partial(periodic_lqr, tol=tol),
        "frozen-lqr": partial(frozen_lqr, phases=table.phases),
        "averaged-lqr": averaged_lqr,
        "finite-horizon-lqr": partial(finite_horizon_lqr, tol=tol),
    }
    if table.kind not in ways:
        raise ArgumentError("there is no such kind of design", got=repr(table.kind), expected=" or ".join(ways))
    return ways[table.kind](system, Q, R, name=table.name)


def system_of(plant: Linearization, kind: str) -> PeriodicSystem:
    """The system that a kind of design is made for; raises ArgumentError for one that needs a period which the motion has not."""
    if plant.motion.periodic:
        return plant.periodic_system()
    if kind != "finite-horizon-lqr":
        raise ArgumentError(
            "a one-way motion has no period to design for",
            got=f'kind = "{kind}"',
            expected='kind = "finite-horizon-lqr"',
            todo="or let the motion go there and back: course = 'there-and-back'",
        )
    return horizon_system(plant)


def design_weights(
    plant: Linearization | PeriodicSystem, system: PeriodicSystem, table: DesignTable
) -> tuple[MatrixFunction, MatrixFunction]:
    """Q(t) and R of a design's table; raises ArgumentError for weights that do not fit the arm."""
    if table.weights is None:
        state, effort = (() if bare is None else bare for bare in (table.state_weight, table.input_weight))
        Q = Constant(diagonal_weight("state_weight", state, system.n, "the states [y; y']"))
        return Q, Constant(diagonal_weight("input_weight", effort, system.m, "the inputs"))
    if isinstance(plant, PeriodicSystem):
        raise ArgumentError(
            "weights in physical sizes need to know the coordinates", got="a PeriodicSystem", expected="a Linearization"
        )
    by_state, R = physical_weights(plant, table.weights)
    return by_state, Constant(R)


def diagonal_weight(name: str, entries: Sequence[float], size: int, what: str) -> Array:
    """Return diag(entries), saying what the entries stand for when their number is wrong."""
    values = real_array(name, entries, (None,))
    if len(values) != size:
        raise ArgumentError(f"{name} has the wrong length", got=len(values), expected=f"{size}: one for each of {what}")
    return np.diag(values)


def weigh_tip(C: Array, fixed: Array, size: float) -> Array:
    """Q = fixed + C' C / d^2 with the tip's map C (N, 2, 2n)."""
    C = C / size
    return fixed + np.swapaxes(C, 1, 2) @ C


def widen(Q: Array, more: Array) -> Array:
    """diag(Q, more): weights of the states of an arm, and of more behind them."""
    n, k = Q.shape[1], len(more)
    out = np.zeros((len(Q), n + k, n + k))
    out[:, :n, :n], out[:, n:, n:] = Q, more
    return out


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
    return Combined(partial(weigh_tip, fixed=fixed, size=float(weights.tip)), (tip_position(lin),), complete=True), R


def joint_integrals(lin: Linearization, weights: Weights) -> tuple[Controller, Array]:
    """The integrals of what the motors' encoders read as states, z' = C [y; y'], and their acceptable sizes (m,).

    Raises: ArgumentError when a size has not the unit of its joint.
    """
    driven = [lin.arm.coordinates[lin.arm.drives[i]] for i in lin.driven]
    units = tuple(f"{coordinate.unit} s" for coordinate in driven)
    sizes = spread("weights.integrals", weights.integrals, units)
    C, m = joint_angles(lin)(np.zeros(1))[0], len(driven)
    names = tuple(coordinate.name + INTEGRAL for coordinate in driven)
    return Controller(np.hstack([C, np.zeros((m, m))]), np.zeros((m, m)), names, units), np.array(sizes)


def state_sizes(lin: Linearization, weights: Weights) -> list[float | None]:
    """The acceptable size of each state of [y; y'], None where nothing is said."""
    own, sizes = weights.coordinates, list[float | None]()
    for mark, per_second, key, turning, bending in (
        ("", "", "joints", weights.joints, weights.deflection),
        (RATE, "/s", "rates", weights.rates, weights.deflection_rates),
    ):
        joints = list(dict.fromkeys(c.link for c in lin.coordinates if c.kind in TURNING))
        each = turning if isinstance(turning, list | tuple) else [turning] * len(joints)
        if len(each) != len(joints):
            got, expected = counted(len(each), "size"), f"{len(joints)}, one a joint"
            raise ArgumentError(f"weights.{key} does not fit the arm", got=got, expected=expected)
        for coordinate in lin.coordinates:
            name = coordinate.name + mark
            if name in own:
                key_of_size, size = name, own[name]
            elif coordinate.kind in TURNING:
                key_of_size, size = key, each[joints.index(coordinate.link)]
            else:
                key_of_size, size = "deflection", bending if coordinate.unit == "m" else None
            sizes += spread(f"weights.{key_of_size}", size, [coordinate.unit + per_second]) or [None]
    names = [name + mark for mark in ("", RATE) for name in lin.names]
    unknown = sorted(set(own) - set(names))
    if unknown:
        expected = f"one of {', '.join([*type(weights).model_fields, *names])}"
        raise ArgumentError("weights: an unknown key", got=unknown[0], expected=expected)
    return sizes
