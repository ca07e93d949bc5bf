"""A certificate's X(t) from the decoupled modes: each group of them by itself, the fast ones without following them."""

from contextlib import suppress

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NumericalError, ToleranceNotReached
from flexlin.periodic.decoupling.decouple import decouple
from flexlin.periodic.decoupling.decoupled import Decoupled, Refusal, as_real
from flexlin.periodic.decoupling.waves import interpolated
from flexlin.periodic.fourier import FourierSeries, fourier_nodes
from flexlin.periodic.quadratic.collocated_lyapunov import CollocatedLyapunov
from flexlin.periodic.quadratic.evidence import find_tail
from flexlin.periodic.quadratic.riccati import periodic_lyapunov
from flexlin.periodic.system import PeriodicSystem

ACCURACY = 1e-7
"""Of the frame and of the groups' equations: what they miss costs margin, not truth."""
COUNTS, TAIL, ENOUGH = (33, 65, 125), 1e-6, 1e-3
"""Nodes of a group's equation, the share of the last harmonics with which they suffice, and the residual that still serves."""


def weigh_modes(system: PeriodicSystem, shift: float, known: Decoupled | None = None) -> Array:
    """X = sum_g S_g^H P_g S_g at equidistant times (N, n, n), S_g: the rows of T^-1 of group g; known: T, where it was computed before.

    P of one mode makes it decay by `shift` at all times; P of several solves -P' = (B + shift)^H P + P (B + shift) + 1.
    The frame's columns have unit length and every P a mean trace of its size, so no group outweighs another.
    Raises: NumericalError where the modes cannot be decoupled, or decay more slowly than `shift`.
    """
    decoupled = known or decouple(system.resolved, system.period, system.resolved.breaks, ACCURACY)
    if isinstance(decoupled, Refusal):
        raise NumericalError("the modes were not decoupled", got=decoupled.reason)
    total = np.zeros(decoupled.inverse.shape)
    for index, group in enumerate(decoupled.groups):
        length = np.linalg.norm(decoupled.frame[:, :, group.part], axis=1).mean(axis=0)
        B = decoupled.generator[:, group.part, group.part] * (length[:, None] / length)
        P = (
            weigh_one(B, system.period, shift)
            if group.size == 1
            else weigh_several(B, system.period, shift, group.partner == index)
        )
        rows = length[:, None] * decoupled.inverse[:, group.part]
        P *= group.size / np.trace(P.mean(axis=0)).real
        total += (np.swapaxes(rows.conj(), -1, -2) @ P @ rows).real
    return total


def weigh_one(B: Array, period: float, shift: float) -> Array:
    """exp(-2 part int Re(B - mean) dt), (N, 1, 1), with as small a part as makes the mode decay by `shift` at all times."""
    waves, rates = np.fft.rfft(B.real, axis=0), B.real
    mean, most = rates.mean(), rates.max()
    part = np.clip((most + shift) / max(most - mean, np.finfo(float).tiny), 0.0, 1.0)
    waves[0], waves[1:] = 0.0, waves[1:] / (2j * np.pi / period * np.arange(1, len(waves))[:, None, None])
    return np.exp(-2 * part * np.fft.irfft(waves, len(B), axis=0))


def weigh_several(B: Array, period: float, shift: float, real: bool) -> Array:
    """P of a group (N, p, p); that of a complex one by its real form, without the group's mean frequency."""
    size, turn = B.shape[1], np.trace(B.mean(axis=0)).imag / B.shape[1]
    shifted = B + (shift - 1j * turn) * np.eye(size)
    P = solve_lyapunov(shifted.real if real else as_real(shifted), period)
    return P if real else P[:, :size, :size] + 1j * P[:, size:, :size]


def solve_lyapunov(A: Array, period: float) -> Array:
    """P of -P' = A' P + P A + 1 at the times of A (N, p, p), without an error of its own: the proof judges it.

    By collocation on as many nodes as P has harmonics; with an error, and by ways that take longer, where the mean of A says little.
    """
    weight, times = np.eye(A.shape[1]), period / len(A) * np.arange(len(A))
    with suppress(ToleranceNotReached):
        for count in COUNTS:
            nodes = interpolated(A, period, fourier_nodes(count, period))
            right = np.broadcast_to(-weight, nodes.shape)
            P = CollocatedLyapunov(nodes, period, -right).solve(right, ACCURACY, ENOUGH)
            if find_tail(P) <= TAIL:
                return FourierSeries.through(P, period)(times)
    slower = PeriodicSystem(lambda t: interpolated(A, period, t), period, complete=True)  # few harmonics, all seen
    return periodic_lyapunov(slower, weight, ACCURACY).X(times)
