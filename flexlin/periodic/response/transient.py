"""What a periodic system does from a state on: under steps, pushes and other inputs, and under noise."""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, positive, real_array
from flexlin.errors import ArgumentError, TooManySegments
from flexlin.periodic.coefficient_series.matrix import ResolvedCompanion, ResolvedMatrix, couple_uncertainty
from flexlin.periodic.coefficients import Combined, Constant, MatrixFunction, assemble_hamiltonian, hold_input
from flexlin.periodic.interpolation import NODES, divide_evenly, divide_segments, edges_of_short
from flexlin.periodic.response.forced import STEP_STAGES
from flexlin.periodic.system import PeriodicSystem, input_of
from flexlin.periodic.transition.choose_segments import (
    MAX_SEGMENTS,
    NODES_PER_HARMONIC,
    choose_gauss_step,
    count_waves,
    measure_pace,
)
from flexlin.periodic.transition.factors import gauss_transitions
from flexlin.plots.view import Series, Shown, View
from flexlin.precision import EPS, SAFETY, TINY
from flexlin.summary import immutable

if TYPE_CHECKING:
    import xarray

PANEL_STEPS = NODES // STEP_STAGES
"""Steps, at the least, over a panel of the coefficients: it may hold more waves than the stages of one follow."""
MOST_STEPS = NODES * MAX_SEGMENTS

Input = Callable[[Array], Array] | ArrayLike


@immutable(eq=False)
class Transient(Shown):
    """States from a time on, and how far noise spreads them.

    Attributes
    ----------
    t : array, shape (N,)
        Times in s.
    x : array, shape (N, n)
        The states, their mean where there is noise.
    covariance : array, shape (N, n, n)
        Of the states; zero without noise.
    error : float
        Of the states and of the roots of their variances, relative to the largest: by two more stages of each step, and by what moves
        with the coefficients as far as they are not known.

    Examples
    --------
    >>> import flexlin as fl
    >>> found = fl.respond(fl.PeriodicSystem([[-2.0]], 1.0, B=[[1.0]]), [0.0, 0.5, 9.0], u=[4.0])
    >>> found.x[:, 0].round(6).tolist()
    [0.0, 1.264241, 2.0]
    """

    t: Array
    x: Array
    covariance: Array
    error: float

    def to_xarray(self) -> "xarray.Dataset":
        """Return the states and their covariance as a dataset.

        Returns
        -------
        xarray.Dataset
            `x` by time and state, `covariance` by time, state and other; error as attribute.
        """
        import xarray

        series = {"x": (("time", "state"), self.x), "covariance": (("time", "state", "other"), self.covariance)}
        return xarray.Dataset(series, coords={"time": ("time", self.t, {"units": "s"})}, attrs={"error": self.error})

    def _view(self) -> View:
        series = tuple(Series(f"x{i + 1}", self.t, x) for i, x in enumerate(self.x.T))
        title = f"states from {self.t[0]:.4g} to {self.t[-1]:.4g} s"
        return View(title, "", (f"error {self.error:.0e}",), "time in s", "states, each in its own unit", series)


@checked
def respond(
    system: PeriodicSystem,
    t: Sequence[float] | Array,
    x0: ArrayLike | None = None,
    u: Input | None = None,
    push: ArrayLike | None = None,
    noise: ArrayLike | None = None,
    tol: float = 1e-9,
) -> Transient:
    """Compute the states from t[0] on.

        x' = A x + B u(t),   x(t[0]) = x0 + B push,   P' = A P + P A' + B S B',   P(t[0]) = 0

    Assumes inputs that are smooth between the times and the system's breaks.

    Parameters
    ----------
    system : PeriodicSystem
        The system, with n states and m inputs.
    t : array_like, shape (N,)
        Increasing times in s, at which the states are wanted.
    x0 : array_like (n,), optional
        The state at t[0]; zero by default.
    u : array_like (m,), or function of times (N,) -> (N, m), optional
        A step at t[0], or any input.
    push : array_like (m,), optional
        The integral of a short push of the inputs at t[0].
    noise : array_like (m, m), optional
        Intensity S of white noise on the inputs.
    tol : float
        Wanted error of a step, relative.

    Returns
    -------
    Transient
        States, covariance and error.

    Raises
    ------
    ArgumentError
        When an input does not fit.
    TooManySegments
        When the times lie too far apart for tol.

    Examples
    --------
    The variance of x' = -x + w grows to 1/2:

    >>> import flexlin as fl
    >>> found = fl.respond(fl.PeriodicSystem([[-1.0]], 1.0, B=[[1.0]]), [0.0, 1.0, 9.0], noise=[[1.0]])
    >>> found.covariance[:, 0, 0].round(6).tolist()
    [0.0, 0.432332, 0.5]
    """
    times = real_array("t", t, (None,))
    if len(times) < 2 or not np.all(np.diff(times) > 0):
        raise ArgumentError("t does not increase", got=f"{len(times)} times", expected="two or more, increasing")
    n, m = system.n, system.m
    if not (u is None and push is None and noise is None):
        input_of(system)
    given = u if u is None or callable(u) else Constant(real_array("u", u, (m,)))
    S = None if noise is None else real_array("noise", noise, (m, m))
    start = np.zeros(n) if x0 is None else real_array("x0", x0, (n,))
    if push is not None:
        start = start + system.resolved_input(times[:1])[0] @ real_array("push", push, (m,))
    edges = divide_times(system, times, positive("tol", tol))
    at = np.searchsorted(edges, times)

    def run(A: MatrixFunction, B: MatrixFunction | None, stages: int) -> tuple[Array, Array, Array]:
        """States, covariances and roots of variances at the times."""
        driven, excited = A, None
        if B is not None and given is not None:
            driven = Combined(lambda A, B, u: hold_input(A, B @ u[:, :, None]), (A, B, given))
        if B is not None and S is not None:
            excited = Combined(
                lambda A, B: assemble_hamiltonian(A, -B @ S @ np.swapaxes(B, 1, 2), np.zeros_like(A)), (A, B)
            )
        x, P = (part[at] for part in follow(driven, excited, start, edges, stages))
        return x, P, np.sqrt(np.abs(np.diagonal(P, axis1=1, axis2=2)))

    A, B = system.resolved, None if u is None and noise is None else system.resolved_input
    better, coarse = (run(A, B, stages) for stages in (STEP_STAGES + 2, STEP_STAGES))
    moved = run(partial(move_entries, A), None if B is None else partial(move_entries, B), STEP_STAGES)
    pairs = (better, coarse), (coarse, moved)
    change, doubt = (max(float(np.abs(one[k] - other[k]).max()) for k in (0, 2)) for one, other in pairs)
    size = max(np.abs(better[0]).max(), better[2].max(), TINY)
    return Transient(times, *better[:2], float((SAFETY * change + doubt) / size + EPS * len(edges)))


def move_entries(given: ResolvedMatrix | ResolvedCompanion, t: Array) -> Array:
    """A coefficient of which each entry is larger, or smaller at all times, by what it is not known by."""
    values = given(t)
    left, right = (np.broadcast_to(np.eye(size), (len(t), size, size)) for size in values.shape[1:])
    sign = np.random.default_rng(0).choice([-1.0, 1.0], values.shape[1:])
    return values + sign * couple_uncertainty(given, t, left, right, in_mean=True)


def divide_times(system: PeriodicSystem, marks: Array, tol: float, others: Sequence[ResolvedMatrix] = ()) -> Array:
    """Edges of steps between marks, short enough for tol; none passes over a corner or a part of a panel of A, B or others.

    Raises: TooManySegments.
    """
    T, every = system.period, [system.resolved, *([] if system.B is None else [system.resolved_input]), *others]
    longest = float(choose_gauss_step(measure_pace(system).rate.max(keepdims=True), tol, STEP_STAGES).min())
    for one in every:
        if one.panels == 1 and not one.constant:
            longest = min(longest, T * STEP_STAGES / (NODES_PER_HARMONIC * float(count_waves(one.series, tol)[0])))
    panels = [divide_segments(one.edges, PANEL_STEPS) for one in every if one.panels > 1]
    corners = np.concatenate([edges_of_short(edges, longest) for edges in panels] + [one.breaks for one in every])
    span = float(marks[-1] - marks[0])
    steps = span / longest + (span / T + 1) * len(corners) + len(marks)
    if steps > MOST_STEPS:
        raise TooManySegments("the answer takes too many steps", got=f"{steps:.3g}", expected=f"at most {MOST_STEPS}")
    if len(corners):
        turns = T * np.arange(np.floor(marks[0] / T), np.floor(marks[-1] / T) + 1)
        inner = (turns[:, None] + corners).ravel()
        marks = np.union1d(marks, inner[(inner > marks[0]) & (inner < marks[-1])])
    return divide_evenly(marks, np.maximum(np.ceil(np.diff(marks) / longest), 1).astype(int))


def follow(
    driven: MatrixFunction, excited: MatrixFunction | None, start: Array, edges: Array, stages: int
) -> tuple[Array, Array]:
    """States (K, n) and covariance (K, n, n) at the edges."""
    n, steps = len(start), gauss_transitions(driven, edges, stages)
    state = np.append(start, 1.0)[: steps.shape[-1]]
    x = np.array(list(accumulate(steps, lambda state, step: step @ state, initial=state)))[:, :n]
    if excited is None:
        return x, np.zeros((len(edges), n, n))

    def spread(P: Array, step: Array) -> Array:
        return (step[:n, :n] @ P + step[:n, n:]) @ step[:n, :n].T

    steps = gauss_transitions(excited, edges, stages)
    return x, np.array(list(accumulate(steps, spread, initial=np.zeros((n, n)))))
