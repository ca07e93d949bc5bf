"""How far the linear model is valid: where the second-order terms of the equations reach a stated share of the linear ones."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.checks import Array, positive
from flexlin.control.harmonic_balance import place_on_motion
from flexlin.linearization import Linearization, along_motion
from flexlin.periodic.collocation import gauss_transitions
from flexlin.periodic.grid import edges
from flexlin.periodic.system import PeriodicSystem

SAMPLES = 64


@dataclass(frozen=True)
class Validity:
    """Along the slowest Floquet modes: directions (k, 2n) with a largest deflection of 1 rad or m, and the amplitudes at which the
    second-order terms reach `share` of the linear ones."""

    directions: Array
    amplitudes: Array
    share: float

    @property
    def status(self) -> str:
        """What the smallest amplitude means."""
        return (
            f"deflections below {self.amplitudes.min():.3g} (rad or m) from the basic motion keep the second-order terms "
            f"below {100 * self.share:g} % of the linear ones; beyond that trust the nonlinear simulation"
        )


def linear_range(lin: Linearization, share: float = 0.1, modes: int = 2) -> Validity:
    """Find the amplitude at which the second-order terms reach a share of the linear terms, along the slowest Floquet modes.

        r(s_R + a z) = r(s_R) + a (M z'' + D z' + K z) + a^2/2 r''[z, z] + ...,
        a = share * max |linear terms| / max |r''[z, z] / 2|,   |f|^2 = f' M^-1 f

    z(t) is the motion that starts in the mode's direction; the linear terms M z'', D z', K z are measured one by one since they
    add up to zero along z. The norm weighs forces by the accelerations that they cause, so rad and m may stand side by side.

    Assumes third-order terms are smaller still.

    Parameters: lin: with the loop closed; share in (0, 1]; modes: how many of the slowest.
    Returns: a `Validity`.
    Raises: ArgumentError for a share that is not positive.
    """
    positive("share", share)
    system = lin.periodic_system()
    directions = slowest_modes(system, modes)
    grid = edges(lin.period, lin.breaks, SAMPLES)
    steps = transitions(system, grid)
    function, amplitudes = second_order(lin), []
    for v in directions:
        x = [v]
        for step in steps:
            x.append(step @ x[-1])
        amplitudes.append(share * ratio(lin, system, function, grid, np.array(x)))
    return Validity(directions, np.array(amplitudes), share)


def ratio(lin: Linearization, system: PeriodicSystem, function: ca.Function, t: Array, x: Array) -> float:
    """max |linear terms| / max |second-order terms| along a linear motion x (N, 2n)."""
    n = lin.n
    y, y_rate = x[:, :n], x[:, n:]
    y_acceleration = np.einsum("tij,tj->ti", system.A(t), x)[:, n:]
    second = symbolic.evaluate(function, y, y_rate, y_acceleration, *place_on_motion(lin, t))[0][:, :, 0]
    c = lin.sample(t)
    linear = [np.einsum("tij,tj->ti", a, b) for a, b in ((c.M, y_acceleration), (c.D, y_rate), (c.K, y))]

    def size(force: Array) -> float:
        return float(np.sqrt(np.einsum("ti,ti->t", force, np.linalg.solve(c.M, force[:, :, None])[:, :, 0]).max()))

    return max(size(part) for part in linear) / max(size(0.5 * second), np.finfo(float).tiny)


def slowest_modes(system: PeriodicSystem, modes: int) -> Array:
    """Real directions (k, 2n) of the k slowest Floquet modes at t = 0, each with a largest deflection of 1.

    A complex pair gives its real and its imaginary part.
    """
    Phi = np.eye(system.n)
    for step in transitions(system, edges(system.period, system.breaks, SAMPLES)):
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
    """Transition matrices over the grid's intervals, each cut fine enough for the fastest eigenvalue."""
    fastest = np.abs(np.linalg.eigvals(system.A(grid[:-1]))).max()
    parts = int(np.ceil(np.diff(grid).max() * fastest / 2)) or 1
    fine = np.concatenate(
        [grid[:1], (grid[:-1, None] + np.diff(grid)[:, None] * np.arange(1, parts + 1) / parts).ravel()]
    )
    steps = gauss_transitions(system.A, fine, 6).reshape(len(grid) - 1, parts, system.n, system.n)
    product = steps[:, 0]
    for j in range(1, parts):
        product = steps[:, j] @ product
    return product


def second_order(lin: Linearization) -> ca.Function:
    """r''[z, z] of the residual along the rigid motion, in the directions z, z', z''."""
    arm, kept, E = lin.arm, list(lin.kept), lin.arm.reference
    extra = [ca.SX.sym(name, lin.n) for name in ("y", "y1", "y2")]
    angles, select = ca.SX.sym("angles", 3 * arm.joints), ca.DM.eye(arm.n)[:, kept]
    full = ca.vertcat(arm.s, arm.s_dot, arm.s_ddot)
    direction = ca.vertcat(*[select @ part for part in extra])
    twice = ca.jtimes(ca.jtimes(arm.residual[kept], full, direction), full, direction)
    rigid = ca.densify(ca.vertcat(*[E @ part for part in ca.vertsplit(angles, arm.joints)]))
    value = ca.substitute([twice], [full], [rigid])[0]
    return along_motion(arm, lin.motion, angles, dict(zip(("y", "y1", "y2"), extra, strict=True)), {"second": value})
