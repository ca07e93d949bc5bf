"""The equations of motion of a manipulator, M(s) s'' + C(s, s') s' + g(s) + d(s, s') = B tau."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca

from flexlin.errors import ModelError
from flexlin.expressions import Expressions
from flexlin.mechanics.coordinates import Coordinate
from flexlin.mechanics.coriolis import coriolis_matrix
from flexlin.mechanics.parameters import Parameters
from flexlin.mechanics.validation import need_quadratic, validate
from flexlin.scene.effects import Effects


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


@dataclass(frozen=True, eq=False)
class Manipulator(Expressions):
    """A manipulator as CasADi expressions of its coordinates s and rates s_dot.

        M(s) s'' + C(s, s') s' + g(s) + d(s, s') = B tau

    Fields: s, s_dot: (n, 1) symbols (rad, m); residual: (n, 1) left side with s_ddot; B: (n, m) input matrix;
    reference: (n, joints) constant matrix, the rigid motion is s_R = reference q; drives: the coordinate that each joint's motor moves;
    measured: (joints, n) what each motor's encoder reads of s, None: the coordinates in drives;
    coordinates: what each one is; parameters: free scene parameters; points: (2, k) world positions from the base to the tip, in m;
    effects: the tables of the effects in it, None where they are not known.
    """

    s: ca.SX
    s_dot: ca.SX
    s_ddot: ca.SX
    residual: ca.SX
    M: ca.SX
    g: ca.SX
    damping: ca.SX
    B: ca.SX
    reference: ca.DM
    drives: tuple[int, ...]
    coordinates: tuple[Coordinate, ...]
    parameters: Parameters = field(default_factory=Parameters)
    energy: ca.SX | None = None
    points: ca.SX | None = None
    coriolis: ca.SX | None = None
    measured: ca.SX | None = None
    effects: Effects | None = None

    @property
    def n(self) -> int:
        """The number of coordinates."""
        return int(self.s.numel())

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the coordinates."""
        return tuple(coordinate.name for coordinate in self.coordinates)

    @property
    def joints(self) -> int:
        """The number of joints that follow the basic motion."""
        return int(self.reference.size2())

    @property
    def encoders(self) -> ca.SX:
        """What the motors' encoders read, (joints, n): angles = encoders s."""
        return ca.SX.eye(self.n)[list(self.drives), :] if self.measured is None else self.measured

    @cached_property
    def C(self) -> ca.SX:
        """The matrix of centrifugal and Coriolis forces, from M unless the user gave one."""
        return coriolis_matrix(self.M, self.s, self.s_dot) if self.coriolis is None else self.coriolis

    @cached_property
    def functions(self) -> "NamedFunctions":
        """Named functions of (s, p) or (s, s_dot, p) or (s, s_dot, s_ddot, p): M, C, g, damping, residual; points and energy if known.

        Each is built when it is first asked for.
        """
        p = self.parameters.symbols
        at, moving = {"s": self.s, "p": p}, {"s": self.s, "s_dot": self.s_dot, "p": p}
        accelerated = {"s": self.s, "s_dot": self.s_dot, "s_ddot": self.s_ddot, "p": p}
        table: dict[str, tuple[dict[str, ca.SX], Callable[[], ca.SX]]] = {
            "M": (at, lambda: self.M),
            "C": (moving, lambda: self.C),
            "g": (at, lambda: self.g),
            "damping": (moving, lambda: self.damping),
            "residual": (accelerated, lambda: self.residual),
        }
        if self.energy is not None:
            table["energy"] = (moving, lambda: self.energy)
        if self.points is not None:
            table["points"] = (at, lambda: self.points)
        return NamedFunctions(table)

    @classmethod
    def from_matrices(
        cls,
        s: ca.SX,
        s_dot: ca.SX,
        M: ca.SX,
        C: ca.SX,
        g: ca.SX,
        B: ca.SX | None = None,
        damping: ca.SX | None = None,
        joints: Sequence[int] | None = None,
        names: Sequence[str] | None = None,
        points: ca.SX | None = None,
    ) -> "Manipulator":
        """Make a manipulator from its matrices, M(s) s'' + C(s, s') s' + g(s) + d(s, s') = B tau.

        Assumes the basic motion moves the coordinates `joints` (default: those that B drives) and leaves the others at zero.

        Parameters: s, s_dot: (n, 1) symbols; M, C: (n, n); g, damping: (n, 1); B: (n, m), default the identity.
        Raises: ModelError when a shape does not fit, an expression holds other symbols, or the matrices contradict mechanics
        (see `flexlin.mechanics.validation`).
        """
        n = s.numel()
        B = ca.DM.eye(n) if B is None else B
        damping = ca.SX.zeros(n) if damping is None else damping
        s_ddot = ca.SX.sym("s_ddot", n)
        _check_shapes(n, M=(M, n), C=(C, n), g=(g, 1), damping=(damping, 1), B=(B, None))
        _check_symbols(ca.vertcat(s, s_dot), M=M, C=C, g=g, damping=damping, B=B)
        arm = cls(
            s,
            s_dot,
            s_ddot,
            residual=M @ s_ddot + C @ s_dot + g + damping,
            M=ca.SX(M),
            g=ca.SX(g),
            damping=ca.SX(damping),
            **_driving(n, B, joints, names),
            points=points,
            coriolis=ca.SX(C),
        )
        validate(arm)
        return arm

    @classmethod
    def from_lagrangian(
        cls,
        s: ca.SX,
        s_dot: ca.SX,
        T: ca.SX,
        V: ca.SX,
        dissipation: ca.SX | None = None,
        resistance: ca.SX | None = None,
        B: ca.SX | None = None,
        joints: Sequence[int] | None = None,
        names: Sequence[str] | None = None,
        parameters: Parameters | None = None,
        points: ca.SX | None = None,
        check: bool = True,
    ) -> "Manipulator":
        """Make a manipulator from its energies by Lagrange's equations of the second kind.

            d/dt (dT/ds') - dT/ds + dV/ds + dR/ds' + r = B tau

        Assumes T quadratic in s'. The basic motion moves the coordinates `joints` (default: those that B drives).

        Parameters: T, V: kinetic and potential energy (J); dissipation: Rayleigh's function R (W); resistance: (n, 1) resisting
        forces r(s, s') that no R gives; B: (n, m), default the identity.
        check: look whether the model obeys mechanics.
        Raises: ModelError when a shape does not fit, an expression holds other symbols, or the energies contradict mechanics
        (see `flexlin.mechanics.validation`).
        Source: Khang, Dat, Tuan (2019), Eq. (55).
        """
        n = s.numel()
        B = ca.DM.eye(n) if B is None else B
        R = ca.SX(0) if dissipation is None else dissipation
        resisting = ca.SX.zeros(n) if resistance is None else resistance
        parameters = parameters or Parameters()
        _check_shapes(1, T=(T, 1), V=(V, 1), dissipation=(R, 1))
        _check_shapes(n, B=(B, None), resistance=(resisting, 1))
        known = ca.vertcat(s, s_dot, parameters.symbols)
        _check_symbols(known, T=T, V=V, dissipation=R, resistance=resisting, B=B)
        s_ddot = ca.SX.sym("s_ddot", n)
        momentum, g, damping = ca.gradient(T, s_dot), ca.gradient(V, s), ca.gradient(R, s_dot) + resisting
        rate_of_momentum = ca.jtimes(momentum, ca.vertcat(s, s_dot), ca.vertcat(s_dot, s_ddot))
        arm = cls(
            s,
            s_dot,
            s_ddot,
            residual=rate_of_momentum - ca.gradient(T, s) + g + damping,
            M=ca.densify(ca.jacobian(momentum, s_dot)),
            g=ca.densify(g),
            damping=ca.densify(damping),
            **_driving(n, B, joints, names),
            parameters=parameters,
            energy=T + V,
            points=points,
        )
        if check:
            need_quadratic(T, s, s_dot, parameters)
            validate(arm)
        return arm


def _driving(n: int, B: ca.SX, joints: Sequence[int] | None, names: Sequence[str] | None) -> dict[str, Any]:
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


def _check_shapes(rows: int, **expressions: tuple[ca.SX, int | None]) -> None:
    for name, (expression, columns) in expressions.items():
        got = ca.SX(expression).shape
        if got[0] != rows or columns not in (None, got[1]):
            raise ModelError(
                f"{name} has the wrong shape", got=got, expected=f"({rows}, {'any' if columns is None else columns})"
            )


def _check_symbols(known: ca.SX, **expressions: ca.SX) -> None:
    names = {symbol.name() for symbol in ca.symvar(known)}
    for name, expression in expressions.items():
        strange = [symbol.name() for symbol in ca.symvar(ca.SX(expression)) if symbol.name() not in names]
        if strange:
            raise ModelError(
                f"{name} holds symbols that are neither coordinates, rates nor parameters", got=", ".join(strange)
            )
