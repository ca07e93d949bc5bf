"""Periodic coordinates that take the coupling out of modes whose shapes hardly change, by rounds of Fourier series."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.decoupling.mean_modes import MeanModes
from flexlin.periodic.decoupling.waves import KEPT, circle_derivative, harmonics, interleaved, shifted

NEAR, BEYOND, LEAST = 0.2, 0.2, 0.05
"""A harmonic whose frequency comes closer to the gap of two eigenvalues stays, since it would not shrink: closer than NEAR of the gap, than
BEYOND times what the two deviate from their means, and than LEAST of the basic frequency where they deviate by less."""
EVEN, FAST, OPEN = 0.8, 30.0, 0.2
"""Two modes are parted by the gap of each time where their eigenvalues stay farther apart than the part EVEN of its mean; or than the part
OPEN of it and FAST times the basic frequency: what is left is as small as the rate of change over the gap, however uneven this is."""
ENOUGH, SHRINK = 2e-3, 0.8
"""Rounds end when the coupling's effect is this part of what is allowed, or shrinks by less than this factor."""
MAX_ROUNDS = 12
EVIDENT = 10.0
"""Rounds end too where a resonance's effect exceeds what is allowed by this factor: no round takes it away."""


@dataclass(frozen=True, eq=False)
class Coordinates:
    """w = P(t) z at nodes k T / N: P, P', P^-1 and the generator P^-1 (A P - P'), each (N, n, n), complex; the rounds that were made.

    resonance (n, n): the effect of what is left of each pair since it resonates, against what is allowed.
    """

    P: Array
    slope: Array
    inverse: Array
    generator: Array
    rounds: int
    resonance: Array


def find_coordinates(own: Array, modes: MeanModes, period: float, allowed: Array) -> Coordinates:
    """Make w' = own(t) w block diagonal up to couplings whose effect is small beside `allowed`.

    Each round takes P := P (1 + S), own := (1 + S)^-1 (own (1 + S) - S') with the Fourier coefficients

        S_ij,k = R_ij,k / (i k w - g),   R the coupling between groups times g / g(t),   g the mean of g(t) = b_i - b_j on the diagonal,

    where the divisor is large enough; it solves S' = g(t) S + R where R is slow beside g or g(t) is constant. Where g(t) is slow and varies
    by much, R is the coupling itself, and what is left is smaller by how much.

    Parameters: own (N, n, n): generator in the modes of the mean; every other node builds P, the others check; allowed (n,) in 1/s.
    Source: averaging to high order: Sanders, Verhulst, Murdock, Averaging Methods in Nonlinear Dynamical Systems (2007), ch. 3.
    """
    B, w, n = own[::2], 2 * np.pi / period, own.shape[-1]
    frequency = w * harmonics(len(B))[:, None, None]
    P = np.broadcast_to(np.eye(n, dtype=complex), B.shape)
    best, least, made = P, np.inf, 0
    while True:
        S, slope, worst, resonance = step_once(B, modes.outside, frequency, allowed)
        if resonance.max() > EVIDENT or not worst < SHRINK * least:
            made -= 1
            break
        best, least = P, worst
        if worst < ENOUGH or made == MAX_ROUNDS:
            break
        step = np.eye(n) + S
        P, B, made = P @ step, np.linalg.solve(step, B @ step - slope), made + 1
    P = interleaved(best, shifted(best, 0.5))
    slope = interleaved(circle_derivative(best, period), circle_derivative(best, period, 0.5))
    inverse = np.linalg.inv(P)
    inverse += inverse @ (np.eye(n) - P @ inverse)
    return Coordinates(P, slope, inverse, inverse @ (own @ P - slope), made, resonance)


def limit_nearness(B: Array, b: Array, outside: Array, w: float) -> Array:
    """How close a harmonic may come to the gap of each pair of modes (n, n), b (n,) the means of the diagonal, w the basic frequency."""
    inner = np.where(outside | np.eye(len(b), dtype=bool), 0, np.abs(B).max(axis=0)).sum(axis=1)
    away = np.abs(np.einsum("tii->ti", B) - b).max(axis=0) + inner
    nearest = np.minimum(NEAR * np.abs(b[:, None] - b), np.maximum(BEYOND * (away[:, None] + away), LEAST * w))
    return np.asarray(nearest)


def keeps_apart(least: Array, mean: Array, w: float) -> Array:
    """Which pairs of modes (n, n) are parted by the gap of each time: its least and mean sizes, w the basic frequency."""
    return np.asarray((least > EVEN * mean) | ((least > OPEN * mean) & (least > FAST * w)))


def step_once(B: Array, outside: Array, frequency: Array, allowed: Array) -> tuple[Array, Array, float, Array]:
    """S and S' at the nodes, the largest effect of the coupling on a mode against what is allowed, and that of resonances (n, n)."""
    count, diagonal = len(B), np.einsum("tii->ti", B)
    b = diagonal.mean(axis=0)
    gap, now = b[:, None] - b, diagonal[:, :, None] - diagonal[:, None]
    even = outside & keeps_apart(np.abs(now).min(axis=0), np.abs(gap), frequency[1, 0, 0])
    divisor = 1j * frequency - gap
    low = outside & (np.abs(harmonics(count)) <= KEPT * count)[:, None, None]
    kept = low & (np.abs(divisor) > limit_nearness(B, b, outside, frequency[1, 0, 0]))
    spectrum = np.fft.fft(B * np.where(even, gap / np.where(even, now, 1), 1), axis=0)
    square = np.abs(spectrum / count) ** 2
    left, stuck = (square * (outside & ~kept)).sum(axis=0), (square * (low & ~kept)).sum(axis=0)
    spectrum = np.where(kept, spectrum / np.where(kept, divisor, 1), 0)
    S, slope = np.fft.ifft(spectrum, axis=0), np.fft.ifft(1j * frequency * spectrum, axis=0)
    size = np.abs(S).max(axis=0)
    effect = np.abs(gap) * size * size.T + (left * left.T) ** 0.25
    return S, slope, float((effect / allowed[:, None]).max()), (stuck * stuck.T) ** 0.25 / allowed[:, None]
