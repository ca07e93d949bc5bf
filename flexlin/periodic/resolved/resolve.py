"""The coefficients of a periodic system over one period, resolved before anything is integrated."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, positive, real_array
from flexlin.errors import ArgumentError
from flexlin.periodic.coefficients import MatrixFunction, varies
from flexlin.periodic.fourier import FourierSeries
from flexlin.periodic.precision import EPS
from flexlin.periodic.resolved.fourier_fit import FourierFit
from flexlin.periodic.resolved.matrix import Discontinuity, ResolvedMatrix
from flexlin.periodic.resolved.sampling import RESOLVED, ROUNDINGS, Least, Sampler
from flexlin.periodic.resolved.search import resolve_on_panels

__all__ = ["Discontinuity", "ResolvedMatrix", "resolve"]


def resolve(
    A: Callable[[Array], Array],
    period: float,
    breaks: Sequence[float] = (),
    features: Sequence[tuple[float, float]] = (),
    *,
    complete: bool = False,
    tol: float = RESOLVED,
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
    >>> from flexlin.periodic.resolved.resolve import resolve
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
    return ResolvedMatrix(FourierSeries(A[None], period), (), (), ROUNDINGS * EPS * np.abs(A), 1)


def resolve_port(
    given: MatrixFunction,
    period: float,
    breaks: Sequence[float],
    features: Sequence[tuple[float, float]],
    complete: bool,
) -> ResolvedMatrix:
    """What stands beside A(t), an input, an output or a weight, as `resolve` does it where it varies."""
    if not varies(given, period):
        return resolve_constant(given(np.zeros(1))[0], period)
    return resolve(given, period, breaks, features, complete=complete)


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
