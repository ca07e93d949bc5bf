"""The coefficients of Riccati's equation at equally spaced times of a period, as sweeps.c takes them."""

import ctypes
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.compiler import address
from flexlin.lazy import lazy
from flexlin.periodic.coefficients import Constant
from flexlin.periodic.fourier import FourierSeries, fourier_nodes, waves_at_nodes
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic, take_once
from flexlin.periodic.quadratic.triangle import lower_triangle, triangle_places
from flexlin.periodic.resolved.matrix import ResolvedMatrix

PARTS = 4
"""Parts of a period that are swept at once."""
FEW_WAVES = 24
"""Harmonics up to which cosines and sines at the nodes are kept for the next problem."""


@dataclass(frozen=True, eq=False)
class RiccatiSamples:
    """Ar (M, n n, 4), -S / 2 of the states that are acted on (M, s s, 4), the lower triangle of Qr (M, n (n + 1) / 2, 4) at the M nodes
    of four parts of a period; B, R^-1 and the cross term N at all 4 M times (4 M, ., .). What is constant stands there once. Every second
    node is swept.

    acted: the first of the states that inputs act on, and the one behind the last.
    """

    A: Array
    S: Array
    Q: Array
    B: Array
    effort: Array
    N: Array
    count: int
    acted: tuple[int, int]

    @property
    def n(self) -> int:
        """The number of states."""
        return int(self.B.shape[1])

    @lazy
    def place(self) -> int:
        """Where sweeps.c finds all this, as an `Equation`."""
        return address(self._equation)

    @lazy
    def _equation(self) -> Array:
        parts = [(address(one), len(one[0]) if len(one) > 1 else 0) for one in (self.A, self.S, self.Q)]
        return np.array([self.n, *self.acted, self.count // PARTS, *(number for part in parts for number in part)])

    @property
    def ports(self) -> tuple[int, ...]:
        """The number of inputs; where B, R^-1 and N stand, and the numbers from one time to the next."""
        return self.B.shape[2], *locate_samples(self.B), *locate_samples(self.effort), *locate_samples(self.N)

    def every_second(self) -> tuple[Array, Array, Array]:
        """Ar, B R^-1 B' and Qr (N / 2, n, n) at every second time; once where they are constant."""
        n, (first, last) = self.n, self.acted
        A, S, Q = (join_parts(one[::2]) if len(one) > 1 else one[:, :, 0] for one in (self.A, self.S, self.Q))
        whole = np.zeros((len(S), n, n))
        whole[:, first:last, first:last] = -2 * S.reshape(-1, last - first, last - first)
        return A.reshape(-1, n, n), whole, Q[:, triangle_places(Q.shape[1])]

    def to_gain(self) -> tuple[Array, Array]:
        """R^-1 B' and R^-1 N' (N / 2, m, n) at every second time."""
        B, effort, N = (one[::2] if len(one) > 1 else one for one in (self.B, self.effort, self.N))
        both = (effort @ np.swapaxes(one, 1, 2) for one in (B, N))
        by_B, by_N = (np.broadcast_to(one, (self.count // 2, *one.shape[1:])) for one in both)
        return by_B, by_N

    def rings(self) -> bool:
        """Whether the fastest eigenvalues of the Hamiltonian are rather imaginary than real: by the sum of their squares."""
        n, (first, last) = self.n, self.acted
        A, S = join_parts(self.A).reshape(-1, n, n), join_parts(self.S).reshape(-1, last - first, last - first)
        Q = join_parts(self.Q)[:, triangle_places(self.Q.shape[1])][:, first:last, first:last]
        coupled = np.einsum("tij,tji->t", *np.broadcast_arrays(S, Q))
        return bool((np.einsum("tij,tji->t", A, A) - 2 * coupled).min() < 0)

    def rate(self, library: ctypes.CDLL) -> float:
        """About the largest spectral radius of the Hamiltonian [[A, -S], [-Q, -A']]."""
        return float(library.find_rate(self.place))


@dataclass(frozen=True, eq=False)
class RiccatiSampler:
    """A problem, to be sampled at equally spaced times of its period; what is constant is made ready once."""

    problem: LinearQuadratic
    period: float
    library: ctypes.CDLL

    def sample(self, count: int) -> RiccatiSamples:
        """Sample at N times, a multiple of four."""
        ready = self._ready
        B, R, N = (self._values(name, count) for name in ("B", "R", "N"))
        effort = ready["effort"] if "effort" in ready else np.linalg.inv(R)
        if "no cross term" in ready:
            A, Q = (
                ready[f"{name} divided"] if name in ready else divide_parts(self._values(name, count), name == "Q")
                for name in ("A", "Q")
            )
        else:
            by_cross = effort @ np.swapaxes(N, 1, 2)
            A = divide_parts(self._values("A", count) - B @ by_cross)
            Q = divide_parts(self._values("Q", count) - N @ by_cross, True)
        return RiccatiSamples(A, self._weigh_inputs(B, effort), Q, B, effort, N, count, self._acted)

    @lazy
    def _ready(self) -> dict[str, Array]:
        """The values of constants, A and Q divided, and R^-1, where these are constant; a key where there is no cross term."""
        found = {}
        for name in ("A", "B", "Q", "R", "N"):
            one = getattr(self.problem, name)
            if isinstance(one, Constant):
                found[name] = np.ascontiguousarray(one.value, dtype=float)[None]
        if "R" in found:
            found["effort"] = np.linalg.inv(found["R"])
        if "N" in found and not found["N"].any():
            found["no cross term"] = found["N"]
        for name in ("A", "Q"):
            if name in found:
                found[f"{name} divided"] = divide_parts(found[name], name == "Q")
        return found

    @lazy
    def _acted(self) -> tuple[int, int]:
        """The first state that inputs act on, and the one behind the last."""
        B = self.problem.B
        values = B.value if isinstance(B, Constant) else getattr(getattr(B, "series", None), "coefficients", None)
        if values is None:
            return 0, int(self._values("B", PARTS).shape[1])
        rows = np.flatnonzero(values.any(axis=(*range(values.ndim - 2), -1))).tolist()
        return (rows[0], rows[-1] + 1) if rows else (0, 1)

    def _values(self, name: str, count: int) -> Array:
        """A coefficient at these times; once where it is constant."""
        if name in self._ready:
            return self._ready[name]
        coefficient = getattr(self.problem, name)
        series = coefficient.series if isinstance(coefficient, ResolvedMatrix) else None
        if not isinstance(series, FourierSeries) or series.harmonics > FEW_WAVES:
            return np.ascontiguousarray(take_once(coefficient(fourier_nodes(count, self.period))), dtype=float)
        flat = series.coefficients.reshape(len(series.coefficients), -1)
        values = waves_at_nodes(count, series.harmonics) @ flat
        return values.reshape(count, *series.coefficients.shape[1:])

    def _weigh_inputs(self, B: Array, effort: Array) -> Array:
        """Return -B R^-1 B' / 2 of the states that are acted on, divided."""
        m, (first, last), count = B.shape[2], self._acted, max(len(B), len(effort))
        nodes, size = max(count // PARTS, 1), (last - first) ** 2
        S = np.empty((nodes, size, PARTS))
        places = (*locate_samples(B), *locate_samples(effort))
        self.library.weigh_inputs(first, last, m, nodes, *places, address(S))
        return S


def divide_parts(values: Array, lower: bool = False) -> Array:
    """Matrices (4 M, n, n) at the nodes of a period as those of its four parts (M, n n, 4), or a constant (1, n, n) as (1, n n, 4).

    lower: whether the lower triangle alone, (M, n (n + 1) / 2, 4).
    """
    count, n, _ = values.shape
    flat = values[:, *lower_triangle(n)] if lower else values.reshape(count, n * n)
    if count == 1:
        return np.repeat(flat[:, :, None], PARTS, axis=2)
    return np.ascontiguousarray(flat.reshape(PARTS, count // PARTS, -1).transpose(1, 2, 0))


def join_parts(divided: Array) -> Array:
    """The rows (4 M, E) of what was divided, (M, E, 4)."""
    return np.asarray(divided.transpose(2, 0, 1).reshape(-1, divided.shape[1]))


def locate_samples(samples: Array) -> tuple[int, int]:
    """Where samples stand, and the numbers from one to the next; 0 of a constant."""
    return address(samples), samples[0].size if len(samples) > 1 else 0
