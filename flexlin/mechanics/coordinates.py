"""The coordinates of a chain: joints, elastic ones link by link, motors."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Named symbols s = [q; w; theta]: q of each joint, w of each link's modes, theta of free motors."""

    q: ca.SX
    modes: tuple[ca.SX, ...]
    motors: ca.SX

    @classmethod
    def named(cls, modes: Sequence[int], free_motors: bool, mark: str = "") -> "Coordinates":
        """Make the symbols for links with these numbers of modes; `mark` goes before each name."""
        joints = range(1, len(modes) + 1)
        return cls(
            q=_symbols(f"{mark}q{i}" for i in joints),
            modes=tuple(_of_link(f"{mark}w{i}", n) for i, n in zip(joints, modes, strict=True)),
            motors=_symbols(f"{mark}theta{i}" for i in joints) if free_motors else ca.SX(0, 1),
        )

    @property
    def all(self) -> ca.SX:
        """s, (n, 1)."""
        return ca.vertcat(self.q, *self.modes, self.motors)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of s."""
        return tuple(symbol.name() for symbol in ca.vertsplit(self.all)) if self.all.numel() else ()


def _of_link(name: str, count: int) -> ca.SX:
    gap = "" if count < 10 else "_"
    return _symbols(f"{name}{gap}{k + 1}" for k in range(count))


def _symbols(names: Iterable[str]) -> ca.SX:
    return ca.vertcat(ca.SX(0, 1), *[ca.SX.sym(name) for name in names])
