"""Which coordinates of a manipulator written by hand the inputs drive."""

from collections.abc import Sequence
from typing import Any

import casadi as ca

from flexlin.errors import ModelError
from flexlin.mechanics.coordinates import Coordinate


def describe_driving(n: int, B: ca.SX, joints: Sequence[int] | None, names: Sequence[str] | None) -> dict[str, Any]:
    """Inputs, and the coordinates that follow the basic motion: those given, or those that some input moves; the others are elastic."""
    moved = [i for i in range(n) if not ca.SX(B[i, :]).is_zero()] if joints is None else list(joints)
    symbols = tuple(names or (f"s{i + 1}" for i in range(n)))
    if len(symbols) != n:
        raise ModelError("names do not fit the coordinates", got=f"{len(symbols)} names", expected=f"{n}")
    coordinates = tuple(
        Coordinate("joint", symbol, "rad", moved.index(i)) if i in moved else Coordinate("elastic", symbol, "m")
        for i, symbol in enumerate(symbols)
    )
    return {
        "B": ca.SX(B),
        "reference": ca.DM.eye(n)[:, moved],
        "drives": tuple(moved),
        "coordinates": coordinates,
    }
