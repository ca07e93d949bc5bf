"""A certificate's X(t) from the decoupled modes: each group of them by itself, the fast ones without following them."""

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NumericalError
from flexlin.periodic.decoupling.decouple import decouple
from flexlin.periodic.decoupling.decoupled import Decoupled, Refusal, as_real
from flexlin.periodic.decoupling.waves import interpolated
from flexlin.periodic.quadratic.riccati import periodic_lyapunov
from flexlin.periodic.system import PeriodicSystem

ACCURACY = 1e-7
"""Of the frame and of the groups' equations: what they miss costs margin, not truth."""


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
    n, size, turn = *B.shape[:2], np.trace(B.mean(axis=0)).imag / B.shape[1]
    shifted = B + (shift - 1j * turn) * np.eye(size)
    values = shifted.real if real else as_real(shifted)
    slower = PeriodicSystem(lambda t: interpolated(values, period, t), period, complete=True)  # few harmonics, all seen
    P = periodic_lyapunov(slower, np.eye(len(values[0])), ACCURACY).X(period / n * np.arange(n))
    return P if real else P[:, :size, :size] + 1j * P[:, size:, :size]
