"""The harmonic frequency response of a periodic system: one frequency in, that frequency and its sidebands out."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, positive, real_array
from flexlin.errors import ToleranceNotReached
from flexlin.lazy import lazy
from flexlin.periodic.coefficient_series.matrix import couple_uncertainty
from flexlin.periodic.coefficients import MatrixFunction
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.result import need_stable
from flexlin.periodic.interpolation import place_edges
from flexlin.periodic.product import COHERENT_PART, cyclic_system
from flexlin.periodic.related import PeriodicStateSpace
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.choose_segments import FEWER_SEGMENTS
from flexlin.periodic.transition.gauss import (
    CHUNK_BYTES,
    DEFAULT_STAGES,
    Tableau,
    place_nodes,
    radau,
    sample_at,
    solve_stages,
    weigh_stages,
)
from flexlin.plots.view import Series, Shown, View
from flexlin.precision import CUBE_ROOT_EPS, EPS, SAFETY, TINY
from flexlin.summary import immutable

if TYPE_CHECKING:
    import xarray

FARTHEST_ORDER = 64
"""Harmonics of an answer at the most."""
LANCZOS_VECTORS = 8
"""Of which the input with the largest gain is made, before they are begun anew from it."""


@immutable(eq=False)
class FrequencyResponse(Shown):
    """What u = exp(i omega t) v does in the long run: y = sum over k of H_k exp(i (omega + 2 pi k / T) t) v.

    Attributes
    ----------
    omega : array, shape (W,)
        Frequencies of the input, in rad/s.
    orders : array, shape (K,)
        The k, in rising order, 0 in the middle.
    H : complex array, shape (W, K, p, m)
        In units of the output per unit of the input.
    error : float
        Of any entry, relative to the largest at its frequency.
    period : float
        T in s.

    Examples
    --------
    >>> import flexlin as fl
    >>> found = fl.frequency_response(fl.PeriodicSystem([[-1.0]], 1.0, B=[[1.0]]), [[1.0]], [1.0])
    >>> print(f"{found.direct.item():.6f}")
    0.500000-0.500000j
    """

    omega: Array
    orders: Array
    H: Array
    error: float
    period: float

    @property
    def direct(self) -> Array:
        """H_0 (W, p, m): what comes out at the frequency that went in."""
        return self.H[:, len(self.orders) // 2]

    def to_xarray(self) -> "xarray.Dataset":
        """Return the harmonic transfer functions as a dataset.

        Returns
        -------
        xarray.Dataset
            `H` by omega, order, output and input; error and period as attributes.
        """
        import xarray

        coords = {"omega": ("omega", self.omega, {"units": "rad/s"}), "order": self.orders}
        attributes = {"error": self.error, "period": self.period}
        return xarray.Dataset({"H": (("omega", "order", "output", "input"), self.H)}, coords=coords, attrs=attributes)

    def _view(self) -> View:
        sizes = np.abs(self.direct)
        series = tuple(
            Series(f"y{i + 1} per u{j + 1}", self.omega, sizes[:, i, j]) for i, j in np.ndindex(sizes.shape[1:])
        )
        facts = (f"orders up to {self.orders[-1]}, period {self.period:.6g} s, relative error {self.error:.0e}",)
        return View(
            "frequency response", "", facts, "omega in rad/s", "|H₀|, in the output's unit per the input's", series
        )


@checked
def frequency_response(
    system: PeriodicSystem, C: MatrixFunction | ArrayLike, omega: ArrayLike, tol: float = 1e-8
) -> FrequencyResponse:
    """Compute the harmonic transfer functions of x' = A x + B u, y = C x.

        x = exp(i omega t) p(t),   p' + i omega p = A p + B,   p(t + T) = p(t),   H_k = the k-th Fourier coefficient of C p

    p by Radau collocation on ever more segments, none of which holds a jump. Assumes a stable system. The orders end where no entry
    beyond exceeds tol, or at 64.

    Parameters
    ----------
    system : PeriodicSystem
        With inputs; n states, m inputs.
    C : array_like (p, n), or function of times (N,) -> (N, p, n)
        The output matrix.
    omega : array_like, shape (W,)
        Frequencies of the input, in rad/s.
    tol : float
        Wanted error, relative to the largest entry at each frequency.

    Returns
    -------
    FrequencyResponse
        H_k at all frequencies, and their error.

    Raises
    ------
    ArgumentError
        When the system has no input, or C does not fit.
    NotStable
        When the system is unstable or undecided.
    ToleranceNotReached
        When coefficients change too fast for the segments that can be computed.

    References
    ----------
    Wereley, Hall, Frequency response of linear time periodic systems, Proc. 29th IEEE CDC (1990) 3650.

    Examples
    --------
    An output that is modulated answers in two sidebands alone:

    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[-1.0]], 2 * np.pi, B=[[1.0]])
    >>> found = fl.frequency_response(system, lambda t: np.cos(t)[:, None, None], [0.0])
    >>> [(int(k), round(float(abs(H)), 6)) for k, H in zip(found.orders, found.H[0, :, 0, 0]) if abs(H) > 1e-8]
    [(-1, 0.5), (1, 0.5)]
    """
    plant, tol = PeriodicStateSpace(system, C), positive("tol", tol)
    frequencies, system = np.atleast_1d(real_array("omega", omega)), plant.system
    need_stable(floquet(system), "there is no response that lasts")
    count, before = DEFAULT_STAGES, np.zeros((len(frequencies), 1, plant.p, system.m), complex)
    while True:
        found = find_harmonics(plant, count, frequencies, min(count, FARTHEST_ORDER))
        size = np.abs(found).max(axis=(1, 2, 3)) + TINY
        beyond = (found.shape[1] - before.shape[1]) // 2
        apart = found - np.pad(before, ((0, 0), (beyond, beyond), (0, 0), (0, 0)))
        change = float((np.abs(apart).max(axis=(1, 2, 3)) / size).max(initial=0.0))
        if SAFETY * change <= tol:
            orders = np.arange(found.shape[1]) - found.shape[1] // 2
            doubt = float((find_doubt(plant, count // 2, frequencies) / size).max(initial=0.0))
            return FrequencyResponse(frequencies, orders, found, SAFETY * change + doubt + EPS * count, system.period)
        if 2 * count > FEWER_SEGMENTS:
            raise ToleranceNotReached(
                "the response was not resolved",
                got=f"a change of {change:.2g} at {count} segments",
                expected=f"at most {tol / SAFETY:.2g}",
                todo="smooth the coefficients, or ask for a larger tol",
            )
        count, before = 2 * count, found


def find_harmonics(plant: PeriodicStateSpace, count: int, omega: Array, highest: int) -> Array:
    """H (W, 2 highest + 1, p, m) under u = exp(i omega t), on so many segments of a period, between all edges of the coefficients."""
    t, h, A, B, C, D = sample_stages(plant, count)
    orders = np.arange(-highest, highest + 1)[:, None, None]
    back = h[:, None] * radau(DEFAULT_STAGES).b / plant.system.period
    back = back * np.exp(-2j * np.pi / plant.system.period * orders * t)
    return np.array([np.tensordot(back, answer(A, B, C, D, h, shift), ((1, 2), (0, 1))) for shift in omega.tolist()])


def find_doubt(plant: PeriodicStateSpace, count: int, omega: Array) -> Array:
    """How far an entry moves at each frequency (W,) by what the coefficients are not known by: the answer to |dA| |x| + |dB|, all of one
    sign, and |dC| |x|.
    """
    t, h, A, B, C, D = sample_stages(plant, count)
    resolved, *ports = plant.series[:3]
    eye, moved = np.broadcast_to(np.eye(plant.system.n), A.shape), list[float]()
    every, none = eye.reshape(t.size, *A.shape[2:]), np.zeros_like(B)
    dB, dC = (
        SAFETY * EPS * np.abs(one) + given.error_near(t.ravel()).reshape(one.shape)
        for one, given in zip((B, C), ports, strict=True)
    )
    for shift in omega.tolist():
        x = answer(A, B, eye, none, h, shift)
        force = couple_uncertainty(resolved, t.ravel(), every, x.reshape(t.size, *x.shape[2:]), in_mean=True)
        parts = np.abs(answer(A, force.reshape(x.shape) + dB, C, D, h, shift)), dC @ np.abs(x)
        moved.append(float(max(one.max() for one in parts)))
    return COHERENT_PART * np.array(moved)


def sample_stages(plant: PeriodicStateSpace, count: int) -> tuple[Array, ...]:
    """Times of the stages (K, s) of segments whose lengths are h (K,), h, and A, B, C and D there."""
    every = plant.series
    least = max((-(-2 * one.degree // DEFAULT_STAGES) for one in every if one.panels > 1), default=1)
    edges = place_edges(plant.system.period, np.unique(np.concatenate([one.edges for one in every])), count, least)
    t = place_nodes(edges, radau(DEFAULT_STAGES).c)
    return t, np.diff(edges), *(sample_at(one, t) for one in every)


def answer(A: Array, B: Array, C: Array, D: Array, h: Array, shift: float) -> Array:
    """What comes out at the stages (K, s, p, m) under u = exp(i shift t), without that factor."""
    moved = A - 1j * shift * np.eye(A.shape[-1]) if shift else A
    v = np.tile(np.eye(B.shape[-1]), (A.shape[1], 1))
    y = condense(moved, B, C, D, h, radau(DEFAULT_STAGES)).respond(1.0)(v)
    return y.reshape(*A.shape[:2], -1, B.shape[-1])


@dataclass(frozen=True, eq=False)
class Segments:
    """Segments of x' = A x + B u, y = C x + D u by their ends: x_1 = free x_0 + pushed u, y = seen x_0 + through u, u and y at the stages.

    free (K, n, n), pushed (K, n, s m), seen (K, s p, n), through (K, s p, s m).
    """

    free: Array
    pushed: Array
    seen: Array
    through: Array

    def respond(self, turn: complex) -> Callable[[Array], Array]:
        """The output at the stages (K, s p, r) for an input there (K, s m, r), where x(T) = turn x(0)."""
        back = np.where(np.arange(len(self.free)) < len(self.free) - 1, 1.0, 1 / turn)[:, None, None]
        cyclic = cyclic_system(back * self.free)
        return lambda u: self.seen @ cyclic.solve(back * (self.pushed @ u)) + self.through @ u

    @lazy
    def adjoint(self) -> "Segments":
        """l_0 = free' l_1 + seen' y, u = pushed' l_1 + through' y, from the last segment to the first."""
        return Segments(*(np.swapaxes(one[::-1], 1, 2) for one in (self.free, self.seen, self.pushed, self.through)))

    def largest_gain(self, turn: complex, tried: Array) -> float:
        """The largest singular value of G: u -> y, where x(T) = turn x(0), |turn| = 1, from the best of some inputs (K, s m, r).

        It is sought by Lanczos' method from that input with some noise, which hides nothing: what is found lies below it.
        Raises: ToleranceNotReached where numbers do not hold it.
        """
        from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh  # takes longer to load than a gain to find

        forth, back = self.respond(turn), self.adjoint.respond(np.conj(turn))
        K, size, _ = tried.shape

        def square(u: Array) -> Array:
            """G'G u."""
            return back(forth(u.reshape(K, size, 1))[::-1])[::-1].ravel()

        flat = np.linalg.qr(tried.reshape(K * size, -1))[0]
        G = LinearOperator((len(flat), len(flat)), square, dtype=complex)
        noise = np.random.default_rng(0).standard_normal((len(flat), 2)) @ (1, 1j)
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                answers = forth(flat.reshape(K, size, -1)).reshape(-1, flat.shape[1])
                best = flat @ np.linalg.svd(answers, full_matrices=False)[2][0].conj()
                start = best + noise / np.linalg.norm(noise)
                found = eigsh(G, 1, ncv=LANCZOS_VECTORS, tol=CUBE_ROOT_EPS, v0=start, return_eigenvectors=False)
        except (np.linalg.LinAlgError, ArpackError) as reason:
            raise ToleranceNotReached(
                "the largest gain was not found: it may be larger than numbers hold",
                got=str(reason),
                todo="is the system nearly unstable, or does it grow in a part of its period? add damping",
            ) from None
        return float(np.sqrt(found[0]))


def condense(A: Array, B: Array, C: Array, D: Array, h: Array, rule: Tableau) -> Segments:
    """Segments from samples at the stages, A (K, s, n, n), B, C, D: nothing is left to be solved for an input in any of them."""
    (s, n), m = A.shape[1:3], B.shape[-1]
    size, made = max(1, CHUNK_BYTES // (8 * (s * n) ** 2)), list[tuple[Array, ...]]()
    for k in (slice(i, i + size) for i in range(0, len(h), size)):
        hA, hB = (h[k, None, None, None] * one[k] for one in (A, B))
        K = len(hA)
        inputs = np.einsum("ij,kjnm->kinjm", rule.a, hB).reshape(K, s, n, s * m)
        within = solve_stages(hA, rule, np.concatenate([np.broadcast_to(np.eye(n), hA.shape), inputs], axis=-1))
        ends = weigh_stages(hA, rule, within)
        ends[..., :n] += np.eye(n)
        ends[..., n:] += np.swapaxes(rule.b[:, None, None] * hB, 1, 2).reshape(K, n, s * m)
        seen = C[k] @ within
        for i in range(s):
            seen[:, i, :, n + i * m : n + (i + 1) * m] += D[k, i]
        seen = seen.reshape(K, -1, n + s * m)
        made.append((ends[..., :n], ends[..., n:], seen[..., :n], seen[..., n:]))
    return Segments(*map(np.concatenate, zip(*made, strict=True)))
