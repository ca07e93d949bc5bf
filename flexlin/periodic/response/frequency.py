"""The harmonic frequency response of a periodic system: one frequency in, that frequency and its sidebands out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, positive, real_array
from flexlin.errors import ArgumentError, NotStable, ToleranceNotReached
from flexlin.periodic.coefficients import MatrixFunction, as_matrix_function, check_samples
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.grid import place_edges
from flexlin.periodic.precision import EPS, SAFETY, TINY
from flexlin.periodic.product.cyclic import cyclic_system
from flexlin.periodic.resolved.matrix import ResolvedMatrix
from flexlin.periodic.resolved.resolve import resolve_port
from flexlin.periodic.system import PeriodicSystem, as_system
from flexlin.periodic.transition.gauss import place_nodes, radau, sample_at, solve_stages
from flexlin.summary import represent

STAGES, FEWEST, LARGEST, FARTHEST_ORDER = 8, 8, 4000, 64
"""Radau stages of a segment; segments that are tried first, and the most; and harmonics of an answer at the most."""


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
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

    __repr__ = represent

    @property
    def direct(self) -> Array:
        """H_0 (W, p, m): what comes out at the frequency that went in."""
        return self.H[:, len(self.orders) // 2]


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
    system, tol = as_system(system), positive("tol", tol)
    frequencies = np.atleast_1d(real_array("omega", omega))
    if system.B is None:
        raise ArgumentError("the system has no input", got="B = None", expected="an input matrix B(t)")
    given = as_matrix_function("C", C)
    if check_samples("C", given, system.period).shape[2] != system.n:
        raise ArgumentError("C does not fit the system", expected=f"(p, {system.n})")
    verdict = floquet(system)
    if verdict.verdict != "stable":
        raise NotStable("there is no response that lasts", got=verdict.status, expected="a stable system")
    output = resolve_port(given, system.period, system.breaks, system.features, system.complete)
    count, before = FEWEST, np.zeros((len(frequencies), 1, *output.shape[:1], system.m), complex)
    while True:
        found = Collocated(system, output, None, count).harmonics(frequencies, min(count, FARTHEST_ORDER))
        size = np.abs(found).max(axis=(1, 2, 3)) + TINY
        beyond = (found.shape[1] - before.shape[1]) // 2
        apart = found - np.pad(before, ((0, 0), (beyond, beyond), (0, 0), (0, 0)))
        change = float((np.abs(apart).max(axis=(1, 2, 3)) / size).max(initial=0.0))
        if SAFETY * change <= tol:
            orders = np.arange(found.shape[1]) - found.shape[1] // 2
            return FrequencyResponse(frequencies, orders, found, SAFETY * change + EPS * count, system.period)
        if 2 * count > LARGEST:
            raise ToleranceNotReached(
                "the response was not resolved",
                got=f"a change of {change:.2g} at {count} segments",
                expected=f"at most {tol / SAFETY:.2g}",
                todo="smooth the coefficients, or ask for a larger tol",
            )
        count, before = 2 * count, found


class Collocated:
    """x' = A x + B u, y = C x + D u under u = exp(i omega t) v(t), v periodic, on segments between all edges of the coefficients.

    Parameters: through: D, None for none; count: of segments in a period.
    """

    def __init__(self, system: PeriodicSystem, C: ResolvedMatrix, D: ResolvedMatrix | None, count: int):
        ports = [system.resolved_input, C, *([] if D is None else [D])]
        every = (system.resolved, *ports)
        least = max((-(-2 * one.degree // STAGES) for one in every if one.panels > 1), default=1)
        edges = place_edges(system.period, np.unique(np.concatenate([one.edges for one in every])), count, least)
        self.rule, h = radau(STAGES), np.diff(edges)
        t = place_nodes(edges, self.rule.c)
        t[:, -1] = np.nextafter(edges[1:], -np.inf)  # before a jump
        self.t, self.h, self.period, self.weights = (
            t,
            h[:, None, None, None],
            system.period,
            h[:, None] * self.rule.b / system.period,
        )
        self.A, self.ports = sample_at(system.resolved, t), [sample_at(one, t) for one in ports]

    def answer(self, omega: float, v: Array) -> Array:
        """What stands beside exp(i omega t) in y at the stages (K, s, p, r), for v there (K, s, m, r)."""
        B, C, *D = self.ports
        n = self.A.shape[-1]
        hA = self.h * (self.A - 1j * omega * np.eye(n))
        pushed = np.einsum("ij,kjnr->kinr", self.rule.a, self.h * (B @ v))
        start = np.broadcast_to(np.eye(n), self.A.shape)
        within = solve_stages(hA, self.rule, np.concatenate([start, pushed], axis=-1))
        free, forced = within[..., :n], within[..., n:]
        x = cyclic_system(free[:, -1]).solve(forced[:, -1])
        y = C @ (free @ x[:, None] + forced)
        return y + D[0] @ v if D else y

    def harmonics(self, omega: Array, highest: int) -> Array:
        """H (W, 2 highest + 1, p, m)."""
        v = np.broadcast_to(np.eye(self.ports[0].shape[-1]), (*self.t.shape, *[self.ports[0].shape[-1]] * 2))
        back = self.weights * self.waves(-np.arange(-highest, highest + 1))
        return np.array([np.tensordot(back, self.answer(w, v), axes=((1, 2), (0, 1))) for w in omega.tolist()])

    def gain(self, omega: float, highest: int) -> float:
        """The largest |y| / |u| in mean square, for inputs with so many harmonics."""
        m = self.ports[0].shape[-1]
        waves = self.waves(np.arange(-highest, highest + 1))
        v = np.einsum("lks,ij->ksilj", waves, np.eye(m)).reshape(*self.t.shape, m, -1)
        y = (np.sqrt(self.weights)[..., None, None] * self.answer(omega, v)).reshape(-1, v.shape[-1])
        return float(np.sqrt(np.linalg.eigvalsh(y.conj().T @ y)[-1]))

    def waves(self, orders: Array) -> Array:
        """exp(2 pi i k t / T) at the stages, (k, K, s)."""
        return np.asarray(np.exp(2j * np.pi / self.period * orders[:, None, None] * self.t))
