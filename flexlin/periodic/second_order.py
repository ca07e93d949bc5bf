"""The second-order equations M y'' + D y' + K y = F u behind a periodic system, and the first-order one that they make."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, at_times
from flexlin.errors import SingularMassMatrix
from flexlin.periodic.coefficients import MatrixFunction

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
        return None if force is None else SecondOrder(SecondOrderLoop(self.sample, force, gain), force)


@dataclass(frozen=True)
class Separate:
    """M, D, K of three functions."""

    M: MatrixFunction
    D: MatrixFunction
    K: MatrixFunction

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        return self.M(t), self.D(t), self.K(t)


@dataclass(frozen=True)
class SecondOrderLoop:
    """M, D + F K_v, K + F K_y: the second-order coefficients with u = -[K_y, K_v] [y; y'] closed."""

    plant: SecondOrderFunction
    force: MatrixFunction
    gain: MatrixFunction

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        M, D, K = self.plant(t)
        n = M.shape[-1]
        feedback = self.force(t) @ self.gain(t)
        return M, D + feedback[..., n:], K + feedback[..., :n]


@dataclass(frozen=True)
class StateMatrix:
    """[[0, I], [-M^-1 K, -M^-1 D]], (N, 2n, 2n)."""

    second_order: SecondOrderFunction

    def __call__(self, t: ArrayLike) -> Array:
        return at_times(lambda t: build_companion(*self.second_order(t), t), t)


@dataclass(frozen=True)
class InputMatrix:
    """[0; M^-1 F], (N, 2n, m)."""

    M: MatrixFunction
    force: MatrixFunction

    def __call__(self, t: ArrayLike) -> Array:
        return at_times(lambda t: build_input(self.M(t), self.force(t), t), t)


def build_companion(M: Array, D: Array, K: Array, t: Array) -> Array:
    """Return A = [[0, I], [-M^-1 K, -M^-1 D]] for x = [y; y'], (N, 2n, 2n), from M, D, K (N, n, n) at the times t (N,).

    Raises: SingularMassMatrix, naming the time.
    """
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
