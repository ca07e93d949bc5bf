"""Coefficients as functions of time: constants, feedback loops, second-order equations M y'' + D y' + K y = F u, and their checks."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, at_times, real_array
from flexlin.errors import ArgumentError, SingularMassMatrix
from flexlin.periodic.interpolation import NAMED_PARTS, ChebyshevPanels, FourierSeries, golden

MatrixFunction = Callable[[Array], Array]
"""Times (N,) -> (N, rows, columns)."""
PROBES = golden(np.arange(3))
"""Where in a period a coefficient is looked at before it is used."""


@dataclass(frozen=True, eq=False)
class Constant:
    """A constant value as a function of time: (N,) -> (N, *value.shape), without copies."""

    value: Array

    complete: ClassVar[bool] = True

    def __call__(self, t: ArrayLike) -> Array:
        return np.broadcast_to(self.value, (*np.shape(t), *self.value.shape))


def has_nothing_narrow(coefficient: Callable[..., Any]) -> bool:
    """Whether a coefficient changes fast at the breaks and features of its system alone, where these are complete.

    So it is with constants, with series of few waves, and with functions of the motion that say so: `complete` is true. Any other may
    hold a pulse of its own, and is looked at everywhere.
    """
    if isinstance(coefficient, FourierSeries | ChebyshevPanels):
        return 2 * coefficient.degree < NAMED_PARTS
    return bool(getattr(coefficient, "complete", False))


@dataclass(frozen=True, eq=False)
class Combined:
    """A function of time made of others, rule(f(t), g(t) ...); `complete`: as of `has_nothing_narrow`."""

    rule: Callable[..., Any]
    parts: tuple[Callable[[Array], Any], ...]
    complete: bool = False

    def __call__(self, t: ArrayLike) -> Any:
        return at_times(lambda s: self.rule(*(part(s) for part in self.parts)), t)


def combine(rule: Callable[..., Array], *parts: Callable[[Array], Array]) -> Combined:
    """What a rule makes of functions of time at each time, as complete as all of them."""
    return Combined(rule, parts, all(map(has_nothing_narrow, parts)))


def close_loop(A: Array, B: Array, K: Array) -> Array:
    """A - B K."""
    return A - B @ K


def hold_input(A: Array, B: Array) -> Array:
    """[[A, B], [0, 0]] (..., n + m, n + m): the state with an input that is held."""
    n, m = B.shape[-2:]
    out = np.zeros((*A.shape[:-2], n + m, n + m))
    out[..., :n, :n], out[..., :n, n:] = A, B
    return out


def varies(coefficient: MatrixFunction, period: float) -> bool:
    """Whether a coefficient is more than one matrix that is handed out at all times."""
    return not isinstance(coefficient, Constant) and bool(coefficient(period * PROBES).strides[0] != 0)


def as_matrix_function(name: str, value: MatrixFunction | ArrayLike) -> MatrixFunction:
    """Let a constant matrix stand where a function of time is wanted."""
    return value if callable(value) else Constant(real_array(name, value, (None, None)))


def refuse_signature(name: str, function: Callable[..., Any]) -> None:
    """Refuse a function that cannot be called with times alone."""
    try:
        inspect.signature(function).bind(PROBES)
    except TypeError as error:
        raise ArgumentError(
            f"{name} is no function of times", got=str(error), expected="a function of t (N,)"
        ) from None
    except ValueError:  # compiled functions do not say what they take
        return


def check_samples(name: str, function: MatrixFunction, period: float) -> Array:
    """Sample a coefficient at a few times, a constant at one, and return the checked (N, rows, columns).

    Raises: ArgumentError when a value is no array or not finite (naming the time), or when the shape depends on the times.
    """
    if isinstance(function, Constant):
        return function.value[None]
    t = period * PROBES
    values = check_finite(name, check_array(name, sample_together(name, function, t), t), t)
    alone = check_array(name, function(t[:1]), t[:1])
    if alone.shape[1:] != values.shape[1:]:
        raise ArgumentError(
            f"{name}(t) changes its shape",
            got=f"{alone.shape} for one time, {values.shape} for {len(t)}",
            expected="(N, rows, columns) for t of shape (N,)",
        )
    return values


def sample_together(name: str, function: MatrixFunction, t: Array) -> Any:
    """Call a coefficient with several times at once; refuse one that was written for a single time."""
    try:
        values = function(t)
    except (ValueError, TypeError, IndexError):
        refuse_signature(name, function)
        if not takes_one_time(function, t):
            raise
    else:
        if (np.ndim(values) == 3 and len(values) == len(t)) or not takes_one_time(function, t):
            return values
    raise ArgumentError(
        f"{name}(t) takes a single time",
        got="a matrix for one time, none for each of several",
        expected=f"({len(t)}, rows, columns) for t of shape ({len(t)},)",
        todo=f"give lambda times: numpy.array([{name}(t) for t in times]), or let {name} work on all times at once, which is faster",
    )


def takes_one_time(function: MatrixFunction, t: Array) -> bool:
    """Whether the function gives a matrix for a time that is a number."""
    try:
        return np.ndim(function(t[0].item())) == 2
    except Exception:  # whatever a function makes of what it was not written for
        return False


def check_array(name: str, value: Any, t: Array, shape: tuple[int, int] | None = None) -> Array:
    """Refuse what is no array (N, rows, columns), of the shape that it had before."""
    if not isinstance(value, np.ndarray):
        raise ArgumentError(
            f"{name}(t) is no array", got=type(value).__name__, expected="numpy.array of what it returns"
        )
    if value.ndim != 3 or len(value) != len(t) or shape not in (None, value.shape[1:]):
        rows = "rows, columns" if shape is None else f"{shape[0]}, {shape[1]}"
        raise ArgumentError(
            f"{name}(t) has the wrong shape",
            got=value.shape,
            expected=f"({len(t)}, {rows}) for t of shape ({len(t)},)",
        )
    if value.dtype.kind == "f" and value.dtype.itemsize not in (4, 8):
        raise ArgumentError(
            f"{name}(t) is of a precision that linear algebra does not take",
            got=f"numbers of type {value.dtype}",
            expected="numbers of type float64",
            todo="return values.astype(float)",
        )
    return value


def check_finite(name: str, values: Array, t: Array) -> Array:
    """Refuse samples (N, rows, columns) that are complex, no numbers, or not finite at one of the times (N,), naming it."""
    if np.issubdtype(values.dtype, np.floating) and not np.isfinite(values).all():
        k, *entry = np.argwhere(~np.isfinite(values))[0].tolist()
        raise ArgumentError(
            f"{name} is not finite at t = {t[k]:.6g} s",
            got=f"{values[(k, *entry)]} at {entry}",
            expected="finite numbers",
        )
    return real_array(f"{name}(t)", values)


SecondOrderFunction = Callable[[Array], tuple[Array, Array, Array]]
"""Times (N,) -> M, D, K, each (N, n, n)."""


@dataclass(frozen=True)
class SecondOrder:
    """M(t) y'' + D(t) y' + K(t) y = force(t) u; sample: times (N,) -> M, D, K, force: (N,) -> (N, n, m)."""

    sample: SecondOrderFunction
    force: MatrixFunction | None = None

    def stacked(self, t: Array) -> Array:
        """[M D K] at the times t, (N, n, 3 n)."""
        return np.concatenate(self.sample(t), axis=2)

    def feedback(self, gain: MatrixFunction) -> "SecondOrder | None":
        """The equations with u = -gain(t) [y; y'], of those that have an input."""
        force = self.force
        return None if force is None else SecondOrder(Combined(feed_back, (self.sample, force, gain)), force)


def gather(*matrices: Array) -> tuple[Array, ...]:
    """M, D, K of three functions."""
    return matrices


def feed_back(equations: tuple[Array, Array, Array], force: Array, gain: Array) -> tuple[Array, Array, Array]:
    """M, D + F K_v, K + F K_y: the second-order coefficients with u = -[K_y, K_v] [y; y'] closed."""
    M, D, K = equations
    by_place, by_rate = np.split(force @ gain, 2, axis=2)
    return M, D + by_rate, K + by_place


def build_companion(equations: tuple[Array, Array, Array], t: Array) -> Array:
    """Return A = [[0, I], [-M^-1 K, -M^-1 D]] for x = [y; y'], (N, 2n, 2n), from M, D, K (N, n, n) at the times t (N,).

    Raises: SingularMassMatrix, naming the time.
    """
    M, D, K = equations
    n = M.shape[-1]
    solved = -solve_mass(M, np.concatenate([K, D], axis=-1), t)
    return stack_companion(solved[..., :n], solved[..., n:])


def build_input(M: Array, F: Array, t: Array) -> Array:
    """Return B = [0; M^-1 F] for x = [y; y'], (N, 2n, m), from M (N, n, n) and F (N, n, m) at the times t (N,).

    Raises: SingularMassMatrix, naming the time.
    """
    lower = solve_mass(M, F, t)
    return np.concatenate([np.zeros_like(lower), lower], axis=-2)


def stack_companion(X: Array, Y: Array) -> Array:
    """Return [[0, I], [X, Y]] for blocks (..., n, n): the state matrix of y'' = X y + Y y'."""
    n = X.shape[-1]
    A = np.zeros((*X.shape[:-2], 2 * n, 2 * n))
    A[..., :n, n:] = np.eye(n)
    A[..., n:, :n], A[..., n:, n:] = X, Y
    return A


def assemble_hamiltonian(A: Array, S: Array, Q: Array) -> Array:
    """Return [[A, -S], [-Q, -A']] for stacks of matrices."""
    H, n = hold_input(A, -S), A.shape[-1]
    H[:, n:, :n], H[:, n:, n:] = -Q, -np.swapaxes(A, 1, 2)
    return H


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
