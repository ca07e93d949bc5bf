"""Periodic systems whose exponents are known, shared by the tests of the numeric wing."""

import numpy as np

from flexlin import PeriodicSystem


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


def turn(n, speed):
    """P(t): n coordinates that turn in the plane of the first two."""

    def P(t):
        out = np.tile(np.eye(n), (len(t), 1, 1))
        c, s = np.cos(speed * t), np.sin(speed * t)
        out[:, 0, 0], out[:, 0, 1], out[:, 1, 0], out[:, 1, 1] = c, s, -s, c
        return out

    return P


def turned(A, B, C, speed=2.0):
    """A constant system in such coordinates, x = P z: exponents, gains, norms and zeros are those of the constant one; and its output."""
    J, P = np.zeros(np.shape(A)), turn(len(A), speed)
    J[0, 1], J[1, 0] = speed, -speed

    def back(t):
        return np.swapaxes(P(t), 1, 2)

    system = PeriodicSystem(lambda t: J + P(t) @ A @ back(t), 2 * np.pi / speed, B=lambda t: P(t) @ B)
    return system, lambda t: C @ back(t)


def mathieu_second_order(a, q, damping=0.0):
    return PeriodicSystem.from_second_order(
        np.eye(1), [[2 * damping]], lambda t: (a - 2 * q * np.cos(2 * t))[:, None, None], np.pi
    )


def meissner(t):
    """x'' + (1 - 0.2 psi) x = 0, psi = 1 on [0, pi/3), then -1; T = pi, a break at pi/3."""
    A = np.zeros((len(t), 2, 2))
    A[:, 0, 1] = 1
    A[:, 1, 0] = -(1 - 0.2 * np.where(np.mod(t, np.pi) < np.pi / 3, 1, -1))
    return A


def lyapunov_transformed(constant, frequency, harmonics, rng, size=0.3):
    """A(t) = P' P^-1 + P A0 P^-1 with P = I + a random trigonometric polynomial: the exponents are the eigenvalues of A0."""
    n = len(constant)
    cosine, sine = (size / harmonics * rng.standard_normal((harmonics, n, n)) / np.sqrt(n) for _ in range(2))
    order = np.arange(1, harmonics + 1)

    def A(t):
        phase = frequency * t[:, None] * order
        P = np.eye(n) + np.einsum("th,hij->tij", np.cos(phase), cosine) + np.einsum("th,hij->tij", np.sin(phase), sine)
        slope = frequency * (
            np.einsum("th,h,hij->tij", np.cos(phase), order, sine)
            - np.einsum("th,h,hij->tij", np.sin(phase), order, cosine)
        )
        right = np.swapaxes(slope + P @ constant, 1, 2)
        return np.swapaxes(np.linalg.solve(np.swapaxes(P, 1, 2), right), 1, 2)

    return A


def random_waves(rng, rows, columns, harmonics, decay, period):
    """A random trigonometric polynomial and its derivative."""
    size = decay ** np.arange(harmonics + 1)[:, None, None]
    cosines, sines = (size * rng.normal(size=(harmonics + 1, rows, columns)) for _ in range(2))
    rate = 2 * np.pi / period * np.arange(harmonics + 1)

    def value(t):
        angle = np.outer(t, rate)
        return np.einsum("tk,kij->tij", np.cos(angle), cosines) + np.einsum("tk,kij->tij", np.sin(angle), sines)

    def slope(t):
        angle = np.outer(t, rate)
        return np.einsum("tk,kij->tij", np.cos(angle) * rate, sines) - np.einsum(
            "tk,kij->tij", np.sin(angle) * rate, cosines
        )

    return value, slope
