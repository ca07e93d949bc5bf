"""Decouple the fast modes of a periodic linear system from the slow ones: group, frame, rounds, and what does not part put together."""

from collections.abc import Callable

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.coefficient_series.sampling import POINTS, RESOLVED_TOL, stratified
from flexlin.periodic.decoupling.coupling import Decoupled, block_values, combined, group_separation, measure_rough
from flexlin.periodic.decoupling.frames import (
    SLOW_PART,
    Group,
    aliasing,
    find_frame,
    follow_modes,
    grouped_modes,
    interleaved,
    interpolated,
    low_harmonics,
    mixing,
    smooth,
    sylvester,
    tail,
)
from flexlin.periodic.interpolation import NODES, circle_derivative, shifted
from flexlin.periodic.product import COHERENT_PART, GROUP_CONDITION
from flexlin.periodic.system import MatrixFunction
from flexlin.precision import EPS, MINOR, PARTIAL, ROOT_EPS, SLIGHT

Uncertainty = Callable[[Array, Array, Array], Array]
FIRST_NODES, MAX_NODES = NODES, 256
HIDDEN_FACTOR = 10.0
"""By what factor A(t), on no grid, may differ from its nodes' series by more than is seen half-way between these, or than rounding."""
ADIABATIC_GAP = 0.05
"""Modes stay together where the basic frequency exceeds this part of the gap between their eigenvalues at some time."""
MOST_TRIES = 14
"""Groupings of the modes, and rounds of each, at the most."""
ENOUGH_EFFECT = MINOR * MINOR
"""Rounds end when the coupling's effect is this part of what is allowed, or shrinks by less than the slowest harmonics do."""


def decouple(
    A: MatrixFunction,
    period: float,
    tol: float = 1e-9,
    uncertainty: Uncertainty | None = None,
    tries: int = MOST_TRIES,
) -> Decoupled | None:
    """Split x' = A(t) x into groups of modes whose eigenvalues stay far apart along the period.

        x = T(t) z,   z' = B(t) z,   B = T^-1 (A T - T') block diagonal

    T starts from the invariant subspaces of A(t) and is improved in superadiabatic rounds, each of which shrinks the coupling by
    the rate of change over the gap. The nodes are doubled until nodes half-way between agree. Assumes A smooth on the circle.

    Parameters
    ----------
    A : function (N,) -> (N, n, n), in 1/s.
    period : in s.
    tol : wanted error of an exponent, in 1/s up to |lambda| = 1/s and relative beyond.
    uncertainty : times, left and right vectors -> bounds on the couplings by what A is not known by (N, n, n), in 1/s.
    tries : how often groups are tried at the most, each time with those together that did not part.

    Returns
    -------
    Decoupled; None where nothing stands apart, A is not resolved, or the coupling does not shrink.

    References
    ----------
    Berry, Histories of adiabatic quantum transitions, Proc. R. Soc. A 429 (1990).

    Examples
    --------
    >>> import numpy as np
    >>> from flexlin.periodic.decoupling.decouple import decouple
    >>> def A(t):
    ...     A = np.zeros((len(t), 2, 2))
    ...     A[:, 0], A[:, 1, 0] = [-1.0, 1.0], np.cos(t)
    ...     A[:, 1, 1] = -500 - 100 * np.sin(t)
    ...     return A
    >>> decoupled = decouple(A, 2 * np.pi)
    >>> decoupled
    Decoupled(n=2, groups=[1, 1], nodes=64)
    """
    count = FIRST_NODES
    samples = A(period / count * np.arange(count))
    roughness = tail(samples)
    while roughness > SLIGHT:
        if count == MAX_NODES:
            return None  # the nodes do not resolve the coefficients
        samples = interleaved(samples, A(period / count * (np.arange(count) + 0.5)))
        count, before, roughness = 2 * count, roughness, tail(samples)
        if count > 2 * FIRST_NODES and roughness > 0.2 * before:
            return None  # harmonics fall off too slowly: a break that is not named, or a narrow feature
    while True:
        between = A(period / len(samples) * (np.arange(len(samples)) + 0.5))
        if hides_waves(A, period, samples, between):
            return None
        try:
            parted = built_on(samples, period, tol, tries)
            if parted is None:
                return None
            answer, settled = checked(*parted, period, samples, between, tol, uncertainty)
        except np.linalg.LinAlgError:
            return None  # eigenvectors of A(t) depend on each other at some time
        if settled or len(samples) == MAX_NODES:
            return answer
        samples = interleaved(samples, between)


def hides_waves(A: MatrixFunction, period: float, samples: Array, between: Array) -> bool:
    """Whether A(t) departs, at times on no grid, from the series through its nodes by more than it does half-way between these.

    N nodes and those half-way take a harmonic k for k - 2 m N and agree on it. One that neither set holds, so that twice the nodes come
    no nearer to it, may meet a gap in resonance.
    """
    both, t = interleaved(samples, between), period * stratified(POINTS)
    apart = np.abs(interpolated(both, period, t) - A(t)).max(axis=0)
    seen, size = np.abs(shifted(samples, 0.5) - between).max(axis=0), np.abs(both).max(axis=0)
    wave = apart > HIDDEN_FACTOR * (seen + RESOLVED_TOL * size) + EPS * size.max()
    return bool(
        np.any(wave | (apart > np.maximum(PARTIAL * seen, ROOT_EPS * size) + HIDDEN_FACTOR * RESOLVED_TOL * size.max()))
    )


def checked(
    frame: Array,
    groups: tuple[Group, ...],
    period: float,
    A: Array,
    between: Array,
    tol: float,
    uncertainty: Uncertainty | None,
) -> tuple[Decoupled, bool]:
    """Evaluate the generator half-way between the nodes too, and state what rounding leaves beside the coupling: the denser result, and
    whether the two sets of nodes agree on every mode and its coupling is small enough."""
    T = interleaved(frame, shifted(frame, 0.5))
    slope = interleaved(*(circle_derivative(frame, period, shift) for shift in (0.0, 0.5)))
    A = interleaved(A, between)
    inverse = np.linalg.inv(T)
    inverse += inverse @ (np.eye(T.shape[-1]) - T @ inverse)
    B, times = inverse @ (A @ T - slope), period / len(A) * np.arange(len(A))
    rounding = EPS * (np.abs(inverse) @ (np.abs(A) @ np.abs(T) + np.abs(slope))).mean(axis=0)
    if uncertainty is not None:
        rounding = rounding + COHERENT_PART / 3 * uncertainty(times, inverse, T).mean(axis=0)
    means = np.einsum("tii->ti", B)
    allowed, noise = tol * np.maximum(1, np.abs(means.mean(axis=0))), 4 * np.diagonal(rounding)
    apart = np.maximum(np.abs(means[::2].mean(axis=0) - means[1::2].mean(axis=0)), aliasing(means))
    done = Decoupled(period, times, T, B, groups, rounding)
    enough = np.diagonal(done.eliminated) < PARTIAL * allowed + noise
    enough |= np.diagonal(done.hidden) > allowed  # more nodes would not help
    return done, bool(np.all((apart < MINOR * allowed + noise) & enough))


def built_on(samples: Array, period: float, tol: float, tries: int) -> tuple[Array, tuple[Group, ...]] | None:
    """Group, build the frame and make the rounds on one set of nodes, putting modes together that do not part; None where all are.

    Returns: a basis T (N, n, n) of the groups' subspaces, and the groups.
    """
    modes = follow_modes(samples)
    apart = np.abs(modes.values[:, :, None] - modes.values[:, None, :]).min(axis=0)
    together = apart < 2 * np.pi / period / ADIABATIC_GAP
    for _ in range(tries):
        columns, groups = grouped_modes(modes, together)
        if len(groups) == 1:
            return None  # no eigenvalues stand apart from the others along the period
        T, groups = find_frame(modes.right[:, :, columns], modes.left[:, columns], groups)
        allowed = tol * np.maximum(1, np.abs(modes.values[:, columns]).min(axis=0))[:, None]
        T, stuck = part_frame(smooth(T), groups, samples, period, allowed)
        if not stuck.any():
            return T, groups
        together[np.ix_(columns, columns)] |= stuck | stuck.T
    return None  # the coupling between groups does not shrink


def part_frame(T: Array, groups: tuple[Group, ...], A: Array, period: float, allowed: Array) -> tuple[Array, Array]:
    """Make the rounds from a basis T (N, n, n) of the groups' subspaces, where no first step would mix modes by much.

    Parameters: allowed (n, 1): error of each exponent, in 1/s.
    Returns: the basis that the rounds reached; pairs of modes whose coupling stays too large (n, n).
    """
    B = np.linalg.solve(T, A @ T - circle_derivative(T, period))
    S = sylvester(B, groups)
    share = mixing(S)
    stuck = share > MINOR
    if not stuck.any():
        T, S, left = part_groups(T, B, S, groups, period, allowed)
        rounding = 30 * EPS * (np.abs(np.linalg.inv(T)) @ (np.abs(A) @ np.abs(T))).max(axis=0)
        stuck = left > MINOR * allowed + np.sqrt(rounding * rounding.T)
        share = mixing(S)
    if (strongest := share[stuck].max(initial=0.0)) > SLIGHT:  # put those together that mix the most
        stuck &= share >= PARTIAL * strongest
    return T, stuck


def part_groups(
    T: Array, B: Array, S: Array, groups: tuple[Group, ...], period: float, allowed: Array
) -> tuple[Array, Array, Array]:
    """Repeat T := T (1 + S), B := (1 + S)^-1 (B (1 + S) - S') until the coupling's effect stops shrinking; keep the best.

    S solves the Sylvester equations of the coupling: what is left is S' and products of S, smaller by the rate of change over the gap
    of the eigenvalues in every round.

    Returns: T, S, and what the coupling that is left does to each mode by each other one (n, n).
    Source: Berry, Histories of adiabatic quantum transitions, Proc. R. Soc. A 429 (1990).
    """
    apart, least = group_separation(block_values(B, groups), period, groups), np.inf
    swing = np.minimum(apart.swing, GROUP_CONDITION)
    for turn in range(MOST_TRIES + 1):
        rough = measure_rough(B, period, apart.gap)
        second = np.abs(B).max(axis=0) * np.abs(S).max(axis=0).T
        left = np.where(apart.outside, combined(second, np.sqrt(rough * rough.T), apart.oblique, swing), 0)
        size = float((left / (MINOR * allowed)).max())  # couplings of a group add up, and it may amplify them
        if turn and not size < SLOW_PART * least:
            break
        best, least = (T, S, left), size
        if size < ENOUGH_EFFECT or turn == MOST_TRIES:
            break
        step = np.eye(S.shape[-1]) + low_harmonics(S, period, apart.gap)
        T, B = T @ step, np.linalg.solve(step, B @ step - circle_derivative(step, period))
        S = sylvester(B, groups)
    return best
