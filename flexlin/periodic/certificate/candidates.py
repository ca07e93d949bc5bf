"""Where a certificate's X(t) may come from: the left Floquet modes, the eigenvectors of A(t), a Lyapunov equation."""

from collections.abc import Callable, Iterator

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NumericalError
from flexlin.periodic.certificate.panels import Resolved
from flexlin.periodic.floquet.modes import solve_modes_at_nodes
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.quadratic.riccati import periodic_lyapunov
from flexlin.periodic.system import PeriodicSystem

SHIFT = 0.9
"""Share of the decay that the Lyapunov equation is asked to prove."""
EQUATION_TOL = 1e-7
Candidate = Callable[[Array], Array]
"""Times (N,) -> X (N, n, n)."""


def propose(result: FloquetResult, resolved: Resolved) -> Iterator[tuple[str, Candidate]]:
    """Yield candidates with their names, the cheap ones first; one that cannot be computed is passed over."""
    system = PeriodicSystem(resolved, result.period, breaks=resolved.breaks)
    system.__dict__["resolved"] = resolved
    ways = [("Floquet modes", from_modes), ("Lyapunov equation", from_equation)]
    ways.insert(1 if resolved.breaks else 0, ("eigenvectors of A(t)", from_eigenvectors))  # cheap, but they jump with A
    for name, way in ways:
        try:
            yield name, way(system, result)
        except (NumericalError, np.linalg.LinAlgError):
            continue


def from_modes(system: PeriodicSystem, result: FloquetResult) -> Candidate:
    """X = sum_i q_i q_i^H, of the left Floquet modes: X' + A' X + X A = sum_i 2 Re(lambda_i) q_i q_i^H.

    Between two edges of the modes' panels: the polynomial through the nodes and both edges.
    """
    modes = solve_modes_at_nodes(system, result, quick=True)
    values = (modes.left @ np.swapaxes(modes.left.conj(), -1, -2)).real
    starts = np.flatnonzero(modes.weights == 0.0)
    width = int(starts[1]) if len(starts) > 1 else len(values)
    places = (starts[:, None] + np.arange(width + 1)) % len(values)
    times = np.append(modes.times, modes.period)
    edges = np.append(times[starts], modes.period)
    nodes = (times[starts[0] : starts[0] + width + 1] - edges[0]) / (edges[1] - edges[0])
    weights = 1 / np.array([np.prod(nodes[j] - np.delete(nodes, j)) for j in range(len(nodes))])

    def X(t: Array) -> Array:
        panel = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, len(starts) - 1)
        gap = ((t - edges[panel]) / (edges[panel + 1] - edges[panel]))[:, None] - nodes
        share = weights / np.where(gap == 0, 1e-300, gap)
        share /= share.sum(axis=1, keepdims=True)
        return np.einsum("tk,tkij->tij", share, values[places[panel]])

    return X


def from_eigenvectors(system: PeriodicSystem, result: FloquetResult) -> Candidate:
    """X = V^-H V^-1 with V(t) the eigenvectors of A(t), columns of length one; neither their order nor their phases matter."""

    def X(t: Array) -> Array:
        inverse = np.linalg.inv(np.linalg.eig(system.resolved(t))[1])
        return (np.swapaxes(inverse.conj(), -1, -2) @ inverse).real

    return X


def from_equation(system: PeriodicSystem, result: FloquetResult) -> Candidate:
    """-X' = (A + s)' X + X (A + s) + Q with s just below the decay: X' + A' X + X A = -Q - 2 s X."""
    shift = -SHIFT * float((result.exponents.real + np.where(np.isinf(result.errors), 0, result.errors)).max())
    faster = PeriodicSystem(
        lambda t: system.resolved(t) + shift * np.eye(system.n), system.period, breaks=system.breaks, complete=True
    )
    mean = system.resolved.mean()
    rates = np.sqrt(np.abs(mean).sum(axis=1) / np.maximum(np.abs(mean).sum(axis=0), np.finfo(float).tiny))
    return periodic_lyapunov(faster, np.diag(1 / np.maximum(rates, 1e-8) ** 2), EQUATION_TOL).X
