"""The linear prediction of a simulation, with its own error."""

from collections.abc import Callable

import numpy as np

from flexlin.about.law import Law
from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.periodic.companion import build_companion, solve_mass
from flexlin.periodic.system import MatrixFunction
from flexlin.periodic.transition.gauss import gauss_transitions
from flexlin.periodic.transition.radau import radau_transitions

Transitions = Callable[[MatrixFunction, Array, int], Array]
METHODS: tuple[tuple[Transitions, int], ...] = ((gauss_transitions, 6), (radau_transitions, 5))
"""Methods and their stages: the second is L-stable, for loops with modes that no step resolves."""
MOST_STEPS = 2**17
"""Steps that one method may take before the next has its turn."""
CHUNK_BYTES = 2**25
"""Transition matrices of one stretch of the time take at most this many bytes."""
ROUNDING = 1e-13
"""Two resolutions that agree so well differ by rounding."""


def predict(lin: Linearization, t: Array, start: Array, law: Law, tol: float) -> tuple[Array, Array]:
    """Compute the linear answer from a start, twice: on the finest steps, and on twice as long ones.

        x' = A(t) x + f(t):   the pair [x; 1] obeys a homogeneous equation, so its transition matrices carry the forcing too

    The steps, which cross no break of the motion, are halved until two resolutions agree to tol, relative to the largest |x|, or to the
    smallest difference that the largest number of steps allows. Saturation and sampling are left out: they are not linear.

    Parameters
    ----------
    lin : Linearization
        With n coordinates.
    t : array, shape (N,)
        Times in s; the first is that of the start.
    start : array, shape (2n,)
        State [y; y'] at the first time.
    law : Law
        What commands the torque.
    tol : float
        Wanted difference of the two.

    Returns
    -------
    fine : array, shape (N, 2n)
        States on the finest steps.
    coarse : array, shape (N, 2n)
        States on twice as long steps.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> from flexlin.simulation import predict
    >>> scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": []})
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> fine, coarse = predict(lin, np.linspace(0.0, 0.1, 3), np.zeros(4), lin.law, 1e-8)
    >>> fine.shape, bool(np.abs(fine - coarse).max() < 1e-8)
    ((3, 4), True)
    """
    marks = with_breaks(t, lin)
    wanted = np.searchsorted(marks, t)
    A = augmented(lin, law)
    best: tuple[float, Array, Array] | None = None
    for method, stages in METHODS:
        coarse, parts = propagate(A, marks, start, 1, method, stages)[wanted], 1
        while 2 * parts * len(marks) <= max(MOST_STEPS, 4 * len(marks)):
            parts *= 2
            fine = propagate(A, marks, start, parts, method, stages)[wanted]
            apart = distance(fine, coarse)
            if best is None or apart < best[0]:
                best = apart, fine, coarse
            if apart <= max(tol, ROUNDING):
                return fine, coarse
            coarse = fine
    assert best is not None
    return best[1:]


def distance(fine: Array, coarse: Array) -> float:
    """The largest difference of two resolutions, relative to the largest |x| (at least 1); infinite where one is lost."""
    apart = float(np.abs(fine - coarse).max() / max(1.0, np.abs(fine).max()))
    return apart if np.isfinite(apart) else np.inf


def with_breaks(t: Array, lin: Linearization) -> Array:
    """The times t and every break of the motion between them."""
    T = lin.period
    if not lin.breaks:
        return t
    rounds = T * np.arange(np.floor(t[-1] / T) + 1) if lin.motion.periodic else np.zeros(1)
    breaks = np.add.outer(rounds, np.array([*lin.breaks, T])).ravel()
    inside = breaks[(breaks > t[0]) & (breaks < t[-1])]
    near = np.abs(inside[:, None] - t[np.clip(np.searchsorted(t, inside)[:, None] + [-1, 0], 0, len(t) - 1)]).min(
        axis=1
    )
    return np.sort(np.concatenate([t, inside[near > 1e-12 * T]]))


def augmented(lin: Linearization, law: Law) -> MatrixFunction:
    """The matrix of [x; 1]' under a law: what the linear equations hold of their own law is taken out first."""
    own, n = lin.closed_by, 2 * lin.n

    def matrix(t: Array) -> Array:
        c = lin.sample(t)
        gain = c.B @ (law.gain(t) - own.gain(t))
        A = np.zeros((len(t), n + 1, n + 1))
        A[:, :n, :n] = build_companion(c.M, c.D + gain[:, :, lin.n :], c.K + gain[:, :, : lin.n], t)
        force = c.h + np.einsum("tij,tj->ti", c.B, law.offset(t) - own.offset(t))
        A[:, lin.n : n, n:] = solve_mass(c.M, force[:, :, None], t)
        return A

    return matrix


def propagate(A: MatrixFunction, marks: Array, start: Array, parts: int, method: Transitions, stages: int) -> Array:
    """The states (N, 2n) at the marks, with `parts` equal steps between neighbours."""
    n = len(start) + 1
    size = max(1, CHUNK_BYTES // (8 * parts * n * n))
    states = [np.append(start, 1.0)]
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(0, len(marks) - 1, size):
            part = marks[k : k + size + 1]
            inner = part[:-1, None] + np.diff(part)[:, None] * np.arange(parts) / parts
            steps = method(A, np.append(inner, part[-1]), stages).reshape(len(part) - 1, parts, n, n)
            product = steps[:, 0]
            for j in range(1, parts):
                product = steps[:, j] @ product
            for transition in product:
                states.append(transition @ states[-1])
    return np.array(states)[:, :-1]
