"""Weights of a quadratic cost: from the scene's tables, and from the largest deviations that one may have."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from flexlin.about.law import INTEGRAL, Controller
from flexlin.about.linearization import Linearization
from flexlin.arguments import checked
from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError, NotDetectable, NotStabilizable, NumericalError, counted
from flexlin.lapack import LAPACK
from flexlin.mechanics.coordinates import Coordinate
from flexlin.periodic.coefficients import Combined, Constant
from flexlin.periodic.system import MatrixFunction
from flexlin.scene.control import RATE, Weights
from flexlin.scene.units import in_si, spread

MARGIN = 1e-13
"""A mode counts as reached (or seen) when its share in B (or Q) is larger than this, relative to the matrices' sizes: than rounding."""
CANCELLED = 1e-6
"""A share of this part of the terms that it sums is no rounding: the mode is reached, whatever the sizes of other modes."""


def diagonal_weight(name: str, entries: Sequence[float], size: int, what: str) -> Array:
    """Return diag(entries), saying what the entries stand for when their number is wrong."""
    values = real_array(name, entries, (None,))
    if len(values) != size:
        raise ArgumentError(f"{name} has the wrong length", got=len(values), expected=f"{size}: one for each of {what}")
    return np.diag(values)


def check_constant_pair(A: Array, B: Array, Q: Array, when: str) -> None:
    """Refuse a constant problem with a mode that does not decay and that the input does not reach or the weight does not see.

    A mode with eigenvalue s, Re s >= 0, is reached when [s I - A, B] has full rank, seen when [s I - A; Q] has (Hautus). Where
    far faster modes hide the rank, it is reached when its left vector w does not cancel in w^H B, seen when its right one does not in
    Q v. The states are scaled so that rows and columns of A have like sizes (balancing), which leaves both ranks as they are.
    Raises: NotStabilizable, NotDetectable, naming the eigenvalue and the mode's direction.
    """
    from scipy.linalg import eig  # takes longer to load than other designs to compute

    A, _, _, states, _ = LAPACK.dgebal(A, scale=1, permute=0)
    B, Q = B / states[:, None], Q * states
    size = float(np.linalg.norm(A, 2)) or 1.0
    values, left, right = eig(A, left=True, right=True)
    for s, w, v in zip(values, left.T, right.T, strict=True):
        if s.real < -1e-12 * size:
            continue
        shifted = s * np.eye(len(A)) - A
        if cancels(B.T, w.conj()):
            lacking(np.concatenate([shifted, scaled(B, size)], axis=1), True, s, states, when)
        if cancels(Q, v):
            lacking(np.concatenate([shifted, scaled(Q, size)], axis=0), False, s, states, when)


def cancels(matrix: Array, vector: Array) -> bool:
    """Whether every entry of a product with a vector is next to nothing beside the terms that it sums."""
    return bool(np.all(np.abs(matrix @ vector) <= CANCELLED * (np.abs(matrix) @ np.abs(vector))))


def constant_lqr(A: Array, B: Array, Q: Array, R: Array, N: Array, when: str) -> tuple[Array, Array]:
    """Return the LQR gain K and cost X of constant matrices, once the loop that they make has been found stable.

        A' X + X A - (X B + N) R^-1 (B' X + N') + Q = 0,   K = R^-1 (B' X + N')

    SciPy's solver is the one that python-control calls, without the second that it takes to load python-control.
    Raises: NotStabilizable, NotDetectable as `check_constant_pair`; NumericalError where rounding leaves no stable loop.
    """
    from scipy.linalg import solve_continuous_are

    check_constant_pair(A, B, Q, when)
    try:
        X = solve_continuous_are(A, B, Q, R, s=N)
        K = np.linalg.solve(R, B.T @ X + N.T)
        growth = float(np.linalg.eigvals(A - B @ K).real.max())
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
        growth, why = np.inf, str(error)
    else:
        why = f"a loop that grows by {growth:.3g} 1/s"
    if not growth < 0:
        todo = "bring states, inputs and weights to like sizes, or leave out the fastest modes"
        raise NumericalError(
            f"the Riccati equation has no stabilising solution in numbers of this precision {when}", got=why, todo=todo
        )
    return K, X


def scaled(matrix: Array, size: float) -> Array:
    """Bring B or Q to the size of A, so that one margin serves both."""
    return matrix * (size / (float(np.linalg.norm(matrix, 2)) or 1.0))


def lacking(pencil: Array, by_input: bool, eigenvalue: complex, states: Array, when: str) -> None:
    """Raise when a Hautus pencil is rank deficient."""
    left, values, right = np.linalg.svd(pencil)
    if values[-1] > MARGIN * values[0]:
        return
    vector = np.abs(left[:, -1] / states if by_input else right[-1] * states)
    kind = NotStabilizable if by_input else NotDetectable
    got = f"eigenvalue {complex(eigenvalue):.6g}, direction {np.array2string(vector / vector.max(), precision=3, suppress_small=True)}"
    raise kind(
        f"a mode that does not decay {'cannot be reached by the input' if by_input else 'is not seen by the weight Q'} {when}",
        got=got,
        todo="add an actuator that moves it" if by_input else "give the mode's states weight in Q",
    )


TURNING = ("joint", "motor")
"""Coordinates that `joints` and `rates` speak of."""


def weigh_tip(C: Array, fixed: Array, size: float) -> Array:
    """Q = fixed + C' C / d^2 with the tip's map C (N, 2, 2n)."""
    C = C / size
    return fixed + np.swapaxes(C, 1, 2) @ C


def widen(Q: Array, more: Array) -> Array:
    """diag(Q, more): weights of the states of an arm, and of more behind them."""
    n, k = Q.shape[1], len(more)
    out = np.zeros((len(Q), n + k, n + k))
    out[:, :n, :n], out[:, n:, n:] = Q, more
    return out


@checked
def physical_weights(lin: Linearization, weights: Weights) -> tuple[MatrixFunction, Array]:
    """Make the weights Q(t) and R of deviations that are all as bad as each other.

        Q(t) = diag(1 / d_i^2) + C_tip(t)' C_tip(t) / d_tip^2,   R = diag(1 / d_u^2)

    C_tip(t) is the slope of the tip's position along the rigid motion. So Q grows with the number of modes, and the sizes stay.

    Parameters
    ----------
    lin : Linearization
        With n coordinates and m inputs.
    weights : Weights
        The sizes, as a scene's `[[designs]]` gives them.

    Returns
    -------
    Q : function of times (N,) -> (N, 2n, 2n)
        Weight of the states [y; y'], in their inverse squared units.
    R : array, shape (m, m)
        Weight of the inputs, in their inverse squared units.

    Raises
    ------
    ArgumentError
        When a size has not the unit of its coordinate, a name is no coordinate, or the arm has no tip.

    References
    ----------
    Bryson, Ho, Applied Optimal Control (1975), section 5.2.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> from flexlin.scene.control import Weights
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    >>> weights = Weights.model_validate({"joints": 0.1, "w11": "5 mm", "q1_rate": "1 rad/s", "input": "0.5 N m"})
    >>> Q, R = fl.control.physical_weights(lin, weights)
    >>> Q(np.zeros(1))[0].diagonal().round(6).tolist(), R.tolist()
    ([100.0, 40000.0, 0.0, 1.0, 0.0, 0.0], [[4.0]])
    """
    fixed = np.diag([0.0 if size is None else size**-2.0 for size in state_sizes(lin, weights)])
    R = np.diag([size**-2.0 for size in spread("weights.input", weights.input, lin.input_units) or ()])
    if weights.tip is None:
        return Constant(fixed), R
    from flexlin.control.sensors import tip_position

    return Combined(partial(weigh_tip, fixed=fixed, size=float(weights.tip)), (tip_position(lin),), complete=True), R


def joint_integrals(lin: Linearization, weights: Weights) -> tuple[Controller, Array]:
    """The integrals of what the motors' encoders read as states, z' = C [y; y'], and their acceptable sizes (m,).

    Raises: ArgumentError when a size has not the unit of its joint.
    """
    from flexlin.control.sensors import joint_angles

    driven = [lin.arm.coordinates[lin.arm.drives[i]] for i in lin.driven]
    units = tuple(f"{coordinate.unit} s" for coordinate in driven)
    sizes = spread("weights.integrals", weights.integrals, units)
    C, m = joint_angles(lin)(np.zeros(1))[0], len(driven)
    names = tuple(coordinate.name + INTEGRAL for coordinate in driven)
    return Controller(np.hstack([C, np.zeros((m, m))]), np.zeros((m, m)), names, units), np.array(sizes)


def state_sizes(lin: Linearization, weights: Weights) -> list[float | None]:
    """The acceptable size of each state of [y; y'], None where nothing is said."""
    own, used = weights.coordinates, set[str]()
    sizes: list[float | None] = []
    for mark, per_second, turning, bending in (
        ("", "", weights.joints, weights.deflection),
        (RATE, "/s", weights.rates, weights.deflection_rates),
    ):
        group = "rates" if mark else "joints"
        for coordinate in lin.coordinates:
            name, unit = coordinate.name + mark, coordinate.unit + per_second
            if name in own:
                used.add(name)
                sizes.append(size_in(name, own[name], unit))
            elif coordinate.kind in TURNING:
                sizes.append(size_in(group, of_joint(lin, group, turning, coordinate), unit))
            else:
                sizes.append(bending if coordinate.unit == "m" else None)
    unknown = sorted(set(own) - used)
    if unknown:
        names = [name + mark for mark in ("", RATE) for name in lin.names]
        expected = f"one of {', '.join([*type(weights).model_fields, *names])}"
        raise ArgumentError("weights: an unknown key", got=unknown[0], expected=expected)
    return sizes


def of_joint(lin: Linearization, key: str, value: Any, coordinate: Coordinate) -> Any:
    """The part of a size that belongs to a joint: the size itself, or its entry of a list over the joints."""
    if not isinstance(value, Sequence) or isinstance(value, str):
        return value
    joints = list(dict.fromkeys(c.link for c in lin.coordinates if c.kind in TURNING))
    if len(value) != len(joints):
        raise ArgumentError(
            f"weights.{key} does not fit the arm",
            got=counted(len(value), "size"),
            expected=f"{len(joints)}, one a joint",
        )
    return value[joints.index(coordinate.link)]


def size_in(key: str, value: Any, unit: str) -> float | None:
    """A size in SI units; raises ArgumentError when it has another dimension than its coordinate."""
    if value is None:
        return None
    try:
        return in_si(value, unit)
    except ValueError as error:
        raise ArgumentError(
            f"weights.{key} has another unit than the coordinate", got=repr(value), expected=str(error)
        ) from None
