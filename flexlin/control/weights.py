"""Weights of a design, and the checks that come before solving."""

from collections.abc import Sequence

import numpy as np

from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError, NotDetectable, NotStabilizable

MARGIN = 1e-10
"""A mode counts as reached (or seen) when its share in B (or Q) is larger than this, relative to the matrices' sizes."""


def diagonal_weight(name: str, entries: Sequence[float], size: int, what: str) -> Array:
    """Return diag(entries), saying what the entries stand for when their number is wrong."""
    values = real_array(name, entries, (None,))
    if len(values) != size:
        raise ArgumentError(f"{name} has the wrong length", got=len(values), expected=f"{size}: one for each of {what}")
    return np.diag(values)


def check_constant_pair(A: Array, B: Array, Q: Array, when: str) -> None:
    """Refuse a constant problem with a mode that does not decay and that the input does not reach or the weight does not see.

    A mode with eigenvalue s, Re s >= 0, is reached when [s I - A, B] has full rank, seen when [s I - A; Q] has (Hautus).
    Raises: NotStabilizable, NotDetectable, naming the eigenvalue and the mode's direction.
    """
    size = float(np.linalg.norm(A, 2)) or 1.0
    for s in np.linalg.eigvals(A):
        if s.real < -1e-12 * size:
            continue
        shifted = s * np.eye(len(A)) - A
        lacking(np.concatenate([shifted, scaled(B, size)], axis=1), True, s, when)
        lacking(np.concatenate([shifted, scaled(Q, size)], axis=0), False, s, when)


def scaled(matrix: Array, size: float) -> Array:
    """Bring B or Q to the size of A, so that one margin serves both."""
    return matrix * (size / (float(np.linalg.norm(matrix, 2)) or 1.0))


def lacking(pencil: Array, by_input: bool, eigenvalue: complex, when: str) -> None:
    """Raise when a Hautus pencil is rank deficient."""
    left, values, right = np.linalg.svd(pencil)
    if values[-1] > MARGIN * values[0]:
        return
    vector = left[:, -1] if by_input else right[-1].conj()
    kind = NotStabilizable if by_input else NotDetectable
    raise kind(
        f"a mode that does not decay {'cannot be reached by the input' if by_input else 'is not seen by the weight Q'} {when}",
        got=f"eigenvalue {complex(eigenvalue):.6g}, direction {np.array2string(np.abs(vector), precision=3, suppress_small=True)}",
        todo="add an actuator that moves it" if by_input else "give the mode's states weight in Q",
    )
