"""From a scene's design table to a design."""

from typing import Protocol

from flexlin.control.averaged import averaged_lqr
from flexlin.control.designed_loop import Design
from flexlin.control.finite_horizon import finite_horizon_lqr
from flexlin.control.frozen import frozen_lqr
from flexlin.control.periodic import periodic_lqr
from flexlin.control.weights import diagonal_weight
from flexlin.errors import ArgumentError
from flexlin.periodic.system import PeriodicSystem


class DesignTable(Protocol):
    """What a scene says about a design: weights are the diagonals of Q (state [y; y']) and R."""

    @property
    def name(self) -> str: ...
    @property
    def kind(self) -> str: ...
    @property
    def state_weight(self) -> tuple[float, ...]: ...
    @property
    def input_weight(self) -> tuple[float, ...]: ...
    @property
    def phases(self) -> int: ...


def design(system: PeriodicSystem, table: DesignTable, tol: float = 1e-9) -> Design:
    """Make the design that a scene's table asks for.

    Parameters: system: the plant without feedback, x = [y; y']; tol: wished relative error of periodic gains.
    Returns: a design bearing the table's name.
    Raises: ArgumentError for an unknown kind or weights that do not fit; what the design itself raises.
    """
    Q = diagonal_weight("state_weight", table.state_weight, system.n, "the states [y; y']")
    R = diagonal_weight("input_weight", table.input_weight, system.m, "the inputs")
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
