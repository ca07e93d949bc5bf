"""The stabilising solution of a smooth problem as a Fourier series: a coarse doubling, then Newton's method."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NotDetectable, NotStabilizable, NumericalError, ToleranceNotReached
from flexlin.periodic.fourier import FourierSeries, fourier_differentiation, fourier_nodes
from flexlin.periodic.quadratic.collocated_lyapunov import CollocatedLyapunov
from flexlin.periodic.quadratic.doubling import carry_costs
from flexlin.periodic.quadratic.evidence import find_error, find_tail
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic, assemble_hamiltonian
from flexlin.periodic.quadratic.resolution import last_harmonic
from flexlin.periodic.quadratic.scattering import transpose
from flexlin.periodic.quadratic.solution import RiccatiSolution
from flexlin.periodic.quadratic.transport import scatter_exponentials

COUNTS = {33: 65, 45: 91, 65: 121, 91: 165, 125: 243, 175: 351, 243: 475}
"""Nodes that are tried and about twice as many that judge them, which must see all harmonics: odd numbers that FFTs like and that
share only t = 0."""
LAST, PATIENCE = 243, 1
"""The largest number of nodes, and the failures after which another way is taken."""
MOST_ENTRIES = 2**18
"""Largest number of entries of X at all nodes: GMRES keeps up to 80 such arrays."""
NEEDED = 0.75
"""Share of the nodes that the fall of the last harmonics of a coarse solution promises to need."""
RINGING = 1e-4
"""Last harmonics of a coarse solution that say nothing of those of X: fast modes ring at an order of two, Newton's method ends that."""
ROUNDS = 12
INEXACT, ENOUGH = (1e-6, 1e-2), 0.1
"""Least and largest relative accuracy of a Newton step, and what will do."""
ROUNDED = 0.5
"""Part of an error below which the method's share does not matter: the rest is rounding, and more nodes do not help."""
SETTLED = 0.7
"""Factor by which a step must be shorter than the one before, from the third on."""


@dataclass(frozen=True)
class Samples:
    """Ar, B R^-1 B' and Qr at the N nodes of a period, and the matrix that differentiates functions known there."""

    A: Array
    S: Array
    Q: Array
    period: float

    @classmethod
    def of(cls, problem: LinearQuadratic, count: int, period: float) -> "Samples":
        """Sample a problem."""
        return cls(*problem.reduced(fourier_nodes(count, period)), period)

    def residual(self, X: Array) -> Array:
        """Return X' + A' X + X A - X S X + Q."""
        rate = (fourier_differentiation(len(X), self.period) @ X.reshape(len(X), -1)).reshape(X.shape)
        product = X @ self.A
        return np.asarray(rate + product + transpose(product) - X @ self.S @ X + self.Q)

    def loop(self, X: Array) -> Array:
        """Return A - S X, whose Lyapunov operator is the derivative of the residual by X."""
        return np.asarray(self.A - self.S @ X)


def solve_by_harmonics(problem: LinearQuadratic, period: float, tol: float) -> RiccatiSolution | None:
    """Solve with as many nodes as X has harmonics; the best answer, or None where this is no way to solve it.

    Assumes smooth coefficients. What is proved, and for which X, is said by `find_error`.
    """
    best: RiccatiSolution | None = None
    X: FourierSeries | None = None
    n, failures = problem.A(np.zeros(1)).shape[1], 0
    least, waves = 0.0, 2 * last_harmonic(problem, tol)
    for count, finer in COUNTS.items():
        if count < least or finer <= waves:
            continue
        if count * n**2 > MOST_ENTRIES or failures > PATIENCE:
            break
        samples = Samples.of(problem, count, period)
        try:
            start = start_coarsely(samples, problem) if X is None else X(fourier_nodes(count, period))
            tail = find_tail(start)
            if tail > RINGING:
                if tail ** (LAST / count) > tol:
                    break
                if X is None and (least := NEEDED * count * np.log(tol) / np.log(min(tail, 0.9))) > count:
                    continue
            X = FourierSeries.through(refine(samples, start, tol), period)
            if find_tail(X.values) > 10 * tol:
                continue
            found = judge_series(problem, X, samples, finer)
        except (NotStabilizable, NotDetectable):
            break
        except NumericalError:
            failures += 1
            continue
        if best is not None and found.error > 0.5 * best.error:
            break
        best = found
        if best.error <= tol or best.method_error <= ROUNDED * best.error:
            break
    return best


def start_coarsely(samples: Samples, problem: LinearQuadratic) -> Array:
    """Return X at the nodes, (N, n, n), with the means of neighbouring Hamiltonians: of order two, well posed however coarse.

    Raises: NotStabilizable, NotDetectable.
    """
    H = assemble_hamiltonian(samples.A, samples.S, samples.Q)
    step = samples.period / len(H)
    segments, _ = scatter_exponentials(step * 0.5 * (H + np.roll(H, -1, axis=0)))
    return carry_costs(segments, None, problem, step * np.arange(len(H) + 1)).X[:-1]


def refine(samples: Samples, X: Array, tol: float) -> Array:
    """Apply Newton's method to the collocated equation until the next step would stay well below tol, or is rounding.

        D' + Ac' D + D Ac = -residual(X),   X <- X + D

    Each step is solved as accurately as what it leaves over by its quadratic term deserves.

    Raises: ToleranceNotReached when the steps do not settle.
    Source: Kleinman, IEEE Trans. Automat. Control 13 (1968) 114.
    """
    last, expected, target = np.inf, np.inf, max(1e-2 * tol, 1e-13)
    for k in range(ROUNDS):
        accuracy = float(np.clip(max(expected, target / expected), *INEXACT))
        D = CollocatedLyapunov(samples.loop(X), samples.period, X).solve(-samples.residual(X), accuracy, ENOUGH)
        X = X + D
        moved = float(np.abs(D).max() / (np.abs(X).max() or 1.0))
        expected = moved * max(moved, accuracy, moved / last)
        if expected <= target or (moved > SETTLED * last and moved < 1e-9):
            return X
        if not np.isfinite(moved) or (k > 1 and moved > SETTLED * last):
            break
        last = moved
    raise ToleranceNotReached("Newton's method did not settle", got=f"a last step of {moved:.2g}")


def judge_series(problem: LinearQuadratic, X: FourierSeries, samples: Samples, finer: int) -> RiccatiSolution:
    """Put the solution together with its error. Raises: ToleranceNotReached when there is none."""
    values = X.values
    evidence = find_error(problem, X, samples.loop(values), finer)
    few = slice(None, None, max(1, len(values) // 32))
    H = assemble_hamiltonian(samples.A[few], samples.S[few], samples.Q[few])
    fastest = max(float(np.abs(np.linalg.eigvals(H)).max()), 1 / X.period)
    return RiccatiSolution(
        problem=problem,
        horizon=X.period,
        periodic=True,
        series=X,
        error=float(evidence.error),
        gain_error=float(evidence.gain_error),
        method_error=evidence.method_error,
        residual=evidence.residual / (float(np.abs(values).max()) * fastest),
        symmetry=0.0,
        closure=0.0,
        doublings=0,
        segments=len(values),
        status="converged",
    )
