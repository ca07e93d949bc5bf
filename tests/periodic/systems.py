"""Periodic systems whose exponents are known, shared by the tests of the numeric wing."""

import numpy as np

from flexlin.periodic import PeriodicSystem


def colaneri(t):
    """A = [[0, 1], [-10 cos t, -24 - 10 sin t]], T = 2 pi: exponents 0 and -24."""
    A = np.zeros((len(t), 2, 2))
    A[:, 0, 1] = 1
    A[:, 1, 0] = -10 * np.cos(t)
    A[:, 1, 1] = -24 - 10 * np.sin(t)
    return A


def mathieu(a, q):
    """x'' + (a - 2 q cos 2t) x = 0 as a system of first order, T = pi."""

    def A(t):
        values = np.zeros((len(t), 2, 2))
        values[:, 0, 1] = 1
        values[:, 1, 0] = -(a - 2 * q * np.cos(2 * t))
        return values

    return A


def mathieu_second_order(a, q):
    return PeriodicSystem.from_second_order(
        np.eye(1), np.zeros((1, 1)), lambda t: (a - 2 * q * np.cos(2 * t))[:, None, None], np.pi
    )
