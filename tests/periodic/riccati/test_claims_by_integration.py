"""Errors of X and K beside backward integration of the Riccati equation by SciPy, which shares nothing with the solver."""

import numpy as np
import pytest

from flexlin import PeriodicSystem
from flexlin.periodic import periodic_riccati
from tests.periodic.dense import at, integrate
from tests.periodic.systems import random_waves

PERIOD, JUMP = 2.0, 0.7
KINDS = ("smooth", "jumps", "unnamed jumps", "semidefinite", "cheap", "fast")
INTEGRATED = 2e-11
"""What DOP853 leaves at rtol 1e-12, relative to the largest entry."""


def flip(M):
    return np.swapaxes(M, -1, -2)


def waves(rng, rows, columns, size):
    """A random trigonometric polynomial with two harmonics."""
    value, _ = random_waves(rng, rows, columns, 2, 1.0, PERIOD)
    return lambda t: size * value(t)


def oscillators(rng, n):
    """Coupled oscillators, slow to fast, whose stiffness swings, and a force on them that turns."""
    rates = np.array([1.0, rng.uniform(4, 10), 10 ** rng.uniform(1.5, 2.3)])
    swing, force = 0.2 * rates[:, None] * rng.uniform(-1, 1, (3, 3)) * rates, waves(rng, 3, 2, 0.7)

    def A(t):
        values = np.zeros((len(t), 6, 6))
        values[:, :3, 3:], values[:, 3:, 3:] = np.eye(3), -0.1 * np.diag(rates)
        values[:, 3:, :3] = -np.diag(rates**2) - swing * np.cos(np.pi * t)[:, None, None]
        return values

    return A, lambda t: np.pad(force(t), ((0, 0), (3, 0), (0, 0)))


def pose(kind, seed):
    """Random coefficients A, B, Q, R, N as functions of time, of which all but A may jump at 0 and JUMP; and six times."""
    rng, jumps = np.random.default_rng([KINDS.index(kind), seed]), "jumps" in kind
    n, m = (6, 2) if kind == "fast" else (int(rng.integers(2, 9)), int(rng.integers(1, 4)))
    A, B = waves(rng, n, n, 1 / np.sqrt(n)), waves(rng, n, m, 1.0)
    if kind == "fast":
        A, B = oscillators(rng, n)
    shift, effort = rng.uniform(-1.5, 0.5) * np.eye(n) * (kind != "fast"), rng.normal(size=(m, m))
    R = (effort @ effort.T + np.eye(m)) * 10.0 ** (rng.uniform(-3, -1) if kind in ("cheap", "fast") else 0)
    root = waves(rng, n, int(rng.integers(1, n)) if kind == "semidefinite" else n, 0.5)
    least = (0.0 if kind == "semidefinite" else 0.3) * np.eye(n)
    N = 0.1 * rng.normal(size=(n, m)) * (kind in ("smooth", "jumps", "unnamed jumps"))

    def step(t):
        wave = 0.2 * np.sin(np.pi * np.asarray(t)) * (kind == "smooth")
        return (1.0 + wave + (jumps & (np.mod(t, PERIOD) >= JUMP)))[:, None, None]

    parts = {
        "A": lambda t: A(t) + shift,
        "B": lambda t: B(t) * step(t),
        "Q": lambda t: (root(t) @ flip(root(t)) + least) * step(t),
        "R": lambda t: R * step(t),
        "N": lambda t: N * step(t),
    }
    return parts, np.sort(rng.uniform(0, PERIOD, 6))


def solve(parts, tol, breaks=()):
    A, B, *weights = parts.values()
    return periodic_riccati(PeriodicSystem(A, PERIOD, B, breaks), *weights, tol)


def integrate_back(parts, X, times, periods):
    """X at 0 and at the times, backwards from X(T), over so many periods or until it repeats, in units of its own."""
    scale = np.sqrt(np.outer(np.diag(X), np.diag(X)))
    stops = np.unique([0.0, *times, JUMP, PERIOD])[::-1]

    def rate(t, X):
        X = 0.5 * (X + X.T) * scale  # skew parts could grow
        A, B, Q, R, N = (at(part, t) if callable(part) else part for part in parts.values())
        pull = B.T @ X + N.T
        return -(X @ A + A.T @ X + Q - pull.T @ np.linalg.solve(R, pull)) / scale

    X, before = X / scale, np.inf
    for _ in range(periods):
        states = integrate(rate, X, stops)
        moved, X = np.abs(states[-1] - X).max(), states[-1]
        if moved <= 1e-12 or 0.5 * before < moved < INTEGRATED / 4:
            break
        before = moved
    else:
        assert periods < 25, f"X does not repeat: {moved:.1e}"
    return states[::-1][np.isin(stops[::-1], [0.0, *times])] * scale


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), [(kind, k % 2) for k, kind in enumerate(KINDS)])
def test_errors_are_within_the_claims(kind, seed):
    (parts, t), fast = pose(kind, seed), kind == "fast"
    found = solve(parts, 1e-9 if fast else (1e-5, 1e-8)[seed % 2], (0.0, JUMP) if kind == "jumps" else ())
    start = found.X(np.nextafter(PERIOD, 0.0)) * (1 + 1e-6 * (not fast))
    X, own = integrate_back(parts, start, t, 2 if fast else 25)[1:], INTEGRATED * (5 if fast else 1)
    K = np.linalg.solve(parts["R"](t), flip(parts["B"](t)) @ X + flip(parts["N"](t)))
    assert np.abs(found.X(t) - X).max() <= (found.error + own) * np.abs(X).max()
    assert np.abs(found.K(t) - K).max() <= (found.gain_error + own) * np.abs(K).max()
    assert found.status == "converged"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_each_coefficient_may_be_constant_or_vary(seed):
    """Every two of them in all four ways: X goes into itself over a period."""
    (parts, _), (a, b, c) = pose("smooth", seed), (seed >> np.arange(3)) & 1
    for name, varies in zip("ABQRN", (a, b, c, a ^ b, a ^ c), strict=True):
        if not varies:
            parts[name] = at(parts[name], 0.3)
    found = solve(parts, 1e-9)
    X = integrate_back(parts, found.X(0.0), [], 1)[0]
    assert np.abs(found.X(0.0) - X).max() <= (found.error + 1e-9) * np.abs(X).max()
    assert found.error < 1e-9
