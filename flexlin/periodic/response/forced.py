"""The periodic response of a periodic system to a periodic force, known between the grid points too, with its error."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, at_times, positive, real_array, whole
from flexlin.errors import ArgumentError, ResonantForcing, TooManySegments
from flexlin.periodic.coefficient_series.matrix import couple_uncertainty
from flexlin.periodic.coefficient_series.resolve import resolve
from flexlin.periodic.coefficients import (
    PROBES,
    Combined,
    Constant,
    MatrixFunction,
    has_nothing_narrow,
    hold_input,
    refuse_signature,
)
from flexlin.periodic.interpolation import FINER_BOUNDS, NODES, TAIL, edges_of_short, place_edges
from flexlin.periodic.product import COHERENT_PART, cyclic_system, find_spectrum
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.choose_segments import GUESS_MARGIN, MAX_SEGMENTS, choose_setting, report_too_many
from flexlin.periodic.transition.factors import factor_segments, sample_segments
from flexlin.periodic.transition.gauss import Tableau, gauss, integrate_legendre, place_nodes, radau, solve_stages
from flexlin.plots.view import Series, Shown, View
from flexlin.precision import EPS, FOURTH_ROOT_EPS, MINOR, ROOT_EPS, SAFETY, TINY
from flexlin.summary import immutable

if TYPE_CHECKING:
    import xarray


VectorFunction = Callable[[Array], Array]
RESONANT_LOSS = 100.0
"""A response that loses this factor beyond tol to rounding is resonant."""
STEP_STAGES = 6
"""Of a step, where two more show the error; of Radau IIA, and of Gauss collocation at the least, where finer steps do."""
STIFF_SEGMENTS = 1024
"""Segments of Gauss collocation beyond which Radau IIA is tried first: it does not feel fast modes that are damped."""


@immutable
class PiecewiseSolution:
    """The collocation polynomials: x(t_k + theta h_k) = start_k + h_k sum_m slope_km int_0^theta P_m."""

    edges: Array
    start: Array
    slope: Array

    def __call__(self, t: Array) -> Array:
        k = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, len(self.start) - 1)
        h = np.diff(self.edges)[k]
        integral = h[:, None] * integrate_legendre(2 * (t - self.edges[k]) / h - 1, self.slope.shape[1])
        return self.start[k] + (integral[:, None, :] @ self.slope[k])[:, 0]


@immutable
class ForcedResponse(Shown):
    """The periodic solution x(t) of a periodic system under a periodic force.

    Call it with times (N,) to get (N, n), or with one time to get (n,).

    Attributes
    ----------
    solution : PiecewiseSolution
        The collocation polynomials.
    period : float
        Period in s.
    error : float
        Estimated bound of the error at any time, in the unit of x.
    amplification : float
        How much an error of the force or of rounding may grow: 1 / the smallest singular value of the periodicity condition.
    segments : int
        Segments of the period.
    status : str
        What to make of it.

    Examples
    --------
    >>> import flexlin as fl
    >>> response = fl.forced_response(fl.PeriodicSystem([[-2.0]], 1.0), [4.0])
    >>> response([0.0, 7.3]).round(10).tolist(), response.error < 1e-9
    ([[2.0], [2.0]], True)
    """

    solution: PiecewiseSolution
    period: float
    error: float
    amplification: float
    segments: int
    status: str

    def __call__(self, t: ArrayLike) -> Array:
        """The state at times (N,), any real numbers, (N, n), or at one time, (n,)."""
        return at_times(lambda s: self.solution(np.mod(s, self.period)), t)

    def to_xarray(self, points: int = 257, names: Sequence[str] = (), units: Sequence[str] = ()) -> "xarray.Dataset":
        """Return the states over a period as a dataset.

        Parameters
        ----------
        points : int
            Times of the period, both ends included.
        names : sequence of str, optional
            Names of the n states; x1, x2 ... by default.
        units : sequence of str, optional
            Their units.

        Returns
        -------
        xarray.Dataset
            `response` by time and state; error, status and period as attributes.

        Raises
        ------
        ArgumentError
            When there are not as many names or units as states.
        """
        import xarray

        t = np.linspace(0.0, self.period, whole("points", points, 2))
        states = self(t)
        labels = label_states(states.shape[1], names, units)
        attributes = {"error": self.error, "status": self.status, "period": self.period}
        series = {"response": (("time", "state"), states)}
        coords = {"time": ("time", t, {"units": "s"}), "state": labels[0], "unit": ("state", labels[1])}
        return xarray.Dataset(series, coords=coords, attrs=attributes)

    def _view(self) -> View:
        t = np.linspace(0.0, self.period, 257)
        states = self(t)
        series = tuple(Series(f"x{i + 1}", t, x) for i, x in enumerate(states.T))
        facts = (
            f"period {self.period:.6g} s, error {self.error:.0e}, amplification {self.amplification:.3g}",
            self.status,
        )
        return View("periodic response", "", facts, "time in s", "states, each in its own unit", series)


def label_states(count: int, names: Sequence[str], units: Sequence[str]) -> tuple[list[str], list[str]]:
    """Names and units of states, of which there must be `count` where any are given."""
    for what, given in (("names", names), ("units", units)):
        if len(given) not in (0, count):
            raise ArgumentError(f"{what} do not fit the states", got=len(given), expected=str(count))
    return list(names) or [f"x{i + 1}" for i in range(count)], list(units) or [""] * count


@checked
def forced_response(
    system: PeriodicSystem,
    f: VectorFunction | Sequence[float],
    tol: float = 1e-9,
    *,
    breaks: Sequence[float] = (),
    max_segments: int = MAX_SEGMENTS,
) -> ForcedResponse:
    """Compute the periodic solution of a periodic system under a periodic force.

        x' = A(t) x + f(t),   x(t + T) = x(t):     x_(k+1) = Phi_k x_k + g_k,   x_K = x_0

    on Gauss collocation segments, or on Radau IIA where Gauss would need very many. Between the edges x is the collocation polynomial.
    Assumes A and f smooth between `system.breaks` and `breaks`, and f(t + T) = f(t).

    Parameters
    ----------
    system : PeriodicSystem
        The system, with n states.
    f : function of times (N,) -> (N, n), or sequence of n floats
        The force in state form, in the unit of x per s.
    tol : float
        Wanted error of x, absolute up to |x| = 1, relative beyond.
    breaks : sequence of float
        Times in [0, T), in s, at which f or a derivative of it jumps.
    max_segments : int
        The most segments of the period that may be used.

    Returns
    -------
    ForcedResponse
        The solution with its error.

    Raises
    ------
    ArgumentError
        When the force does not fit.
    ResonantForcing
        When 1 is so nearly a multiplier that tol is out of reach; the message names the multiplier.
    TooManySegments
        When tol needs more segments than allowed.

    Notes
    -----
    The cyclic system is condensed by orthogonal transformations, so fast modes of either sign do no harm. Working memory: some transition
    matrices of each segment, 8 n^2 bytes each, and 64 MiB.

    Examples
    --------
    x' = -x + cos t has the periodic solution (cos t + sin t) / 2:

    >>> import numpy as np
    >>> import flexlin as fl
    >>> response = fl.forced_response(fl.PeriodicSystem([[-1.0]], 2 * np.pi), lambda t: np.cos(t)[:, None])
    >>> print(f"{response(0.7).item():.9f} {(np.cos(0.7) + np.sin(0.7)) / 2:.9f}")
    0.704529937 0.704529937
    """
    whole("max_segments", max_segments)
    force = as_force(f, system)
    problem = ForcedProblem(system, force, find_corners(system, force, real_array("breaks", breaks, (None,))))
    rule, (solution, sigma, apart, scale) = problem.follow(positive("tol", tol), max_segments)
    count = len(solution.start)
    apart += problem.doubt(solution, rule)
    family = "Radau" if rule.c[-1] == 1 else "Gauss"
    status = f"periodic response to {apart:.1e} on {count} segments of {len(rule.c)} {family} stages; amplification {1 / sigma:.1e}"
    if apart > tol * scale:
        status += f"; tol {tol:.0e} was not reached: the error above is what rounding and the number of segments allow"
    return ForcedResponse(solution, system.period, apart, 1 / sigma, count, status)


Refined = tuple[PiecewiseSolution, float, float, float]
"""A response, the smallest singular value of its closure, how far two resolutions are apart, and the size of the response."""


def find_corners(system: PeriodicSystem, force: MatrixFunction, breaks: Array) -> Array:
    """Where force or coefficients are not smooth, and edges of what they do in a short time, so that no segment steps over it."""
    known, longest = np.union1d(system.resolved.breaks, breaks), system.period / NODES
    corners = np.union1d(known, edges_of_short(system.resolved.edges, longest))
    if isinstance(force, Constant):
        return corners
    named, complete = np.union1d(known, 0.0).tolist(), system.complete and has_nothing_narrow(force)
    series = resolve(force, system.period, named, system.features, complete=complete, tol=ROOT_EPS, repeats=False)
    found = [place.time for place in series.found]
    return np.unique(np.concatenate([corners, found, edges_of_short(series.edges, longest)]))


@dataclass(frozen=True, eq=False)
class ForcedProblem:
    """x' = A(t) x + f(t) with a force (N,) -> (N, n, 1), on segments that step over no corner."""

    system: PeriodicSystem
    force: MatrixFunction
    corners: Array

    def follow(self, tol: float, most: int) -> tuple[Tableau, Refined]:
        """By Gauss collocation. Where that needs very many segments Radau's method is tried before, which follows what is smooth on fewer,
        but not modes that ring behind a break.

        Raises: TooManySegments.
        """
        setting, found = choose_setting(self.system, tol), None
        enough, rule = setting.segments, radau(STEP_STAGES)
        if enough > STIFF_SEGMENTS:
            with suppress(TooManySegments):
                found = self.refine(tol, rule, STIFF_SEGMENTS // 4, min(enough, most))
            if found is not None and found[2] <= tol * found[3]:
                return rule, found
        try:
            better = gauss(max(STEP_STAGES, setting.order // 2))
            return better, self.refine(tol, better, enough, most)
        except TooManySegments:
            if found is None:
                raise
            return rule, found

    def refine(self, tol: float, rule: Tableau, enough: int, most: int) -> Refined:
        """Solve on more and more segments until two resolutions that share no edges agree to tol, or to what rounding and the limit allow.

        Parameters: enough: segments that would follow the fastest mode; most: that may be used.
        """
        count = first = max(NODES, enough if enough > STIFF_SEGMENTS else enough // TAIL)
        previous, misses, best = None, list[float](), None
        while count <= most:
            solution, sigma, Phi = self.solve(rule, count, -(-count // first))
            rounding = SAFETY * EPS / max(sigma, TINY)
            if solution is None or rounding > RESONANT_LOSS * max(tol, 1e-10):
                if count >= enough:
                    raise report_resonance(Phi, sigma)
                previous, count = None, 2 * count
                continue
            wanted = 0.0
            if previous is not None:
                scale = max(1.0, float(np.abs(solution.start).max()))
                missed, rounded = measure_difference(solution, previous), measure_rounding(solution, sigma, Phi)
                if missed + rounded <= tol * scale or missed <= 2 * rounding * scale:
                    return solution, sigma, missed + rounded, scale
                misses.append(missed)
                if missed == min(misses):
                    best = solution, sigma, scale, rounded, len(misses)
                if len(misses) > TAIL and min(misses[-TAIL:]) > 0.5 * min(misses[:-TAIL]):
                    break  # rounding of the force and of the coefficients is all that is left
                wanted = len(previous.start) * (GUESS_MARGIN * missed / (tol * scale)) ** (1 / (len(rule.c) + 1))
            previous, count = solution, int(np.ceil(np.clip(wanted, FINER_BOUNDS[0] * count, 2 * count)))
        if best is None or (count > most and misses[-1] > FOURTH_ROOT_EPS * np.abs(best[0].start).max()):
            raise report_too_many(count, most, tol)
        solution, sigma, scale, rounded, at = best
        missed = max(misses[at - 1 : at + 1])
        return solution, sigma, max(SAFETY * missed, missed + rounded), scale

    def solve(self, rule: Tableau, count: int, least: int = 1) -> tuple[PiecewiseSolution | None, float, Array]:
        """On so many segments: the solution, the smallest singular value of the closure, and Phi.

        The force is one more column of A, which a constant state multiplies: z' = [[A, f], [0, 0]] z, z = [x; 1], gives Phi x + g over
        each segment. There is no solution where the singular value is one of rounding alone.
        """
        n, grid = self.system.n, place_edges(self.system.period, self.corners, count, least)
        driven, h = Combined(hold_input, (self.system.resolved, self.force)), np.diff(grid)
        Phi = factor_segments(driven, grid, rule)[:, :n]
        cyclic = cyclic_system(Phi[:, :, :n])
        sigma = float(np.linalg.svd(cyclic.closure, compute_uv=False)[-1])
        if sigma <= SAFETY * EPS:
            return None, sigma, Phi[:, :, :n]
        x = cyclic.solve(Phi[:, :, n:])[..., 0]
        start, rates = np.append(x, np.ones((len(x), 1)), axis=1)[:, None, :, None], list[Array]()
        for part, (A,), _ in sample_segments(driven, (n + 1, n + 1), grid, (rule,)):
            right = np.broadcast_to(start[part], (*A.shape[:3], 1))
            rates.append((A @ solve_stages(h[part, None, None, None] * A, rule, right))[..., :n, 0])
        slope = np.linalg.solve(legvander(2 * rule.c - 1, len(rule.c) - 1), np.concatenate(rates))
        return PiecewiseSolution(grid, x, slope), sigma, Phi[:, :, :n]

    def doubt(self, solution: PiecewiseSolution, rule: Tableau) -> float:
        """How far the response moves by what the coefficients are not known by: the response to |dA| |x|, all of one sign."""

        def force(t: Array) -> Array:
            eye = np.broadcast_to(np.eye(self.system.n), (len(t), self.system.n, self.system.n))
            return couple_uncertainty(self.system.resolved, t, eye, solution(t)[:, :, None])

        moved = replace(self, force=force).solve(rule, max(1, len(solution.start) // 2))[0]
        return np.inf if moved is None else COHERENT_PART * float(np.abs(moved.start).max())


def as_force(f: VectorFunction | Sequence[float], system: PeriodicSystem) -> MatrixFunction:
    """Check the force, and give it as a column (N, n, 1)."""
    if not callable(f):
        return Constant(real_array("f", f, (system.n,))[:, None])
    refuse_signature("f", f)
    shape = real_array("f", f(system.period * PROBES)).shape
    if shape != (3, system.n):
        raise ArgumentError("f(t) has the wrong shape", got=shape, expected=f"(3, {system.n}) for t of shape (3,)")
    return Combined(lambda values: real_array("f", values)[:, :, None], (f,), has_nothing_narrow(f))


def measure_difference(fine: PiecewiseSolution, coarse: PiecewiseSolution) -> float:
    """The largest difference between two resolutions at the edges and inside the segments."""
    grid = coarse.edges
    t = np.concatenate([grid[:-1], place_nodes(grid, gauss(3).c).ravel()])
    return float(np.abs(fine(t) - coarse(t)).max())


def measure_rounding(solution: PiecewiseSolution, sigma: float, Phi: Array) -> float:
    """What rounding moves: states carried over a segment, amplified by the closure, and the gaps between segments that should close.

    A mode that grows fast multiplies a rounding of the state before it: the next state is right, the polynomial that leads there is not.
    """
    carried = float((np.abs(Phi) @ np.abs(solution.start)[:, :, None]).max())
    ends = solution.start + np.diff(solution.edges)[:, None] * solution.slope[:, 0]
    gaps = float(np.abs(ends - np.roll(solution.start, -1, axis=0)).max())
    return SAFETY * EPS * max(1.0, carried) / sigma + gaps


def report_resonance(Phi: Array, sigma: float) -> ResonantForcing:
    """Name the multiplier nearest to 1; where that is none, states of other sizes make the condition singular."""
    found = find_spectrum(Phi)
    k = np.argmin(np.abs(found.logs))
    nearest = found.logs[k] if abs(found.logs[k].imag) > found.rounding[k] else found.logs[k].real
    got = f"the multiplier {np.exp(nearest):.12g} with the periodicity condition's smallest singular value {sigma:.1e}"
    if abs(nearest) > MINOR:
        return ResonantForcing(
            "rounding hides the periodic response, although no multiplier is near 1",
            got=got,
            todo="take units in which the states are of like size, coordinates in which A is closer to normal, or a larger tol",
        )
    return ResonantForcing(
        "1 is (nearly) a Floquet multiplier, so the periodic response is not bounded or not unique",
        got=got,
        todo="fix the free rigid motion by feedback, add damping, or move the forcing's frequency",
    )
