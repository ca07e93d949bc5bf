"""M, C, g and damping from energies: Lagrange's equations, Christoffel's symbols, driven joints, and checks of given expressions."""

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca

from flexlin.arguments import instance
from flexlin.errors import ModelError, counted
from flexlin.kronecker.symbolic import derivative
from flexlin.mechanics.coordinates import Coordinate, Parameters, parameters_at_hand


def derive_lagrange_equations(
    T: ca.SX, V: ca.SX, R: ca.SX, resistance: ca.SX, s: ca.SX, s_dot: ca.SX, s_ddot: ca.SX
) -> dict[str, ca.SX]:
    """The left side of the equations of motion, and the parts of it that have names.

        d/dt (dT/ds') - dT/ds + dV/ds + dR/ds' + r,   M = d2T/ds'2

    Parameters: T quadratic in s', V, R: energies and Rayleigh's function, (1, 1); resistance r, s, s_dot, s_ddot: (n, 1).
    Returns: residual (n, 1), M (n, n), g (n, 1), damping (n, 1).
    Source: Khang, Dat, Tuan (2019), Eq (55).
    """
    momentum, g, damping = ca.gradient(T, s_dot), ca.gradient(V, s), ca.gradient(R, s_dot) + resistance
    rate_of_momentum = ca.jtimes(momentum, ca.vertcat(s, s_dot), ca.vertcat(s_dot, s_ddot))
    return {
        "residual": rate_of_momentum - ca.gradient(T, s) + g + damping,
        "M": ca.densify(ca.jacobian(momentum, s_dot)),
        "g": ca.densify(g),
        "damping": ca.densify(damping),
    }


def derive_coriolis(M: ca.SX, s: ca.SX, s_dot: ca.SX) -> ca.SX:
    """The matrix of Christoffel's symbols in Kronecker layout, for which M' - 2 C is skew.

        C(s, s') = 1/2 [dM/ds (I (x) s') + dM/ds (s' (x) I) - (dM/ds (s' (x) I))^T]

    Parameters: M: (n, n); s, s_dot: (n, 1). Returns: (n, n).
    Source: Khang, Dat, Tuan (2019), property (19), with the symmetry of M.
    """
    dM, eye = derivative(M, s), ca.DM.eye(s.numel())
    along = dM @ ca.kron(eye, s_dot)
    across = dM @ ca.kron(s_dot, eye)
    return (along + across - across.T) / 2


def describe_model(
    s: ca.SX,
    s_dot: ca.SX,
    parts: Mapping[str, tuple[ca.SX, int, int | None]],
    B: ca.SX | None,
    joints: Sequence[int] | None,
    names: Sequence[str] | None,
    units: Sequence[str] | None,
    parameters: Parameters | None = None,
) -> dict[str, Any]:
    """What every manipulator has, once its parts (expression, rows, columns) have been found to fit; columns None: any number.

    The coordinates `joints` follow the basic motion, by default those that some input moves, or all; the others are elastic. Without
    B each of them has a force of its own.
    Raises: ModelError for parts of another shape or with other symbols, and for inputs, joints, names or units that do not fit.
    """
    n, at_hand = s.numel(), parameters_at_hand(parameters)
    moved = list(range(n)) if joints is None else list(joints)
    if any(i not in range(n) for i in moved) or len(set(moved)) != len(moved):
        raise ModelError("joints are no coordinates", got=moved, expected=f"different numbers from 0 to {n - 1}")
    inputs = ca.SX(ca.DM.eye(n)[:, moved]) if B is None else ca.SX(B)
    known = {one.name() for one in ca.symvar(ca.vertcat(s, s_dot, at_hand.symbols))}
    for name, (expression, rows, columns) in {**parts, "B": (inputs, n, None)}.items():
        got = ca.SX(expression).shape
        if got[0] != rows or columns not in (None, got[1]):
            expected = f"({rows}, {'any' if columns is None else columns})"
            raise ModelError(f"{name} has the wrong shape", got=got, expected=expected)
        strange = [symbol.name() for symbol in ca.symvar(ca.SX(expression)) if symbol.name() not in known]
        if strange:
            what = f"{name} holds symbols that are neither coordinates, rates nor parameters"
            raise ModelError(what, got=", ".join(strange))
    if joints is None:
        moved = [i for i in range(n) if not inputs[i, :].is_zero()]
    if inputs.size2() != len(moved):
        raise ModelError(
            "the inputs do not fit the joints",
            got=f"{counted(inputs.size2(), 'input')} for the coordinates {moved}",
            expected="one input for each coordinate in joints",
            todo="name in joints= as many coordinates as there are inputs; the others rest at zero in the rigid motion",
        )
    symbols = tuple(names or (f"s{i + 1}" for i in range(n)))
    if len(symbols) != n:
        raise ModelError("names do not fit the coordinates", got=counted(len(symbols), "name"), expected=f"{n}")
    stated = list(units or ("rad" if i in moved else "m" for i in range(n)))
    if len(stated) != n or not set(stated) <= {"rad", "m"}:
        raise ModelError("units do not fit the coordinates", got=stated, expected=f"rad or m for each of {n}")
    coordinates = tuple(
        Coordinate("joint", symbol, unit, moved.index(i)) if i in moved else Coordinate("elastic", symbol, unit)
        for i, (symbol, unit) in enumerate(zip(symbols, stated, strict=True))
    )
    own = {"s": s, "s_dot": s_dot, "s_ddot": ca.SX.sym("s_ddot", n), "parameters": at_hand, "coordinates": coordinates}
    return {**own, "B": inputs, "reference": ca.DM.eye(n)[:, moved], "drives": tuple(moved)}


def check_coordinates(s: object, s_dot: object) -> None:
    """Raise ArgumentError unless coordinates and rates are CasADi SX symbols."""
    for name, symbols in (("s", s), ("s_dot", s_dot)):
        instance(name, symbols, ca.SX, "give CasADi SX symbols")
