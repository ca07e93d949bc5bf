"""Decouple the fast modes of a periodic linear system from the slow ones."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.decoupling.coupling import Coupled, hidden_effect, residual_effect
from flexlin.periodic.decoupling.decoupled import Decoupled, Refusal
from flexlin.periodic.decoupling.grouping import find_eigenvectors
from flexlin.periodic.decoupling.parting import MAX_MERGES, SPARSE, Parted, built_on, part_frame
from flexlin.periodic.decoupling.superadiabatic import (
    aliasing,
    circle_derivative,
    interleaved,
    interpolated,
    shifted,
    tail,
)
from flexlin.periodic.precision import EPS, MINOR, PARTIAL, ROOT, SLIGHT
from flexlin.periodic.product.spectrum import COHERENT
from flexlin.periodic.resolved.panels import NODES
from flexlin.periodic.resolved.sampling import POINTS, RESOLVED, stratified
from flexlin.periodic.system import MatrixFunction

Uncertainty = Callable[[Array, Array, Array], Array]
FIRST_NODES, MAX_NODES = NODES, 256
HIDDEN = 10.0
"""By what factor A(t), on no grid, may differ from its nodes' series by more than is seen half-way between these, or than rounding."""


def decouple(
    A: MatrixFunction,
    period: float,
    tol: float = 1e-9,
    uncertainty: Uncertainty | None = None,
    tries: int = MAX_MERGES,
) -> Decoupled | Refusal:
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
    Decoupled, or a Refusal with its reason: nothing stands apart, A is not resolved, or the coupling does not shrink.

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
    Decoupled(n=2, groups=[1, 1], nodes=64, rounds=1)
    """
    count = FIRST_NODES
    samples = A(period / count * np.arange(count))
    roughness = tail(samples)
    while roughness > SLIGHT:
        if count == MAX_NODES:
            return Refusal(f"the coefficients are not resolved by {count} nodes")
        samples = interleaved(samples, A(period / count * (np.arange(count) + 0.5)))
        count, before, roughness = 2 * count, roughness, tail(samples)
        if count > 2 * FIRST_NODES and roughness > 0.2 * before:
            return Refusal(
                "the coefficients' harmonics fall off too slowly: a break that is not named, or a narrow feature"
            )
    between = A(period / count * (np.arange(count) + 0.5))
    try:
        return decouple_on_more(A, samples, between, period, tol, uncertainty, tries)
    except np.linalg.LinAlgError:
        return Refusal("the eigenvectors of A(t) depend on each other at some time")


def decouple_on_more(
    A: MatrixFunction,
    samples: Array,
    between: Array,
    period: float,
    tol: float,
    uncertainty: Uncertainty | None,
    tries: int,
) -> Decoupled | Refusal:
    """Decouple on nodes at which A is given (N, n, n), as it is half-way between them, and on twice as many until both agree.

    These go on from what the fewer ones reached, where that parts; else they begin anew, from the eigenvectors of A(t).
    Raises: LinAlgError where the eigenvectors of A(t) depend on each other at a node.
    """
    joined, before = np.zeros(samples.shape[1:], bool), None
    while True:
        count = len(samples)
        if hides_waves(A, period, samples, between):
            return Refusal("the coefficients have harmonics that equidistant nodes take for others")
        going = None if before is None else part_frame(before.frame.doubled(), samples, period, tol)
        parted: Parted | Refusal | None = going
        if going is None or going.stuck.any():
            few = count == FIRST_NODES
            parted = built_on(samples, find_eigenvectors(samples), joined, period, tol, tries, few)
        if isinstance(parted, Refusal):
            return parted
        if parted is not None and not parted.stuck.any():
            answer, settled = checked(parted.decoupled, samples, between, tol, uncertainty)
            if settled or count == MAX_NODES:
                return answer
        before, samples = parted, interleaved(samples, between)
        between = A(period / len(samples) * (np.arange(len(samples)) + 0.5))


def hides_waves(A: MatrixFunction, period: float, samples: Array, between: Array) -> bool:
    """Whether A(t) departs, at times on no grid, from the series through its nodes by more than it does half-way between these.

    N nodes and those half-way take a harmonic k for k - 2 m N and agree on it. One that neither set holds, so that twice the nodes come
    no nearer to it, may meet a gap in resonance.
    """
    both, t = interleaved(samples, between), period * stratified(POINTS)
    apart = np.abs(interpolated(both, period, t) - A(t)).max(axis=0)
    seen, size = np.abs(shifted(samples, 0.5) - between).max(axis=0), np.abs(both).max(axis=0)
    wave = apart > HIDDEN * (seen + RESOLVED * size) + EPS * size.max()
    return bool(np.any(wave | (apart > np.maximum(PARTIAL * seen, ROOT * size) + HIDDEN * RESOLVED * size.max())))


def checked(
    built: Decoupled, A: Array, between: Array, tol: float, uncertainty: Uncertainty | None
) -> tuple[Decoupled, bool]:
    """Evaluate the generator half-way between the nodes too: the denser result, and whether the two sets of nodes agree."""
    period = built.period
    T = interleaved(built.frame, shifted(built.frame, 0.5))
    slope = interleaved(*(circle_derivative(built.frame, period, shift) for shift in (0.0, 0.5)))
    A = interleaved(A, between)
    inverse = np.linalg.inv(T)
    inverse += inverse @ (np.eye(T.shape[-1]) - T @ inverse)
    B = inverse @ (A @ T - slope)
    times = period / len(A) * np.arange(len(A))
    done = replace(built, times=times, frame=T, inverse=inverse, generator=B)
    coupled = Coupled(B, period, built.groups)
    done = replace(done, residual=residual_effect(coupled))
    allowed = tol * np.maximum(1, np.abs(np.einsum("tii->ti", B).mean(axis=0)))
    done, agree, parted = with_evidence(done, coupled, slope, A, allowed, uncertainty)
    return done, bool(np.all(agree & parted))


def with_evidence(
    done: Decoupled, coupled: Coupled, slope: Array, A: Array, allowed: Array, uncertainty: Uncertainty | None
) -> tuple[Decoupled, Array, Array]:
    """State what rounding is left beside the coupling; and of which modes the nodes and those half-way between them agree (n,), and the
    coupling is small enough (n,).

    Parameters: coupled: the generator; slope, A (N, n, n): the frame's slope and the coefficients at the times of `done`;
    allowed (n,): error of each exponent, in 1/s.
    """
    some = slice(None, None, SPARSE)
    T, inverse = done.frame[some], done.inverse[some]
    rounding = EPS * (np.abs(inverse) @ (np.abs(A[some]) @ np.abs(T) + np.abs(slope[some]))).mean(axis=0)
    if uncertainty is not None:
        rounding = rounding + COHERENT / 3 * uncertainty(done.times[some], inverse, T).mean(axis=0)
    means = np.einsum("tii->ti", done.generator)
    apart = np.maximum(np.abs(means[::2].mean(axis=0) - means[1::2].mean(axis=0)), aliasing(means))
    noise = 4 * np.diagonal(rounding)
    hidden = hidden_effect(coupled, rounding)
    parted = np.diagonal(done.residual) < PARTIAL * allowed + noise
    parted |= np.diagonal(hidden) > allowed  # more nodes would not help
    stated = replace(done, residual=done.residual + hidden, rounding=rounding, coupled=coupled)
    return stated, apart < MINOR * allowed + noise, parted
