"""Periodic systems with outputs, and how they are connected: in series, in parallel, in feedback."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.periodic.coefficients import (
    Constant,
    MatrixFunction,
    as_matrix_function,
    check_samples,
    has_nothing_narrow,
)
from flexlin.periodic.grid import golden
from flexlin.periodic.precision import ROOT
from flexlin.periodic.system import PeriodicSystem, as_system
from flexlin.summary import represent

Matrices = tuple[Array, Array, Array, Array]


@dataclass(frozen=True, eq=False)
class PeriodicStateSpace:
    """A periodic system with an output, x' = A x + B u, y = C x + D u, all of one period.

    `G * H` is H followed by G, `G + H` both side by side, `G.feedback(H)` the loop of G whose output goes back through H.

    Parameters
    ----------
    system : PeriodicSystem
        A(t) and B(t), with n states and m inputs.
    C : array_like (p, n), or function of times (N,) -> (N, p, n)
        The output matrix.
    D : array_like (p, m), or function of times (N,) -> (N, p, m), optional
        The feedthrough; zero where it is not given.

    Attributes
    ----------
    p : int
        Number of outputs.

    Raises
    ------
    ArgumentError
        When the system has no input, or a matrix does not fit.

    References
    ----------
    Bittanti, Colaneri, Periodic Systems (2009), ch. 2.

    Examples
    --------
    1 / (s + 1) followed by 1 / (s + 2), and each in a loop of gain 1 around both:

    >>> import flexlin as fl
    >>> G, H = (fl.PeriodicStateSpace(fl.PeriodicSystem([[-a]], 1.0, B=[[1.0]]), [[1.0]]) for a in (2.0, 1.0))
    >>> fl.floquet((G * H).system).exponents.real.round(9).tolist()
    [-1.0, -2.0]
    >>> fl.floquet(G.feedback(H).system).exponents.real.round(9).tolist()
    [-1.5, -1.5]
    """

    system: PeriodicSystem
    C: MatrixFunction
    D: MatrixFunction
    p: int = field(init=False)

    __repr__ = represent

    @checked
    def __init__(
        self,
        system: PeriodicSystem,
        C: MatrixFunction | ArrayLike,
        D: MatrixFunction | ArrayLike | None = None,
    ):
        system = as_system(system)
        if system.B is None:
            raise ArgumentError("the system has no input", got="B = None", expected="an input matrix B(t)")
        output = as_matrix_function("C", C)
        p, columns = check_samples("C", output, system.period).shape[1:]
        through = as_matrix_function("D", np.zeros((p, system.m)) if D is None else D)
        got = check_samples("D", through, system.period).shape[1:]
        if columns != system.n or got != (p, system.m):
            raise ArgumentError(
                "C or D does not fit the system",
                got=f"C {(p, columns)}, D {got}",
                expected=f"({p}, {system.n}) and ({p}, {system.m})",
            )
        vars(self).update(system=system, C=output, D=through, p=p)

    def __mul__(self, other: "PeriodicStateSpace") -> "PeriodicStateSpace":
        return connect(self, other, join_in_series, (self.system.m, other.p))

    def __add__(self, other: "PeriodicStateSpace") -> "PeriodicStateSpace":
        return connect(self, other, join_in_parallel, (self.system.m, other.system.m), (self.p, other.p))

    def feedback(self, other: "PeriodicStateSpace", sign: float = -1.0) -> "PeriodicStateSpace":
        """Close the loop u = r + sign H y.

        Parameters
        ----------
        other : PeriodicStateSpace
            H, from y to u.
        sign : float
            -1 for negative feedback; any factor does.

        Returns
        -------
        PeriodicStateSpace
            From r to y, with the states of this system and those of H behind them.

        Raises
        ------
        ArgumentError
            When the systems do not fit, or I - sign H D is singular: the loop has no solution.
        """
        joined = Feedback(float(sign))
        times = self.system.period * golden(np.arange(64))
        loops = (
            np.eye(self.system.m) - joined.sign * other.D(times) @ self.D(times) if other.p == self.system.m else None
        )
        if loops is not None and np.linalg.svd(loops, compute_uv=False)[:, -1].min() < ROOT:
            raise ArgumentError("the loop through both feedthroughs has no solution", got="I - sign D2 D1 singular")
        return connect(self, other, joined, (self.system.m, other.p), (self.p, other.system.m))


def sample_state_space(one: PeriodicStateSpace, t: Array) -> Matrices:
    """A, B, C, D at times t (N,)."""
    assert one.system.B is not None
    return one.system.A(t), one.system.B(t), one.C(t), one.D(t)


Join = Callable[[Matrices, Matrices], Matrices]


@dataclass(frozen=True, eq=False)
class Joined:
    """One of A, B, C, D of two systems that are connected, as a function of time."""

    first: PeriodicStateSpace
    second: PeriodicStateSpace
    join: Join
    which: int

    def __call__(self, t: Array) -> Array:
        return self.join(sample_state_space(self.first, t), sample_state_space(self.second, t))[self.which]

    @property
    def complete(self) -> bool:
        """Whether what it is made of has nothing narrow of its own."""
        both = (self.first, self.second)
        return all(one.system.complete and has_nothing_narrow(one.C) and has_nothing_narrow(one.D) for one in both)


def connect(
    first: PeriodicStateSpace, second: PeriodicStateSpace, join: Join, *fitting: tuple[int, int]
) -> PeriodicStateSpace:
    """Two systems as one. Raises: ArgumentError where periods or ports do not fit each other."""
    if first.system.period != second.system.period:
        periods = f"{first.system.period:.9g} and {second.system.period:.9g} s"
        raise ArgumentError("systems of two periods are connected", got=periods, expected="one period")
    if any(a != b for a, b in fitting):
        raise ArgumentError(
            "inputs and outputs do not fit each other", got=str(list(fitting)), expected="equal numbers"
        )
    A, B, C, D = parts = [Joined(first, second, join, which) for which in range(4)]
    both = (first.system, second.system)
    if all(isinstance(f, Constant) for one in (first, second) for f in (one.system.A, one.system.B, one.C, one.D)):
        A, B, C, D = (Constant(part(np.zeros(1))[0]) for part in parts)  # type: ignore[assignment]
    breaks, features = (sorted({*getattr(both[0], name), *getattr(both[1], name)}) for name in ("breaks", "features"))
    system = PeriodicSystem(A, first.system.period, B, breaks, features=features, complete=parts[0].complete)
    return PeriodicStateSpace(system, C, D)


def blocks(rows: list[list[Array]]) -> Array:
    """A block matrix of stacks."""
    return np.concatenate([np.concatenate(row, axis=2) for row in rows], axis=1)


def nothing(left: Array, right: Array) -> Array:
    """Zeros with the rows of one stack and the columns of another."""
    return np.zeros((len(left), left.shape[1], right.shape[2]))


def join_in_series(first: Matrices, second: Matrices) -> Matrices:
    """The second's output into the first."""
    (A1, B1, C1, D1), (A2, B2, C2, D2) = first, second
    A = blocks([[A1, B1 @ C2], [nothing(A2, A1), A2]])
    return A, blocks([[B1 @ D2], [B2]]), blocks([[C1, D1 @ C2]]), D1 @ D2


def join_in_parallel(first: Matrices, second: Matrices) -> Matrices:
    """One input, the sum of the outputs."""
    (A1, B1, C1, D1), (A2, B2, C2, D2) = first, second
    A = blocks([[A1, nothing(A1, A2)], [nothing(A2, A1), A2]])
    return A, blocks([[B1], [B2]]), blocks([[C1, C2]]), D1 + D2


@dataclass(frozen=True)
class Feedback:
    """u1 = E (r + s C2 x2 + s D2 C1 x1),   E = (I - s D2 D1)^-1."""

    sign: float

    def __call__(self, first: Matrices, second: Matrices) -> Matrices:
        (A1, B1, C1, D1), (A2, B2, C2, D2) = first, second
        E = np.linalg.inv(np.eye(B1.shape[2]) - self.sign * D2 @ D1)
        by_states = self.sign * E @ blocks([[D2 @ C1, C2]])
        own = blocks([[C1, nothing(C1, A2)]])
        y, through = own + D1 @ by_states, D1 @ E
        A = blocks([[A1, nothing(A1, A2)], [nothing(A2, A1), A2]]) + blocks([[B1 @ by_states], [B2 @ y]])
        return A, blocks([[B1 @ E], [B2 @ through]]), y, through
