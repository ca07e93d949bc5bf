"""The periodic response of a periodic system to a periodic force, known between the grid points too."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import ArrayLike

from flexlin.checks import Array, at_times, instance, positive, real_array, whole
from flexlin.errors import ArgumentError, ResonantForcing
from flexlin.periodic.coefficients import Constant
from flexlin.periodic.floquet.uncertainty import couple_uncertainty
from flexlin.periodic.grid import place_edges
from flexlin.periodic.product.cyclic import cyclic_system
from flexlin.periodic.product.eigenvalues import product_logs
from flexlin.periodic.product.perturbation import COHERENT
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.choice import choose_setting
from flexlin.periodic.transition.gauss import (
    CHUNK_BYTES,
    Tableau,
    gauss,
    place_nodes,
    sample_at,
    solve_stages,
    weigh_stages,
)
from flexlin.periodic.transition.radau import radau
from flexlin.periodic.transition.setting import MAX_SEGMENTS, report_too_many
from flexlin.summary import represent

VectorFunction = Callable[[Array], Array]
ROUNDINGS, RESONANT = 4.0, 100.0
"""Roundings that the periodicity condition amplifies; a response that loses this factor beyond tol counts as resonant."""
STIFF = 1024
"""Segments of Gauss collocation beyond which Radau IIA is taken: its smooth solution does not feel modes that are fast and damped."""
PROBES = np.array([0.13, 0.5, 0.81])
"""Where inside each segment two resolutions are compared."""


@dataclass(frozen=True)
class PiecewiseSolution:
    """The collocation polynomials: x(t_k + theta h_k) = start_k + h_k sum_m slope_km int_0^theta P_m."""

    edges: Array
    start: Array
    slope: Array

    __repr__ = represent

    def __call__(self, t: Array) -> Array:
        k = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, len(self.start) - 1)
        h = np.diff(self.edges)[k]
        integral = h[:, None] * integrate_legendre((t - self.edges[k]) / h, self.slope.shape[1])
        return self.start[k] + (integral[:, None, :] @ self.slope[k])[:, 0]


@dataclass(frozen=True)
class ForcedResponse:
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

    __repr__ = represent

    def __call__(self, t: ArrayLike) -> Array:
        """The state at times (N,), any real numbers, (N, n), or at one time, (n,)."""
        return at_times(lambda s: self.solution(np.mod(s, self.period)), t)


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
    The cyclic system is condensed by orthogonal transformations, so fast modes of either sign do no harm. Working memory: the stages'
    transition matrices, 16 s n^2 bytes a segment, and 32 MiB.

    Examples
    --------
    x' = -x + cos t has the periodic solution (cos t + sin t) / 2:

    >>> import numpy as np
    >>> import flexlin as fl
    >>> response = fl.forced_response(fl.PeriodicSystem([[-1.0]], 2 * np.pi), lambda t: np.cos(t)[:, None])
    >>> print(f"{response(0.7).item():.9f} {(np.cos(0.7) + np.sin(0.7)) / 2:.9f}")
    0.704529937 0.704529937
    """
    instance("system", system, PeriodicSystem)
    whole("max_segments", max_segments)
    force = as_vector_function(f, system)
    corners = tuple(np.union1d(system.resolved.breaks, real_array("breaks", breaks, (None,))).tolist())
    setting = choose_setting(system, positive("tol", tol), "gauss", None, None)
    stages, count, previous = max(6, setting.order // 2), setting.segments, None
    rule = gauss(stages)
    if count > STIFF:
        stages, count = 6, STIFF // 8
        rule = radau(stages)
    while True:
        solution, sigma, Phi = solve_periodic(system, force, place_edges(system.period, corners, count), rule)
        scale = max(1.0, float(np.abs(solution.start).max()))
        rounding = ROUNDINGS * np.finfo(float).eps / sigma
        if rounding > RESONANT * max(tol, 1e-10):
            raise report_resonance(Phi, sigma)
        if previous is not None:
            apart = float(measure_difference(solution, previous) + rounding * scale)
            if apart <= tol * scale or apart <= 3 * rounding * scale:
                break
        previous = solution
        if 2 * count > max_segments:
            raise report_too_many(2 * count, max_segments, tol)
        count *= 2
    apart += unknown_response(system, solution, corners, max(1, count // 2), rule)
    family = "Radau" if rule.c[-1] == 1 else "Gauss"
    status = f"periodic response to {apart:.1e} on {count} segments of {stages} {family} stages; amplification {1 / sigma:.1e}"
    if apart > tol * scale:
        status += f"; tol {tol:.0e} was not reached: near resonance the error above is what rounding allows"
    return ForcedResponse(solution, system.period, apart, 1 / sigma, count, status)


def unknown_response(
    system: PeriodicSystem, solution: PiecewiseSolution, corners: tuple[float, ...], count: int, rule: Tableau
) -> float:
    """How far the response moves by what the coefficients are not known by: the response to |dA| |x|, all of one sign."""

    def force(t: Array) -> Array:
        eye = np.broadcast_to(np.eye(system.n), (len(t), system.n, system.n))
        return couple_uncertainty(system, t, eye, solution(t)[:, :, None])[:, :, 0]

    moved = solve_periodic(system, force, place_edges(system.period, corners, count), rule)[0]
    return COHERENT * float(np.abs(moved.start).max())


def as_vector_function(f: VectorFunction | Sequence[float], system: PeriodicSystem) -> VectorFunction:
    """Check the force, or let a constant stand for it."""
    n = system.n
    if not callable(f):
        return Constant(real_array("f", f, (n,)))
    probe = system.period * np.array([0.0, 0.2917, 0.6281])
    shape = real_array("f", f(probe)).shape
    if shape != (3, n):
        raise ArgumentError("f(t) has the wrong shape", got=shape, expected=f"(3, {n}) for t of shape (3,)")
    return f


def solve_periodic(
    system: PeriodicSystem, f: VectorFunction, grid: Array, rule: Tableau
) -> tuple[PiecewiseSolution, float, Array]:
    """Solve for the states at the edges; returns the solution, the smallest singular value of the closure, and Phi."""
    h = np.diff(grid)
    t = np.minimum(place_nodes(grid, rule.c), np.nextafter(grid[1:], -np.inf)[:, None])
    force = real_array("f", sample_at(f, t))[..., None]
    A = sample_at(system.resolved, t)
    hA = A * h[:, None, None, None]
    hf = force * h[:, None, None, None]
    n = A.shape[-1]
    eye = np.broadcast_to(np.eye(n), A.shape)
    right = np.concatenate([eye, integrate_stages(rule, hf)], axis=-1)
    size = max(1, CHUNK_BYTES // (8 * (len(rule.c) * n) ** 2))
    parts = [solve_stages(hA[k : k + size], rule, right[k : k + size]) for k in range(0, len(h), size)]
    Y = np.concatenate(parts)
    Phi, g = find_ends(hA, hf, rule, Y)
    cyclic = cyclic_system(Phi)
    sigma = float(np.linalg.svd(cyclic.closure, compute_uv=False)[-1])
    if sigma == 0.0:
        raise report_resonance(Phi, sigma)
    x = cyclic.solve(g)
    rise = (Y[..., :n] @ x[:, None] + Y[..., n:] - x[:, None])[..., 0] / h[:, None, None]
    slope = invert_legendre(rule) @ np.linalg.solve(rule.a, rise)
    return PiecewiseSolution(grid, x[..., 0], slope), sigma, Phi


def find_ends(hA: Array, hf: Array, rule: Tableau, Y: Array) -> tuple[Array, Array]:
    """Transition matrices and particular ends of the segments from the stages Y = [of Phi, of f]; the last stage where c = 1."""
    n = hA.shape[-1]
    if rule.c[-1] == 1:
        return Y[:, -1, :, :n], Y[:, -1, :, n:]
    step = weigh_stages(hA, rule, Y)
    return np.eye(n) + step[..., :n], step[..., n:] + (rule.b[:, None, None] * hf).sum(axis=1)


def integrate_stages(rule: Tableau, values: Array) -> Array:
    """sum_j a_ij values_j over the stage axis of (K, s, n, r)."""
    return np.einsum("ij,kjnr->kinr", rule.a, values)


def invert_legendre(rule: Tableau) -> Array:
    """The matrix from stage values to coefficients of P_m on [0, 1]."""
    return np.linalg.inv(legvander(2 * rule.c - 1, len(rule.c) - 1))


def integrate_legendre(theta: Array, count: int) -> Array:
    """int_0^theta P_m(2 s - 1) ds for m < count: (N, count)."""
    P = legvander(2 * theta - 1, count)
    m = np.arange(1, count)
    return np.column_stack([theta, (P[:, 2:] - P[:, :-2]) / (2 * (2 * m + 1))])


def measure_difference(fine: PiecewiseSolution, coarse: PiecewiseSolution) -> float:
    """The largest difference between two resolutions at the edges and inside the segments."""
    grid = coarse.edges
    t = np.concatenate([grid[:-1], *(grid[:-1] + p * np.diff(grid) for p in PROBES)])
    return float(np.abs(fine(t) - coarse(t)).max())


def report_resonance(Phi: Array, sigma: float) -> ResonantForcing:
    """Name the multiplier nearest to 1."""
    logs = product_logs(Phi)
    nearest = logs[np.argmin(np.abs(logs))]
    return ResonantForcing(
        "1 is (nearly) a Floquet multiplier, so the periodic response is not bounded or not unique",
        got=f"the multiplier {np.exp(nearest):.12g} with the periodicity condition's smallest singular value {sigma:.1e}",
        todo="fix the free rigid motion by feedback, add damping, or move the forcing's frequency",
    )
