"""A Lyapunov certificate of stability, and how one is issued for a loop that Floquet calls stable."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array
from flexlin.errors import ArgumentError, NotCertified, NumericalError
from flexlin.periodic.certificate.proof import (
    CLOSE,
    LEAST,
    SHIFT,
    CommonPanels,
    Proof,
    Resolved,
    prove,
    represent_on_panels,
)
from flexlin.periodic.chebyshev import ChebyshevPanels
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.quadratic.riccati import periodic_lyapunov
from flexlin.periodic.quadratic.scattering import symmetrize
from flexlin.periodic.system import PeriodicSystem
from flexlin.summary import represent


@dataclass(frozen=True)
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

    __repr__ = represent

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
        panels = self.panels
        data: dict[str, Any] = {"edges": panels.edges.tolist(), "A": panels.A.tolist(), "X": panels.X.tolist()}
        data |= {
            "error": panels.error.tolist(),
            "margin": self.margin,
            "tolerates": self.tolerates,
            "source": self.source,
        }
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

    Raises: NotCertified for a loop that is not stable, or where no candidate proves the inequality.
    """
    if result.verdict != "stable":
        raise NotCertified(f"the loop is {result.verdict}", got=result.status, expected="a stable loop")
    resolved = result.resolved
    if resolved is None:
        raise ArgumentError("the result does not know its loop", expected="a result of fl.floquet")
    tried, found = list[str](), list[tuple[Proof, CommonPanels]]()
    for name, weights in list_weights(result, resolved).items():
        try:
            panels = represent_on_panels(resolved, solve_equation(result, resolved, weights))
            proof = prove(panels)
        except (NumericalError, np.linalg.LinAlgError) as error:
            tried.append(f"{name}: {error}")
            continue
        said = f"{proof.margin:.3g} 1/s" if np.isfinite(proof.margin) else "none beyond rounding"
        tried.append(f"{name}: {said}")
        found.append((proof, panels))
        if proof.margin > SHIFT * -float(result.exponents.real.max()):  # twice the decay is the most
            break
    proven = [one for one in found if one[0].margin > 0]
    if not proven:
        raise NotCertified("no X(t) that was tried proves the stability", got="; ".join(tried))
    proof, panels = max(proven, key=lambda one: one[0].margin)
    claimed = 1 - CLOSE  # so that another program's rounding does not matter
    return Certificate(panels, claimed * proof.margin, claimed * proof.tolerates, "Lyapunov equation")


def find_shift(result: FloquetResult) -> float:
    """What the Lyapunov equation is asked to prove, in 1/s."""
    return -SHIFT * float((result.exponents.real + np.where(np.isinf(result.errors), 0, result.errors)).max())


def list_weights(result: FloquetResult, resolved: Resolved) -> dict[str, Array]:
    """Weights Q (n, n) of the Lyapunov equation, by name; no choice of them is wrong, and the proof judges.

    By the left eigenvectors q_i of the mean of A, Q = sum_i 2 (r_i - s) q_i q_i^H with r_i the decay of each mode: where A is constant
    X = sum_i q_i q_i^H, which proves all of the decay. By the units of the states: where the eigenvectors are nearly dependent.
    """
    mean, shift = resolved.mean(), find_shift(result)
    values, vectors = np.linalg.eig(mean)
    weights = {}
    if np.linalg.matrix_rank(vectors) == len(mean):
        rates = np.maximum(-values.real - shift, shift * (1 / SHIFT - 1))
        rows = np.linalg.inv(vectors)
        weights["modes of the mean"] = 2 * symmetrize(((rows.conj().T * rates) @ rows).real)
    sizes = np.abs(mean)
    units = np.sqrt(sizes.sum(axis=1) / np.maximum(sizes.sum(axis=0), np.finfo(float).tiny))
    return weights | {"units of the states": np.diag(1 / np.maximum(units, LEAST) ** 2)}


def solve_equation(result: FloquetResult, resolved: Resolved, Q: Array) -> Callable[[Array], Array]:
    """X(t) of -X' = (A + s)' X + X (A + s) + Q with s just below the decay: X' + A' X + X A = -Q - 2 s X.

    Raises: NumericalError where the decay is so slow against the fastest mode that the error of X hides it.
    """
    shift, tol = find_shift(result), CLOSE / 10
    hidden = tol * float(np.abs(np.linalg.eigvals(resolved.mean())).max())
    if shift < hidden:
        raise NumericalError("the loop decays too slowly", got=f"{shift:.3g} 1/s", expected=f"above {hidden:.3g} 1/s")
    edges, moved = resolved.edges[:-1].tolist() if resolved.panels > 1 else (), shift * np.eye(len(Q))
    faster = PeriodicSystem(lambda t: resolved(t) + moved, resolved.period, breaks=edges, complete=True)
    return periodic_lyapunov(faster, Q, tol).X
