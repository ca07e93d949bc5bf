"""Which mode keeps a linear-quadratic problem from having a stabilising solution."""

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NotDetectable, NotStabilizable, NumericalError
from flexlin.periodic.floquet.modes import find_coinciding, floquet_modes
from flexlin.periodic.precision import CUBE, EPS, ROOT, SLIGHT, TINY
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.system import PeriodicSystem, dual_system

LARGEST = 1e100
"""A size that only growth without end reaches."""


def bound_sizes(problem: LinearQuadratic, horizon: float) -> tuple[float, float]:
    """Return the sizes of H and G from which on a mode's coupling to B or Q cannot be distinguished from rounding.

    One mode of rate a needs X = 2 a / b for its share b of B R^-1 B', and dually 2 a / q of G for its share q of Q.
    """
    A, S, Q = problem.reduced(horizon * (np.arange(32) + 0.5) / 32)
    tiny = 1e-100
    rate = np.linalg.norm(A, 2, axis=(1, 2)).max() + 1 / horizon
    S_size, Q_size = np.abs(S).max() + tiny, np.abs(Q).max() + tiny
    return (
        min(1e13 * max(rate / S_size, Q_size / rate), LARGEST),
        min(1e13 * max(rate / Q_size, S_size / rate), LARGEST),
    )


def name_blocked_mode(unreached: bool, problem: LinearQuadratic, edges: Array) -> NumericalError:
    """Name the mode that no input reaches (or that no weight sees): its exponent's real part and its direction.

    Parameters: edges: times from 0 to the period between which the coefficients are smooth.
    """
    T = float(edges[-1])
    loop = PeriodicSystem(lambda t: problem.reduced(t)[0], T, breaks=edges[:-1].tolist(), complete=True)
    growth, share, rounding, vector = find_blocked(unreached, problem, dual_system(loop) if unreached else loop)
    kind = NotStabilizable if unreached else NotDetectable
    what = "reached by the input" if unreached else "seen by the weight Q"
    got = f"real part of its exponent about {growth:.3g}/s, direction {np.array2string(vector, precision=3)} at t = 0"
    todo = "bring states, inputs and weights to like sizes, ask for a larger tol, or leave out the fastest modes"
    if share > SLIGHT:  # its square leaves ten digits
        return NumericalError(
            "the problem's coefficients lie too far apart to be computed with",
            got=problem.describe_sizes(edges[:-1]),
            todo=todo,
        )
    if share > rounding:
        return kind(
            f"a mode is {what} too weakly to be computed with",
            got=f"{got}; its share is {share:.1g}, and what it needs grows as the share's inverse square",
            todo=todo,
        )
    return kind(
        f"a mode that does not decay {'cannot be reached by the input' if unreached else 'is not seen by the weight Q'}",
        got=got,
        todo="add an actuator that moves it" if unreached else "give the mode's states weight in Q",
    )


def find_blocked(unreached: bool, problem: LinearQuadratic, loop: PeriodicSystem) -> tuple[float, float, float, Array]:
    """Growth in 1/s of the mode that does not decay with the least share in the weight (or in the input), the share, how much of a share
    rounding makes, and its direction at t = 0.

        max over t of |Q p| / (|Q| |p|)   (or of |S q| / (|S| |q|),   S = B R^-1 B')

    p(t) is a right Floquet vector, q(t) a left one: a right one of the dual loop. Of modes with one exponent every combination is one.
    """
    modes = floquet_modes(loop)
    weight = problem.reduced(np.mod(-modes.times, loop.period) if unreached else modes.times)[1 if unreached else 2]
    weight = weight / np.maximum(np.linalg.norm(weight, 2, axis=(1, 2)), TINY)[:, None, None]
    same, found = find_coinciding(loop.period * modes.exponents), []
    for i in np.flatnonzero(modes.exponents.real >= -np.maximum(ROOT, modes.errors)):
        p = modes.right[:, :, same[i]]
        p = p @ np.linalg.svd(np.linalg.qr((weight @ p).reshape(-1, p.shape[2]), mode="r"))[2][-1].conj()
        length = np.linalg.norm(p, axis=1)
        share = float((np.linalg.norm((weight @ p[:, :, None])[:, :, 0], axis=1) / length).max())
        condition = float((np.linalg.norm(modes.left[:, :, i], axis=1) * length).max())
        rounding = min(CUBE, 1e2 * len(modes.exponents) * EPS * max(condition, 1.0))
        found.append((float(modes.exponents[i].real), share, rounding, (p[0] / length[0]).real))
    nothing = 0.0, 1.0, 0.0, np.zeros(loop.n)
    return min(found, key=lambda mode: mode[1] if mode[1] > mode[2] else 0.0, default=nothing)
