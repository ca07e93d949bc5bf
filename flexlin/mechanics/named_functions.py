"""CasADi functions that are built when they are first asked for."""

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

import casadi as ca

if TYPE_CHECKING:
    from flexlin.mechanics.manipulator import Manipulator


class NamedFunctions(Mapping[str, ca.Function]):
    """CasADi functions by name, from (named inputs, maker of the output), each built at its first use."""

    def __init__(self, table: dict[str, tuple[dict[str, ca.SX], Callable[[], ca.SX]]]):
        self._table, self._built = table, dict[str, ca.Function]()

    def __getitem__(self, name: str) -> ca.Function:
        if name not in self._built:
            inputs, output = self._table[name]
            self._built[name] = ca.Function(name, list(inputs.values()), [ca.densify(output())], list(inputs), [name])
        return self._built[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._table)

    def __len__(self) -> int:
        return len(self._table)


def name_functions(arm: "Manipulator") -> NamedFunctions:
    """Functions of s, s_dot, s_ddot as needed, and p: M, C, g, damping, residual; more if known."""
    p = arm.parameters.symbols
    at, moving = {"s": arm.s, "p": p}, {"s": arm.s, "s_dot": arm.s_dot, "p": p}
    accelerated = {"s": arm.s, "s_dot": arm.s_dot, "s_ddot": arm.s_ddot, "p": p}
    table: dict[str, tuple[dict[str, ca.SX], Callable[[], ca.SX]]] = {
        "M": (at, lambda: arm.M),
        "C": (moving, lambda: arm.C),
        "g": (at, lambda: arm.g),
        "damping": (moving, lambda: arm.damping),
        "residual": (accelerated, lambda: arm.residual),
    }
    if arm.energy is not None:
        table["energy"] = (moving, lambda: arm.energy)
    if arm.points is not None:
        table["points"] = (at, lambda: arm.points)
    if arm.axes is not None:
        table["axes"] = (at, lambda: arm.axes)
    if arm.rotation is not None:
        table["rotation"] = (at, lambda: arm.rotation)
    if arm.loops is not None:
        loops, following = arm.loops, {"s": arm.s, "v": arm.loops.v, "p": p}
        table["followers"] = (at, lambda: loops.followers)
        table["closing"] = (following, lambda: ca.jacobian(loops.gap, loops.v))
        table["newton_step"] = (following, loops.newton_step)
    return NamedFunctions(table)
