"""Compiled sweeps of the Riccati equation backwards over a period, by Adams' methods: the calls of sweeps.c and running_cost.c."""

import ctypes
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from flexlin.checks import Array
from flexlin.compiler import address, find_kept_library
from flexlin.periodic.coefficients import Constant
from flexlin.periodic.fourier import FourierSeries, waves_at_nodes
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic, take_once
from flexlin.periodic.resolved.matrix import ResolvedMatrix

FILES = tuple(Path(__file__).with_name(name) for name in ("sweeps.c", "running_cost.c"))
ROW = 4
"""Rows are filled up to a multiple of this."""
FEW_WAVES = 24
"""Harmonics up to which cosines and sines at the nodes are kept for the next problem."""


@lru_cache(maxsize=1)
def find_sweeps() -> ctypes.CDLL | None:
    """The library of sweeps.c and running_cost.c; none where there is no compiler."""
    library = find_kept_library(*FILES)
    if library is not None:
        whole, long, real, where = ctypes.c_int, ctypes.c_long, ctypes.c_double, ctypes.c_void_p
        samples: list[Any] = [where, long] * 3
        library.sweep_until_closed.argtypes = [whole, whole, long, real, whole, *[where] * 4, *samples, where, where]
        library.find_share.argtypes = [whole, whole, long, *samples, where, where, real, where]
        library.find_rate.argtypes = [whole, whole, long, *samples]
        library.weigh_inputs.argtypes = [whole, whole, whole, long, *samples[:4], where]
        library.bound_gain.argtypes = [whole, whole, long, long, *samples, where, where]
        library.find_share.restype = library.find_rate.restype = real
    return library


@lru_cache(maxsize=8)
def adams_weights(order: int) -> Array:
    """Return the weights of Adams' explicit and implicit method of an order p, (2 p,), the newest rate first.

    Integrals over [0, 1] of Lagrange's polynomials through the nodes 0, -1, ... and 1, 0, -1, ...
    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I (1993), III.1.
    """
    weights = []
    for first in (0, 1):
        nodes = [first - j for j in range(order)]
        for node in nodes:
            polynomial = [Fraction(1)]
            for other in (one for one in nodes if one != node):
                higher, lower = [Fraction(0), *polynomial], [*polynomial, Fraction(0)]
                polynomial = [(a - other * b) / (node - other) for a, b in zip(higher, lower, strict=True)]
            weights.append(float(sum(c / (i + 1) for i, c in enumerate(polynomial))))
    return np.array(weights)


@dataclass(frozen=True, eq=False)
class RiccatiSamples:
    """Ar, -S / 2, Qr / 2 at N equally spaced times of a period, in rows filled up with zeros (N, n, w); B, R^-1, the cross term N.

    What is constant stands there once.
    """

    A: Array
    S: Array
    Q: Array
    B: Array
    effort: Array
    N: Array
    count: int

    @property
    def shape(self) -> tuple[int, int, int]:
        """Times, states and numbers in a row."""
        return self.count, self.A.shape[1], self.A.shape[2]

    def places(self) -> tuple[int, ...]:
        """Where A, S and Q stand, and the numbers from one sample to the next."""
        return (*locate_samples(self.A), *locate_samples(self.S), *locate_samples(self.Q))

    def between(self, every: int) -> "RiccatiSamples":
        """The samples half-way between every so many, an even number."""

        def part(one: Array) -> Array:
            return np.ascontiguousarray(one[every // 2 :: every]) if len(one) > 1 else one

        A, S, Q, B, effort, N = map(part, (self.A, self.S, self.Q, self.B, self.effort, self.N))
        return RiccatiSamples(A, S, Q, B, effort, N, self.count // every)

    def rings(self) -> bool:
        """Whether the fastest eigenvalues of the Hamiltonian are rather imaginary than real: by the sum of their squares."""
        n = self.A.shape[1]
        A, S, Q = (one[:, :, :n] for one in (self.A, self.S, self.Q))
        coupled = np.einsum("tij,tji->t", *np.broadcast_arrays(S, Q))
        return bool((np.einsum("tij,tji->t", A, A) - 4 * coupled).min() < 0)

    def rate(self, library: ctypes.CDLL) -> float:
        """About the largest spectral radius of the Hamiltonian [[A, -S], [-Q, -A']]."""
        return float(library.find_rate(*self.shape[1:], self.count, *self.places()))


@dataclass(frozen=True, eq=False)
class RiccatiSampler:
    """A problem, to be sampled at equally spaced times of its period; what is constant is made ready once."""

    problem: LinearQuadratic
    period: float
    library: ctypes.CDLL

    def sample(self, count: int, half: bool = False) -> RiccatiSamples:
        """Sample at N times, or half a step behind them."""
        A, B, Q, R, N = (self._values(name, count, half) for name in ("A", "B", "Q", "R", "N"))
        ready, effort = self._ready, self._ready.get("effort")
        effort = np.linalg.inv(R) if effort is None else effort
        if N.any():
            by_cross = effort @ np.swapaxes(N, 1, 2)
            A, Q, ready = A - B @ by_cross, Q - N @ by_cross, {}
        rows = (ready.get("A rows"), ready.get("Q rows"))
        A, Q = (
            fill_rows(one, factor) if row is None else row
            for one, factor, row in zip((A, Q), (1.0, 0.5), rows, strict=True)
        )
        return RiccatiSamples(A, weigh_inputs(self.library, B, effort), Q, B, effort, N, count)

    @cached_property
    def _ready(self) -> dict[str, Array]:
        """The values of constants, A and Q / 2 in rows, and R^-1, where these are constant."""
        found = {}
        for name in ("A", "B", "Q", "R", "N"):
            one = getattr(self.problem, name)
            if isinstance(one, Constant):
                found[name] = np.ascontiguousarray(one.value, dtype=float)[None]
        if "R" in found:
            found["effort"] = np.linalg.inv(found["R"])
        for name, factor in (("A", 1.0), ("Q", 0.5)):
            if name in found:
                found[f"{name} rows"] = fill_rows(found[name], factor)
        return found

    def _values(self, name: str, count: int, half: bool) -> Array:
        """A coefficient at these times; once where it is constant."""
        if name in self._ready:
            return self._ready[name]
        coefficient = getattr(self.problem, name)
        series = coefficient.series if isinstance(coefficient, ResolvedMatrix) else None
        if not isinstance(series, FourierSeries) or series.harmonics > FEW_WAVES:
            t = self.period * ((np.arange(count) + 0.5 * half) / count)
            return np.ascontiguousarray(take_once(coefficient(t)), dtype=float)
        flat = series.coefficients.reshape(len(series.coefficients), -1)
        values = waves_at_nodes(count, series.harmonics, half) @ flat
        return values.reshape(count, *series.coefficients.shape[1:])


def locate_samples(samples: Array) -> tuple[int, int]:
    """Where samples stand, and the numbers from one to the next; 0 of a constant."""
    return address(samples), samples[0].size if len(samples) > 1 else 0


def weigh_inputs(library: ctypes.CDLL, B: Array, effort: Array) -> Array:
    """Return -B R^-1 B' / 2 of samples of B (N, n, m) and R^-1 (N, m, m), one of each where constant, in rows filled up with zeros."""
    count, n, m = max(len(B), len(effort)), *B.shape[1:]
    S = np.empty((count, n, -(-n // ROW) * ROW))
    library.weigh_inputs(n, S.shape[2], m, count, *locate_samples(B), *locate_samples(effort), address(S))
    return S


def fill_rows(values: Array, factor: float = 1.0) -> Array:
    """Return a multiple of matrices (N, n, n) in rows filled up with zeros (N, n, w); the one matrix of a constant once."""
    values = take_once(values)
    count, n, _ = values.shape
    filled = np.zeros((count, n, -(-n // ROW) * ROW))
    np.multiply(values, factor, out=filled[:, :, :n])
    return filled


@dataclass(frozen=True)
class Level:
    """Sweeps on every `step`-th node by Adams' method of an order, until X(T) changes by less than `end` of X."""

    step: int
    order: int
    end: float


def sweep_until_closed(
    library: ctypes.CDLL, samples: RiccatiSamples, period: float, levels: tuple[Level, ...], X: Array | None
) -> Array | None:
    """Sweep X back over the period by Adams' predictor and corrector until it closes: X at the nodes, (n (n + 1) / 2, N), N even.

    A sweep maps X(T) to X(0); with Phi its loop's transition matrix over the period, Newton's method for X(0) = X(T) adds

        E = Phi' E Phi + X(0) - X(T)

    A level ends after an E below its share of X. A loop that does not forget is swept on: the cost of a longer horizon has a better one.
    Parameters: X (p, n, n): at the first nodes of the next period, p the first order, to start from; none: zero.
    Returns: the lower triangle row by row; None where the last level does not close.
    Source: Hewer, IEEE Trans. Automat. Control 16 (1971) 382; for E: Smith, SIAM J. Appl. Math. 16 (1968) 198.
    """
    count, n, width = samples.shape
    room, packed = np.empty(samples.shape), np.empty((n * (n + 1) // 2, count))
    room[: levels[0].order] = 0.0
    if X is not None:
        room[: levels[0].order, :, :n] = X
    whole = np.array([[one.step for one in levels], [one.order for one in levels]], np.int32)
    ends, weights = np.array([one.end for one in levels]), np.concatenate([adams_weights(one.order) for one in levels])
    plan = (len(levels), address(whole[0]), address(whole[1]), address(ends), address(weights))
    places = (*samples.places(), address(room), address(packed))
    return packed if library.sweep_until_closed(n, width, count, period, *plan, *places) else None


def find_share(
    library: ctypes.CDLL, samples: RiccatiSamples, X: Array, slopes: Array, unit: float
) -> tuple[float, float, float, Array]:
    """Return the least r with -r C <= F <= r C at all times, C = Q + X S X, the largest entries of F and X, the sizes of F's entries.

    F: the residual X' + A' X + X A - X S X + Q of X and its slopes X', lower triangles (n (n + 1) / 2, N) with N a multiple of four, and
    what rounding may make of it: `unit` times the sum of the sizes of its terms. r is infinite where C is not positive, or X at the first
    time.
    """
    count, n, width = samples.shape
    seen = np.zeros(2 + len(X))
    share = library.find_share(n, width, count, *samples.places(), address(X), address(slopes), unit, address(seen))
    return share, float(seen[0]), float(seen[1]), seen[2:]


def bound_gain(library: ctypes.CDLL, samples: RiccatiSamples, X: Array, every: int) -> tuple[float, float, float]:
    """Return the largest (R^-1 B' X B R^-1)_ii X_jj at every so many times, the largest entry of |R^-1 B'| |X|, and that of the gain.

    K = R^-1 (B' X + N').   Parameters: X: lower triangles (n (n + 1) / 2, N).
    """
    n, m = samples.B.shape[1:]
    found = np.zeros(3)
    places = (*locate_samples(samples.B), *locate_samples(samples.effort), *locate_samples(samples.N))
    library.bound_gain(n, m, samples.count, every, *places, address(X), address(found))
    reach, product, gain = found.tolist()
    return reach, product, gain
