"""Scene parameters left free: symbols in the expressions, each with its dotted path and nominal value."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import TypeVar

import casadi as ca
import numpy as np
from pydantic import BaseModel

from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.expressions import Expressions
from flexlin.scene.parameters import PARAMETERS, get_value, path_in, replace_value
from flexlin.summary import represent

AnyTable = TypeVar("AnyTable", bound=BaseModel)


@dataclass(frozen=True, eq=False)
class Parameters(Expressions):
    """The free parameters of a manipulator, p of shape (n_p, 1)."""

    paths: tuple[str, ...] = ()
    symbols: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    values: Array = field(default_factory=lambda: np.zeros(0))

    __repr__ = represent

    @classmethod
    def of_scene(cls, scene: BaseModel, paths: Iterable[str]) -> "Parameters":
        """Make a symbol for each dotted path of the scene.

        Raises: ArgumentError when a path does not lead to a number of the scene.
        """
        paths = tuple(path_in(scene, path) for path in paths)
        values = [get_value(scene, path) for path in paths]
        for path, value in zip(paths, values, strict=True):
            whole = path.startswith(f"{PARAMETERS}.") and type(value) is int  # a model's table is not checked yet
            if not isinstance(value, float) and not whole:
                raise ArgumentError(
                    f"{path} cannot be left free", got=repr(value)[:80], expected="a real number of the scene"
                )
        symbols = [ca.SX.sym(path) for path in paths]
        return cls(paths, ca.vertcat(*symbols) if symbols else ca.SX(0, 1), np.array(values, dtype=float))

    def placed_in(self, table: AnyTable, prefix: str = "") -> AnyTable:
        """The table with the symbols in the place of their numbers; `prefix` names where in the scene the table stands."""
        for i, path in enumerate(self.paths):
            if path.startswith(prefix):
                table = replace_value(table, path.removeprefix(prefix), self.symbols[i])
        return table


_given: ContextVar[Parameters | None] = ContextVar("given", default=None)


@contextmanager
def given_to_model(parameters: Parameters) -> Iterator[None]:
    """Within the block, equations that are made without a list of parameters hold these."""
    token = _given.set(parameters)
    try:
        yield
    finally:
        _given.reset(token)


def parameters_at_hand(parameters: Parameters | None = None) -> Parameters:
    """The parameters that are named; else those given to the model that is being built; else none."""
    return parameters or _given.get() or Parameters()
