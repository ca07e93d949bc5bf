"""The largest growth rate made smooth: exponents that meet have corners and infinite slopes, their symmetric functions have none."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from flexlin.checks import Array


@dataclass(frozen=True)
class Smoothing:
    """A smooth bound on the largest real part of the exponents of some loops, which tends to it with mu -> 0.

        phi = min over s > max Re lambda of   s - mu sum_loops sum_ij log(1 - z_ij),   z_ij = exp((lambda_i + lambda_j - 2 s) N T)

    The inner sum is log det(1 - exp(-2 s N T) Phi (x) Phi), Phi = the transition matrix of N periods T: the determinant of the Lyapunov
    operator, a barrier of stability. It is a symmetric function of the multipliers, so phi is analytic in the gains also where they
    meet. Modes much faster than 1 / (N T) have no part in it.
    `mu`: in 1/s; `horizon`: the least N T, in s.
    Source: Fuller, Conditions for a matrix to have only characteristic roots with negative real parts, J. Math. Anal. Appl. 23 (1968)
    71, for the determinant; Vanbiervliet et al., The smoothed spectral abscissa, SIAM J. Optim. 20 (2009) 156, for the idea.
    """

    mu: float
    horizon: float

    def value(self, exponents: Array, periods: Array) -> float:
        """phi of the exponents (S, n) of S loops with periods (S,); infinite where one is no number."""
        if not np.isfinite(exponents).all():
            return float("inf")
        span = self.span(periods)
        s = self.solve(exponents, span)
        return s - self.mu * float(np.log1p(-self.pairs(exponents, span, s)).real.sum())

    def weights(self, exponents: Array, periods: Array, s: float) -> Array:
        """d phi / d lambda (S, n) at the s that belongs to phi; they sum to one."""
        span = self.span(periods)
        z = self.pairs(exponents, span, s)
        return np.asarray(self.mu * (2 * span * z / (1 - z)).sum(axis=2))

    def level(self, exponents: Array, periods: Array) -> float:
        """The s at which phi is taken."""
        return self.solve(exponents, self.span(periods))

    def span(self, periods: Array) -> Array:
        """N T of each loop, in the shape of pairs."""
        return np.asarray(periods * np.ceil(self.horizon / periods))[:, None, None]

    def pairs(self, exponents: Array, span: Array, s: float) -> Array:
        """z (S, n, n)."""
        return np.asarray(np.exp((exponents[:, :, None] + exponents[:, None, :] - 2 * s) * span))

    def solve(self, exponents: Array, span: Array) -> float:
        """s from   1 = mu sum 2 N T z / (1 - z);   the right-hand side falls from infinity to zero, as it is a sum of squares of traces."""
        largest, count, longest = float(exponents.real.max()), exponents.size * exponents.shape[1], float(span.max())
        top = int(np.argmax(exponents.real.max(axis=1)))
        own = float(span[top, 0, 0])

        def excess(u: float) -> float:
            z = self.pairs(exponents, span, largest + np.exp(u))
            return float(self.mu * (2 * span * z / (1 - z)).real.sum()) - 1

        low = np.log1p(2 * own * self.mu / (1 + self.mu * longest * count)) / (2 * own)
        shortest = float(span.min())
        high = np.log1p(2 * longest * self.mu * count) / (2 * shortest)
        return largest + float(np.exp(brentq(excess, np.log(low) - 1e-9, np.log(high) + 1e-9, xtol=1e-13)))
