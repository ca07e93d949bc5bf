"""Does a Lyapunov certificate prove what it claims? Those of a report.json are checked with NumPy and json, without flexlin.

X' + A' X + X A <= -margin X at samples of each panel, in coordinates U x; between them by |T_k''| <= k^2 (k^2 - 1) / 3.
Run: flexlin report single-link --out out && python studies/check_certificate.py out/report.json
"""

import hashlib
import json
import sys
from pathlib import Path

import numpy as np
from numpy.linalg import LinAlgError, cholesky, cond, eigvals, eigvalsh, inv, norm, solve
from numpy.polynomial.chebyshev import chebder, chebfit, chebpts1, chebval


def at(u, c):
    return np.moveaxis(chebval(u, c), -1, 0)


def side(u, a, x, width):
    return at(u, chebder(x)) * 2 / width + (product := at(u, x) @ at(u, a)) + product.swapaxes(1, 2)


def bend(c, samples):
    k = np.arange(len(c))
    return norm(c.reshape(len(c), -1), axis=1) @ (k**2 * (k**2 - 1.0)) / 6 / (samples - 1) ** 2


def holds(certificate, samples=1025):
    try:  # what is no certificate proves nothing
        return proves(certificate, samples)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError, LinAlgError):
        return False


def proves(certificate, samples):
    said = {key: value for key, value in certificate.items() if key != "sha256"}
    edges, A, X, error = (np.array(said[key], dtype=float) for key in ("edges", "A", "X", "error"))
    widths, mu, u = np.diff(edges), said["margin"], np.linspace(-1, 1, samples)
    mean = np.einsum("p,k,pkij->ij", widths / edges[-1], 1 / (1 - np.arange(0.0, X.shape[1], 2) ** 2), X[:, ::2])
    parts = (
        k.encode() + (v.encode() if k == "source" else np.array(v, "<f8").tobytes()) for k, v in sorted(said.items())
    )
    if hashlib.sha256(b"".join(parts)).hexdigest() != certificate["sha256"]:
        return False
    if edges[0] or min(widths) <= 0 or np.any(X.swapaxes(2, 3) != X) or np.any(error < 0) or eigvalsh(mean).min() <= 0:
        return False
    U, V, found = cholesky(mean).T, inv(cholesky(mean).T), []
    off = norm(abs(U) @ error @ abs(V)) + 1e-15 * len(U) * norm(U @ A @ V, 2, (2, 3)).sum(1).max()
    for a, x, width in zip(U @ A @ V, V.T @ X @ V, widths, strict=True):
        nodes, S, loose = chebpts1(len(a) + len(x)), at(u, x), bend(x, samples)
        R = chebfit(nodes, side(nodes, a, x, width).reshape(len(nodes), -1), len(nodes) - 1)
        least, most = eigvalsh(S).min() - loose, eigvalsh(S).max() + loose
        added = bend(R, samples) + mu * loose + 2 * off * most
        worst = eigvals(solve(S, side(u, a, x, width) + added * np.eye(len(U)))).real.max() if least > 0 else np.inf
        found.append((least, most, worst, S[0], S[-1]))
    least, most, worst, first, last = map(np.array, zip(*found, strict=True))
    if not least.min() > 0:
        return False
    grown = np.log(np.maximum(eigvals(solve(np.roll(last, 1, axis=0), first)).real.max(1), 1)).sum() / edges[-1]
    proved, tolerates = -worst.max() - grown, np.sqrt(least.min() / most.max()) / cond(U) / 2
    return bool(proved >= mu > 0 and proved * tolerates >= said["tolerates"] > 0)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    report = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    for name, loop in {"own": report["floquet"], "open": report["open_loop"], **report["designs"]}.items():
        print(name, loop["verdict"], holds(loop["certificate"]) if loop.get("certificate") else "no certificate")
