"""Periodic systems with outputs, and how they are connected: in series, in parallel, in feedback."""

from dataclasses import field
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.lazy import lazy
from flexlin.periodic.coefficient_series.matrix import ResolvedCompanion, ResolvedMatrix
from flexlin.periodic.coefficients import Combined, Constant, MatrixFunction, has_nothing_narrow
from flexlin.periodic.interpolation import golden
from flexlin.periodic.system import PeriodicSystem, as_port, input_of, resolve_beside
from flexlin.precision import ROOT_EPS
from flexlin.summary import immutable


@immutable(eq=False)
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

    @checked
    def __init__(
        self,
        system: PeriodicSystem,
        C: MatrixFunction | ArrayLike,
        D: MatrixFunction | ArrayLike | None = None,
    ):
        input_of(system)
        output = as_port("C", C, (None, system.n), system.period)
        p = output(np.zeros(1)).shape[1]
        through = as_port("D", np.zeros((p, system.m)) if D is None else D, (p, system.m), system.period)
        vars(self).update(system=system, C=output, D=through, p=p)

    @lazy
    def series(self) -> tuple[ResolvedMatrix | ResolvedCompanion, ResolvedMatrix, ResolvedMatrix, ResolvedMatrix]:
        """A, B, C, D as series that agree with them everywhere. Raises: NotPeriodic, UnresolvedCoefficient, ArgumentError as `resolve`."""
        output, through = (resolve_beside(self.system, one) for one in (self.C, self.D))
        return self.system.resolved, self.system.resolved_input, output, through

    def __mul__(self, other: "PeriodicStateSpace") -> "PeriodicStateSpace":
        m, p, inputs, outputs = self.system.m, self.p, self.system.m + other.system.m, self.p + other.p
        wires = np.eye(inputs, outputs, p), np.eye(inputs, other.system.m, -m), np.eye(p, outputs)
        return connect(self, other, wires, (m, other.p))

    def __add__(self, other: "PeriodicStateSpace") -> "PeriodicStateSpace":
        m, p, none = self.system.m, self.p, np.zeros((self.system.m + other.system.m, self.p + other.p))
        wires = none, np.tile(np.eye(m), (2, 1)), np.tile(np.eye(p), 2)
        return connect(self, other, wires, (m, other.system.m), (p, other.p))

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
            When the systems do not fit, or I - sign H D is singular: the loop has no solution. Where it is singular between the times
            that are looked at, what is computed of the loop raises this or UnresolvedCoefficient.
        """
        m, p, times = self.system.m, self.p, self.system.period * golden(np.arange(64))
        size = m + other.system.m, p + other.p
        wires = sign * np.eye(*size, p) + np.eye(*size, -m), np.eye(size[0], m), np.eye(p, size[1])
        if (other.system.m, other.p) == (p, m):
            loop = np.eye(m) - sign * other.D(times) @ self.D(times)
            if np.linalg.svd(loop, compute_uv=False)[:, -1].min() < ROOT_EPS:
                raise ArgumentError(NO_LOOP, got="I - sign D2 D1 singular")
        return connect(self, other, wires, (m, other.p), (p, other.system.m))


NO_LOOP = "the loop through both feedthroughs has no solution"
Wires = tuple[Array, Array, Array]
"""F, G, L of u = F y + G r and L y, for the inputs and outputs of two systems, one's above the other's."""


def join(*matrices: Array, wires: Wires, which: int) -> Array:
    """One of A, B, C, D of two systems that are connected, from those of the first and those of the second.

    u = E (F C x + G r),   E = (I - F D)^-1

    Raises: ArgumentError where no E exists.
    """
    A, B, C, D = map(beside, matrices[:4], matrices[4:])
    F, G, L = wires
    try:
        E = np.linalg.inv(np.eye(len(F)) - F @ D)
    except np.linalg.LinAlgError:
        raise ArgumentError(NO_LOOP, got="I - sign D2 D1 singular at some time") from None
    u, r = E @ F @ C, E @ G
    return np.asarray((A + B @ u, B @ r, L @ (C + D @ u), L @ D @ r)[which])


def beside(first: Array, second: Array) -> Array:
    """Two stacks of matrices as the blocks of a diagonal."""
    rows, columns = first.shape[1:]
    out = np.zeros((len(first), rows + second.shape[1], columns + second.shape[2]))
    out[:, :rows, :columns], out[:, rows:, columns:] = first, second
    return out


def connect(
    first: PeriodicStateSpace, second: PeriodicStateSpace, wires: Wires, *fitting: tuple[int, int]
) -> PeriodicStateSpace:
    """Two systems as one. Raises: ArgumentError where periods or ports do not fit each other."""
    both, T = (first.system, second.system), first.system.period
    if second.system.period != T:
        periods = f"{T:.9g} and {second.system.period:.9g} s"
        raise ArgumentError("systems of two periods are connected", got=periods, expected="one period")
    if any(a != b for a, b in fitting):
        raise ArgumentError(
            "inputs and outputs do not fit each other", got=str(list(fitting)), expected="equal numbers"
        )
    known = tuple(f for one in (first, second) for f in (one.system.A, input_of(one.system), one.C, one.D))
    complete = all(one.system.complete and all(map(has_nothing_narrow, (one.C, one.D))) for one in (first, second))
    parts: list[MatrixFunction] = [
        Combined(partial(join, wires=wires, which=which), known, complete) for which in range(4)
    ]
    if all(isinstance(f, Constant) for f in known):
        parts = [Constant(part(np.zeros(1))[0]) for part in parts]
    A, B, C, D = parts
    breaks, features = (sorted({*getattr(both[0], name), *getattr(both[1], name)}) for name in ("breaks", "features"))
    return PeriodicStateSpace(PeriodicSystem(A, T, B, breaks, features=features, complete=complete), C, D)
