"""Where a resisting force saturates within a thin layer of rates, such as friction about rest: no step may pass one unseen."""

from collections.abc import Callable

import casadi as ca
import numpy as np

from flexlin.about.deviation import Deviation
from flexlin.checks import Array
from flexlin.simulation.window import Grid, Path, between

SATURATING = (ca.OP_TANH, ca.OP_ERF, ca.OP_ATAN)
THICK = 5.0
"""Arguments beyond which a saturating function changes little: 1 - tanh(5) is 1e-4."""
SEEN = 2.0
"""Change of an argument between neighbouring samples from which a step's own error estimate sees the layer."""
MANY = 2000
"""Operations of a resisting force from which it holds the steps that find the joints that follow; with symbols for these it is short."""
PARTS = np.linspace(0.0, 1.0, 9)
"""Of a step: where the arguments are looked at."""


class Layers:
    """The arguments of tanh, erf and atan in the resisting forces, along a motion: a layer is passed where one goes through zero.

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
        self._about, self._function = about, about.function(angles, {"y": y, "y1": rate}, {"arguments": values})

    @classmethod
    def of(cls, about: Deviation) -> "Layers | None":
        """Those of an arm; None where it has none."""
        arm = about.arm
        short = arm.loops is None or arm.functions["damping"].n_instructions() <= MANY
        found = saturating_arguments(arm.damping if arm.loops is None or short else arm.loops.residual)
        return cls(about, found) if found else None

    def hurry(self, t: Array, y: Array, rate: Array) -> Array:
        """How many times too fast steps (K,) pass a layer, from y, y' (K, N, n) at times t (K, N) of each; at most 1 is well.

        Where an argument comes near its layer between neighbours (by what its second difference leaves open), it may change by SEEN.
        """
        n, moved = self._about.n, np.ones(len(t))
        finite = np.isfinite(y).all(axis=(1, 2)) & np.isfinite(rate).all(axis=(1, 2))
        if not finite.any():
            return moved
        at = t[finite]
        values = self._about.evaluate(
            self._function, at.ravel(), y[finite].reshape(-1, n), rate[finite].reshape(-1, n)
        )[0].reshape(*at.shape, -1)
        size, change = np.abs(values), np.abs(np.diff(values, axis=1))
        low = np.where(values[:, 1:] * values[:, :-1] < 0, 0.0, np.minimum(size[:, 1:], size[:, :-1]))
        bend = np.abs(np.diff(values, 2, axis=1)).max(axis=1, keepdims=True) / 4
        moved[finite] = np.max(change / SEEN, axis=(1, 2), where=low - bend < THICK, initial=0.0)
        return moved

    def hurries(self, grid: Grid, path: Path) -> Array:
        """The same for the steps (K,) of a window; coordinates of a controller stand behind those of the arm."""
        t, n = grid.edges[:-1, None] + grid.h[:, None] * PARTS, self._about.n
        x = between(grid, path, np.zeros((grid.count, grid.stages)), t.ravel())[0].reshape(*t.shape, -1)
        return self.hurry(t, x[..., :n], x[..., x.shape[-1] // 2 :][..., :n])

    def of_step(self, begin: float, end: float, dense: Callable[[Array], Array]) -> float:
        """The same for one step of an integrator with states [y; y'; ...] (.., N) between."""
        t, n = begin + (end - begin) * PARTS, self._about.n
        x = dense(t).T
        return float(self.hurry(t[None], x[None, :, :n], x[None, :, n : 2 * n])[0])


def saturating_arguments(expression: ca.SX) -> list[ca.SX]:
    """What tanh, erf and atan are taken of in an expression, each argument once."""
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
