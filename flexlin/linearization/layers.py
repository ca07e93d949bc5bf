"""Where forces saturate along a motion: layers of tanh, erf, atan and exp, and how fast steps pass them."""

from functools import lru_cache

import casadi as ca
import numpy as np

from flexlin.checks import Array
from flexlin.linearization.deviation import Deviation

SATURATING = (ca.OP_TANH, ca.OP_ERF, ca.OP_ATAN, ca.OP_EXP)
LAYER_ARGUMENT = 5.0
"""Arguments beyond which a saturating function changes little: 1 - tanh(5) is 1e-4."""
SEEN_CHANGE = 2.0
"""Change of an argument between neighbouring samples from which a step's own error estimate sees the layer."""


class Layers:
    """The arguments of tanh, erf, atan and exp in the resisting forces, along a motion: a layer is passed where one is about zero.

    Parameters
    ----------
    about : Deviation
        The arm and its motion.
    arguments : list of casadi.SX
        In the arm's coordinates and rates.
    """

    def __init__(self, about: Deviation, arguments: list[ca.SX]):
        y, rate, _, angles = about.symbols()
        (values,) = about.lift([ca.vertcat(*arguments)], angles, y, rate)
        self.about, self._function = about, about.function(angles, {"y": y, "y1": rate}, {"arguments": values})

    @classmethod
    @lru_cache(maxsize=8)
    def of(cls, about: Deviation) -> "Layers | None":
        """Those of an arm; None where it has none. Kept for the next run."""
        about, arm = about.near, about.arm.near
        resisting = arm.damping if arm.loops is None else arm.loops.residual  # with symbols for the joints that follow
        found = saturating_arguments(resisting)
        return cls(about, found) if found else None

    def arguments(self, t: Array, y: Array, rate: Array) -> Array:
        """The p arguments (..., p) for y, y' (..., n) at times t (...)."""
        n = self.about.n
        flat = self.about.evaluate(self._function, t.ravel(), y.reshape(-1, n), rate.reshape(-1, n))[0]
        return flat.reshape(*t.shape, -1)

    def hurry(self, t: Array, y: Array, rate: Array) -> Array:
        """How many times too fast steps (K,) pass a layer, from y, y' (K, N, n) at times t (K, N) of each; at most 1 is well.

        Where an argument comes near its layer between neighbours (by what its second difference leaves open), it may change by SEEN_CHANGE.
        """
        moved, finite = np.ones(len(t)), np.isfinite(y).all(axis=(1, 2)) & np.isfinite(rate).all(axis=(1, 2))
        if not finite.any():
            return moved
        values = self.arguments(t[finite], y[finite], rate[finite])
        size, change = np.abs(values), np.abs(np.diff(values, axis=1))
        low = np.where(values[:, 1:] * values[:, :-1] < 0, 0.0, np.minimum(size[:, 1:], size[:, :-1]))
        bend = np.abs(np.diff(values, 2, axis=1)).max(axis=1, keepdims=True) / 4
        moved[finite] = np.max(change / SEEN_CHANGE, axis=(1, 2), where=low - bend < LAYER_ARGUMENT, initial=0.0)
        return moved


def saturating_arguments(expression: ca.SX) -> list[ca.SX]:
    """What tanh, erf, atan and exp are taken of in an expression, each argument once."""
    found: dict[int, ca.SX] = {}
    seen: set[int] = set()
    left = [expression.nz[i] for i in range(expression.nnz())]
    while left:
        node = left.pop()
        if node.element_hash() in seen or node.is_leaf():
            continue
        seen.add(node.element_hash())
        parts = [node.dep(i) for i in range(node.n_dep())]
        if node.op() in SATURATING:
            found[parts[0].element_hash()] = parts[0]
        left += parts
    return list(found.values())
