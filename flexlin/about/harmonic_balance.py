"""Harmonic balance: the nonlinear equations and a closing condition at equally spaced times of a period, by Newton's method."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from flexlin.about.deviation import Deviation
from flexlin.about.law import Controller, Law
from flexlin.checks import Array
from flexlin.errors import NumericalError
from flexlin.periodic.fourier import FourierSeries, fourier_differentiation

NEWTON_STEPS = 25


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The symbols that a closing condition is written in.

    y, y_rate (n, 1), torque (m, 1), z (k, 1): unknown; offset (m, 1), gain (m, 2n + k): the law's torque is offset - gain [y; y'; z];
    s, rigid (arm.n, 1): the coordinates with and without y.
    """

    y: ca.SX
    y_rate: ca.SX
    torque: ca.SX
    z: ca.SX
    offset: ca.SX
    gain: ca.SX
    s: ca.SX
    rigid: ca.SX


Closing = Callable[[Deviation, Unknowns], ca.SX]
"""What determines the torque: m expressions that vanish."""


def by_law(about: Deviation, at: Unknowns) -> ca.SX:
    """The torque is the one that the law commands."""
    return at.torque - at.offset + at.gain @ ca.vertcat(at.y, at.y_rate, at.z)


def balance(about: Deviation, closing: Closing, controller: Controller | None = None) -> ca.Function:
    """All equations F of one time but for z', and their Jacobians by y, y', y'' and [torque; z].

    The last k rows are those of a controller: -rates [y; y'; z] - steer, to which z' is added.
    """
    arm, kept, driven, n, m = about.arm, list(about.kept), list(about.driven), about.n, about.m
    k = 0 if controller is None else controller.states
    *moved, angles = about.symbols()
    names = (("torque", m), ("z", k), ("offset", m), ("gain", m * (2 * n + k)), ("steer", k))
    torque, z, offset, gain, steer = (ca.SX.sym(name, size) for name, size in names)
    left, B = about.lift([arm.residual, arm.B[:, driven]], angles, *moved)
    y, y_rate, y_acceleration = moved
    s, rigid = about.coordinates(angles, y)[0], about.coordinates(angles)[0]
    at = Unknowns(y, y_rate, torque, z, offset, ca.reshape(gain, m, 2 * n + k), s, rigid)
    rates = ca.DM(0, 2 * n) if controller is None else ca.DM(controller.rates)
    F = ca.vertcat((left - B @ torque)[kept], closing(about, at), -rates @ ca.vertcat(y, y_rate, z) - steer)
    others = ca.vertcat(torque, z)
    outputs = {"F": F} | {
        name: ca.jacobian(F, by) for name, by in (("K", y), ("D", y_rate), ("M", y_acceleration), ("T", others))
    }
    named = {
        "y": y,
        "y1": y_rate,
        "y2": y_acceleration,
        "others": others,
        "offset": offset,
        "gain": gain,
        "steer": steer,
    }
    return about.function(angles, named, outputs)


def solve_at(
    about: Deviation, equations: ca.Function, law: Law, points: int, linear: bool, start: FourierSeries | None
) -> Array:
    """Solve the equations at N times by Newton's method, from the rigid motion or from a coarser solution: y, torque, z (N, n + m + k)."""
    n, k, T = about.n, law.memory, about.motion.period
    size = n + about.m + k
    t = T * np.arange(points) / points
    first = fourier_differentiation(points, T)
    second = first @ first
    steer = law.steer(law.reference(t))
    given = (law.offset(t), np.swapaxes(law.gain(t), 1, 2).reshape(points, -1), steer)
    z = np.zeros((points, size)) if start is None or linear else start(t)
    for _ in range(NEWTON_STEPS):
        y = z[:, :n]
        F, K, D, M, by_others = about.evaluate(equations, t, y, first @ y, second @ y, z[:, n:], *given)
        F[:, size - k :, 0] += first @ z[:, size - k :]
        J = np.zeros((points, size, points, size))
        J[:, :, :, :n] = np.einsum("jab,jk->jakb", D, first) + np.einsum("jab,jk->jakb", M, second)
        j = np.arange(points)
        J[j, :, j, :n] += K
        J[j, :, j, n:] += by_others
        for i in range(size - k, size):
            J[:, i, :, i] += first
        step = np.linalg.solve(J.reshape(z.size, z.size), F.reshape(-1)).reshape(z.shape)
        z = z - step
        if linear or np.abs(step[:, :n]).max() <= 1e-11 * max(np.abs(z[:, :n]).max(), 1e-12):
            return z
        if not np.all(np.abs(z) < 1e8):
            break
    raise NumericalError(
        "no periodic motion was found near the rigid one",
        got=f"Newton's method did not settle in {NEWTON_STEPS} steps",
        todo="slow the motion down, lower its amplitude or stiffen the feedback",
    )
