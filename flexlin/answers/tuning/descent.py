"""BFGS that lives with functions whose valleys are steep and bent, and with rounding in their gradients."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array

ARMIJO, WOLFE = 1e-4, 0.5
"""Share of the linear decrease that a step must reach, and of the slope that it may leave."""
BISECTIONS = 30
PATIENCE = 5
"""Steps over which too small a decrease ends the search."""


@dataclass(frozen=True)
class Minimum:
    """The best point, its value, a factor S of the inverse Hessian H = S S', and how many values and gradients were taken."""

    x: Array
    value: float
    factor: Array
    values: int
    gradients: int


def descend(
    f: Callable[[Array], float],
    gradient: Callable[[Array], Array],
    x: Array,
    steps: int,
    settled: float,
    factor: Array | None = None,
) -> Minimum:
    """Minimise by BFGS with a weak Wolfe line search.

        f(x + t p) <= f(x) + c1 t g'p,   g(x + t p)' p >= c2 g'p,   p = -S S' g

    H is kept as S S', brought up to date by an orthogonal factorization: it stays positive where its condition is beyond 1e12, and there
    the plain update fails by rounding. Parameters: f may return infinity; settled: relative decrease over five steps that ends the search;
    factor: S of an earlier search nearby.
    Source: Lewis, Overton, Nonsmooth optimization via quasi-Newton methods, Math. Program. 141 (2013) 135.
    """
    value, g, S = f(x), gradient(x), np.eye(len(x)) if factor is None else factor
    values, gradients, past = 1, 1, [value]
    for step in range(steps):
        p = -S @ (S.T @ g)
        slope = float(g @ p)
        if not np.isfinite(slope) or slope >= 0:
            break
        first = 1.0 if step or factor is not None else min(1.0, 0.5 / float(np.linalg.norm(g)))
        t, found, new_g, tried, taken = search_line(f, gradient, x, p, value, g, first)
        values, gradients = values + tried, gradients + taken
        if not found < value:
            break
        s, y = t * p, new_g - g
        x, value, g = x + s, found, new_g
        S = update_factor(S, s, y, scaled=step == 0 and factor is None)
        past.append(value)
        if len(past) > PATIENCE and past[-1 - PATIENCE] - value <= settled * (1 + abs(value)):
            break
    return Minimum(x, value, S, values, gradients)


def search_line(
    f: Callable[[Array], float],
    gradient: Callable[[Array], Array],
    x: Array,
    p: Array,
    value: float,
    g: Array,
    t: float,
) -> tuple[float, float, Array, int, int]:
    """A step that meets the weak Wolfe conditions, by doubling and halving alone; no derivative is trusted to be continuous.

    Returns: the step, the value and the gradient there, and how many values and gradients it took; infinity where none descends.
    """
    slope, low, high, best = float(g @ p), 0.0, np.inf, np.inf
    tried = taken = 0
    while tried < BISECTIONS:
        now, tried = f(x + t * p), tried + 1
        if not now <= value + ARMIJO * t * slope:
            high = t
        else:
            low, best, g, taken = t, now, gradient(x + t * p), taken + 1
            if float(g @ p) >= WOLFE * slope:
                break
        t = (low + high) / 2 if np.isfinite(high) else 2 * low
    return low, best, g, tried, taken


def update_factor(S: Array, s: Array, y: Array, scaled: bool) -> Array:
    """S of (I - s y'/c) S S' (I - y s'/c) + s s'/c, c = s'y; unchanged where the curvature c is not positive.

    Parameters: scaled: make H fit the first step's curvature before.
    """
    c = float(y @ s)
    if not c > 1e-14 * float(np.linalg.norm(y) * np.linalg.norm(s)):
        return S
    if scaled:
        S = S * np.sqrt(c / float(y @ y))
    left = S - np.outer(s, y @ S) / c
    return np.asarray(np.linalg.qr(np.column_stack([left, s / np.sqrt(c)]).T)[1].T)
