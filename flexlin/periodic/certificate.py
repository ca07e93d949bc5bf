"""Lyapunov certificates of stability: a periodic X(t) > 0 whose inequality is proved over the whole period."""

import hashlib
from dataclasses import dataclass
from math import isqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array
from flexlin.errors import ArgumentError, NotCertified, NumericalError
from flexlin.periodic.coefficient_series.matrix import ResolvedCompanion, ResolvedMatrix, couple_uncertainty
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.interpolation import (
    NODES,
    TAIL,
    ChebyshevPanels,
    FourierSeries,
    chebyshev_coefficients,
    chebyshev_nodes,
    divided,
    panel_times,
)
from flexlin.periodic.riccati.linear_quadratic import PANEL_HARMONICS, RiccatiSolution
from flexlin.periodic.riccati.riccati import solve_lyapunov
from flexlin.periodic.riccati.scattering import symmetrize
from flexlin.periodic.system import PeriodicSystem
from flexlin.precision import EPS, ROOT_EPS, TINY
from flexlin.summary import immutable

CLOSE_SHARE = 1e-6
"""How small the last coefficients of X must be, relative to its largest values; and relative distance of a bound above the eigenvalues
that were computed."""
PROVED_SHARE = 0.9
"""Share of the decay that the Lyapunov equation is asked to prove, and of the margin that the bound between samples must leave."""
SUM_ROUNDING = NODES * EPS
"""Relative rounding of a sum of as many terms as a panel has nodes."""
Resolved = ResolvedMatrix | ResolvedCompanion


@dataclass(frozen=True)
class CommonPanels:
    """Edges (P + 1,) from 0 to T, Chebyshev coefficients of A and X (P, K, n, n), and a bound on the error of A's entries (n, n)."""

    edges: Array
    A: Array
    X: Array
    error: Array


def represent_on_panels(resolved: Resolved, solution: RiccatiSolution) -> CommonPanels:
    """Interpolate A and X on panels; A's error: that of its representation, what the panels add between their nodes, and rounding."""
    n = len(resolved.mean())
    both = (resolved.series, 1), (solution.series, 2)  # X to half the digits, of half the waves
    waves = max(one.degree / share if isinstance(one, FourierSeries) else 0.0 for one, share in both)
    edges = divided(solution.series.edges, resolved.period * PANEL_HARMONICS / max(waves, PANEL_HARMONICS))
    t = panel_times(edges[:-1], edges[1:], NODES)
    A, X = (chebyshev_coefficients(f(t.ravel()).reshape(*t.shape, n, n)) for f in (resolved, solution.X))
    X = symmetrize(X)
    u = np.linspace(-1.0, 1.0, 2 * NODES + 1)[1:-1]
    t = (edges[:-1, None] + edges[1:, None]) / 2 + np.diff(edges)[:, None] / 2 * u
    apart = np.abs(resolved(t.ravel()).reshape(*t.shape, n, n) - evaluate(A, u))
    between = 3 * apart.max(axis=(0, 1)) + np.abs(A[:, -TAIL:]).sum(axis=1).max(axis=0)
    units = np.sqrt(np.abs(X[..., range(n), range(n)]).sum(axis=1).max(axis=0))
    some = resolved.period * np.arange(257) / 257  # and half as much again for between them
    eye = np.broadcast_to(np.eye(n), (len(some), n, n))
    represented = 1.5 * couple_uncertainty(resolved, some, eye, eye).max(axis=0)
    error = represented + between + SUM_ROUNDING * np.abs(A).sum(axis=1).max(axis=0)
    kept = trimmed(A, error / NODES)
    error = error + np.abs(A[:, kept.shape[1] :]).sum(axis=1).max(axis=0)
    error = np.where(np.any(A, axis=(0, 1)), error, 0.0)
    return CommonPanels(edges, kept, trimmed(X, ROOT_EPS * np.outer(units, units)), error)


def trimmed(coefficients: Array, least: Array) -> Array:
    """Coefficients without the highest ones, where those are at most `least` (n, n) on every panel."""
    counts = np.flatnonzero(np.any(np.abs(coefficients) > least, axis=(0, 2, 3)))
    return coefficients[:, : int(counts.max(initial=0)) + 1]


def prove(panels: CommonPanels) -> tuple[float, float]:
    """Bounds from below on the margin in 1/s, X' + A' X + X A <= -margin X, and on the spectral norm of a change of A in 1/s that leaves
    this negative; a margin <= 0 says nothing.

    In coordinates z = L' x, L L' = mean X, with R = X' + A' X + X A:

        R(t) + mu X(t) <= -(what A's error and rounding can add)

    holds at the samples, and between two of them because a matrix polynomial p lies within h^2/8 max |p''| of its chord, where
    |p''| <= sum_k |c_k| k^2 (k^2 - 1) / 3 (Markov). Where X grows from one panel to the next, the growth is paid from the margin.
    Rounding of the change of coordinates grows with the condition of L in units in which X has a diagonal of ones.
    """
    L = np.linalg.cholesky(ChebyshevPanels(panels.edges, panels.X).mean())
    back = np.linalg.inv(L.T)
    A = L.T @ panels.A @ back
    X = np.linalg.solve(L, np.swapaxes(np.linalg.solve(L, panels.X), -1, -2))
    unknown = float(np.linalg.norm(np.abs(L.T) @ panels.error @ np.abs(back)))
    rounding = SUM_ROUNDING * len(L) * float(np.linalg.cond(L / np.sqrt((L**2).sum(axis=1))[:, None]))
    best, count = (-np.inf, 0.0), TAIL * NODES + 1
    while count < NODES**2:
        margin, tolerates, lost = bound_margin(panels.edges, A, X, unknown, rounding, count)
        best, count = max(best, (margin, tolerates)), 4 * count - 3
        if lost <= (1 - PROVED_SHARE) * max(margin, 0.0) or margin + lost <= 0 or margin == -np.inf:
            break
    margin, tolerates = best[0], best[1] / float(np.linalg.cond(L))
    # a certificate that bears next to no change says more of rounding than of the loop
    return (margin, tolerates) if tolerates > EPS**0.75 * margin else (-np.inf, 0.0)


def bound_margin(
    edges: Array, A: Array, X: Array, unknown: float, rounding: float, count: int
) -> tuple[float, float, float]:
    """The margin proved with so many samples a panel, the change that leaves some of it, and what the bound between samples costs."""
    slope = ChebyshevPanels(edges, X).derivative().coefficients
    R = chebyshev_coefficients(sum_terms(A, X, slope, chebyshev_nodes(A.shape[1] + X.shape[1] - 1)))
    u = np.linspace(-1.0, 1.0, count)
    bends = [float(bend(one).max()) * (u[1] - u[0]) ** 2 / 8 for one in (R, X)]
    values, size = sum_terms(A, X, slope, u), evaluate(X, u)
    of_X = np.linalg.eigvalsh(size)
    low, high = (above(most) + bends[1] for most in (-of_X[..., 0].min(), of_X[..., -1].max()))
    if not low < 0:
        return -np.inf, 0.0, np.inf
    largest_A = float(np.linalg.norm(evaluate(A, u), axis=(-2, -1)).max())
    known = 2 * unknown * high + rounding * (2 * largest_A * high + float(np.abs(evaluate(slope, u)).max()))
    some = slice(None, None, isqrt(count))
    eye = np.eye(size.shape[-1])
    first = largest_ratios(values[:, some] + known * eye, size[:, some]).max()  # not above that of all
    mu = above(largest_ratios(values + (known + bends[0] + max(-first, 0.0) * bends[1]) * eye, size).max())
    ends = evaluate(X, np.array([-1.0, 1.0]))
    paid = np.log(np.maximum(largest_ratios(ends[:, 0], np.roll(ends[:, 1], 1, axis=0)), 1.0))
    margin = -mu - float(paid.sum()) / float(edges[-1])
    return margin, max(margin, 0.0) / 2 * float(np.sqrt(-low / high)), mu - first


def sum_terms(A: Array, X: Array, slope: Array, u: Array) -> Array:
    """X' + A' X + X A at u of each panel, (P, U, n, n)."""
    product = evaluate(X, u) @ evaluate(A, u)
    return evaluate(slope, u) + product + np.swapaxes(product, -1, -2)


def evaluate(coefficients: Array, u: Array) -> Array:
    """Polynomials of each panel at u (U,): (P, U, n, n)."""
    return np.einsum(
        "uk,pkij->puij", np.polynomial.chebyshev.chebvander(u, coefficients.shape[1] - 1), coefficients, optimize=True
    )


def bend(coefficients: Array) -> Array:
    """A bound on the second derivative of each panel's polynomial in [-1, 1], by |T_k''| <= k^2 (k^2 - 1) / 3 (P,)."""
    k = np.arange(coefficients.shape[1])
    return np.linalg.norm(coefficients, axis=(2, 3)) @ (k**2 * (k**2 - 1.0) / 3)


def largest_ratios(R: Array, X: Array) -> Array:
    """The largest eigenvalue of L^-1 R L^-T with L L' = X > 0, at each sample: the least mu with R <= mu X."""
    inverse = np.linalg.inv(np.linalg.cholesky(X))
    return np.linalg.eigvalsh(inverse @ R @ np.swapaxes(inverse, -1, -2))[..., -1]


def above(most: float) -> float:
    """A bound by more than rounding above the largest eigenvalue of many."""
    return float(most + CLOSE_SHARE * abs(most) + TINY)


@immutable
class Certificate:
    """A periodic X(t) > 0 along which every motion of x' = A(t) x decays.

        X' + A' X + X A <= -margin X     at every time, so x' X x falls at least as exp(-margin t)

    The inequality is proved from the coefficients of A and X: at samples, and between them by bounds on the second derivative, with
    A's stated error and rounding added.

    Attributes
    ----------
    panels : CommonPanels
        Edges of panels of the period, the Chebyshev coefficients of A and X on each, and the error of A's entries.
    margin : float
        In 1/s. Twice the decay of the slowest mode is the most that any X can prove.
    tolerates : float
        The inequality survives every change of A(t) whose spectral norm, in the units of A, stays below this.
    source : str
        Where X comes from: a Lyapunov equation.

    Examples
    --------
    >>> import flexlin as fl
    >>> proof = fl.floquet(fl.PeriodicSystem([[0.0, 1.0], [-1.0, -0.2]], 1.0)).certificate()
    >>> print(f"{proof.margin:.4f} {proof.tolerates > 0} {proof.X(0.3).shape}")
    0.2000 True (2, 2)
    """

    panels: CommonPanels
    margin: float
    tolerates: float
    source: str

    def X(self, t: ArrayLike) -> Array:
        """Return the Lyapunov matrix.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n, n) or (n, n)
            X(t), symmetric and positive definite.
        """
        return ChebyshevPanels(self.panels.edges, self.panels.X)(t)

    def record(self) -> dict[str, Any]:
        """Return what `report.json` holds and `studies/check_certificate.py` checks: plain numbers and a digest against accidents.

        Returns
        -------
        dict
            edges (P + 1), A and X as Chebyshev coefficients (P, K, n, n), error of A (n, n), margin, tolerates, source, sha256.
        """
        data = {name: getattr(self.panels, name).tolist() for name in ("edges", "A", "X", "error")}
        data |= {name: getattr(self, name) for name in ("margin", "tolerates", "source")}
        return data | {"sha256": digest(data)}


def digest(said: dict[str, Any]) -> str:
    """The SHA-256 of names and values in alphabetical order, numbers as doubles: that of their text would take longer than the proof."""
    parts = (
        key.encode() + (v.encode() if isinstance(v, str) else np.array(v, "<f8").tobytes())
        for key, v in sorted(said.items())
    )
    return hashlib.sha256(b"".join(parts)).hexdigest()


def certify(result: FloquetResult) -> Certificate:
    """Issue a certificate for a stable loop.

    Raises: NotCertified for a loop that is not stable, or whose X(t) does not prove the inequality.
    """
    if result.verdict != "stable":
        raise NotCertified(f"the loop is {result.verdict}", got=result.status, expected="a stable loop")
    resolved = result.resolved
    if resolved is None:
        raise ArgumentError("the result does not know its loop", expected="a result of fl.floquet")
    try:
        panels = represent_on_panels(resolved, solve_equation(result, resolved))
        margin, tolerates = prove(panels)
    except (NumericalError, np.linalg.LinAlgError) as error:
        raise NotCertified("no X(t) proves the stability", got=str(error)) from None
    if not margin > 0:
        said = f"a margin of {margin:.3g} 1/s" if np.isfinite(margin) else "none beyond rounding"
        raise NotCertified("X(t) does not prove the stability", got=said)
    claimed = 1 - CLOSE_SHARE  # so that another program's rounding does not matter
    return Certificate(panels, claimed * margin, claimed * tolerates, "Lyapunov equation")


def choose_weights(resolved: Resolved, shift: float) -> Array:
    """Weights Q (n, n) of the Lyapunov equation; no choice of them is wrong, and the proof judges.

    By the left eigenvectors q_i of the mean of A, Q = sum_i 2 (r_i - s) q_i q_i^H with r_i the decay of each mode: where A is constant
    X = sum_i q_i q_i^H, which proves all of the decay. By the units of the states: where the eigenvectors depend on each other.
    """
    mean = resolved.mean()
    values, vectors = np.linalg.eig(mean)
    if np.linalg.matrix_rank(vectors) == len(mean):
        rates = np.maximum(-values.real - shift, shift * (1 / PROVED_SHARE - 1))
        rows = np.linalg.inv(vectors)
        return 2 * symmetrize(((rows.conj().T * rates) @ rows).real)
    sizes = np.abs(mean)
    units = np.sqrt(sizes.sum(axis=1) / np.maximum(sizes.sum(axis=0), TINY))
    return np.diag(1 / np.maximum(units, ROOT_EPS) ** 2)


def solve_equation(result: FloquetResult, resolved: Resolved) -> RiccatiSolution:
    """X(t) of -X' = (A + s)' X + X (A + s) + Q with s just below the decay: X' + A' X + X A = -Q - 2 s X.

    Raises: NumericalError where the decay is so slow against the fastest mode that the error of X hides it.
    """
    growth, tol = result.exponents.real + np.where(np.isinf(result.errors), 0, result.errors), CLOSE_SHARE / 10
    shift = -PROVED_SHARE * float(growth.max())
    hidden = tol * float(np.abs(np.linalg.eigvals(resolved.mean())).max())
    if shift < hidden:
        raise NumericalError("the loop decays too slowly", got=f"{shift:.3g} 1/s", expected=f"above {hidden:.3g} 1/s")
    edges, moved = resolved.edges[:-1].tolist() if resolved.panels > 1 else (), shift * np.eye(result.exponents.size)
    faster = PeriodicSystem(lambda t: resolved(t) + moved, resolved.period, breaks=edges, complete=True)
    return solve_lyapunov(faster, choose_weights(resolved, shift), tol, bounded=False)
