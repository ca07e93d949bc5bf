"""The coefficients of a periodic system over one period, resolved before anything is integrated: smooth ones by a Fourier series."""

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, positive, real_array
from flexlin.errors import ArgumentError
from flexlin.periodic.coefficient_series.matrix import ResolvedMatrix
from flexlin.periodic.coefficient_series.panels import resolve_on_panels
from flexlin.periodic.coefficient_series.sampling import (
    LEAST_SIZE,
    NOISE_DEVIATIONS,
    POINTS,
    RESOLVED_TOL,
    SEARCH_BLOCKS,
    TIMES_IN_BLOCK,
    Least,
    Sampler,
    end_phases,
    look_beyond,
    need_repetition,
    noise_level,
    search_phases,
    stratified,
)
from flexlin.periodic.interpolation import (
    NODES,
    FourierSeries,
    fourier_nodes,
    fourier_waves,
    real_fourier_coefficients,
)
from flexlin.precision import EPS, SAFETY

MOST_NODES = NODES * NODES
"""Nodes at most, where a matrix of waves costs as much as those of as many panels; the first SEARCH_BLOCKS lie closer than T / 100."""


def resolve(
    A: Callable[[Array], Array],
    period: float,
    breaks: Sequence[float] = (),
    features: Sequence[tuple[float, float]] = (),
    *,
    complete: bool = False,
    tol: float = RESOLVED_TOL,
    least: Least = 0.0,
    repeats: bool = True,
) -> ResolvedMatrix:
    """Represent a periodic matrix function by a series that agrees with it between the nodes.

    A smooth A becomes a Fourier series of as many harmonics as it has. Otherwise the period is divided into panels of polynomials of
    degree 31, at the breaks, about the features, and wherever A is not smooth: a jump is followed by bisection to the last bits of t, a
    kink as far as it shows. Noise of A is measured, and agreement beyond it is not asked for.

    What no sampler can promise: to see what happens between its samples. A is compared at 10240 times on no regular grid, with gaps below
    T / 10000: a pulse on at least T / 10000 is seen, a shorter one perhaps, unless it begins or ends with the period. Name it in
    `features`; then panels and check points lie as close as its width asks. What happens within 1e-11 T of a jump counts as part of the
    jump. With `complete` you guarantee that every feature of a half-width below T / 200 is named, and fewer times do.

    Parameters
    ----------
    A : function (N,) -> (N, rows, columns), evaluated at times in [0, T) and at a few in (T, 2 T). See `need_repetition` for what is
        asked of it beyond T.
    period : T in s.
    breaks : times in [0, T) at which A jumps or loses smoothness. A is not sampled at them, only beside them.
    features : pairs (time, width) in s about which A changes fast.
    complete : whether breaks and features name everything that is narrow.
    tol : agreement that is asked for, of each entry's largest size over the period. More than noise and rounding allow is not asked.
    repeats : whether A goes on as it began; without it nothing is asked of A outside [0, T), and 0 must be one of the breaks.
    least : size whose rounding need not be seen, for all entries or for each (also a function of first samples): smaller entries are then
        known less well than tol of themselves.

    Returns
    -------
    A `ResolvedMatrix` with its error, the places found and the number of evaluations.

    Raises
    ------
    ArgumentError : A(t) has the wrong shape, is not real or not finite at a time that is named.
    NotPeriodic : A goes on after T as something else.
    UnresolvedCoefficient : A cannot be followed near a time that is named.

    References
    ----------
    Pachón, Platte and Trefethen, Piecewise-smooth chebfuns, IMA J. Numer. Anal. 30 (2010).

    Examples
    --------
    >>> import numpy as np
    >>> from flexlin.periodic.coefficient_series.resolve import resolve
    >>> A = resolve(lambda t: np.where(np.mod(t, 2.0) < 1.0002, 1.0, 9.0)[:, None, None], 2.0)
    >>> [(place.time, place.kind) for place in A.found]
    [(0.0, 'jump'), (1.0002, 'jump')]
    """
    period = positive("period", period)
    sample = Sampler(A, period, tol, least)
    if repeats and not len(breaks) and not len(features):
        fit = FourierFit(sample, wary=not complete)
        if fit.run():
            shape = sample.shape or (0, 0)
            series = FourierSeries(fit.coefficients.reshape(-1, *shape), period)
            return ResolvedMatrix(series, (), (), fit.error.reshape(shape), sample.count)
    named, pairs = check_places(period, breaks, features)
    return resolve_on_panels(sample, named, pairs, not complete, repeats)


def resolve_constant(A: Array, period: float) -> ResolvedMatrix:
    """Represent a matrix (rows, columns) that does not depend on time."""
    return ResolvedMatrix(FourierSeries(A[None], period), (), (), SAFETY * EPS * np.abs(A), 1)


def check_places(period: float, breaks: ArrayLike, features: ArrayLike) -> tuple[Array, Array]:
    """Increasing breaks (B,) and pairs (time, width) of features (F, 2), as they may be.

    Raises: ArgumentError.
    """
    if not np.size(breaks) and not np.size(features):
        return np.empty(0), np.empty((0, 2))
    named = np.unique(real_array("breaks", breaks, (None,)))
    pairs = real_array("features", features if np.size(features) else np.empty((0, 2)), (None, 2))
    for name, t in (("breaks", named), ("features", pairs[:, 0])):
        if t.size and (t.min() < 0 or t.max() >= period):
            raise ArgumentError(f"{name} lie outside the period", got=t.tolist(), expected=f"times in [0, {period})")
    if np.any(pairs[:, 1] <= 0):
        raise ArgumentError("a feature has no width", got=pairs[:, 1].tolist(), expected="widths greater than 0")
    return named, pairs


class FourierFit:
    """A by its Fourier series: coefficients (2 H + 1, E), what may be left over and the bound on the error of each entry (E,).

    Parameters: wary: whether A may hold pulses that nobody named.
    """

    coefficients: Array
    error: Array

    def __init__(self, sample: Sampler, wary: bool):
        self.sample, self.wary = sample, wary
        self.noise: Array | None = None

    def run(self) -> bool:
        """Double the nodes until the series agrees; False where panels serve better. Raises: NotPeriodic."""
        sample, T, worst = self.sample, self.sample.period, np.inf
        self.phases = stratified(POINTS)
        values, self.there = np.split(
            sample(T * np.append(np.arange(SEARCH_BLOCKS) / SEARCH_BLOCKS, self.phases)), [SEARCH_BLOCKS]
        )
        first = self.there
        while True:
            size = self.transform(values)
            excess = _last(size).max(axis=0) / (self.allowed / 4)
            if excess.max() > 1 and self.noise is None and _flat(size[:, excess > 1]):
                self.measure_noise()
                continue
            if excess.max() <= 1 and self.agrees():
                rounding = self.rounding + SAFETY * EPS * sample.scale
                self.error = SAFETY * self.deviation + 2 * _last(size).sum(axis=0) + rounding
                t = T * stratified(POINTS)
                need_repetition(sample, first, look_beyond(sample, T + t), t, self.allowed)
                return True
            last, worst, count = worst, float(excess.max()), len(values)
            # if the harmonics fall on as they did
            ahead = worst * min(worst / max(last, LEAST_SIZE), 1.0) ** (2 * (MOST_NODES / count - 1))
            if count >= MOST_NODES or (count > SEARCH_BLOCKS and not ahead <= 1 < worst):
                return False
            between = sample(fourier_nodes(count, T) + T / (2 * count))
            values = np.stack([values, between], axis=1).reshape(2 * count, -1)

    def transform(self, values: Array) -> Array:
        """Take the coefficients from values at nodes; the size of each harmonic (H, E)."""
        self.full = real_fourier_coefficients(values)
        H = len(self.full) // 2
        squares = self.full[1:] ** 2
        self.size = np.sqrt(squares[:H] + squares[H:])
        # the largest rate of A times the rounding of t = T
        self.rounding = 2 * np.pi * EPS * np.arange(1, H + 1) @ self.size
        return self.size

    @property
    def allowed(self) -> Array:
        """What may be left over (E,): tol of each entry's size, noise, and A' times the rounding of t."""
        scale = self.sample.scale
        allowed = np.maximum(self.sample.tol * scale + LEAST_SIZE, np.minimum(self.rounding, 1e-6 * scale))
        return allowed if self.noise is None else np.maximum(allowed, NOISE_DEVIATIONS * self.noise)

    def measure_noise(self) -> None:
        """Estimate the noise of each entry, from both halves of the period."""
        half = self.sample.period * np.array([0.0, 0.5, 1.0])
        self.noise = noise_level(self.sample, half[:-1], half[1:]).max(axis=0)

    def agrees(self) -> bool:
        """Whether the series is as near to A as it may be where it was looked at, and wherever A is loudest beside it."""
        self.trim()
        self.deviation = self.apart(self.phases, self.there)
        searched = not self.wary
        while True:
            good = bool((self.deviation <= 2 * self.allowed).all())
            if good and searched:
                return True
            if good:
                self.search()
                searched = True
            elif self.noise is None:
                self.measure_noise()
            else:
                return False

    def trim(self) -> None:
        """Drop the last harmonics that are rounding or noise in every entry."""
        floor = np.maximum(2 * EPS * self.sample.scale, self.rounding / 8) + LEAST_SIZE
        floor = floor if self.noise is None else np.maximum(floor, 1.5 * self.noise)
        H, heard = len(self.size), (self.size > floor).any(axis=1)
        kept = H - int(heard[::-1].argmax()) if heard.any() else 0
        self.coefficients = np.concatenate([self.full[: kept + 1], self.full[H + 1 : H + 1 + kept]])

    def apart(self, phases: Array, there: Array) -> Array:
        """The largest deviation of each entry from A at some phases, (E,)."""
        T = self.sample.period
        return np.abs(there - FourierSeries(self.coefficients, T)(T * phases)).max(axis=0)

    def search(self) -> None:
        """Find the times at which A is furthest from the series, and hold it against these there.

        At each of many times one sum of all entries is compared, sum_e w_e A_e(t), with weights that make the deviations seen so far,
        which are mostly rounding, of the same size: no entry hides below another. They are drawn at random, so no pattern of
        entries cancels in the sum but with probability zero.
        """
        sample, T, c = self.sample, self.sample.period, self.coefficients
        rng = np.random.default_rng(c.shape[1])  # always the same weights, so that answers repeat
        weights = rng.uniform(1, 2, c.shape[1]) * rng.choice([-1.0, 1.0], c.shape[1])
        weights /= np.maximum(self.deviation, EPS * sample.scale) + LEAST_SIZE
        heard = sample.contract(T * search_phases(), weights)
        with np.errstate(over="ignore", invalid="ignore"):
            apart = np.abs(heard - _evaluate_search(c @ weights))
        in_block = apart.reshape(SEARCH_BLOCKS, TIMES_IN_BLOCK).argmax(axis=1) + TIMES_IN_BLOCK * np.arange(
            SEARCH_BLOCKS
        )
        loudest = in_block[np.argpartition(apart[in_block], -POINTS)[-POINTS:]]  # what is no number comes last too
        phases = np.concatenate([search_phases()[loudest], end_phases()])
        there = sample(T * phases)
        self.deviation = np.maximum(self.deviation, self.apart(phases, there))
        self.phases, self.there = np.append(self.phases, phases), np.concatenate([self.there, there])


def _last(size: Array) -> Array:
    """The last quarter of the harmonics."""
    return size[-(len(size) // 4) :]


def _flat(size: Array) -> bool:
    """Whether some entry's last harmonics have stopped falling: noise, a narrow feature, or a place that is not smooth."""
    quarter = len(size) // 4
    return bool(np.any(np.median(size[-quarter:], axis=0) >= 0.1 * np.median(size[-2 * quarter : -quarter], axis=0)))


@lru_cache(maxsize=16)
def _search_waves(harmonics: int) -> tuple[Array, Array]:
    """Waves at the beginnings of the blocks, (SEARCH_BLOCKS, 2 H): cosines and sines, and complex ones within, (H, TIMES_IN_BLOCK)."""
    outer = fourier_waves(np.arange(SEARCH_BLOCKS) / SEARCH_BLOCKS, harmonics)
    return np.concatenate([outer.real, -outer.imag], axis=1), fourier_waves(
        search_phases()[:TIMES_IN_BLOCK], harmonics
    ).T


def _evaluate_search(series: Array) -> Array:
    """A scalar series (2 H + 1,) at `search_phases`: the waves of a block turn those within it, so it takes one product of matrices."""
    H = len(series) // 2
    outer, inner = _search_waves(H)
    turned = (series[1 : H + 1] - 1j * series[H + 1 :])[:, None] * inner
    return (outer @ np.concatenate([turned.real, turned.imag])).ravel() + series[0]
