"""Does a model obey mechanics? Checked numerically at a few states; each error names the entry that is wrong."""

from typing import Any

import casadi as ca
import numpy as np

from flexlin.checks import Array
from flexlin.errors import ModelError
from flexlin.mechanics.coordinates import Parameters
from flexlin.mechanics.lagrange import derive_coriolis

TOLERANCE = 1e-8
"""Relative size of a contradiction that rounding explains."""


def validate(arm: Any) -> None:
    """Check the equations of a `Manipulator` against the laws they must obey.

        M = M^T > 0,   C(s, s') s' = Christoffel forces of M  (so that s'^T (M' - 2 C) s' = 0),   dg/ds = (dg/ds)^T,

    and all values finite. Together they conserve T + V when nothing dissipates.

    Assumes joints of order 1 rad and other coordinates of order 0.01; `damping` is free: forces that are not mechanical belong there.

    Raises: ModelError naming the entry, what was got and what was expected.
    """
    s, p = arm.s, arm.parameters.values
    _need_independence(arm)
    for at, rate in _states(arm):
        where = "at s = 0" if not at.any() else f"at s = {np.array2string(at, precision=3)}"
        inputs = [(arm.s, at), (arm.s_dot, rate), (arm.parameters.symbols, p)]
        M, C, g, d = (_value(x, inputs) for x in (arm.M, arm.C, arm.g, arm.damping))
        for name, matrix in (("M", M), ("C", C), ("g", g), ("damping", d), ("B", _value(arm.B, inputs))):
            _need_finite(name, matrix, where)
        _need_symmetric("M", M, where)
        need_positive(M, arm.names, where)
        _need_symmetric("dg/ds", _value(ca.jacobian(arm.g, s), inputs), where)
        if arm.coriolis is not None:
            _need_christoffel(arm, inputs, where)


def need_quadratic(T: ca.SX, s: ca.SX, s_dot: ca.SX, parameters: Parameters) -> None:
    """Check that a kinetic energy has no part that is free of the rates or linear in them.

    Raises: ModelError naming the rate, or the whole energy.
    """
    at = np.random.default_rng(0).uniform(-1, 1, s.numel())
    inputs = [(s, at), (s_dot, np.zeros(s.numel())), (parameters.symbols, parameters.values)]
    energy, momentum = float(_value(T, inputs)[0, 0]), _value(ca.gradient(T, s_dot), inputs)[:, 0]
    wrong = (
        f"linear in rate {int(np.argmax(np.abs(momentum)))}"
        if np.abs(momentum).max() > TOLERANCE
        else "free of the rates"
    )
    if abs(energy) > TOLERANCE or wrong.startswith("linear"):
        raise ModelError(
            f"T has a part that is {wrong}",
            expected="a kinetic energy quadratic in the rates",
            todo="put what is free of rates into V with the other sign; make what moves by itself a joint with a prescribed motion",
        )


def _states(arm: Any) -> list[tuple[Array, Array]]:
    """Rest, and four random states."""
    rng = np.random.default_rng(0)
    scale = np.where(np.isin(np.arange(arm.n), arm.drives), 1.0, 0.01)
    random = [(rng.uniform(-1, 1, arm.n) * scale, rng.uniform(-1, 1, arm.n)) for _ in range(4)]
    return [(np.zeros(arm.n), np.zeros(arm.n)), *random]


def _value(expression: ca.SX, inputs: list[tuple[ca.SX, Array]]) -> Array:
    function = ca.Function("value", [symbol for symbol, _ in inputs], [ca.densify(expression)])
    return np.array(function(*[number for _, number in inputs]))


def _need_independence(arm: Any) -> None:
    for name, expression in (("M", arm.M), ("g", arm.g)):
        if ca.depends_on(expression, arm.s_dot):
            entry = next(i for i in range(expression.numel()) if ca.depends_on(ca.vec(expression)[i], arm.s_dot))
            place = (entry % expression.size1(), entry // expression.size1())
            raise ModelError(
                f"{name}[{place[0]}, {place[1]}] depends on the rates",
                expected=f"{name}(s)",
                todo="put forces that depend on rates into damping; the kinetic energy T must be quadratic in the rates",
            )


def _need_finite(name: str, matrix: Array, where: str) -> None:
    if not np.all(np.isfinite(matrix)):
        i, j = np.argwhere(~np.isfinite(matrix))[0]
        raise ModelError(f"{name}[{i}, {j}] is not finite {where}", got=matrix[i, j], expected="a finite number")


def _need_symmetric(name: str, matrix: Array, where: str) -> None:
    difference = np.abs(matrix - matrix.T)
    i, j = np.unravel_index(np.argmax(difference), difference.shape)
    if difference[i, j] > TOLERANCE * np.abs(matrix).max():
        raise ModelError(
            f"{name} is not symmetric {where}: {name}[{j}, {i}] = {matrix[j, i]:.9g} and {name}[{i}, {j}] differ",
            got=f"{matrix[i, j]:.9g}",
            expected="equal entries" if name == "M" else "the gradient of a potential energy",
        )


def need_positive(M: Array, names: tuple[str, ...], where: str, todo: str | None = None) -> None:
    """Raises: ModelError, naming the coordinate that moves most where there is no kinetic energy."""
    values, vectors = np.linalg.eigh(M)
    if values[0] <= 0:
        entry = int(np.argmax(np.abs(vectors[:, 0])))
        raise ModelError(
            f"M is not positive definite {where}: a motion mainly along {names[entry]} (M[{entry}, {entry}] = {M[entry, entry]:.6g}) "
            "has no kinetic energy",
            got=f"smallest eigenvalue {values[0]:.6g}",
            expected="greater than 0",
            todo=todo,
        )


def _need_christoffel(arm: Any, inputs: list[tuple[ca.SX, Array]], where: str) -> None:
    """Compare C s' with the forces that M implies, product of rates by product of rates."""
    expected = derive_coriolis(arm.M, arm.s, arm.s_dot) @ arm.s_dot
    products = [
        _value(ca.jacobian(ca.jacobian(force, arm.s_dot), arm.s_dot), inputs).reshape(arm.n, arm.n, arm.n, order="F")
        for force in (arm.C @ arm.s_dot, expected)
    ]
    difference = np.abs(products[0] - products[1])
    row, i, j = np.unravel_index(np.argmax(difference), difference.shape)
    if difference[row, i, j] > TOLERANCE * max(np.abs(products[1]).max(), np.abs(inputs[0][1]).max(), 1e-3):
        share = 0.5 if i == j else 1.0
        raise ModelError(
            f"C does not belong to M {where}: in row {row} of C s' the product {arm.names[i]}' {arm.names[j]}' has another factor",
            got=f"{share * products[0][row, i, j]:.9g}",
            expected=f"{share * products[1][row, i, j]:.9g}, so that M' - 2 C is skew",
            todo=f"correct C[{row}, {i}] or C[{row}, {j}], or put forces that are not inertial into damping",
        )
