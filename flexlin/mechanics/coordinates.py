"""The coordinates of a manipulator: what each one is, and the symbols of a chain's; scene numbers that stay free, as symbols too."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Literal, TypeVar

import casadi as ca
import numpy as np
from pydantic import BaseModel

from flexlin.checks import Array
from flexlin.context import holding
from flexlin.scene.links import Direction, Link
from flexlin.scene.parameters import PARAMETERS, get_value, need_numbers, path_in, replace_value
from flexlin.summary import immutable
from flexlin.symbolic import Expressions

AnyTable = TypeVar("AnyTable", bound=BaseModel)


@immutable(eq=False)
class Parameters(Expressions):
    """The free parameters of a manipulator, p of shape (n_p, 1)."""

    paths: tuple[str, ...] = ()
    symbols: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    values: Array = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of_scene(cls, scene: BaseModel, paths: Iterable[str]) -> "Parameters":
        """Make a symbol for each dotted path of the scene.

        Raises: ArgumentError when a path does not lead to a number of the scene.
        """
        paths = tuple(path_in(scene, path) for path in paths)
        values = [get_value(scene, path) for path in paths]
        whole = {path for path, value in zip(paths, values, strict=True) if type(value) is int}
        need_numbers(scene, (path for path in paths if not (path in whole and path.startswith(f"{PARAMETERS}."))))
        symbols = [ca.SX.sym(path) for path in paths]
        return cls(paths, ca.vertcat(*symbols) if symbols else ca.SX(0, 1), np.array(values, dtype=float))

    def placed_in(self, table: AnyTable, prefix: str = "") -> AnyTable:
        """The table with the symbols in the place of their numbers; `prefix` names where in the scene the table stands."""
        for i, path in enumerate(self.paths):
            if path.startswith(prefix):
                table = replace_value(table, path.removeprefix(prefix), self.symbols[i])
        return table


_given: ContextVar[Parameters | None] = ContextVar("given", default=None)


def given_to_model(parameters: Parameters) -> AbstractContextManager[None]:
    """Within the block, equations that are made without a list of parameters hold these."""
    return holding(_given, parameters)


def parameters_at_hand(parameters: Parameters | None = None) -> Parameters:
    """The parameters that are named; else those given to the model that is being built; else none."""
    return parameters or _given.get() or Parameters()


Kind = Literal["joint", "elastic", "motor"]
NAMES: dict[Direction, tuple[str, str]] = {"y": ("w", "m"), "z": ("wz", "m"), "torsion": ("phi", "rad")}
"""Letter and unit of a link's elastic coordinates."""


@dataclass(frozen=True)
class Coordinate:
    """What one coordinate is.

    kind: a joint's displacement, an elastic one, or that of a motor behind a flexible joint; name: such as q1 or w12;
    unit: rad or m; link: number of its link or joint from 0, None where the model has no links; mode: number from 0 of the link's mode;
    direction: y, z or torsion for a mode of a link; joint: what the robot calls a joint.
    """

    kind: Kind
    name: str
    unit: str
    link: int | None = None
    mode: int | None = None
    direction: Direction | None = field(default=None, compare=False)
    joint: str = field(default="", compare=False)

    @property
    def title(self) -> str:
        """The name, with the robot's own word for the joint: q1 (shoulder)."""
        return f"{self.name} ({self.joint})" if self.joint else self.name


def list_coordinates(
    links: Sequence[Link], units: Mapping[int, str], free_motors: Sequence[int], free_bearings: Sequence[int] = ()
) -> tuple[Coordinate, ...]:
    """Describe the coordinates of a chain: the modes of each link; the unit of the joint before each link that moves; bearings, motors."""
    joints = [Coordinate("joint", f"q{i + 1}", unit, i, joint=links[i].name) for i, unit in units.items()]
    elastic = [
        Coordinate("elastic", f"{letter}{i + 1}{'' if count < 10 else '_'}{k + 1}", unit, i, k, direction=direction)
        for i, link in enumerate(links)
        for direction, count in link.counts.by_direction().items()
        for letter, unit in (NAMES[direction],)
        for k in range(count)
    ]
    bearings = [Coordinate("elastic", f"beta{i + 1}{k + 1}", units[i], i) for i in free_bearings for k in range(2)]
    motors = [Coordinate("motor", f"theta{i + 1}", units[i], i) for i in free_motors]
    return (*joints, *elastic, *bearings, *motors)


@dataclass(frozen=True, eq=False)
class Symbols:
    """The symbols s = [q; w; beta; theta] of a chain: q of each joint, w of each link's modes, beta of the bearing before each link, (2, 1)
    or (0, 1), theta of motors, `free` those of which links."""

    q: ca.SX
    modes: tuple[ca.SX, ...]
    bearings: tuple[ca.SX, ...]
    motors: ca.SX
    free: tuple[int, ...] = ()

    @classmethod
    def of(cls, coordinates: Sequence[Coordinate], links: int, mark: str = "") -> "Symbols":
        """Make a symbol for each coordinate; `mark` goes before each name."""

        def column(kind: Kind, link: int | None = None, of_mode: bool = False) -> ca.SX:
            found = [c for c in coordinates if c.kind == kind and link in (None, c.link)]
            chosen = [c for c in found if (c.mode is not None) == of_mode]
            return ca.vertcat(*[ca.SX.sym(mark + c.name) for c in chosen]) if chosen else ca.SX(0, 1)

        free = tuple(c.link for c in coordinates if c.kind == "motor" and c.link is not None)
        modes, bearings = (tuple(column("elastic", i, of_mode) for i in range(links)) for of_mode in (True, False))
        return cls(column("joint"), modes, bearings, column("motor"), free)

    def with_motors(self, q: ca.SX, moving: Sequence[int]) -> ca.SX:
        """What the motors see: their own coordinates where they are free, elsewhere the joints' q."""
        if not self.free:
            return q
        own = [self.motors[self.free.index(i)] if i in self.free else q[k] for k, i in enumerate(moving)]
        return ca.vertcat(ca.SX(0, 1), *own)

    @property
    def all(self) -> ca.SX:
        """s, (n, 1)."""
        return ca.vertcat(self.q, *self.modes, *self.bearings, self.motors)


@dataclass(frozen=True, eq=False)
class ClosedLoops(Expressions):
    """The joints v(u) (k, 1) that follow from f(u, v) = 0; nan where a loop stays open.

    With symbols v (k, 1) in the place of v(u): f (k, 1), the residual (n, 1), C_1 = D_u v (k, n), the tip's position (2 or 3, 1) and
    the rotation of its axes (3, 3), where these are known.
    """

    followers: ca.SX
    v: ca.SX
    gap: ca.SX
    residual: ca.SX
    slopes: ca.SX
    tip: ca.SX | None = None
    rotation: ca.SX | None = None

    def slope(self, s: ca.SX) -> ca.SX:
        """The residual's Jacobian by s, (n, n), with the symbols v: by the chain rule far shorter than through the steps that find v(u)."""
        return ca.jacobian(self.residual, s) + ca.jacobian(self.residual, self.v) @ self.slopes

    def newton_step(self) -> ca.SX:
        """V^-1 f (k, 1), V = D_v f, by u and the symbols v."""
        return ca.solve(ca.jacobian(self.gap, self.v), self.gap)
