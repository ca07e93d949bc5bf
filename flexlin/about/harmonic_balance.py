"""Harmonic balance: the nonlinear equations and a closing condition at equally spaced times of a period, by Newton's method."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from flexlin.about.deviation import Deviation
from flexlin.about.law import Law
from flexlin.errors import NumericalError
from flexlin.periodic.fourier import FourierSeries, fourier_differentiation

NEWTON_STEPS = 25


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The symbols that a closing condition is written in.

    y, y_rate (n, 1), torque (m, 1): unknown; offset (m, 1), gain (m, 2n): the law's torque is offset - gain [y; y'];
    s, rigid (arm.n, 1): the coordinates with and without y.
    """

    y: ca.SX
    y_rate: ca.SX
    torque: ca.SX
    offset: ca.SX
    gain: ca.SX
    s: ca.SX
    rigid: ca.SX


Closing = Callable[[Deviation, Unknowns], ca.SX]
"""What determines the torque: m expressions that vanish."""


def by_law(about: Deviation, at: Unknowns) -> ca.SX:
    """The torque is the one that the law commands."""
    return at.torque - at.offset + at.gain @ ca.vertcat(at.y, at.y_rate)


def balance(about: Deviation, closing: Closing) -> ca.Function:
    """All equations F of one time, and their Jacobians by y, y', y'' and torque."""
    arm, kept, driven, n, m = about.arm, list(about.kept), list(about.driven), about.n, about.m
    *moved, angles = about.symbols()
    torque, offset, gain = ca.SX.sym("torque", m), ca.SX.sym("offset", m), ca.SX.sym("gain", m * 2 * n)
    left, B = about.lift([arm.residual, arm.B[:, driven]], angles, *moved)
    y, y_rate, y_acceleration = moved
    s, rigid = about.coordinates(angles, y)[0], about.coordinates(angles)[0]
    at = Unknowns(y, y_rate, torque, offset, ca.reshape(gain, m, 2 * n), s, rigid)
    F = ca.vertcat((left - B @ torque)[kept], closing(about, at))
    outputs = {"F": F} | {
        name: ca.jacobian(F, by) for name, by in (("K", y), ("D", y_rate), ("M", y_acceleration), ("T", torque))
    }
    named = {"y": y, "y1": y_rate, "y2": y_acceleration, "torque": torque, "offset": offset, "gain": gain}
    return about.function(angles, named, outputs)


def solve_at(
    about: Deviation, equations: ca.Function, law: Law, points: int, linear: bool, start: FourierSeries | None
) -> tuple[FourierSeries, FourierSeries]:
    """Solve the equations at N times by Newton's method, from the rigid motion or from a coarser solution."""
    n, m, T = about.n, about.m, about.motion.period
    t = T * np.arange(points) / points
    first = fourier_differentiation(points, T)
    second = first @ first
    given = (law.offset(t), np.swapaxes(law.gain(t), 1, 2).reshape(points, -1))
    z = np.zeros((points, n + m)) if start is None or linear else start(t)
    for _ in range(NEWTON_STEPS):
        y = z[:, :n]
        F, K, D, M, by_torque = about.evaluate(equations, t, y, first @ y, second @ y, z[:, n:], *given)
        J = np.zeros((points, n + m, points, n + m))
        J[:, :, :, :n] = np.einsum("jab,jk->jakb", D, first) + np.einsum("jab,jk->jakb", M, second)
        j = np.arange(points)
        J[j, :, j, :n] += K
        J[j, :, j, n:] += by_torque
        step = np.linalg.solve(J.reshape(z.size, z.size), F.reshape(-1)).reshape(z.shape)
        z = z - step
        if linear or np.abs(step[:, :n]).max() <= 1e-11 * max(np.abs(z[:, :n]).max(), 1e-12):
            return FourierSeries.through(z[:, :n], T), FourierSeries.through(z[:, n:], T)
        if not np.all(np.abs(z) < 1e8):
            break
    raise NumericalError(
        "no periodic motion was found near the rigid one",
        got=f"Newton's method did not settle in {NEWTON_STEPS} steps",
        todo="slow the motion down, lower its amplitude or stiffen the feedback",
    )
