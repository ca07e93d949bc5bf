"""Chebyshev panels of a coefficient: what they are fitted to, what they may leave over, and how they join."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from flexlin.checks import Array
from flexlin.periodic.interpolation import ChebyshevPanels, chebyshev_coefficients, panel_times
from flexlin.periodic.precision import EPS, SAFETY
from flexlin.periodic.resolved.sampling import LEAST, NEAR, SIGMAS, Sampler

NODES, TAIL = 32, 4
"""Nodes of a panel, and how many of its last coefficients must have vanished."""
MOST_PANELS = 4096
"""The largest number of panels."""


@dataclass
class PanelSet:
    """Panels (Q,): edges, coefficients (Q, K, E), deviation of noise (Q, E), what was seen at check points, and whether any were.

    deviation, average, drift (Q, E): the largest size of A less the panel, its mean size, and the size of its mean.
    """

    begin: Array
    end: Array
    coefficients: Array
    noise: Array
    deviation: Array
    average: Array
    drift: Array
    checked: Array

    @property
    def width(self) -> Array:
        """Lengths in s."""
        return np.asarray(self.end - self.begin)

    def some(self, which: Array | slice) -> "PanelSet":
        """A part of the panels."""
        return PanelSet(*(getattr(self, field.name)[which] for field in fields(self)))

    def joined(self, other: "PanelSet") -> "PanelSet":
        """Both sets, in the order of time."""
        order = np.argsort(np.concatenate([self.begin, other.begin]))
        return PanelSet(*(np.concatenate([getattr(self, f.name), getattr(other, f.name)])[order] for f in fields(self)))

    def series(self) -> ChebyshevPanels:
        """The function of time that they make where they fill the period, (N,) -> (N, E)."""
        return ChebyshevPanels(np.append(self.begin, self.end[-1:]), self.coefficients)


def fitted(sample: Sampler, begin: Array, end: Array, noise: Array | None = None) -> PanelSet:
    """Sample panels and interpolate."""
    count, entries = len(begin), len(sample.scale)
    values = sample(panel_times(begin, end, NODES).ravel()).reshape(count, NODES, entries)
    noise = np.zeros((count, entries)) if noise is None else noise
    deviation, average, drift = np.zeros((3, count, entries))
    return PanelSet(begin, end, chebyshev_coefficients(values), noise, deviation, average, drift, np.zeros(count, bool))


def left_over(panels: PanelSet, sample: Sampler) -> Array:
    """What panels may leave over (Q, E): tol of each entry's size, its noise, and A' times the rounding of t."""
    low = np.abs(panels.coefficients[:, : NODES // 2])
    rate = np.einsum("k,qke->qe", np.arange(NODES // 2) ** 2.0, low) * 2 / panels.width[:, None]
    rounding = np.minimum(EPS * sample.period * rate, 1e-6 * sample.scale)
    return np.asarray(np.maximum(np.maximum(sample.tol * sample.scale + LEAST, SIGMAS * panels.noise), rounding))


def panel_error(panels: PanelSet, degree: int) -> tuple[Array, Array]:
    """Bounds on the error of each entry on each panel (Q, E): of its size anywhere, and of its integral divided by the panel's length.

    By the deviations seen and the coefficients beyond `degree`. What is allowed plays no part: most panels agree far better. The mean
    size of the deviation counts beside its mean, for the times at which the panel is read, which are rounded as those of the samples.
    """
    size = np.abs(panels.coefficients)
    beyond, tails = size[:, degree + 1 :].sum(axis=1), size[:, -TAIL:].sum(axis=1)
    anywhere = SAFETY * panels.deviation + tails + beyond + EPS * size.sum(axis=1)
    return anywhere, panels.drift + panels.average + beyond


def shown_degree(panels: PanelSet, scale: Array) -> int:
    """The degree beyond which the coefficients are rounding or noise in every panel and entry, by the root of the sum of their squares."""
    floor = np.maximum(2 * EPS * scale + LEAST, panels.noise)
    left = ((panels.coefficients[:, ::-1] / floor[:, None]) ** 2).cumsum(axis=1)[:, ::-1]
    return max(int(np.count_nonzero(np.any(left > 1, axis=(0, 2)))) - 1, 0)


def rough_edges(panels: PanelSet, sample: Sampler) -> tuple[Array, Array]:
    """Left edges at which A is not smooth (S,), 0 for the period's end, and whether it jumps there.

    A jump: the two sides differ by 8 times what is allowed. A kink: either side, continued by a 1 / 32^2 of the narrower panel, differs
    from the other by as much; a polynomial of degree 31 magnifies its rounding by cosh(31 arccosh(1 + 2 / 32^2)) = 3.5 then.
    """
    width, before = panels.width, np.roll(np.arange(len(panels.begin)), 1)
    step = np.minimum(width, width[before]) / NODES**2
    at = np.stack([np.zeros_like(step), step, -step], axis=1)
    here, there = chebvander(np.stack([2 * at / width[:, None] - 1, 2 * at / width[before][:, None] + 1]), NODES - 1)
    own, other = here @ panels.coefficients, there @ panels.coefficients[before]
    allowed = left_over(panels, sample)
    apart = (np.abs(own - other) / np.maximum(allowed, allowed[before])[:, None]).max(axis=2)
    which = np.flatnonzero(apart.max(axis=1) > 8)
    return panels.begin[which], apart[which, 0] > 8


def miss_beside(sample: Sampler, series: ChebyshevPanels, places: Array, looked_at: Array) -> Array:
    """Bound the integral of |A - series| within 1e-11 T of each place (B,), for each entry: (B, E); zero beside those not looked at.

        |A(t+) - A(t-)| d_0 / 2   +   sum over both sides and k of   (d_k - d_(k-1)) max(|A - series|(t +- d_k), |A - series|(t +- d_(k-1)))

    with d_0 the last bit of t. A jump that is off by d costs its height times d; a kink half of d^2 times the jump of its slope.
    """
    missed = np.zeros((len(places), series.coefficients[0, 0].size))
    which = np.isin(places, looked_at)
    edges = places[which]
    if not len(edges):
        return missed
    T = sample.period
    away = np.maximum(np.spacing(edges), EPS * T / 8)[:, None] * 2.0 ** np.arange(int(np.log2(8 * NEAR / EPS)) + 2)
    t = np.mod(edges[:, None, None] + away[:, None] * np.array([[-1.0], [1.0]]), T)
    apart = np.abs(sample(t.ravel()) - series(t.ravel()).reshape(t.size, -1)).reshape(*t.shape, -1)
    nearer = np.concatenate([apart[:, :, :1], apart[:, :, :-1]], axis=2)
    width = np.diff(away, axis=1, prepend=0.0)
    jump = np.abs(series(edges) - series(edges, left=True)).reshape(len(edges), -1)
    missed[which] = away[:, :1] / 2 * jump + np.einsum("bk,bske->be", width, np.maximum(apart, nearer))
    return missed
