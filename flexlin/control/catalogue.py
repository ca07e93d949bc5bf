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
    """Make the design that a table of a scene asks for.

    Parameters
    ----------
    system : PeriodicSystem
        The plant without feedback, x = [y; y'].
    table : DesignTable
        One of the scene's `[[designs]]`; its weights are the diagonals of Q and R.
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
    periodic_lqr, frozen_lqr, averaged_lqr, finite_horizon_lqr : What they raise comes through.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> plant = fl.linearize(fl.build_manipulator(scene), scene.motion).periodic_system()
    >>> made = fl.control.design(plant, scene.designs[0], tol=1e-6)
    >>> made.kind, made.error < 1e-6
    ('frozen-lqr', True)
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
