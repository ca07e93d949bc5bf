"""Jumps, named or forgotten, and narrow pulses at random places; truths from exponentials and panels in extended precision."""

from dataclasses import dataclass, replace

import numpy as np

from tests.periodic.cases import kind, known, tol_of
from tests.periodic.chains import TWO_PI, Real
from tests.periodic.truths import integrated, panels_of, switched_exponents


@dataclass(frozen=True)
class Piecewise:
    """matrices[k] from edges[k] on, edges[0] = 0, the last one to the end of the period."""

    edges: np.ndarray
    period: float
    matrices: np.ndarray

    def __call__(self, t):
        return self.matrices[np.searchsorted(self.edges, np.mod(t, self.period), side="right") - 1]


def steady(matrix):
    return Piecewise(np.zeros(1), 1.0, np.asarray(matrix, float)[None])


def switched(rng, matrices, period, undamped=False):
    """A different constant matrix on each piece, the jumps not named; half of them do not jump at t = 0."""
    edges = np.sort(period * rng.random(len(matrices)))
    if rng.random() < 0.5:
        edges[0] = 0.0
    else:
        edges, matrices = np.concatenate([[0.0], edges]), [matrices[-1], *matrices]
    return piecewise_case(edges, period, matrices, tol_of(rng), undamped)


def piecewise_case(edges, period, matrices, tol, undamped=False):
    A = Piecewise(edges, period, np.asarray(matrices, float))
    return known(A, period, switched_exponents(matrices, [*edges, period]), tol, undamped=undamped)


def with_breaks(case):
    return replace(case, breaks=tuple(case.A.edges.tolist()))


def oscillators(rng, n):
    """[[0, I], [-K, -D]] with random stiffness, now and then negative, and light damping."""
    K = rng.standard_normal((n, n)) * 0.3
    K = K + K.T + np.diag(10 ** rng.uniform(-0.5, 1.2, n) * rng.choice([1, 1, 1, -0.3], n))
    return np.block([[np.zeros((n, n)), np.eye(n)], [-K, -np.diag(rng.choice([0, 0.05, 0.3], n))]])


def some_matrix(rng, n):
    if n % 2 == 0 and rng.random() < 0.5:
        return oscillators(rng, n // 2)
    return 2 * rng.standard_normal((n, n)) - np.eye(n)


@kind("jumps not named", 400)
def forgotten_jumps(rng):
    n, count = int(rng.integers(2, 6)), int(rng.integers(2, 6))
    return switched(rng, [some_matrix(rng, n) for _ in range(count)], float(10 ** rng.uniform(-0.3, 0.7)))


@kind("jumps named", 200)
def named_jumps(rng):
    return with_breaks(forgotten_jumps(rng))


@kind("Meissner not named", 200)
def meissner_not_named(rng):
    """x'' + 2 z x' + (a + b sign) x = 0 with the jump at a random place."""
    a, b, z = 10 ** rng.uniform(-0.5, 1), 10 ** rng.uniform(-2, 0.5), rng.choice([0.0, 0.02])
    first, second = (np.array([[0, 1.0], [-(a + s * b), -2 * z]]) for s in (1, -1))
    period = float(rng.choice([np.pi, 2.0, 10 ** rng.uniform(-0.3, 0.7)]))
    return switched(rng, [first, second], period, undamped=z == 0)


def reference_jump(tol=1e-9):
    """A jump at 1.0002 in a period of 2: exponents -0.05 +- 1.1982763 i."""
    first, second = np.array([[0, 1], [-1, -0.1]]), np.array([[0, 1], [-9, -0.1]])
    return piecewise_case(np.array([0, 1.0002]), 2.0, [first, second], tol)


def panelled(extended, period, rate, tol, corners=(), windows=(), undamped=False):
    """A function of extended times in [0, T), made periodic and rounded to doubles; its truth is integrated panel by panel."""
    exponents, doubt = integrated(extended, panels_of(period, rate, corners, windows), period)

    def A(t):
        return extended(np.mod(np.asarray(t, float), period).astype(Real)).astype(float)

    return known(A, period, exponents, tol, doubt, undamped=undamped)


@kind("jumps not named, smooth between", 500)
def smooth_jumps(rng):
    n, count = int(rng.integers(2, 5)), int(rng.integers(2, 6))
    period = float(10 ** rng.uniform(-0.3, 0.5))
    edges = np.sort(period * rng.random(count))
    edges[0] = edges[0] if rng.random() < 0.5 else 0.0
    table, turn = (np.array([some_matrix(rng, n) for _ in range(count)]) for _ in range(2))
    harmonic = int(rng.integers(1, 4))

    def extended(t):
        piece = np.searchsorted(edges, t, side="right") - 1
        return table[piece] + Real(0.5) * turn[piece] * np.cos(TWO_PI * harmonic * t / period)[:, None, None]

    rate = np.abs(table).sum(axis=(1, 2)).max() + np.abs(turn).sum(axis=(1, 2)).max() + harmonic / period
    return panelled(extended, period, rate, tol_of(rng), edges)


@dataclass(frozen=True)
class Pulse:
    """A pulse of unit area on the circle: gaussian, box, or two steps of tanh a tenth of the width long."""

    shape: str
    centre: float
    width: float
    period: float

    def __call__(self, t):
        c, w, T = Real(self.centre), Real(self.width), Real(self.period)
        if self.shape == "box":
            start, end = self.corners
            return np.where((t >= start) & (t < end), 1 / (Real(end) - Real(start)), Real(0))
        d = (np.mod(t - c + T / 2, T) - T / 2) / w
        if self.shape == "gaussian":
            return np.exp(-(d**2)) / (w * np.sqrt(TWO_PI / 2))
        return (np.tanh(10 * (d + Real(0.5))) - np.tanh(10 * (d - Real(0.5)))) / (2 * w)

    @property
    def corners(self):
        return (self.centre, self.centre + self.width) if self.shape == "box" else ()

    @property
    def windows(self):
        """Where the truth needs short panels: (centre, half-width, count)."""
        if self.shape == "box":
            return ((self.centre + self.width / 2, self.width / 2, 40),)
        # half a period away from the centre a wide pulse is folded: the kink there is far below rounding
        return ((self.centre, min((8 if self.shape == "gaussian" else 3) * self.width, self.period / 2), 160),)


@kind("pulses", 1000)
def pulses(rng):
    """[[0, I], [-K - a p(t) G, -D]]: a pulse of unit area and width T/10 to T/1000 in the stiffness."""
    n, period = int(rng.integers(1, 4)), float(10 ** rng.uniform(-0.3, 0.5))
    base, area = oscillators(rng, n), float(rng.choice([1.0, 6.0, rng.normal() * 4]))
    G = np.zeros((2 * n, 2 * n))
    G[n:, :n] = -np.eye(n) if rng.random() < 0.5 else np.round(rng.standard_normal((n, n)), 2)
    shape = str(rng.choice(["gaussian", "box", "steps"]))
    width = float(period * 10 ** rng.uniform(-3, -1.2 if shape == "gaussian" else -1))
    p = Pulse(shape, float(rng.uniform(0, period - 1.01 * width)), width, period)

    def extended(t):
        return base + area * p(t)[:, None, None] * G

    return panelled(extended, period, np.abs(base).sum() + 20 / period, tol_of(rng), p.corners, p.windows)


def reference_pulse(tol=1e-9):
    """Width 2e-4 at 0.3 of T = 1, area 6: exponents 1.28204116 and -1.33204116 (and half a turn)."""
    p, base = Pulse("gaussian", 0.3, 2e-4, 1.0), np.array([[0, 1], [-1, -0.05]])

    def extended(t):
        return base - 6 * p(t)[:, None, None] * np.array([[0, 0], [1, 0]])

    return panelled(extended, 1.0, 2.0, tol, (), p.windows)
