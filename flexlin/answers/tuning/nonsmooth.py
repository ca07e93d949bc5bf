"""BFGS for functions that are not smooth where it matters: at their minima."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array

ARMIJO, WOLFE = 1e-4, 0.5
"""Share of the linear decrease that a step must reach, and of the slope that it may leave."""
BISECTIONS = 30


@dataclass(frozen=True)
class Minimum:
    """The best point found, its value, and how many values and gradients were taken."""

    x: Array
    value: float
    values: int
    gradients: int


def minimize_nonsmooth(
    f: Callable[[Array], float],
    gradient: Callable[[Array], Array],
    x: Array,
    steps: int = 100,
    settled: float = 1e-10,
    restarts: int = 0,
) -> Minimum:
    """Minimise a function that is smooth almost everywhere, beginning anew with steepest descent where the search is stuck.

    Each restart starts beside the best point, by 1e-2 to 1e-6 of its size, so that another gradient of the kink is seen.
    """
    best = descend_nonsmooth(f, gradient, x, steps, settled)
    rng = np.random.default_rng(0)
    for k in range(restarts):
        size = 10.0 ** -(2 + k % 5)
        beside = best.x + size * (1 + np.abs(best.x)) * rng.standard_normal(len(x))
        other = descend_nonsmooth(f, gradient, beside, steps, settled)
        counts = best.values + other.values, best.gradients + other.gradients
        better = other if other.value < best.value else best
        best = Minimum(better.x, better.value, *counts)
    return best


def descend_nonsmooth(
    f: Callable[[Array], float], gradient: Callable[[Array], Array], x: Array, steps: int, settled: float
) -> Minimum:
    """Minimise a function that is smooth almost everywhere by BFGS with a weak Wolfe line search.

        f(x + t p) <= f(x) + c1 t g'p,   g(x + t p)' p >= c2 g'p

    Smooth line searches give up where f is not smooth; this one only bisects and doubles, so the inverse Hessian learns the kinks.
    Parameters: f may return infinity; steps: at most; settled: relative decrease over five steps that ends it.
    Source: Lewis, Overton, Nonsmooth optimization via quasi-Newton methods, Math. Program. 141 (2013) 135.
    """
    value, g, H = f(x), gradient(x), np.eye(len(x))
    values, gradients, past = 1, 1, [value]
    for step in range(steps):
        p = -H @ g
        slope = float(g @ p)
        if not np.isfinite(slope) or slope >= 0 or not np.any(p):
            break
        low, high, t = 0.0, np.inf, 1.0 if step else min(1.0, 0.5 / float(np.linalg.norm(g)))
        new_value, new_g = np.inf, g
        for _ in range(BISECTIONS):
            tried = f(x + t * p)
            values += 1
            if not tried <= value + ARMIJO * t * slope:
                high = t
            else:
                low, new_value, new_g = t, tried, gradient(x + t * p)
                gradients += 1
                if float(new_g @ p) >= WOLFE * slope:
                    break
            t = (low + high) / 2 if np.isfinite(high) else 2 * low
        if not new_value < value:
            break
        s, y = low * p, new_g - g
        x, value, g = x + s, new_value, new_g
        curvature = float(y @ s)
        if curvature > 1e-14 * float(np.linalg.norm(y) * np.linalg.norm(s)):
            if step == 0:
                H = H * curvature / float(y @ y)
            left = np.eye(len(x)) - np.outer(s, y) / curvature
            H = left @ H @ left.T + np.outer(s, s) / curvature
        past.append(value)
        if len(past) > 5 and past[-6] - value <= settled * (1 + abs(value)):
            break
    return Minimum(x, value, values, gradients)
