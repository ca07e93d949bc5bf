"""Periodic systems with known exponents: blocks with known means, rotated and sheared by periodic matrices, in extended precision.

Of some the modes hardly change their shapes, of others the fast gaps vary by much.
"""

from dataclasses import dataclass, field

import numpy as np

from tests.periodic.cases import kind, known, tol_of
from tests.periodic.chains import Factor, Real, Rotation, Shear, Wave


def wave(rng, mean, size, harmonics):
    """mean + a random trigonometric polynomial."""
    fall = np.sqrt(harmonics) * np.arange(1, harmonics + 1)
    return Wave(mean, 0, *(tuple(rng.standard_normal(harmonics) * size / fall) for _ in range(2)))


def turn(i, j, rotation, angle):
    """A rotation in the plane of coordinates (i, j), or a shear of j onto i, by an angle that waves."""
    return (Rotation if rotation else Shear)(i, j, angle)


def mix(rng, n, smallest, largest):
    """Turns and shears about any angles that wave by 10^smallest to 10^largest."""
    turns = []
    for _ in range(int(rng.integers(1, 2 * n))):
        i, j = rng.choice(n, 2, replace=False)
        size = 10 ** rng.uniform(smallest, largest)
        turns.append(turn(i, j, rng.random() < 0.6, wave(rng, rng.uniform(-1, 1), size, int(rng.integers(1, 7)))))
    return turns


@dataclass(frozen=True)
class Rotated:
    """x' = A(t) x from modes (growth, frequency or None), turned one after another. links: constant entries that make Jordan blocks."""

    period: float
    modes: list
    turns: list[Factor]
    links: list = field(default_factory=list)

    @property
    def exponents(self):
        levels = [(growth.level, frequency.level if frequency else None) for growth, frequency in self.modes]
        return np.concatenate([[a] if w is None else [a + 1j * w, a - 1j * w] for a, w in levels]).astype(complex)

    @property
    def n(self):
        return len(self.exponents)

    def __call__(self, t):
        w = 2 * Real(np.pi) / Real(self.period)
        phase = np.asarray(t, float).astype(Real) * w
        X, i = np.zeros((self.n, self.n, len(phase)), Real), 0
        for growth, frequency in self.modes:
            X[i, i] = growth.value(phase)
            if frequency is not None:
                X[i + 1, i + 1], X[i, i + 1] = X[i, i], frequency.value(phase)
                X[i + 1, i] = -X[i, i + 1]
            i += 1 if frequency is None else 2
        for row, column, value in self.links:
            X[row, column] = value
        for one in self.turns:
            one.conjugate(X, one.wave.value(phase))
            one.drift(X, one.wave.slope(phase) * w)
        return np.ascontiguousarray(np.moveaxis(X, -1, 0).astype(float))


def slow_case(system, tol):
    """Its A(t) is slow to sample in extended precision, and has few harmonics, which are named as all there is."""
    return known(system, system.period, system.exponents, tol, complete=True)


@kind("kept shapes", 1000)
def kept_shapes(rng):
    return slow_case(draw_gentle(rng, bool(rng.random() < 0.5)), tol_of(rng))


@kind("waving shapes", 500)
def waving_shapes(rng):
    return slow_case(draw_lively(rng), tol_of(rng))


@kind("uneven gaps", 300)
def uneven_gaps(rng):
    """A slow pair and two that are up to 1500 times as fast as the motion, whose gap varies by much."""
    period, tol = float(10 ** rng.uniform(-1, 1)), tol_of(rng)
    w, modes = 2 * np.pi / period, []
    for rate, share in ((rng.uniform(1, 5), 0.0), (rng.uniform(50, 400), 0.1), (rng.uniform(300, 1500), 0.4)):
        damping = rate * w * 10 ** rng.uniform(-3, -1)
        modes.append([wave(rng, -damping, 0.3 * damping, 2), wave(rng, rate * w, share * rate * w, 1)])
    turns = [
        turn(*map(int, rng.choice(6, 2, replace=False)), rng.random() < 0.6, wave(rng, rng.uniform(-1, 1), 0.03, 1))
        for _ in range(6)
    ]
    return slow_case(Rotated(period, modes, turns), tol)


def gentle_system(seed, near_resonance=False):
    """The same one for a seed."""
    return draw_gentle(np.random.default_rng([seed, near_resonance]), near_resonance)


def draw_gentle(rng, near_resonance):
    """2 to 12 states, rates from the basic frequency to a million times it, mixed by a constant matrix and slightly by waves.

    near_resonance: frequencies whose differences lie close to multiples of the basic frequency, where coupling adds up.
    """
    period = float(10 ** rng.uniform(-1, 1))
    w, modes, states = 2 * np.pi / period, [], 0
    n = int(rng.integers(2, 13))
    while states < n:
        rate = w * 10 ** rng.uniform(0, rng.choice([2, 4, 6]))
        if near_resonance:
            rate = w * (round(rate / w) % 40 + 0.5 * rng.integers(0, 2) + 10 ** rng.uniform(-6, -1))
        damping = rate * 10 ** rng.uniform(-4, -0.5)
        sign = rng.choice([-1, -1, -1, 1e-3])
        if n - states >= 2 and rng.random() < 0.7:
            frequency = wave(rng, rate, rate * rng.choice([0, 0.02, 0.1]), int(rng.integers(1, 4)))
            modes.append([wave(rng, sign * damping, 0.3 * damping, 2), frequency])
        else:
            modes.append([wave(rng, sign * rate, rate * rng.choice([0, 0.02, 0.2]), 2), None])
        states += 1 if modes[-1][1] is None else 2
    return Rotated(period, modes, mix(rng, states, -4, -0.7))


def draw_lively(rng):
    """2 to 10 states, rates from a third of the basic frequency on, some apart by their damping alone, mixed by larger waves."""
    period = float(10 ** rng.uniform(-1, 1))
    w, modes, states, n = 2 * np.pi / period, [], 0, int(rng.integers(2, 11))
    while states < n:
        rate = w * 10 ** rng.uniform(-0.5, rng.choice([1, 1.5, 2.5]))
        if rng.random() < 0.5:
            rate = w * (round(rate / w) % 30 + 0.5 * rng.integers(0, 2) + 10 ** rng.uniform(-6, -0.5))
        damping, sign = rate * 10 ** rng.uniform(-3, 0), rng.choice([-1, -1, -1, 1e-3, 0.05])
        part = rng.choice([0, 0.02, 0.1, 0.3])
        if n - states >= 2 and rng.random() < 0.6:
            frequency = wave(rng, rate, rate * rng.choice([0, 0.02, 0.1, 0.2]), int(rng.integers(1, 4)))
            modes.append([wave(rng, sign * damping, part * damping, 2), frequency])
        else:
            modes.append([wave(rng, sign * rate, rate * part, 2), None])
        states += 1 if modes[-1][1] is None else 2
    return Rotated(period, modes, mix(rng, states, -3, -0.4))
