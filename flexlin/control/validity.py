"""How far the linear model is valid: where the nonlinear terms of the equations reach a stated share of the linear ones."""

from dataclasses import dataclass

import numpy as np

from flexlin import symbolic
from flexlin.about.linear import Linearization
from flexlin.about.periodic_motion import own_gain
from flexlin.checks import Array, positive
from flexlin.periodic.grid import place_edges
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.gauss import gauss_transitions, second_order_transitions

SAMPLES = 64
LARGEST, SMALLEST, HALVINGS = 10.0, 1e-7, 30
"""Amplitudes between which the border is sought, in rad or m, and the steps of the search."""


@dataclass(frozen=True)
class Validity:
    """Along the slowest Floquet modes: directions (k, 2n) with a largest deflection of 1 rad or m, and the amplitudes at which the
    nonlinear terms reach `share` of the linear ones (inf where they never do)."""

    directions: Array
    amplitudes: Array
    share: float

    @property
    def status(self) -> str:
        """What the smallest amplitude means."""
        smallest, percent = self.amplitudes.min(), f"{100 * self.share:g} % of the linear ones"
        if not np.isfinite(smallest):
            return f"along the slowest modes the nonlinear terms stay below {percent} however large the deflection"
        return (
            f"deflections below {smallest:.3g} (rad or m) along the slowest modes keep the nonlinear terms below {percent}; "
            "beyond that trust the nonlinear simulation"
        )


def linear_range(lin: Linearization, share: float = 0.1, modes: int = 2) -> Validity:
    """Find the amplitude at which the nonlinear terms reach a share of the linear terms, along the slowest Floquet modes.

        r(s_R + a z) = r(s_R) + a (M z'' + D z' + K z) + R(a),   max over t of |R(a)| / (a max(|M z''|, |D z'|, |K z|)) = share

    z(t) is the motion that starts in the mode's direction; the linear terms are measured one by one, since along z they balance
    the feedback. |f|^2 = f' M^-1 f weighs forces by the accelerations that they cause, so rad and m may stand side by side.
    R holds all orders; for a small share it is the second-order term, a^2/2 r''[z, z].

    Parameters: lin: with the loop closed; share in (0, 1]; modes: how many of the slowest.
    Returns: a `Validity`.
    Raises: ArgumentError for a share that is not positive.
    """
    positive("share", share)
    system = lin.periodic_system()
    t = place_edges(lin.period, lin.breaks, SAMPLES)
    steps, amplitudes = transitions(system, t), []
    directions = slowest_modes(system, modes, steps)
    for v in directions:
        x = [v]
        for step in steps:
            x.append(step @ x[-1])
        amplitudes.append(border(lin, system, t, np.array(x), share))
    return Validity(directions, np.array(amplitudes), share)


def border(lin: Linearization, system: PeriodicSystem, t: Array, x: Array, share: float) -> float:
    """The amplitude of a linear motion x (N, 2n) at which the nonlinear share is reached."""
    n, c = lin.n, lin.sample(t)
    motion = [x[:, :n], x[:, n:], np.einsum("tij,tj->ti", system.A(t), x)[:, n:]]
    loop = c.B @ own_gain(lin)
    parts = [
        np.einsum("tij,tj->ti", matrix, z)
        for matrix, z in zip((c.K - loop[:, :, :n], c.D - loop[:, :, n:], c.M), motion, strict=True)
    ]
    linear = np.max([size(c.M, part) for part in parts], axis=0)
    rest = residual(lin, t, [0.0 * z for z in motion])

    def reached(a: float) -> bool:
        left = residual(lin, t, [a * z for z in motion]) - rest - a * sum(parts)
        return bool(np.any(size(c.M, left) > share * a * linear))

    if not reached(LARGEST):
        return np.inf
    low, high = np.log(SMALLEST), np.log(LARGEST)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if reached(float(np.exp(middle))) else (middle, high)
    return float(np.exp(low))


def size(M: Array, force: Array) -> Array:
    """sqrt(f' M^-1 f) at each time."""
    return np.sqrt(np.einsum("ti,ti->t", force, np.linalg.solve(M, force[:, :, None])[:, :, 0]))


def residual(lin: Linearization, t: Array, motion: list[Array]) -> Array:
    """The left side of the equations of motion, kept rows, at deviations y, y', y'' from the rigid motion."""
    E, kept = lin.arm.reference.full(), list(lin.kept)
    s = [part @ E.T for part in lin.motion.sample(t)]
    for part, extra in zip(s, motion, strict=True):
        part[:, kept] += extra
    p = np.broadcast_to(lin.arm.parameters.values, (len(t), len(lin.arm.parameters.values)))
    return symbolic.evaluate(lin.arm.functions["residual"], *s, p)[0][:, kept, 0]


def slowest_modes(system: PeriodicSystem, modes: int, steps: Array | None = None) -> Array:
    """Real directions (k, 2n) of the k slowest Floquet modes at t = 0, each with a largest deflection of 1.

    A complex pair gives its real and its imaginary part. Parameters: steps: transition matrices of one period, if known.
    """
    Phi = np.eye(system.n)
    for step in transitions(system, place_edges(system.period, system.breaks, SAMPLES)) if steps is None else steps:
        Phi = step @ Phi
    values, vectors = np.linalg.eig(Phi)
    order = np.argsort(-np.abs(values), kind="stable")
    found: list[Array] = []
    for k in order:
        if values[k].imag >= 0:
            found += [vectors[:, k].real] if values[k].imag == 0 else [vectors[:, k].real, vectors[:, k].imag]
    chosen = np.array(found[: max(1, modes)])
    return chosen / np.abs(chosen[:, : system.n // 2]).max(axis=1, keepdims=True)


def transitions(system: PeriodicSystem, grid: Array) -> Array:
    """Transition matrices over the grid's intervals, good to a few digits for the slow modes, which is all that is asked of them.

    Steps of ten time constants of the fastest eigenvalue still damp it: the four-stage Gauss method shrinks it by 0.3 a step.
    """
    fastest = np.abs(np.linalg.eigvals(system.A(grid[:-1]))).max()
    parts = max(1, int(np.ceil(np.diff(grid).max() * fastest / 10)))
    inner = grid[:-1, None] + np.diff(grid)[:, None] * np.arange(1, parts + 1) / parts
    fine, stages = np.append(grid[0], inner), 4
    if system.second_order is not None:
        steps = second_order_transitions(system.second_order, fine, stages)
    else:
        steps = gauss_transitions(system.A, fine, stages)
    steps = steps.reshape(len(grid) - 1, parts, system.n, system.n)
    product = steps[:, 0]
    for j in range(1, parts):
        product = steps[:, j] @ product
    return product
