"""Modes of the coefficients frozen at each time, each followed over the period by its shape."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import assign
from flexlin.periodic.precision import ROOT


@dataclass(frozen=True)
class FrozenModes:
    """Eigenvalues (N, n) in 1/s and eigenvectors (N, n, n) of A at N times; mode i keeps its place i."""

    values: Array
    vectors: Array

    @property
    def frequencies(self) -> Array:
        """Im / 2 pi in Hz of the eigenvalue of each pair that turns forward, (N, n); nan where a mode does not oscillate."""
        turns = self.values.imag > ROOT * np.abs(self.values)
        return np.where(turns, self.values.imag / (2 * np.pi), np.nan)


def follow_frozen_modes(A: Array) -> FrozenModes:
    """Order the eigenvalues of A (N, n, n), n states at N times close to each other, such that neighbours belong to one mode.

        overlap_ij = |w_i(k) v_j(k+1)| |w_j(k+1) v_i(k)|,   w the rows of inv([v_1 ... v_n])

    It is 1 for the same mode and 0 for another in whatever units the states are and however the vectors are scaled. The assignment
    takes the largest overlap less the relative distance of the eigenvalues, so modes that cross keep their shapes, and those that turn
    into each other at an avoided crossing keep their frequencies' order.
    """
    values, vectors = np.linalg.eig(np.asarray(A, dtype=float))
    values, vectors = values.astype(complex), vectors.astype(complex)
    inverse = invert(vectors)
    forward, backward = np.abs(inverse[:-1] @ vectors[1:]), np.abs(inverse[1:] @ vectors[:-1])
    overlap = np.minimum(np.nan_to_num(forward * np.swapaxes(backward, 1, 2)), 1.0)
    size = np.abs(values[:-1, :, None]) + np.abs(values[1:, None, :])
    apart = np.abs(values[:-1, :, None] - values[1:, None, :]) / np.where(size == 0, 1.0, size)
    order = np.empty(values.shape, dtype=int)
    order[0] = np.lexsort((values[0].real, values[0].imag))
    for k, cost in enumerate(apart - overlap):
        order[k + 1] = assign(cost[order[k]])
    return FrozenModes(
        np.take_along_axis(values, order, axis=1), np.take_along_axis(vectors, order[:, None, :], axis=2)
    )


def invert(vectors: Array) -> Array:
    """Inverses (N, n, n); of a defective matrix, whose eigenvectors coincide, the pseudo-inverse."""
    try:
        return np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return np.linalg.pinv(vectors, rcond=1e-12)
