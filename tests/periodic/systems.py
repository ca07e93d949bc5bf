"""Periodic systems whose exponents are known, shared by the tests of the numeric wing."""

import numpy as np

from flexlin import PeriodicSystem


def oscillator(stiffness, damping=0.0):
    """A of x'' + damping x' + stiffness x = 0 from values at many times, in their precision."""
    A = np.zeros((len(stiffness), 2, 2), stiffness.dtype)
    A[:, 0, 1], A[:, 1, 0], A[:, 1, 1] = 1, -stiffness, -damping
    return A


def colaneri(t):
    """A = [[0, 1], [-10 cos t, -24 - 10 sin t]], T = 2 pi: exponents 0 and -24."""
    return oscillator(10 * np.cos(t), 24 + 10 * np.sin(t))


def mathieu(a, q):
    """x'' + (a - 2 q cos 2t) x = 0 as a system of first order, T = pi."""
    return lambda t: oscillator(a - 2 * q * np.cos(2 * t))


def turn(n, speed, i=0, j=1):
    """P(t): n coordinates that turn in the plane of two of them."""

    def P(t):
        out = np.tile(np.eye(n), (len(t), 1, 1))
        c, s = np.cos(speed * t), np.sin(speed * t)
        out[:, i, i], out[:, i, j], out[:, j, i], out[:, j, j] = c, s, -s, c
        return out

    return P


def turned(A, B, C, speed=2.0, i=0, j=1):
    """A constant system in such coordinates, x = P z: exponents, gains, norms and zeros are those of the constant one; and its output."""
    J, P = np.zeros(np.shape(A)), turn(len(A), speed, i, j)
    J[i, j], J[j, i] = speed, -speed

    def back(t):
        return np.swapaxes(P(t), 1, 2)

    system = PeriodicSystem(lambda t: J + P(t) @ A @ back(t), 2 * np.pi / speed, B=lambda t: P(t) @ B)
    return system, lambda t: C @ back(t)


def mathieu_second_order(a, q, damping=0.0):
    stiffness = lambda t: (a - 2 * q * np.cos(2 * t))[:, None, None]  # noqa: E731
    return PeriodicSystem.from_second_order(np.eye(1), [[2 * damping]], stiffness, np.pi)


def meissner(t):
    """x'' + (1 - 0.2 psi) x = 0, psi = 1 on [0, pi/3), then -1; T = pi, a break at pi/3."""
    return oscillator(1 - 0.2 * np.where(np.mod(t, np.pi) < np.pi / 3, 1, -1))


def waves(cosines, sines, rates):
    """sum_k cosine_k cos rate_k t + sine_k sin rate_k t for matrices (K, n, m), and its derivative."""

    def value(t):
        angle = np.outer(t, rates)
        return np.einsum("tk,kij->tij", np.cos(angle), cosines) + np.einsum("tk,kij->tij", np.sin(angle), sines)

    def slope(t):
        angle = np.outer(t, rates)
        c, s = np.cos(angle) * rates, np.sin(angle) * rates
        return np.einsum("tk,kij->tij", c, sines) - np.einsum("tk,kij->tij", s, cosines)

    return value, slope


def lyapunov_transformed(constant, frequency, harmonics, rng, size=0.3):
    """A(t) = P' P^-1 + P A0 P^-1 with P = I + a random trigonometric polynomial: the exponents are the eigenvalues of A0."""
    n = len(constant)
    cosine, sine = (size / harmonics * rng.standard_normal((harmonics, n, n)) / np.sqrt(n) for _ in range(2))
    wave, slope = waves(cosine, sine, frequency * np.arange(1, harmonics + 1))

    def A(t):
        P = np.eye(n) + wave(t)
        right = np.swapaxes(slope(t) + P @ constant, 1, 2)
        return np.swapaxes(np.linalg.solve(np.swapaxes(P, 1, 2), right), 1, 2)

    return A


def random_waves(rng, rows, columns, harmonics, decay, period):
    """A random trigonometric polynomial and its derivative."""
    size = decay ** np.arange(harmonics + 1)[:, None, None]
    cosines, sines = (size * rng.normal(size=(harmonics + 1, rows, columns)) for _ in range(2))
    return waves(cosines, sines, 2 * np.pi / period * np.arange(harmonics + 1))


def waving_arm(rng, fixed, sizes, units):
    """M, D, K that wave about fixed ones by sizes, in units of the coordinates (n,); period 1."""
    n = len(units)

    def part(mean, size):
        wave = random_waves(rng, n, n, 4, 0.4, 1.0)[0]
        return lambda t: (mean + size * wave(t)) * units * units[:, None]

    return PeriodicSystem.from_second_order(*map(part, fixed, sizes), 1.0, complete=True)
