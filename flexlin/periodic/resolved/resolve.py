"""The coefficients of a periodic system over one period, resolved before anything is integrated."""

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from flexlin.checks import Array, positive, real_array
from flexlin.errors import ArgumentError
from flexlin.periodic.chebyshev import ChebyshevPanels
from flexlin.periodic.fourier import FourierSeries, fourier_basis
from flexlin.periodic.resolved.beside import miss_beside
from flexlin.periodic.resolved.harmonics import EPS, FourierFit, first_times, fit_fourier
from flexlin.periodic.resolved.matrix import Discontinuity, ResolvedMatrix, divided
from flexlin.periodic.resolved.panels import left_over, panel_error, shown_degree
from flexlin.periodic.resolved.refining import PanelResolver
from flexlin.periodic.resolved.repetition import need_repetition
from flexlin.periodic.resolved.sampling import REPEATS, CheckPoints, Sampler, graded, stratified, usual_phases

__all__ = ["Discontinuity", "ResolvedMatrix", "resolve"]

FEW = 200
"""Check points of a function whose narrow features are named, where it needs panels."""
STEP = 4.0
"""Ratio of neighbouring panels about a named feature."""
CLOSE = 1e-11
"""Of the period: edges about features that come closer to another edge are left out."""
PARTS = 4
"""Panels of a period at the start."""


def resolve(
    A: Callable[[Array], Array],
    period: float,
    breaks: Sequence[float] = (),
    features: Sequence[tuple[float, float]] = (),
    *,
    complete: bool = False,
    tol: float = 1e-13,
    least: float | Array = 0.0,
    repeats: bool = True,
) -> ResolvedMatrix:
    """Represent a periodic matrix function by a series that agrees with it between the nodes.

    A smooth A becomes a Fourier series of as many harmonics as it has. Otherwise the period is divided into panels of polynomials of
    degree 31, at the breaks, about the features, and wherever A is not smooth: a jump is followed by bisection to the last bits of t, a
    kink as far as it shows. Noise of A is measured, and agreement beyond it is not asked for.

    What no sampler can promise: to see what happens between its samples. A is compared at 12289 times on no regular grid, with gaps below
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
    least : size below which an entry counts as that large, for all or for each: smaller ones are then known less well than tol of
        themselves.

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
    >>> from flexlin.periodic.resolved.resolve import resolve
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
    sample = Sampler(A, period, least)
    about = [centre + 4 * width * (2 * stratified(64) - 1) for centre, width in pairs]
    phases = stratified(FEW) if complete else usual_phases()
    checks = CheckPoints(sample, np.concatenate([period * phases, *about]), not complete and not about)
    if repeats and not len(named) and not len(pairs):
        fit = fit_fourier(sample, tol, None if complete else checks)
        if fit is not None:
            return _as_series(sample, fit, REPEATS if complete else 7)
    return _on_panels(sample, named, pairs, checks, tol, not complete, repeats)


def resolve_constant(A: Array, period: float) -> ResolvedMatrix:
    """Represent a matrix (rows, columns) that does not depend on time."""
    return ResolvedMatrix(FourierSeries(A[None], period), (), (), 4 * EPS * np.abs(A), 1)


def foresee_times(period: float) -> list[Array]:
    """The times that `resolve` asks for first, of a smooth function whose narrow features are named."""
    return [first_times(period), period * stratified(REPEATS) + period]


def _as_series(sample: Sampler, fit: FourierFit, repeats: int) -> ResolvedMatrix:
    """Judge the period at some times, and collect."""
    series = FourierSeries(fit.coefficients.reshape(-1, *_shape(sample)), sample.period)
    phases = _waves(repeats, series.harmonics)
    need_repetition(sample, lambda t: phases @ fit.coefficients, sample.period * stratified(repeats), fit.allowed)
    return ResolvedMatrix(series, (), (), fit.error.reshape(_shape(sample)), sample.count)


@lru_cache(maxsize=32)
def _waves(repeats: int, harmonics: int) -> Array:
    """Cosines and sines at the times at which a function is compared with itself a period later, kept between calls."""
    return fourier_basis(stratified(repeats), harmonics)


def _on_panels(
    sample: Sampler, named: Array, pairs: Array, checks: CheckPoints, tol: float, wary: bool, repeats: bool
) -> ResolvedMatrix:
    """Resolve by panels, judge the period, and collect."""
    T = sample.period
    sample(T * stratified(PARTS))
    resolver = PanelResolver(sample, tol, first_edges(T, named, pairs), named, checks, wary)
    resolver.run()
    done = resolver.done
    rough, jumps = resolver.rough()
    found = tuple(
        Discontinuity(float(t), "jump" if jump else "kink")
        for t, jump in zip(rough, jumps, strict=True)
        if not np.any(np.abs(named - t) <= 4 * np.finfo(float).eps * T)
    )
    allowed = left_over(done, sample, tol).max(axis=0)
    degree = shown_degree(done, sample.scale)
    coefficients = done.coefficients[:, : degree + 1].reshape(len(done.begin), degree + 1, *_shape(sample))
    series = ChebyshevPanels(np.append(done.begin, T), coefficients)
    narrow = np.argsort(done.width)[:32]
    times = np.sort(done.begin[narrow] + 0.38 * done.width[narrow])
    if repeats:
        need_repetition(sample, series, np.concatenate([times, T * stratified(7)]), allowed, rough)
    anywhere, local = (bound.reshape(-1, *_shape(sample)) for bound in panel_error(done, degree))
    located = np.array([place.time for place in found])
    places = np.union1d(named, located)
    beside = miss_beside(sample, series, places, places if wary else located).reshape(-1, *_shape(sample))
    return ResolvedMatrix(series, tuple(places.tolist()), found, anywhere.max(axis=0), sample.count, local, beside)


def first_edges(period: float, named: Array, pairs: Array) -> Array:
    """Return the first edges from 0 to T: breaks, a graded mesh about each feature, and no panel longer than a quarter of the period."""
    fixed = np.unique(np.concatenate([[0.0, period], named]))
    meshes = [graded([centre], width, max(period / 8, width), STEP) for centre, width in pairs]
    free = np.sort(np.mod(np.concatenate([np.empty(0), *meshes]), period))
    free = free[np.diff(free, append=np.inf) > CLOSE * period]
    free = free[np.abs(free[:, None] - fixed).min(axis=1) > CLOSE * period]
    return divided(np.union1d(fixed, free), period / PARTS)


def _times_in(name: str, times: Array, period: float) -> Array:
    """Increasing times in [0, T)."""
    if not times.size:
        return np.empty(0)
    inside = np.unique(real_array(name, times.ravel(), (None,)))
    if inside.size and (inside.min() < 0 or inside.max() >= period):
        raise ArgumentError(f"{name} lie outside the period", got=inside.tolist(), expected=f"times in [0, {period})")
    return inside


def _shape(sample: Sampler) -> tuple[int, int]:
    return sample.shape or (0, 0)
