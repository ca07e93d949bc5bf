"""Errors of X and K beside backward integration of the Riccati equation by SciPy, which shares nothing with the solver."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flexlin import PeriodicSystem
from flexlin.periodic import periodic_riccati

PERIOD, JUMP = 2.0, 0.7
KINDS = ("smooth", "jumps", "unnamed jumps", "semidefinite", "units", "cheap")
INTEGRATED = 2e-11
"""What DOP853 leaves at rtol 1e-12, relative to the largest entry."""


def flip(M):
    return np.swapaxes(M, -1, -2)


def waves(rng, rows, columns, size):
    """A random trigonometric polynomial with two harmonics."""
    parts = size * rng.normal(size=(5, rows * columns))

    def value(t):
        angle = 2 * np.pi / PERIOD * np.outer(t, [1, 2])
        waves = parts[0] + np.cos(angle) @ parts[1:3] + np.sin(angle) @ parts[3:]
        return waves.reshape(-1, rows, columns)

    return value


@dataclass
class Problem:
    """Random coefficients in units that may lie far apart; B, R, Q and N may jump at 0 and JUMP."""

    kind: str
    seed: int

    def __post_init__(self):
        rng = np.random.default_rng([KINDS.index(self.kind), self.seed])
        n, m = int(rng.integers(2, 9)), int(rng.integers(1, 4))
        self.jumps, semidefinite = "jumps" in self.kind, self.kind == "semidefinite"
        self.units = 10.0 ** (rng.uniform(-1.5, 1.5, n) * (2 if self.kind == "units" else 0))
        self.A0, self.B0 = waves(rng, n, n, 1 / np.sqrt(n)), waves(rng, n, m, 1.0)
        self.shift, effort = rng.uniform(-1.5, 0.5) * np.eye(n), rng.normal(size=(m, m))
        self.R0 = (effort @ effort.T + np.eye(m)) * 10.0 ** (rng.uniform(-3, -1) if self.kind == "cheap" else 0)
        self.root = waves(rng, n, int(rng.integers(1, n)) if semidefinite else n, 0.5)
        self.least = (0.0 if semidefinite else 0.3) * np.eye(n)
        self.N0 = 0.1 * rng.normal(size=(n, m)) * (self.kind in ("smooth", "jumps", "unnamed jumps", "units"))
        self.times = np.sort(rng.uniform(0, PERIOD, 6))

    def step(self, t):
        return (1.0 + (self.jumps & (np.mod(t, PERIOD) >= JUMP)))[:, None, None]

    def A(self, t):
        return self.units[:, None] * (self.A0(t) + self.shift) / self.units

    def B(self, t):
        return self.units[:, None] * self.B0(t) * self.step(t)

    def Q(self, t):
        root = self.root(t)
        return (root @ flip(root) + self.least) * self.step(t) / np.outer(self.units, self.units)

    def R(self, t):
        return self.R0 * self.step(t)

    def N(self, t):
        return self.N0 / self.units[:, None] * self.step(t)

    def solve(self, tol):
        breaks = (0.0, JUMP) if self.kind == "jumps" else ()
        return periodic_riccati(PeriodicSystem(self.A, PERIOD, self.B, breaks), self.Q, self.R, self.N, tol)

    def gain(self, t, X):
        return np.linalg.solve(self.R(t), flip(self.B(t)) @ X + flip(self.N(t)))

    def integrate(self, start):
        """X at the times, backwards from about X(T), over periods until it repeats."""
        scale = np.sqrt(np.diag(start))
        scale, shape = np.outer(scale, scale), start.shape
        edges = [0.0, JUMP, PERIOD] if self.jumps else [0.0, PERIOD]

        def integrate_back(x, begin, end, times):
            inside = np.nextafter([begin, end], [PERIOD, 0.0])

            def rate(s, x):
                t, X = np.clip([-s], *inside), x.reshape(shape) * scale
                X = 0.5 * (X + X.T)  # skew parts could grow
                A, B, Q, R, N = (part(t)[0] for part in (self.A, self.B, self.Q, self.R, self.N))
                pull = B.T @ X + N.T
                return ((X @ A + A.T @ X + Q - pull.T @ np.linalg.solve(R, pull)) / scale).ravel()

            stops = np.append(times[::-1], begin)
            found = solve_ivp(rate, (-end, -begin), x, "DOP853", -stops, rtol=1e-12, atol=1e-13)
            assert found.success
            return found.y.T

        x, before = (start / scale).ravel(), np.inf
        for _ in range(25):
            states, after = [], x
            for begin, end in reversed(list(pairwise(edges))):
                *inside, x = integrate_back(x, begin, end, self.times[(self.times > begin) & (self.times <= end)])
                states = [*inside[::-1], *states]
            moved = np.abs(x - after).max()
            if moved <= 1e-12 or 0.5 * before < moved < INTEGRATED / 4:
                break
            before = moved
        else:
            raise AssertionError(f"X does not repeat: {moved:.1e}")
        return np.reshape(states, (-1, *shape)) * scale


def compare(problem, tol):
    """The errors of X and of K, each relative to what is claimed."""
    found, t = problem.solve(tol), problem.times
    X = problem.integrate(found.X(np.nextafter(PERIOD, 0.0)) * (1 + 1e-6))
    K = problem.gain(t, X)
    misses = np.abs(found.X(t) - X).max() / np.abs(X).max(), np.abs(found.K(t) - K).max() / np.abs(K).max()
    return misses[0] / (found.error + INTEGRATED), misses[1] / (found.gain_error + INTEGRATED), found


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), [(kind, k % 2) for k, kind in enumerate(KINDS)])
def test_errors_are_within_the_claims(kind, seed):
    of_X, of_K, found = compare(Problem(kind, seed), (1e-5, 1e-8)[seed % 2])
    assert max(of_X, of_K) <= 1
    assert found.status == "converged"
