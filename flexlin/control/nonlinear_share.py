"""Nonlinear terms of the equations of motion along a linear motion, as a share of the linear ones, and where that is largest."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.control.slow_motions import LinearMotion
from flexlin.periodic.resolved.companion import ResolvedCompanion

HUGE = 700.0
"""A logarithm beyond all numbers."""
STILL = 1e-14
"""An amplitude at which only rounding is left of the nonlinear terms."""
WITHIN = 8
"""Places of an interval between two nodes where a share is estimated from the terms at the nodes."""
PEAKS, MOST = 8, 64
"""Times of large shares that are looked at more closely; named features that are."""
LOOK, ROUNDS = 9, 4
"""Times of a look at a peak; how many looks there are, each as wide as the space between two times of the one before."""


@dataclass(frozen=True, eq=False)
class Terms:
    """A linear motion in the equations at times t (N,): y, y', y'' (3, N, n); M (N, n, n); K y, D y', M y'' (3, N, n); and what the
    equations leave where nothing deviates (N, n)."""

    plant: Linearization
    t: Array
    motion: Array
    mass: Array
    parts: Array
    rest: Array

    @classmethod
    def along(cls, plant: Linearization, t: Array, motion: Array) -> "Terms":
        """The terms of a motion y, y', y'' (3, N, n) at times t (N,)."""
        resolved = plant.periodic_system().resolved
        assert isinstance(resolved, ResolvedCompanion)
        M, D, K = resolved.sample(t % plant.period)
        parts = np.array([np.einsum("tij,tj->ti", matrix, z) for matrix, z in zip((K, D, M), motion, strict=True)])
        return cls(plant, t, motion, M, parts, residual(plant, t, np.zeros_like(motion)))

    @property
    def linear(self) -> Array:
        """The size of the largest linear term at each time, (N,)."""
        return np.asarray(size(self.mass, *self.parts).max(axis=0))

    def left(self, a: float) -> Array:
        """R(a) at each time, (N, n)."""
        return residual(self.plant, self.t, a * self.motion) - self.rest - a * self.parts.sum(axis=0)

    def nonlinear(self, a: float) -> Array:
        """|R(a)| at each time."""
        return size(self.mass, self.left(a))[0]

    def excess(self, a: float, share: float, rounding: float) -> Array:
        """The logarithm of |R(a)| against the share of the linear terms at each time; HUGE where the forces are no numbers."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return compare(self.nonlinear(a), share * a * self.linear, rounding)


def compare(nonlinear: Array, allowed: Array, rounding: float) -> Array:
    """The logarithm of the nonlinear terms, less their rounding, against what is allowed."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratio = np.log((nonlinear - rounding) / allowed)
    return np.where(nonlinear <= rounding, -HUGE, np.clip(np.nan_to_num(ratio, nan=HUGE), -HUGE, HUGE))


@dataclass(frozen=True, eq=False)
class Along:
    """One linear motion over a period, with its terms at the nodes; `rounding`: of |R|."""

    plant: Linearization
    motion: LinearMotion
    nodes: Terms
    share: float
    rounding: float

    @classmethod
    def of(cls, plant: Linearization, motion: LinearMotion, share: float) -> "Along":
        nodes = Terms.along(plant, motion.t, np.concatenate([motion.starts, motion.ends[:, -1:]], axis=1))
        return cls(plant, motion, nodes, share, 4 * float(nodes.nonlinear(STILL).max()))

    def at(self, t: Array) -> Terms:
        """The terms at any times."""
        return Terms.along(self.plant, t, self.motion(t))

    def excess(self, t: Array, a: float) -> Array:
        """As `Terms.excess`, at any times."""
        return self.at(t).excess(a, self.share, self.rounding)

    def peaks(self, a: float) -> tuple[Array, Array]:
        """The times of the largest shares at an amplitude, and how much the logarithms there rose in the last look.

        They are sought where the terms at the nodes promise much, and where the coefficients are known to be narrow.
        """
        named = np.array(self.plant.features).reshape(-1, 2)
        t, width = (np.append(*parts) for parts in zip(self.estimate_peaks(a), named[:MOST].T, strict=True))
        found, rose = np.full(len(t), -np.inf), np.full(len(t), np.inf)
        for _ in range(ROUNDS):
            near = np.clip(t[:, None] + width[:, None] * np.linspace(-1, 1, LOOK), 0.0, self.motion.t[-1])
            excess = self.excess(near.ravel(), a).reshape(near.shape)
            best = excess.argmax(axis=1)[:, None]
            t, largest = np.take_along_axis(near, best, 1)[:, 0], np.take_along_axis(excess, best, 1)[:, 0]
            rose, found = largest - found, largest
            width = np.where(best[:, 0] % (LOOK - 1) > 0, 2 * width / (LOOK - 1), width)
        return t, np.abs(rose)

    def estimate_peaks(self, a: float) -> tuple[Array, Array]:
        """About where the shares are largest, and how closely that is known: between the nodes, forces are taken to be linear in time.

        A force that passes through zero does so nearly on a straight line, and there the share of what is left peaks.
        """
        root = np.linalg.cholesky(self.nodes.mass)
        with np.errstate(all="ignore"):
            left = np.nan_to_num(self.nodes.left(a), nan=np.inf)
        weighed = np.linalg.solve(root, np.moveaxis(np.array([*self.nodes.parts, left]), 0, -1))
        s = np.arange(WITHIN) / WITHIN
        with np.errstate(all="ignore"):
            inner = weighed[:-1, None] * (1 - s)[:, None, None] + weighed[1:, None] * s[:, None, None]
            sizes = np.linalg.norm(inner, axis=2).reshape(-1, 4)
        excess = compare(sizes[:, 3], self.share * a * sizes[:, :3].max(axis=1), self.rounding)
        steps = np.diff(self.motion.t)
        t = (self.motion.t[:-1, None] + steps[:, None] * s).ravel()
        around = np.pad(excess, 1, constant_values=-np.inf)
        higher = np.flatnonzero((excess >= around[:-2]) & (excess >= around[2:]))
        chosen = higher[np.argsort(excess[higher])[-PEAKS:]]
        return t[chosen], np.repeat(steps / WITHIN, WITHIN)[chosen]

    def thinned(self) -> "Along":
        """The same with the motion between every second node."""
        return replace(self, motion=self.motion.thinned())


def size(M: Array, *forces: Array) -> Array:
    """sqrt(f' M^-1 f) of each force at each time: (forces, N)."""
    f = np.moveaxis(np.array(forces), 0, -1)
    return np.sqrt(np.einsum("tik,tik->kt", f, np.linalg.solve(M, f)))


def residual(plant: Linearization, t: Array, motion: Sequence[Array] | Array) -> Array:
    """The left side of the equations of motion, kept rows, at deviations y, y', y'' from the rigid motion."""
    return plant.about.of_arm("residual", t, *motion)[:, list(plant.kept), 0]
