"""Which mode keeps a linear-quadratic problem from having a stabilising solution."""

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NotDetectable, NotStabilizable, NumericalError
from flexlin.periodic.precision import CUBE, EPS, ROOT, SLIGHT
from flexlin.periodic.quadratic.linear_quadratic import SAMPLES, LinearQuadratic
from flexlin.periodic.quadratic.scattering import Segment, carry_cost_back, combine_in_tree, transpose
from flexlin.periodic.transition.gauss import gauss_transitions

MAX_PERIODS = 20
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


def name_blocked_mode(
    unreached: bool, segments: Segment, periods: Segment, large: float, problem: LinearQuadratic, marks: Array
) -> NumericalError:
    """Name the mode that no input reaches (or that no weight sees): its exponent's real part and its direction.

    The main direction of a growing H is a left Floquet vector of the open loop, that of a growing G a right one; the growth
    of that direction over one period is the exponent. G obeys the same recursion with time reversed.
    Parameters: segments of one period between marks; periods: a product of whole periods whose H (or G) is still sound;
    large: the size at which the direction is read off.
    """
    steps = gauss_transitions(lambda t: problem.reduced(t)[0], marks)
    grouped, counts = unite_neighbours(segments)
    if unreached:
        backward, counts, steps, size = grouped[::-1], counts[::-1], transpose(steps)[::-1], periods.H
    else:
        backward, size = Segment(transpose(grouped.F), grouped.H, grouped.G), periods.G
    vector, passed = find_main_direction(backward, size, large)
    place = int(counts[:passed].sum())
    growth = 0.0
    for step in np.roll(steps, -place, axis=0):
        vector = step @ vector
        length = np.linalg.norm(vector)
        vector, growth = vector / length, growth + np.log(length)
    got = f"real part of its exponent about {growth / marks[-1]:.3g}/s, " + describe_direction(
        vector, place, unreached, marks
    )
    steps = np.roll(steps, -place, axis=0)
    coupling, rounding = measure_coupling(unreached, steps, vector, place, problem, marks)
    kind = NotStabilizable if unreached else NotDetectable
    what = "reached by the input" if unreached else "seen by the weight Q"
    if growth < -ROOT or coupling > rounding:
        todo = "bring states, inputs and weights to like sizes, ask for a larger tol, or leave out the fastest modes"
        if coupling > SLIGHT:  # its square leaves ten digits
            sizes = [float(np.abs(part).max()) for part in problem.reduced(marks[:-1])]
            return NumericalError(
                "the problem's coefficients lie too far apart to be computed with",
                got="|A| = {:.2g}, |B R^-1 B'| = {:.2g}, |Q| = {:.2g} (less what N takes)".format(*sizes),
                todo=todo,
            )
        return kind(
            f"a mode is {what} too weakly to be computed with",
            got=f"{got}; its share is {coupling:.1g}, and what it needs grows as the share's inverse square",
            todo=todo,
        )
    return kind(
        f"a mode that does not decay {'cannot be reached by the input' if unreached else 'is not seen by the weight Q'}",
        got=got,
        todo="add an actuator that moves it" if unreached else "give the mode's states weight in Q",
    )


def describe_direction(vector: Array, place: int, unreached: bool, marks: Array) -> str:
    """Say a direction and the time at which it holds."""
    moment = "t = 0" if place == 0 else f"t = {(marks[::-1] if unreached else marks)[place]:.4g} s"
    return f"direction {np.array2string(vector, precision=3, suppress_small=True)} at {moment}"


def measure_coupling(
    unreached: bool, steps: Array, vector: Array, place: int, problem: LinearQuadratic, marks: Array
) -> tuple[float, float]:
    """Return the share of a mode in the input (or the weight) over a period, and how much of a share rounding makes.

        max over t of |S p| / (|S| |p|),   S = B R^-1 B' (or Q)

    p(t) is the Floquet vector nearest to `vector`, from the eigenvectors of the product of the steps; its rounding is that of an
    eigenvector, which grows with the condition of the eigenvalue.
    """
    from scipy.linalg import eig  # takes longer to load than most equations to solve

    with np.errstate(over="ignore", invalid="ignore"):
        product = steps[0]
        for step in steps[1:]:
            product = step @ product
    if np.all(np.isfinite(product)):
        left, right = eig(product, left=True)[1:]
        nearest = int(np.argmax(np.abs(right.conj().T @ vector)))
        p, condition = right[:, nearest], 1 / max(abs(np.vdot(left[:, nearest], right[:, nearest])), 1e-100)
    else:
        p, condition = vector.astype(complex), 1e100
    ordered = np.roll((marks[::-1] if unreached else marks)[:-1], -place)
    weights, share = problem.reduced(ordered)[1 if unreached else 2], 0.0
    for weight, step in zip(np.broadcast_to(weights, steps.shape), steps, strict=True):
        size = np.linalg.norm(weight, 2) or 1.0
        share = max(share, float(np.linalg.norm(weight @ p) / size))
        p = step @ p
        p = p / (np.linalg.norm(p) or 1.0)
    return share, min(CUBE, 1e2 * len(p) * EPS * condition)


def unite_neighbours(segments: Segment) -> tuple[Segment, Array]:
    """Combine neighbours until few segments are left, and count how many make each: a direction needs no more."""
    counts = np.ones(len(segments), dtype=int)
    for level in combine_in_tree(segments):
        if len(level) <= SAMPLES:
            break
        counts = np.add.reduceat(counts, np.arange(0, len(counts), 2))
    return level, counts


def find_main_direction(backward: Segment, size: Array, large: float) -> tuple[Array, int]:
    """Walk on until the cost is large, but not yet spoilt by rounding: its main direction and the place in the period."""
    place, X = 0, size if np.abs(size).max() < large else np.zeros_like(size)
    for step in range(MAX_PERIODS * len(backward)):
        if np.abs(X).max() > large:
            break
        X = carry_cost_back(backward[place], X)
        place = (step + 1) % len(backward)
    return np.linalg.eigh(X).eigenvectors[:, -1], place
