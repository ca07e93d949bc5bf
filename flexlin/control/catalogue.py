"""From a scene's design table to a design."""

from dataclasses import replace
from functools import partial
from typing import Protocol

import numpy as np

from flexlin.about.linearization import Linearization
from flexlin.arguments import checked
from flexlin.control.designed_loop import Design
from flexlin.control.finite_horizon import finite_horizon_lqr, horizon_system
from flexlin.control.frozen import averaged_lqr, frozen_lqr
from flexlin.control.periodic import periodic_lqr
from flexlin.control.sampled import sampled_lqr
from flexlin.control.weights import diagonal_weight, joint_integrals, physical_weights, widen
from flexlin.errors import ArgumentError
from flexlin.periodic.coefficients import Constant, combine
from flexlin.periodic.related import extend_system
from flexlin.periodic.system import MatrixFunction, PeriodicSystem
from flexlin.scene.control import Weights


class DesignTable(Protocol):
    """What a scene says about a design: weights in physical sizes, or the diagonals of Q (state [y; y']) and R."""

    @property
    def name(self) -> str: ...
    @property
    def kind(self) -> str: ...
    @property
    def weights(self) -> Weights | None: ...
    @property
    def state_weight(self) -> tuple[float, ...] | None: ...
    @property
    def input_weight(self) -> tuple[float, ...] | None: ...
    @property
    def phases(self) -> int: ...
    @property
    def sample_time(self) -> float | None: ...


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
    system = plant if isinstance(plant, PeriodicSystem) else system_of(plant, table.kind)
    Q, R = design_weights(plant, system, table)
    if isinstance(plant, PeriodicSystem) or table.weights is None or table.weights.integrals is None:
        return solve_design(system, Q, R, table, tol)
    controller, sizes = joint_integrals(plant, table.weights)
    wide = combine(partial(widen, more=np.diag(sizes**-2.0)), Q)
    return replace(solve_design(extend_system(system, controller.rates), wide, R, table, tol), controller=controller)


def solve_design(
    system: PeriodicSystem, Q: MatrixFunction, R: MatrixFunction, table: DesignTable, tol: float
) -> Design:
    """The design of a table's kind; raises ArgumentError for an unknown one."""
    if table.sample_time is not None:
        return sampled_lqr(system, Q, R, table.sample_time, tol=tol).named(table.name)
    if table.kind == "periodic-lqr":
        return periodic_lqr(system, Q, R, tol=tol, name=table.name)
    if table.kind == "frozen-lqr":
        return frozen_lqr(system, Q, R, phases=table.phases, name=table.name)
    if table.kind == "averaged-lqr":
        return averaged_lqr(system, Q, R, name=table.name)
    if table.kind == "finite-horizon-lqr":
        return finite_horizon_lqr(system, Q, R, tol=tol, name=table.name)
    raise ArgumentError(
        "there is no such kind of design",
        got=repr(table.kind),
        expected="periodic-lqr, frozen-lqr, averaged-lqr or finite-horizon-lqr",
    )


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
