"""Does a Lyapunov certificate prove what it claims? Those of a report.json are checked with NumPy and json, without flexlin.

    X' + A' X + X A <= -margin X     at every time, in coordinates in which the mean of X is the identity:

at samples of each panel; between them by |T_k''| <= k^2 (k^2 - 1) / 3; A's stated error, rounding and the growth of X at edges added.

Run: python studies/check_certificate.py report.json
"""

import hashlib
import json
import sys

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebfit, chebpts1, chebval


def values(u, c):
    return np.moveaxis(chebval(u, c), -1, 0)


def left_side(u, a, x, width):
    product = values(u, x) @ values(u, a)
    return values(u, chebder(x)) * 2 / width + product + product.swapaxes(1, 2)


def between(c, step):
    k = np.arange(len(c))
    return step**2 / 8 * np.linalg.norm(c.reshape(len(c), -1), axis=1) @ (k**2 * (k**2 - 1) / 3)


def ratio(R, X):
    return np.linalg.eigvals(np.linalg.solve(X, R)).real.max()


def holds(certificate, samples=1025):
    """Whether a certificate proves its margin and tolerance; False where a number was changed."""
    said = {key: value for key, value in certificate.items() if key != "sha256"}
    edges, A, X, error = (np.array(said[key], dtype=float) for key in ("edges", "A", "X", "error"))
    if hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest() != certificate["sha256"]:
        return False
    widths, mu, k = np.diff(edges), said["margin"], np.arange(0, X.shape[1], 2)
    if edges[0] != 0 or min(widths) <= 0 or np.any(X.swapaxes(2, 3) != X) or np.any(error < 0) or not mu > 0:
        return False
    mean = np.einsum("p,k,pkij->ij", widths / edges[-1], 1 / (1 - k**2), X[:, ::2])
    if not np.linalg.eigvalsh(mean).min() > 0:
        return False
    L = np.linalg.cholesky(mean)
    inverse = np.linalg.inv(L.T)
    unknown = (
        np.linalg.norm(np.abs(L.T) @ error @ np.abs(inverse))
        + 1e-15 * len(L) * np.linalg.norm(L.T @ A @ inverse, 2, (2, 3)).sum(1).max()
    )
    u, step, least, most, worst, ends = np.linspace(-1, 1, samples), 2 / (samples - 1), np.inf, 0.0, -np.inf, []
    for a, x, width in zip(L.T @ A @ inverse, inverse.T @ X @ inverse, widths, strict=True):
        nodes, S = chebpts1(len(a) + len(x)), values(u, x)
        R = chebfit(nodes, left_side(nodes, a, x, width).reshape(len(nodes), -1), len(nodes) - 1)
        least, most = (
            min(least, np.linalg.eigvalsh(S).min() - between(x, step)),
            max(most, np.linalg.eigvalsh(S).max() + between(x, step)),
        )
        if not least > 0:
            return False
        added = between(R, step) + mu * between(x, step) + 2 * unknown * most
        worst = max(worst, ratio(left_side(u, a, x, width) + added * np.eye(len(L)), S))
        ends.append((S[0], S[-1]))
    grown = sum(np.log(max(1.0, ratio(ends[i][0], ends[i - 1][1]))) for i in range(len(ends)))
    tolerates = mu / 2 * np.sqrt(least / most) / np.linalg.cond(L)
    return bool(-worst - grown / edges[-1] >= mu and tolerates >= said["tolerates"] > 0)


if __name__ == "__main__":
    with open(sys.argv[1], encoding="utf-8") as file:
        report = json.load(file)
    for name, loop in {"own": report["floquet"], "open": report["open_loop"], **report["designs"]}.items():
        print(name, loop["verdict"], holds(loop["certificate"]) if loop.get("certificate") else "no certificate")
