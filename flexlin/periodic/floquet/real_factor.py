"""The real Floquet factorization Phi(t, 0) = P(t) exp(R t) P(0)^-1, with P of period T or 2T."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.floquet.modes import FloquetModes

REAL = 1e-9
"""A multiplier whose angle is this close to 0 or pi (of pi) counts as real."""


@dataclass(frozen=True)
class RealFactor:
    """P (N, n, n) at times (N,) of one period, R (n, n) block diagonal, and the period of P (T or 2T, in s).

    sign (n,): P[:, :, i] at t + T is sign[i] times that at t; the change of variables x = P(t) z gives z' = R z.
    """

    times: Array
    P: Array
    R: Array
    period: float
    sign: Array


def real_factor(modes: FloquetModes) -> RealFactor:
    """Turn the complex modes into a real periodic change of variables.

        complex pair p = a + i b:  columns a, b,  block [[Re lambda, Im lambda], [-Im lambda, Re lambda]]
        real multiplier > 0:       column p;      real multiplier < 0:  column Re(p exp(i pi t / T)), which changes sign over T

    Assumes independent modes (no defective exponent).
    Source: Yakubovich, Starzhinskii (1975), ch. II; Montagnier, Paige, Spiteri, Linear Algebra Appl. 364 (2003).
    """
    n = len(modes.exponents)
    half = np.pi / modes.period
    P, R, sign = np.empty(modes.right.shape), np.zeros((n, n)), np.ones(n)
    for i, exponent in enumerate(modes.exponents):
        angle = abs(exponent.imag) / half
        if min(angle, 1 - angle) < REAL:
            sign[i] = -1.0 if angle > 0.5 else 1.0
            R[i, i] = exponent.real
            P[:, :, i] = turn_real(modes.right[:, :, i] * np.exp(1j * exponent.imag * modes.times)[:, None])
        elif exponent.imag > 0:
            j = find_conjugate(i, modes.exponents)
            P[:, :, i], P[:, :, j] = modes.right[:, :, i].real, modes.right[:, :, i].imag
            R[np.ix_([i, j], [i, j])] = [[exponent.real, exponent.imag], [-exponent.imag, exponent.real]]
    return RealFactor(modes.times, P, R, modes.period * (2 if np.any(sign < 0) else 1), sign)


def turn_real(mode: Array) -> Array:
    """Turn the phase of a mode that is real up to a constant factor."""
    square = (mode * mode).sum()
    return (mode * np.exp(-0.5j * np.angle(square))).real


def find_conjugate(i: int, exponents: Array) -> int:
    """The index of the conjugate of exponent i: among equal pairs, the one of the same place."""
    place = int(np.sum(np.abs(exponents[:i] - exponents[i]) < 1e-12 * (1 + abs(exponents[i]))))
    order = np.argsort(np.abs(exponents - exponents[i].conjugate()), kind="stable")
    return int(order[place])
