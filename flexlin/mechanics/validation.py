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
    _need_independence(arm)
    s, s_dot, p = arm.s, arm.s_dot, arm.parameters
    parts = {"M": arm.M, "C": arm.C, "g": arm.g, "damping": arm.damping, "B": arm.B, "dg/ds": ca.jacobian(arm.g, s)}
    forces = () if arm.coriolis is None else (arm.C @ s_dot, derive_coriolis(arm.M, s, s_dot) @ s_dot)
    products = [ca.jacobian(ca.jacobian(force, s_dot), s_dot) for force in forces]
    function = ca.Function("parts", [s, s_dot, p.symbols], [ca.densify(x) for x in (*parts.values(), *products)])
    for at, rate in _states(arm):
        where = "at s = 0" if not at.any() else f"at s = {np.array2string(at, precision=3)}"
        values = [np.array(value) for value in function(at, rate, p.values)]
        for name, matrix in zip(parts, values[:-1], strict=False):
            if not np.all(np.isfinite(matrix)):
                i, j = np.argwhere(~np.isfinite(matrix))[0]
                raise ModelError(
                    f"{name}[{i}, {j}] is not finite {where}", got=matrix[i, j], expected="a finite number"
                )
        M, slope = values[0], values[5]
        _need_symmetric("M", M, where)
        need_positive(M, arm.names, where)
        _need_symmetric("dg/ds", slope, where)
        if forces:
            _need_christoffel(arm.names, values[6], values[7], np.abs(at).max(), where)


def need_quadratic(T: ca.SX, s: ca.SX, s_dot: ca.SX, parameters: Parameters) -> None:
    """Check that a kinetic energy has no part that is free of the rates or linear in them.

    Raises: ModelError naming the rate, or the whole energy.
    """
    at = np.random.default_rng(0).uniform(-1, 1, s.numel())
    function = ca.Function("parts", [s, s_dot, parameters.symbols], [T, ca.densify(ca.gradient(T, s_dot))])
    energy, momentum = (np.array(value)[:, 0] for value in function(at, np.zeros(s.numel()), parameters.values))
    wrong = (
        f"linear in rate {int(np.argmax(np.abs(momentum)))}"
        if np.abs(momentum).max() > TOLERANCE
        else "free of the rates"
    )
    if abs(energy[0]) > TOLERANCE or wrong.startswith("linear"):
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


def _need_christoffel(names: tuple[str, ...], C: Array, M: Array, size: float, where: str) -> None:
    """Compare C s' with the forces that M implies, product of rates by product of rates; size: of the coordinates."""
    n = len(names)
    products = [part.reshape(n, n, n, order="F") for part in (C, M)]
    difference = np.abs(products[0] - products[1])
    row, i, j = np.unravel_index(np.argmax(difference), difference.shape)
    if difference[row, i, j] > TOLERANCE * max(np.abs(products[1]).max(), size, 1e-3):
        share = 0.5 if i == j else 1.0
        raise ModelError(
            f"C does not belong to M {where}: in row {row} of C s' the product {names[i]}' {names[j]}' has another factor",
            got=f"{share * products[0][row, i, j]:.9g}",
            expected=f"{share * products[1][row, i, j]:.9g}, so that M' - 2 C is skew",
            todo=f"correct C[{row}, {i}] or C[{row}, {j}], or put forces that are not inertial into damping",
        )
