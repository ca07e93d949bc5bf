"""The periodic linear system x' = A(t) x + B(t) u, the common currency of the numeric wing."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, positive, real_array
from flexlin.errors import ArgumentError, SingularMassMatrix

MatrixFunction = Callable[[Array], Array]


@dataclass(frozen=True)
class SecondOrder:
    """M(t) y'' + D(t) y' + K(t) y = force(t) u: each a function (N,) -> (N, n, n) or (N, n, m)."""

    M: MatrixFunction
    D: MatrixFunction
    K: MatrixFunction
    force: MatrixFunction | None = None
    together: Callable[[Array], tuple[Array, Array, Array]] | None = None

    def sample(self, t: Array) -> tuple[Array, Array, Array]:
        """M, D, K at the times t, in one call where the maker gave `together`."""
        return (self.M(t), self.D(t), self.K(t)) if self.together is None else self.together(t)

    def feedback(self, gain: MatrixFunction) -> "SecondOrder":
        """The equations with u = -gain(t) [y; y']."""
        force = self.force
        if force is None:
            raise ArgumentError("the equations have no input", got="force = None", expected="an input matrix")

        def together(t: Array) -> tuple[Array, Array, Array]:
            M, D, K = self.sample(t)
            n = M.shape[-1]
            feedback = force(t) @ gain(t)
            return M, D + feedback[..., n:], K + feedback[..., :n]

        return SecondOrder(self.M, lambda t: together(t)[1], lambda t: together(t)[2], force, together)


@dataclass(frozen=True)
class PeriodicSystem:
    """A linear system whose coefficients repeat with a period.

        x' = A(t) x + B(t) u,   A(t + T) = A(t),   B(t + T) = B(t)

    Assumes that A and B are smooth between the `breaks`; at a break they may jump.

    Parameters: A: function (N,) -> (N, n, n), or a constant (n, n); period T in s; B: function (N,) -> (N, n, m), a constant, or None;
    breaks: times in [0, T) at which A or B jumps or loses smoothness.
    Raises: ArgumentError when shapes, period or breaks do not fit, or values are not finite.
    """

    A: MatrixFunction
    period: float
    B: MatrixFunction | None = None
    breaks: tuple[float, ...] = ()
    second_order: SecondOrder | None = None

    def __init__(
        self,
        A: MatrixFunction | ArrayLike,
        period: float,
        B: MatrixFunction | ArrayLike | None = None,
        breaks: Sequence[float] = (),
        second_order: SecondOrder | None = None,
    ):
        period = positive("period", period)
        inside = real_array("breaks", breaks, (None,))
        if inside.size and (inside.min() < 0 or inside.max() >= period):
            raise ArgumentError(
                "breaks lie outside the period", got=inside.tolist(), expected=f"times in [0, {period})"
            )
        A = as_matrix_function("A", A)
        probe = check_samples("A", A, period)
        if probe.shape[1] != probe.shape[2]:
            raise ArgumentError("A is not square", got=probe.shape[1:], expected="(n, n)")
        if B is not None:
            B = as_matrix_function("B", B)
            rows = check_samples("B", B, period).shape[1]
            if rows != probe.shape[1]:
                raise ArgumentError("B has the wrong number of rows", got=rows, expected=str(probe.shape[1]))
        for name, value in (("A", A), ("period", period), ("B", B), ("second_order", second_order)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "breaks", tuple(np.unique(inside).tolist()))

    @property
    def n(self) -> int:
        """The number of states."""
        return int(self.A(np.zeros(1)).shape[1])

    @property
    def m(self) -> int:
        """The number of inputs."""
        return 0 if self.B is None else int(self.B(np.zeros(1)).shape[2])

    @classmethod
    def from_second_order(
        cls,
        M: MatrixFunction | ArrayLike,
        D: MatrixFunction | ArrayLike,
        K: MatrixFunction | ArrayLike,
        period: float,
        B: MatrixFunction | ArrayLike | None = None,
        breaks: Sequence[float] = (),
        together: Callable[[Array], tuple[Array, Array, Array]] | None = None,
    ) -> "PeriodicSystem":
        """Build the first-order system of M y'' + D y' + K y = B u with x = [y; y'].

            A = [[0, I], [-M^-1 K, -M^-1 D]],   B = [0; M^-1 B]

        Parameters: M, D, K: functions (N,) -> (N, n, n) or constants; B: (N,) -> (N, n, m), constant or None; period in s;
        together: t -> (M, D, K) in one call, where that is cheaper than three.
        Returns: a system that keeps M, D, K, so that methods made for second order can use them.
        Raises: ArgumentError on shapes; SingularMassMatrix when M cannot be inverted.
        """
        M, D, K = (as_matrix_function(name, f) for name, f in (("M", M), ("D", D), ("K", K)))
        second_order = SecondOrder(M, D, K, None, together)
        size = check_samples("M", M, positive("period", period)).shape[1:]
        for name, f in (("D", D), ("K", K)):
            got = check_samples(name, f, period).shape[1:]
            if got != size:
                raise ArgumentError(f"{name} does not fit M", got=got, expected=str(size))

        def state_matrix(t: Array) -> Array:
            n = size[0]
            A = np.zeros((len(t), 2 * n, 2 * n))
            A[:, :n, n:] = np.eye(n)
            mass, damping, stiffness = second_order.sample(t)
            A[:, n:, :] = -solve_mass(mass, np.concatenate([stiffness, damping], axis=2), t)
            return A

        if B is None:
            return cls(state_matrix, period, None, breaks, second_order)
        force = as_matrix_function("B", B)

        def input_matrix(t: Array) -> Array:
            lower = solve_mass(M(t), force(t), t)
            return np.concatenate([np.zeros_like(lower), lower], axis=1)

        return cls(state_matrix, period, input_matrix, breaks, replace(second_order, force=force))

    def feedback(self, gain: MatrixFunction | ArrayLike, breaks: Sequence[float] = ()) -> "PeriodicSystem":
        """Close the loop u = -K(t) x: the system x' = (A - B K) x + B u.

        A second-order system stays one: M y'' + (D + F K_v) y' + (K + F K_y) y = F u with the gain [K_y, K_v].
        """
        if self.B is None:
            raise ArgumentError("the system has no input", got="B = None", expected="an input matrix B(t)")
        K, A, B = as_matrix_function("gain", gain), self.A, self.B
        got = check_samples("gain", K, self.period).shape[1:]
        if got != (self.m, self.n):
            raise ArgumentError("the gain does not fit the system", got=got, expected=f"({self.m}, {self.n})")
        second_order = None if self.second_order is None else self.second_order.feedback(K)
        corners = (*self.breaks, *breaks)
        return PeriodicSystem(lambda t: A(t) - B(t) @ K(t), self.period, B, corners, second_order)


def as_matrix_function(name: str, value: MatrixFunction | ArrayLike) -> MatrixFunction:
    """Let a constant matrix stand where a function of time is wanted."""
    if callable(value):
        return value
    constant = real_array(name, value, (None, None))
    return lambda t: np.broadcast_to(constant, (len(t), *constant.shape))


def check_samples(name: str, function: MatrixFunction, period: float) -> Array:
    """Sample a coefficient at a few times and return the checked (N, rows, columns)."""
    t = period * np.array([0.0, 0.2917, 0.6281])
    samples = real_array(name, function(t), (None, None, None))
    if len(samples) != len(t):
        raise ArgumentError(
            f"{name}(t) has the wrong shape",
            got=samples.shape,
            expected=f"({len(t)}, rows, columns) for t of shape ({len(t)},)",
        )
    return samples


def solve_mass(M: Array, right: Array, t: Array) -> Array:
    """Solve M z = right at each time, naming the time at which M is singular."""
    try:
        return np.linalg.solve(M, right)
    except np.linalg.LinAlgError:
        worst = int(np.argmin([np.linalg.svd(m, compute_uv=False)[-1] for m in M]))
        raise SingularMassMatrix(
            f"the mass matrix is singular at t = {t[worst]:.6g} s",
            todo="give every coordinate inertia, or remove the coordinate",
        ) from None
