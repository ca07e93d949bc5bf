"""`floquet`: which way leads to the exponents of a periodic system; each (segments, decoupling, Hill, constant A) makes its own errors."""

from dataclasses import replace
from functools import partial

import numpy as np

from flexlin.arguments import checked
from flexlin.checks import Array, bytes_allowed, positive, whole
from flexlin.errors import TooManySegments
from flexlin.periodic.circle import match_logs, pair_conjugates, wrap_log
from flexlin.periodic.coefficient_series.matrix import ResolvedCompanion, couple_uncertainty
from flexlin.periodic.coefficient_series.sampling import SEARCH_BLOCKS, stratified
from flexlin.periodic.decoupling.coupling import Decoupled
from flexlin.periodic.decoupling.decouple import MOST_TRIES, decouple
from flexlin.periodic.floquet.by_decoupling import decoupled_exponents, estimate_decoupling_work, hide_enclosed
from flexlin.periodic.floquet.by_segments import solve_by_segments
from flexlin.periodic.floquet.result import FloquetResult, find_coinciding_within, find_reached, judge
from flexlin.periodic.product import balance_factors, bound_pairs, complex_schur, separate_triangular
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.choose_segments import MAX_SEGMENTS, Setting, choose_setting, estimate_work
from flexlin.precision import CUBE_ROOT_EPS, EPS, FAINT, SAFETY

COLLOCATION_WORK = 4e9
"""Multiplications of collocation that are spent where decoupling has answered, but not to the wanted accuracy."""
WORKING_SETS = 22
"""All that is held at once for the product of a period, in units of its factors: of two methods, in Schur form, with what is unknown."""


@checked
def floquet(
    system: PeriodicSystem,
    tol: float = 1e-9,
    *,
    method: str = "auto",
    order: int | None = None,
    segments: int | None = None,
    max_segments: int = MAX_SEGMENTS,
) -> FloquetResult:
    """Compute the Floquet exponents of x' = A(t) x.

        Phi(T) = F_K ... F_1,   mu_i = eigenvalues of Phi(T),   lambda_i = log(mu_i) / T

    The product is never formed, so exponents far apart keep their digits. Where the fastest modes would ask for very many segments,
    they are decoupled from the slow ones instead, and the exponents are means over the period. A constant A needs only its eigenvalues.
    The error of each exponent is estimated by perturbation theory: by its left and right vectors, from what a finer method, the
    representation of A and rounding would change in each factor. Assumes that A is smooth between its breaks, named or found.

    Parameters
    ----------
    system : PeriodicSystem
        The system with n states.
    tol : float
        Wanted error of an exponent, in 1/s up to |lambda| = 1/s and relative beyond.
    method : str
        auto, gauss, radau or hill.
    order : int, optional
        Order of the method; number of harmonics for hill, which are kept as segments are.
    segments : int, optional
        Segments of the period. They are kept, and not refined; the errors come from a second computation with free segments.
    max_segments : int
        Most segments that are tried; where tol needs a third more at most, their error is stated. They are also limited by memory:
        all of the work takes up to 176 n^2 bytes a segment.

    Returns
    -------
    FloquetResult
        Exponents, errors, verdict, status, setting.

    Raises
    ------
    ArgumentError
        When an argument does not fit, or A(t) is not finite at a time that is named.
    NotPeriodic
        When A does not repeat with the period.
    UnresolvedCoefficient
        When A cannot be followed near a time that is named.
    TooManySegments
        With the figure, when tol needs many more segments than the limits allow.

    References
    ----------
    Yakubovich, Starzhinskii, Linear Differential Equations with Periodic Coefficients (1975); Hairer, Norsett, Wanner, Solving Ordinary
    Differential Equations I, II; Bojanczyk, Golub, Van Dooren, The periodic Schur decomposition, Proc. SPIE 1770 (1992).

    Examples
    --------
    Mathieu's equation y'' + (1 + 0.4 cos 2t) y = 0 lies in its first tongue of instability, its damped form does not:

    >>> import numpy as np
    >>> import flexlin as fl
    >>> def spring(t):
    ...     return (1.0 + 0.4 * np.cos(2.0 * t))[:, None, None]
    >>> free, damped = (fl.PeriodicSystem.from_second_order([[1.0]], [[d]], spring, np.pi) for d in (0.0, 0.5))
    >>> fl.floquet(free).verdict, fl.floquet(damped).verdict
    ('unstable', 'stable')
    >>> found = fl.floquet(damped)
    >>> bool(abs(found.exponents.real.sum() + 0.5) <= found.errors.sum())  # Liouville: the sum is the mean trace of A
    True
    """
    tol = positive("tol", tol)
    order, segments = (None if v is None else whole(k, v) for k, v in (("order", order), ("segments", segments)))
    limit = max(1, min(whole("max_segments", max_segments), bytes_allowed() // (8 * WORKING_SETS * system.n**2)))
    answer = find_exponents(system, tol, method, order, segments, limit)
    return replace(answer, resolved=system.resolved)


def find_exponents(
    system: PeriodicSystem,
    tol: float,
    method: str,
    order: int | None,
    segments: int | None,
    limit: int,
) -> FloquetResult:
    """Choose a way to the exponents and go it."""
    if method == "hill":
        return solve_by_hill(system, tol, order)
    if method == "auto" and system.resolved.constant:
        exponents, errors = solve_constant(system)
        folded = wrap_log(exponents * system.period) / system.period
        return finish(system, folded, errors, Setting("eigenvalues", 0, 1, "A is constant"), tol)
    if segments is not None and segments > limit:
        raise TooManySegments(
            "more segments were asked for than are computed",
            got=segments,
            expected=f"at most {limit}",
            todo="ask for fewer, or leave segments to the solver",
        )
    if segments is not None:
        setting = choose_setting(system, tol, method, order, segments)
        fixed = solve_by_segments(system, setting, tol, segments, fixed=True)
        return judge_beside(system, fixed.logs / system.period, fixed.rounding / system.period, setting, tol)
    setting = choose_setting(system, tol, method, order)
    if method != "auto":
        return answer_by_segments(system, setting, tol, limit)
    return answer_by_either(system, setting, tol, limit)


def answer_by_segments(system: PeriodicSystem, setting: Setting, tol: float, limit: int) -> FloquetResult:
    """The exponents of the product of the segments' factors.

    Raises: TooManySegments.
    """
    spectrum = solve_by_segments(system, setting, tol, limit)
    return finish(system, spectrum.logs / system.period, spectrum.errors / system.period, spectrum.setting, tol)


def answer_by_either(system: PeriodicSystem, setting: Setting, tol: float, limit: int) -> FloquetResult:
    """The exponents by decoupling where that promises less work, else by segments; by the better one where decoupling misses tol."""
    decoupled = try_decoupling(system, setting, tol)
    work = estimate_work(system, setting.order // 2, setting.segments)
    patient = setting.segments <= limit and work < COLLOCATION_WORK
    if decoupled is not None and not (patient and count_missed(decoupled, tol)):
        return decoupled
    try:
        answer = answer_by_segments(system, setting, tol, limit)
    except TooManySegments:
        if decoupled is not None:
            return decoupled
        bound = choose_setting(system, tol, "radau")
        reason = "other methods would take too many segments; modes that decay too fast for these are only bounded"
        answer = answer_by_segments(system, replace(bound, segments=4 * bound.segments, reason=reason), tol, limit)
    return answer if decoupled is None or count_missed(answer, tol) <= count_missed(decoupled, tol) else decoupled


def try_decoupling(system: PeriodicSystem, setting: Setting, tol: float) -> FloquetResult | None:
    """The exponents by decoupling, where that promises less work than segments, and serves."""
    resolved, T = system.resolved, system.period
    tries = float(estimate_work(system, setting.order // 2, setting.segments)) / estimate_decoupling_work(system.n)
    if tries < 1 or resolved.breaks:
        return None
    decoupled = decouple(resolved, T, tol, partial(couple_uncertainty, resolved), int(min(tries, MOST_TRIES)))
    if decoupled is None:
        return None
    found = decoupled_exponents(decoupled, tol)
    errors = hide_enclosed(found.exponents, found.errors)
    reason = f"eigenvalues of A(t) up to {setting.rate:.3g} 1/s beside a motion of {2 * np.pi / T:.3g} 1/s"
    chosen = Setting("decoupling", 0, 1, reason, setting.rate)
    return finish(system, found.exponents, errors, chosen, tol, decoupled)


def count_missed(found: FloquetResult, tol: float) -> int:
    """How many exponents miss tol; those that are enclosed only do not, nor those that coincide with another one as far as can be
    known: a double one that rounding splits, which segments know no better."""
    size, logs = np.maximum(1.0, np.abs(found.exponents)), found.exponents * found.period
    alike = find_coinciding_within(logs, found.errors * found.period) & (found.errors <= CUBE_ROOT_EPS * size)
    reached = find_reached(found.exponents, found.errors, tol)
    return int(np.sum(~(reached | np.isinf(found.errors) | alike)))


def finish(
    system: PeriodicSystem,
    exponents: Array,
    errors: Array,
    setting: Setting,
    tol: float,
    decoupled: Decoupled | None = None,
) -> FloquetResult:
    """Pair conjugate exponents, and those of an undamped system, exactly, and give the verdict."""
    logs, uncertain = pair_conjugates(exponents * system.period, errors * system.period)
    exponents, errors = logs / system.period, uncertain / system.period
    order = np.lexsort((-exponents.imag, -exponents.real))
    exponents, errors = exponents[order], errors[order]
    decays = all(g + e < 0 or e == np.inf for g, e in zip(exponents.real.tolist(), errors.tolist(), strict=True))
    undamped = not decays and abs(exponents.real.sum()) <= errors.sum() and is_hamiltonian(system)
    if undamped:
        logs, violation = pair_hamiltonian(exponents * system.period)
        exponents, errors = logs / system.period, np.maximum(errors, violation / system.period)
    return judge(exponents, errors, system.period, setting, tol, undamped, decoupled=decoupled)


def judge_beside(
    system: PeriodicSystem, exponents: Array, rounding: Array, setting: Setting, tol: float
) -> FloquetResult:
    """Judge exponents (n,) of a resolution that is held by their distance to those of one that the engine chose."""
    best = floquet(system, tol)
    partner, apart = match_logs(exponents * system.period, best.log_multipliers)
    errors = 1.5 * apart / system.period + best.errors[partner] + rounding
    return judge(exponents, errors, system.period, setting, tol, coarse=best.verdict != "undecided")


def solve_by_hill(system: PeriodicSystem, tol: float, harmonics: int | None) -> FloquetResult:
    """The same exponents by the independent Fourier route, imaginary parts folded into (-pi/T, pi/T].

    Truncations that leave out waves of A(t) agree with each other, and not with A(t): they are held against another method.
    """
    from flexlin.periodic.floquet.hill import hill_spectrum

    spectrum = hill_spectrum(system, tol, harmonics)
    folded = wrap_log(spectrum.exponents * system.period) / system.period
    setting = Setting("hill", spectrum.harmonics, 1, "as asked")
    if harmonics is not None or not spectrum.covered:
        return judge_beside(system, folded, spectrum.rounding, setting, tol)
    reached = find_reached(folded, spectrum.errors, tol) | (spectrum.errors <= 2 * spectrum.rounding)
    return judge(folded, spectrum.errors, system.period, setting, tol, coarse=not reached.all())


def solve_constant(system: PeriodicSystem) -> tuple[Array, Array]:
    """Eigenvalues of A (n,) by falling real part, in 1/s, and bounds on their errors (n,).

    |d lambda_i| <= eps |A| |l_i| |r_i|,   l_i^H r_i = 1, and what pairs of eigenvalues do to each other
    """
    A = system.resolved(np.zeros(1))
    unit = 2.0 ** np.frexp(np.abs(A).max())[1]  # of 1/s, for squares of entries to be numbers
    A, scale = balance_factors(A / unit)
    T, Q = complex_schur(A[0])
    size, values = SAFETY * EPS * np.linalg.norm(A[0]), np.diagonal(T)
    X, shared = separate_triangular(T)
    right, left = Q @ X, np.linalg.solve(X, Q.conj().T)
    coupling = size * np.outer(np.linalg.norm(left, axis=1), np.linalg.norm(right, axis=0))
    sides = (left / scale)[None], (scale[:, None] * right)[None]
    coupling += couple_uncertainty(system.resolved, np.zeros(1), *sides)[0] / unit
    own = np.diagonal(coupling)
    gap = np.abs(values[:, None] - values)
    errors = own + bound_pairs(coupling, own, gap, shared)
    errors = np.maximum(errors, bound_reached(coupling, errors, gap))
    order = np.argsort(-values.real, kind="stable")
    return unit * values[order], unit * errors[order]


def bound_reached(coupling: Array, errors: Array, gap: Array) -> Array:
    """How far each eigenvalue (n,) may move with the m - 1 others that reach it, being lost within R: |d lambda|^m <= c^2 R^(m - 2).

    They solve (z - lambda_i) det(z - L) = a adj(z - L) b, c^2 being the largest |a_j b_j|. Parameters: as of `bound_pairs`; errors (n,).
    """
    reached = (errors >= gap) & (errors > errors[:, None])
    c, R = (np.where(reached, size, 0).max(axis=1) for size in (np.sqrt(coupling * coupling.T), errors))
    m = np.maximum(2, 1 + reached.sum(axis=1))
    return np.asarray(c ** (2 / m) * R ** (1 - 2 / m))


def is_hamiltonian(system: PeriodicSystem) -> bool:
    """Whether the flow keeps a symplectic form.

        first order:   J A(t) symmetric, J = [[0, I], [-I, 0]]
        second order:  M and K - G'/2 symmetric, G = D - M' skew   (then p = M y' + G y / 2 is the momentum)

    M', G' are those of the series.
    Source: Yakubovich, Starzhinskii, Linear Differential Equations with Periodic Coefficients (1975), ch. III.
    """
    resolved, t = system.resolved, system.period * stratified(SEARCH_BLOCKS)
    if not isinstance(resolved, ResolvedCompanion):
        n, odd = divmod(system.n, 2)
        A = resolved(t)
        return not odd and is_symmetric(np.concatenate([A[:, n:], -A[:, :n]], axis=1))
    slope = resolved.series.derivative()
    M, D, K = resolved.sample(t)
    (dM, dD, _), (ddM, _, _) = (resolved.split(one(t)) for one in (slope, slope.derivative()))
    G = D - dM
    scale = np.abs(D).max() + np.sqrt(np.abs(M).max() * np.abs(K).max())
    skew = np.abs(G + np.swapaxes(G, 1, 2)).max() <= 10 * FAINT * scale
    return bool(skew and is_symmetric(M) and is_symmetric(K - (dD - ddM) / 2))


def is_symmetric(values: Array) -> bool:
    """Whether matrices (N, n, n) are symmetric to within rounding of their largest entry."""
    return bool(np.abs(values - np.swapaxes(values, 1, 2)).max() <= FAINT * np.abs(values).max())


def pair_hamiltonian(logs: Array) -> tuple[Array, Array]:
    """Make logs of multipliers exactly paired, log mu -> -log mu, and return by how much each missed its pair.

    (l_i - l_j) / 2 for each i and the partner j nearest to -l_i, imaginary parts modulo 2 pi
    """
    partner, violation = match_logs(-logs, logs)
    mutual = partner[partner] == np.arange(len(logs))
    return wrap_log(logs + np.where(mutual, wrap_log(-logs[partner] - logs) / 2, 0)), violation
