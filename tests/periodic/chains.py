"""Lyapunov transformations as chains of elementary factors in extended precision, with the rounding of A in the exponents.

    A = P' P^-1 + P D P^-1,   P = X_k ... X_1,   as A <- X A X^-1 + X' X^-1, one factor after the other
    x(phi(t)):   A(t) = phi' A(phi),   phi(t + T) = phi(t) + 2 pi

Each factor is a row and column operation, so P^-1 is never computed; only the last step rounds A to double precision.
"""

from dataclasses import dataclass, replace

import numpy as np

Real = np.longdouble
TWO_PI = 2 * np.arccos(Real(-1))


@dataclass(frozen=True)
class Wave:
    """turns phi + level + sum_k (cosine_k cos k phi + sine_k sin k phi)."""

    level: float = 0.0
    turns: int = 0
    cosine: tuple[float, ...] = ()
    sine: tuple[float, ...] = ()

    def value(self, phi):
        total = self.turns * phi + Real(self.level)
        for k, (a, b) in enumerate(zip(self.cosine, self.sine, strict=True), 1):
            total = total + a * np.cos(k * phi) + b * np.sin(k * phi)
        return total

    def slope(self, phi):
        total = Real(self.turns) + 0 * phi
        for k, (a, b) in enumerate(zip(self.cosine, self.sine, strict=True), 1):
            total = total - k * a * np.sin(k * phi) + k * b * np.cos(k * phi)
        return total


class Factor:
    """X(phi) of a chain; `left` makes X A and `right` A X^-1 in place, `drift` adds X' X^-1; X^T is of the `transposed` factor."""

    def right(self, A, value):
        self.transposed.left(A.swapaxes(0, 1), -value)

    def conjugate(self, A, value):
        self.left(A, value)
        self.right(A, value)


@dataclass(frozen=True)
class InPlane(Factor):
    """Of two coordinates and an angle or size."""

    i: int
    j: int
    wave: Wave

    @property
    def transposed(self):
        return replace(self, i=self.j, j=self.i)


class Rotation(InPlane):
    """A turn in the plane (i, j) by the wave."""

    def left(self, A, value):
        c, s = np.cos(value), np.sin(value)
        A[self.i], A[self.j] = c * A[self.i] - s * A[self.j], s * A[self.i] + c * A[self.j]

    def drift(self, A, slope):
        A[self.j, self.i] += slope
        A[self.i, self.j] -= slope


class Shear(InPlane):
    """I + wave e_i e_j^T."""

    def left(self, A, value):
        A[self.i] += value * A[self.j]

    def drift(self, A, slope):
        A[self.i, self.j] += slope


@dataclass(frozen=True)
class Stretch(Factor):
    """exp(wave) in the coordinate i: an exponential of a periodic diagonal matrix."""

    i: int
    wave: Wave

    @property
    def transposed(self):
        return self

    def left(self, A, value):
        A[self.i] *= np.exp(value)

    def drift(self, A, slope):
        A[self.i, self.i] += slope


@dataclass(frozen=True)
class Unipotent(Factor):
    """exp(wave N) with N^3 = 0."""

    N: np.ndarray
    wave: Wave

    def left(self, A, value):
        term = A.copy()
        for k in (1, 2):
            term = np.einsum("ij,jkt->ikt", self.N, term) * value / k
            A += term

    @property
    def transposed(self):
        return replace(self, N=self.N.T)

    def drift(self, A, slope):
        A += self.N[..., None] * slope


@dataclass(frozen=True)
class Clock:
    """phi(t): the period, relative speed 1 + sum of depth_k cos(2 pi k t/T + phase_k), or 1 + depth g(t/T - start) with a kink or jump."""

    period: float
    depth: tuple[float, ...] = ()
    phase: tuple[float, ...] = ()
    shape: str = "smooth"
    start: float = 0.0
    duty: float = 0.5

    def __call__(self, t):
        """phi and its slope in 1/s, at double times t."""
        u = np.asarray(t, Real) / Real(self.period)
        if self.shape == "smooth":
            speed, turn = 1 + 0 * u, u + 0
            for k, (a, p) in enumerate(zip(self.depth, self.phase, strict=True), 1):
                speed = speed + a * np.cos(TWO_PI * k * u + p)
                turn = turn + a * np.sin(TWO_PI * k * u + p) / (TWO_PI * k)
        else:
            g, G = bump(self.shape, np.mod(u - Real(self.start) / Real(self.period), 1), Real(self.duty))
            speed, turn = 1 + self.depth[0] * g, u + self.depth[0] * G
        return TWO_PI * turn, TWO_PI / Real(self.period) * speed

    @property
    def corners(self):
        """Times at which A is not smooth."""
        ends = {"smooth": [], "triangle": [0.0, 0.5], "square": [0.0, self.duty]}.get(self.shape, [0.0])
        return tuple(sorted({float((self.start + e * self.period) % self.period) for e in ends}))


def bump(shape, u, duty):
    """A function of mean 0 on [0, 1), not smooth at 0, and its integral."""
    c, s = np.cos(TWO_PI / 2 * u), np.abs(np.sin(TWO_PI / 2 * u))
    if shape == "sine":
        return TWO_PI / 4 * s - 1, (1 - c) / 2 - u
    if shape == "cube":
        return 3 * TWO_PI / 8 * s**3 - 1, Real(0.75) * (Real(2) / 3 - c + c**3 / 3) - u
    if shape == "triangle":
        return 4 * np.abs(u - 0.5) - 1, np.where(u < 0.5, u - 2 * u**2, 2 * u**2 - 3 * u + 1)
    ratio = duty / (1 - duty)
    return np.where(u < duty, 1, -ratio), np.where(u < duty, u, duty - (u - duty) * ratio)


@dataclass(frozen=True)
class Chain:
    """A(t) of a constant matrix D in 1/s seen through a chain of factors and a clock."""

    D: np.ndarray
    factors: tuple
    clock: Clock

    def extended(self, t):
        """A(t) as (n, n, N), and phi, in extended precision."""
        phi, slope = self.clock(t)
        n = len(self.D)
        A = np.zeros((n, n, len(phi)), Real)
        A += (self.D.astype(Real) * Real(self.clock.period) / TWO_PI)[..., None]
        for factor in self.factors:
            factor.conjugate(A, factor.wave.value(phi))
            factor.drift(A, factor.wave.slope(phi))
        return A * slope, phi

    def __call__(self, t):
        return np.ascontiguousarray(np.moveaxis(self.extended(t)[0], -1, 0).astype(float))

    def rounding(self, rng, samples=64):
        """The rounding of A seen in D's coordinates, E = P^-1 dA P: |mean| + 3 standard errors of each entry, in 1/s."""
        t = self.clock.period * rng.random(samples)
        A, phi = self.extended(t)
        E = A.astype(float) - A
        for factor in reversed(self.factors):
            factor.conjugate(E, -factor.wave.value(phi))
        spread = np.sqrt(np.mean(E**2, axis=-1))
        return (1.5 * (np.abs(E.mean(axis=-1)) + 3 * spread / np.sqrt(samples))).astype(float)

    def condition(self, samples=16):
        """The largest condition number of P over a period."""
        n, phi = len(self.D), TWO_PI * np.arange(samples) / samples
        P = np.zeros((n, n, samples), Real) + np.eye(n)[..., None]
        for factor in self.factors:
            factor.left(P, factor.wave.value(phi))
        return float(np.linalg.cond(np.moveaxis(P, -1, 0).astype(float)).max())
