"""Periodic systems with known exponents: blocks with known means, rotated and sheared by periodic matrices, in extended precision."""

from dataclasses import dataclass, field

import numpy as np

LONG = np.longdouble


@dataclass(frozen=True)
class Wave:
    """mean + sum_k a_k cos k p + b_k sin k p of the phase p, with its derivative by p."""

    mean: float
    a: np.ndarray
    b: np.ndarray

    def __call__(self, phase):
        k = np.arange(1, len(self.a) + 1).astype(LONG)
        x = phase[:, None] * k
        return self.mean + np.cos(x) @ self.a + np.sin(x) @ self.b, np.cos(x) @ (k * self.b) - np.sin(x) @ (k * self.a)


def wave(rng, mean, size, harmonics):
    fall = np.sqrt(harmonics) * np.arange(1, harmonics + 1)
    a, b = ((rng.standard_normal(harmonics) * size / fall).astype(LONG) for _ in range(2))
    return Wave(mean, a, b)


@dataclass(frozen=True)
class Turn:
    """A rotation in the plane of coordinates (i, j), or a shear of j onto i, by an angle that waves and makes whole turns."""

    i: int
    j: int
    rotation: bool
    angle: Wave
    turns: int = 0

    def act(self, X, phase, w):
        """P X P^-1 + P' P^-1."""
        i, j = self.i, self.j
        angle, slope = self.angle(phase)
        if self.rotation:
            angle, slope = angle + self.turns * phase, slope + self.turns
        P = np.zeros_like(X) + np.eye(X.shape[-1], dtype=LONG)
        Q, rate = P.copy(), np.zeros_like(X)
        if self.rotation:
            for M, sign in ((P, 1), (Q, -1)):
                M[:, i, i] = M[:, j, j] = np.cos(angle)
                M[:, i, j], M[:, j, i] = -sign * np.sin(angle), sign * np.sin(angle)
            rate[:, i, j], rate[:, j, i] = -slope * w, slope * w
        else:
            P[:, i, j], Q[:, i, j], rate[:, i, j] = angle, -angle, slope * w
        return P @ X @ Q + rate


@dataclass(frozen=True)
class Rotated:
    """x' = A(t) x from modes (growth, frequency or None), turned one after another. links: constant entries that make Jordan blocks."""

    period: float
    modes: list
    turns: list
    links: list = field(default_factory=list)

    @property
    def n(self):
        return sum(1 if frequency is None else 2 for _, frequency in self.modes)

    @property
    def exponents(self):
        found = []
        for growth, frequency in self.modes:
            if frequency is None:
                found.append(complex(growth.mean))
            else:
                found += [complex(growth.mean, frequency.mean), complex(growth.mean, -frequency.mean)]
        return np.array(found)

    def __call__(self, t):
        w = LONG(2) * LONG(np.pi) / LONG(self.period)
        phase = np.asarray(t, float).astype(LONG) * w
        X, i = np.zeros((len(phase), self.n, self.n), LONG), 0
        for growth, frequency in self.modes:
            X[:, i, i] = growth(phase)[0]
            if frequency is not None:
                X[:, i + 1, i + 1] = X[:, i, i]
                X[:, i, i + 1] = frequency(phase)[0]
                X[:, i + 1, i] = -X[:, i, i + 1]
            i += 1 if frequency is None else 2
        for row, column, value in self.links:
            X[:, row, column] = value
        for turn in self.turns:
            X = turn.act(X, phase, w)
        return X.astype(float)


KINDS = ("plain", "heavy", "undamped", "unstable", "crossing frequencies", "crossing damping", "jordan", "overdamped")


def random_system(seed, kind):
    """4 to 20 states, rates up to a million times the basic frequency."""
    rng = np.random.default_rng(seed)
    n, period = int(rng.integers(4, 21)), float(10 ** rng.uniform(-1, 1))
    w, width, modes, states = 2 * np.pi / period, rng.uniform(1, 6), [], 0
    while states < n:
        rate = w * (10 ** rng.uniform(-1, width) if rng.random() < 0.6 else rng.uniform(0.1, 2))
        if n - states >= 2 and rng.random() < 0.7:
            damping = {"heavy": rng.uniform(0.05, 1), "undamped": 0.0}.get(kind, 10 ** rng.uniform(-4, -1)) * rate
            growth = wave(rng, -damping, damping * rng.uniform(0, 0.3), 3)
            modes.append([growth, wave(rng, rate, rate * rng.choice([0, 0.05, 0.3]), 3)])
        else:
            rate *= kind != "undamped"
            modes.append([wave(rng, -rate, rate * rng.choice([0, 0.1, 0.3]), 3), None])
        states += 1 if modes[-1][1] is None else 2
    starts = np.cumsum([0] + [1 if f is None else 2 for _, f in modes])
    pairs = [k for k, (_, f) in enumerate(modes) if f is not None]
    links = []
    if kind == "unstable":
        growth = modes[0][0]
        modes[0][0] = Wave(abs(growth.mean), growth.a, growth.b)
    if len(pairs) > 1:
        first, second = modes[pairs[0]], modes[pairs[1]]
        if kind == "crossing frequencies":
            second[1] = wave(rng, first[1].mean * rng.uniform(0.97, 1.03), 0.1 * first[1].mean, 2)
        if kind == "crossing damping":
            second[0] = wave(rng, first[0].mean + 0.1 * w * rng.uniform(-1, 1), min(20 * w, -first[0].mean, 3 * w), 2)
        if kind == "jordan":
            second[:] = first
            links = [(starts[pairs[0]] + k, starts[pairs[1]] + k, w * 0.5) for k in (0, 1)]
    turns = []
    for _ in range(int(rng.integers(1, 2 * n))):
        i, j = rng.choice(n, 2, replace=False)
        angle = wave(rng, rng.uniform(-1, 1), rng.choice([0.05, 0.2, 0.5]), int(rng.integers(1, 4)))
        turns.append(Turn(i, j, rng.random() < 0.6, angle, int(rng.integers(-1, 2)) if rng.random() < 0.1 else 0))
    if kind == "overdamped" and pairs:
        start = starts[pairs[0]]
        turns.append(Turn(start, start + 1, False, wave(rng, 0.0, 1.0, 1)))
    return Rotated(period, modes, turns, links)
