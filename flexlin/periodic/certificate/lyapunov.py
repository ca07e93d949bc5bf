"""A Lyapunov certificate of stability, and how one is issued for a loop that Floquet calls stable."""

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array
from flexlin.errors import ArgumentError, NotCertified, NumericalError
from flexlin.periodic.certificate.candidates import propose
from flexlin.periodic.certificate.panels import CommonPanels, represent_on_panels
from flexlin.periodic.certificate.proof import Proof, prove
from flexlin.periodic.chebyshev import ChebyshevPanels
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.summary import represent

GOOD = 0.75
"""Share of twice the decay, which no margin exceeds, at which no further candidate is tried."""
CLAIMED = 1 - 1e-6
"""What is claimed of what was proved, so that another program's rounding does not matter."""


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
        Where X comes from: decoupled modes, Floquet modes, eigenvectors of A(t), or a Lyapunov equation.

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
    if result.resolved is None:
        raise ArgumentError("the result does not know its loop", expected="a result of fl.floquet")
    decay, tried = -float(result.exponents.real.max()), []
    best: tuple[Proof, CommonPanels, str] | None = None
    for name, compute, most in propose(result, result.resolved):
        try:
            panels = represent_on_panels(result.resolved, compute(), most)
            found = prove(panels)
        except (NumericalError, np.linalg.LinAlgError) as error:
            tried.append(f"{name}: {error}")
            continue
        tried.append(
            f"{name}: {found.margin:.3g} 1/s" if np.isfinite(found.margin) else f"{name}: none beyond rounding"
        )
        if found.margin > 0 and (best is None or found.margin > best[0].margin):
            best = found, panels, name
        if found.margin > GOOD * 2 * decay:
            break
    if best is None:
        raise NotCertified("no X(t) that was tried proves the stability", got="; ".join(tried))
    return Certificate(best[1], CLAIMED * best[0].margin, CLAIMED * best[0].tolerates, best[2])
