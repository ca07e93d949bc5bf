"""Weights of a design, and the checks that come before solving."""

from collections.abc import Sequence

import numpy as np

from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError, NotDetectable, NotStabilizable, NumericalError
from flexlin.lapack import LAPACK

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
