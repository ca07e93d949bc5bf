"""Where a certificate's X(t) may come from: the left Floquet modes, the eigenvectors of A(t), a Lyapunov equation."""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NumericalError
from flexlin.periodic.certificate.decoupled import weigh_modes
from flexlin.periodic.certificate.panels import MOST, Resolved
from flexlin.periodic.decoupling.waves import interpolated
from flexlin.periodic.floquet.modes import solve_modes_at_nodes
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.quadratic.riccati import periodic_lyapunov
from flexlin.periodic.system import PeriodicSystem

SHIFT = 0.9
"""Share of the decay that the Lyapunov equation is asked to prove."""
EQUATION_TOL = 1e-7
FEW = 48
"""Panels of eigenvectors: more are a sign that they turn too quickly to be followed."""
MANY = 8
"""States of which some eigenvalues of A(t) are expected to meet."""
Candidate = Callable[[Array], Array]
"""Times (N,) -> X (N, n, n)."""
Way = tuple[str, Callable[[PeriodicSystem, FloquetResult], Candidate], int]


def propose(result: FloquetResult, resolved: Resolved) -> Iterator[tuple[str, Callable[[], Candidate], int]]:
    """Yield what computes candidates, with their names and the panels that they are worth, the cheap ones first.

    Eigenvectors turn quickly where eigenvalues of A(t) nearly meet, as among many they do; then the decoupled modes come before.
    """
    system = PeriodicSystem(resolved, result.period, breaks=resolved.breaks)
    system.__dict__["resolved"] = resolved
    ways: list[Way] = [
        ("eigenvectors of A(t)", from_eigenvectors, FEW),
        ("Floquet modes", from_modes, MOST),
        ("Lyapunov equation", from_equation, MOST),
    ]
    if not resolved.breaks:
        if result.decoupled is not None and system.n >= MANY:
            ways = []  # the others follow every oscillation, or turn where eigenvalues meet
        ways.insert(
            0 if system.n >= MANY or result.setting.method == "decoupling" else 1,
            ("decoupled modes", from_decoupled_modes, MOST),
        )
    for name, way, most in ways:
        yield name, partial(way, system, result), most


def from_modes(system: PeriodicSystem, result: FloquetResult) -> Candidate:
    """X = sum_i q_i q_i^H, of the left Floquet modes: X' + A' X + X A = sum_i 2 Re(lambda_i) q_i q_i^H.

    Between two edges of the modes' panels: the polynomial through the nodes and both edges.
    """
    modes = solve_modes_at_nodes(system, result, quick=True)
    with np.errstate(over="ignore", invalid="ignore"):
        values = (modes.left @ np.swapaxes(modes.left.conj(), -1, -2)).real
    if not np.isfinite(values).all():
        raise NumericalError("the Floquet modes part too far to be weighed together")
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


def from_decoupled_modes(system: PeriodicSystem, result: FloquetResult) -> Candidate:
    """X of each group of modes by itself, which asks for no steps of the fast ones."""
    values = weigh_modes(system, find_shift(result), result.decoupled)

    def X(t: Array) -> Array:
        return interpolated(values, system.period, t)

    return X


def from_equation(system: PeriodicSystem, result: FloquetResult) -> Candidate:
    """-X' = (A + s)' X + X (A + s) + Q with s just below the decay: X' + A' X + X A = -Q - 2 s X.

    Raises: NumericalError where the decay is so slow against the fastest mode that the error of X hides it.
    """
    shift, resolved = find_shift(result), system.resolved
    mean = resolved.mean()
    hidden = EQUATION_TOL * float(np.abs(np.linalg.eigvals(mean)).max())
    if shift < hidden:
        raise NumericalError("the loop decays too slowly", got=f"{shift:.3g} 1/s", expected=f"above {hidden:.3g} 1/s")
    edges = resolved.edges[:-1].tolist() if resolved.panels > 1 else ()
    faster = PeriodicSystem(
        lambda t: resolved(t) + shift * np.eye(system.n), system.period, breaks=edges, complete=True
    )
    rates = np.sqrt(np.abs(mean).sum(axis=1) / np.maximum(np.abs(mean).sum(axis=0), np.finfo(float).tiny))
    return periodic_lyapunov(faster, np.diag(1 / np.maximum(rates, 1e-8) ** 2), EQUATION_TOL).X


def find_shift(result: FloquetResult) -> float:
    """What the Lyapunov equation is asked to prove, in 1/s."""
    return -SHIFT * float((result.exponents.real + np.where(np.isinf(result.errors), 0, result.errors)).max())
