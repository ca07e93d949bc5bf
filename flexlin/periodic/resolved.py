"""The coefficients of a periodic system over one period, resolved before anything is integrated."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array, positive, real_array
from flexlin.errors import ArgumentError
from flexlin.periodic.chebyshev import ChebyshevPanels, chebyshev_coefficients, panel_times
from flexlin.periodic.fourier import FourierSeries
from flexlin.periodic.harmonics import fit_fourier
from flexlin.periodic.panels import NODES, PanelResolver
from flexlin.periodic.repetition import need_repetition
from flexlin.periodic.sampling import Sampler, graded, stratified

CHECKS, FEW = 12289, 256
"""Check points of a function of which nothing is known; and of one whose narrow features are named, where it needs panels."""
STEP = 4.0
"""Ratio of neighbouring panels about a named feature."""
PARTS = 4
"""Panels of a period at the start."""
WAVES = 3.0
"""Harmonics of a Fourier series for each panel of degree NODES - 1 that replaces it."""


@dataclass(frozen=True)
class Discontinuity:
    """A place that was found, not named: time in [0, T) in s, kind "jump" or "kink" (a jump of a derivative)."""

    time: float
    kind: str


@dataclass(frozen=True, eq=False)
class ResolvedMatrix:
    """A matrix function A(t) = A(t + T) as one Fourier series, or as one Chebyshev series for each of its panels.

    series: the coefficients; breaks: named and found places in [0, T) where A is not smooth; found: those that were not named;
    error (rows, columns): bound on |series(t) - A(t)| over the period, in the units of the entry, measured at the check points;
    samples: how often A was evaluated.
    """

    series: FourierSeries | ChebyshevPanels
    breaks: tuple[float, ...]
    found: tuple[Discontinuity, ...]
    error: Array
    samples: int

    @property
    def period(self) -> float:
        """T in s."""
        return self.series.period

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.error.shape[0], self.error.shape[1]

    @property
    def edges(self) -> Array:
        """Edges of the panels from 0 to T, (P + 1,); a Fourier series has one panel."""
        return self.series.edges

    @property
    def panels(self) -> int:
        """The number of panels."""
        return len(self.edges) - 1

    @property
    def degree(self) -> int:
        """The highest harmonic of a Fourier series, or the degree of the panels' polynomials."""
        if isinstance(self.series, FourierSeries):
            return self.series.harmonics
        return self.series.coefficients.shape[1] - 1

    @property
    def constant(self) -> bool:
        """Whether A does not depend on t: then `mean()` is the matrix."""
        if self.degree:
            return False
        values = self.series.coefficients.reshape(-1, *self.shape)
        return bool(np.all(values == values[0]))

    def __call__(self, t: Array, left: bool = False) -> Array:
        """Evaluate at any times t (N,): (N, rows, columns). At an edge the panel behind it counts; with `left` the one before it."""
        return self.series(t, left)

    def mean(self) -> Array:
        """The integral of A over the period, divided by T (rows, columns)."""
        return self.series.mean()

    def derivative(self) -> "ResolvedMatrix":
        """A'(t) inside the panels; its error: that of A times the rate of the fastest wave or polynomial (Markov's inequality)."""
        if isinstance(self.series, FourierSeries):
            rate = 2 * np.pi / self.period * max(self.degree, 1)
        else:
            rate = 2 * max(self.degree, 1) ** 2 / float(np.diff(self.edges).min())
        return ResolvedMatrix(self.series.derivative(), self.breaks, self.found, self.error * rate, self.samples)

    def pieces(self, edges: Array | None = None) -> ChebyshevPanels:
        """Give A as polynomials on panels, which contain the edges given and none of A's edges inside.

        Parameters: edges: increasing times from 0 to T that must be edges of panels.
        Returns: panels whose coefficients (P, K, rows, columns) are padded with zeros to a common K.
        """
        wanted = self.edges if edges is None else np.union1d(self.edges, real_array("edges", edges, (None,)))
        if wanted[0] != 0 or wanted[-1] != self.period:
            raise ArgumentError("edges leave the period", got=f"{wanted[0]} to {wanted[-1]}", expected=f"0 to {self.period}")
        if isinstance(self.series, ChebyshevPanels):
            if len(wanted) == len(self.edges):
                return self.series
            count = self.degree + 1
        else:
            wanted, count = _divided(wanted, self.period * WAVES / max(self.degree, 1)), NODES
        values = self.series(panel_times(wanted[:-1], wanted[1:], count).ravel())
        flat = chebyshev_coefficients(values.reshape(len(wanted) - 1, count, -1))
        return ChebyshevPanels(wanted, flat.reshape(*flat.shape[:2], *self.shape))


def resolve(
    A: Callable[[Array], Array],
    period: float,
    breaks: Sequence[float] = (),
    features: Sequence[tuple[float, float]] = (),
    *,
    complete: bool = False,
    tol: float = 1e-13,
) -> ResolvedMatrix:
    """Represent a periodic matrix function by a series that agrees with it between the nodes.

    A smooth A becomes a Fourier series of as many harmonics as it has. Otherwise the period is divided into panels of polynomials of
    degree 31, at the breaks, about the features, and wherever A is not smooth: a jump is followed by bisection to the last bits of t, a
    kink as far as it shows. Noise of A is measured, and agreement beyond it is not asked for.

    What no sampler can promise: to see what happens between its samples. A is compared at 12289 times on no regular grid, with gaps below
    T / 10000: a pulse on at least T / 10000 is seen, a shorter one perhaps. Name it in `features`; then panels and check points lie as
    close as its width asks. With `complete` you guarantee that every feature of a half-width below T / 200 is named, and fewer times do.

    Parameters
    ----------
    A : function (N,) -> (N, rows, columns), evaluated at times in [0, T) and at a few in (T, 2 T). See `need_repetition` for what is
        asked of it beyond T.
    period : T in s.
    breaks : times in [0, T) at which A jumps or loses smoothness. A is not sampled at them, only beside them.
    features : pairs (time, width) in s about which A changes fast.
    complete : whether breaks and features name everything that is narrow.
    tol : agreement that is asked for, of each entry's largest size over the period. More than noise and rounding allow is not asked.

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
    >>> from flexlin.periodic.resolved import resolve
    >>> A = resolve(lambda t: np.where(np.mod(t, 2.0) < 1.0002, 1.0, 9.0)[:, None, None], 2.0)
    >>> [(place.time, place.kind) for place in A.found]
    [(0.0, 'jump'), (1.0002, 'jump')]
    """
    period = positive("period", period)
    named = _times_in("breaks", np.asarray(breaks, dtype=float), period)
    pairs = real_array("features", np.reshape(np.asarray(features, dtype=float), (-1, 2)))
    _times_in("features", pairs[:, 0], period)
    if np.any(pairs[:, 1] <= 0):
        raise ArgumentError("a feature has no width", got=pairs[:, 1].tolist(), expected="widths greater than 0")
    sample = Sampler(A, period)
    if not len(named) and not len(pairs):
        fit = fit_fourier(sample, tol, None if complete else stratified(CHECKS))
        if fit is not None:
            series = FourierSeries(fit.coefficients.reshape(-1, *_shape(sample)), period)
            need_repetition(sample, series, period * stratified(3 if complete else 7), fit.allowed)
            return ResolvedMatrix(series, (), (), fit.error.reshape(_shape(sample)), sample.count)
    return _on_panels(sample, named, pairs, FEW if complete else CHECKS, tol)


def _on_panels(sample: Sampler, named: Array, pairs: Array, checks: int, tol: float) -> ResolvedMatrix:
    """Resolve by panels, judge the period, and collect."""
    T = sample.period
    sample(T * stratified(PARTS))
    start, about = _start(T, named, pairs), [centre + 4 * width * (2 * stratified(64) - 1) for centre, width in pairs]
    resolver = PanelResolver(sample, tol, start, named, np.concatenate([T * stratified(checks), *about]))
    resolver.run()
    done = resolver.done
    rough, jumps = resolver.singular()
    found = tuple(
        Discontinuity(float(t), "jump" if jump else "kink")
        for t, jump in zip(rough, jumps, strict=True)
        if not np.any(np.abs(named - t) <= 4 * np.finfo(float).eps * T)
    )
    allowed = resolver.allowed(done).max(axis=0)
    shown = np.flatnonzero(np.any(np.abs(done.coefficients) > np.finfo(float).eps / 2 * sample.scale, axis=(0, 2)))
    degree = int(shown[-1]) if len(shown) else 0
    coefficients = done.coefficients[:, : degree + 1].reshape(len(done.begin), degree + 1, *_shape(sample))
    series = ChebyshevPanels(np.append(done.begin, T), coefficients)
    narrow = np.argsort(done.end - done.begin)[:32]
    times = np.sort(done.begin[narrow] + 0.38 * (done.end - done.begin)[narrow])
    need_repetition(sample, series, np.concatenate([times, T * stratified(7)]), allowed, rough)
    places = np.union1d(named, [place.time for place in found])
    return ResolvedMatrix(series, tuple(places.tolist()), found, resolver.error().reshape(_shape(sample)), sample.count)


def _start(period: float, named: Array, pairs: Array) -> Array:
    """The first edges: the breaks, a graded mesh about each feature, and no panel longer than a quarter of the period."""
    meshes = [graded([centre], width, max(period / 8, width), STEP) for centre, width in pairs]
    edges = np.mod(np.concatenate([np.empty(0), *meshes]), period)
    edges = np.unique(np.concatenate([[0.0, period], edges, named]))
    close = np.diff(edges, append=np.inf) < 1e-11 * period
    close &= ~np.isin(edges, [0.0, *named])
    if np.any(np.diff(edges[~close])[-1:] < 1e-11 * period):
        close[np.flatnonzero(~close)[-2]] = True
    return _divided(edges[~close], period / PARTS)


def _divided(edges: Array, longest: float) -> Array:
    """Divide intervals evenly until none is longer."""
    counts = [math.ceil((b - a) / longest * (1 - 1e-12)) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    parts = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(edges[:-1], edges[1:], counts, strict=True)]
    return np.concatenate([*parts, edges[-1:]])


def _times_in(name: str, times: Array, period: float) -> Array:
    """Increasing times in [0, T)."""
    inside = np.unique(real_array(name, times.ravel(), (None,)))
    if inside.size and (inside.min() < 0 or inside.max() >= period):
        raise ArgumentError(f"{name} lie outside the period", got=inside.tolist(), expected=f"times in [0, {period})")
    return inside


def _shape(sample: Sampler) -> tuple[int, int]:
    return sample.shape or (0, 0)
