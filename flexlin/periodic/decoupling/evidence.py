"""What stands behind a decoupled system: the generator at the nodes and between them, its coupling, rounding, and what is hidden."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.decoupling.coupling import Coupled, residual_effect
from flexlin.periodic.decoupling.decoupled import Decoupled
from flexlin.periodic.decoupling.hidden import hidden_effect
from flexlin.periodic.decoupling.waves import aliasing, circle_derivative, interleaved, shifted
from flexlin.periodic.product.perturbation import COHERENT

Uncertainty = Callable[[Array, Array, Array], Array]
SPARSE = 4
"""Means of rounding are taken at every so many nodes: it changes slowly."""
EPS = float(np.finfo(float).eps)


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
    parted = np.diagonal(done.residual) < 0.3 * allowed + noise
    parted |= np.diagonal(hidden) > allowed  # more nodes would not help
    stated = replace(done, residual=done.residual + hidden, rounding=rounding, coupled=coupled)
    return stated, apart < 0.1 * allowed + noise, parted
