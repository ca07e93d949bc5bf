"""Closed linkages in space in closed form, and their accelerations by multipliers: no code of flexlin.

A uniform rod with ends a, b has the kinetic energy m/6 (a'.a' + a'.b' + b'.b') and the potential energy of m/2 at each end.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from flexlin.checks import Array

GRAVITY = 9.81


@dataclass(frozen=True)
class Arms:
    """Bars that turn about fixed axes: bases (k, 3), directions at zero (k, 3), axes (k, 3), lengths (k,), masses (k,)."""

    bases: Array
    along: Array
    axes: Array
    lengths: Array
    masses: Array

    def ends(self, q: Array) -> Array:
        """Their ends (k, 3)."""
        turned = Rotation.from_rotvec(self.axes * q[:, None]).apply(self.along)
        return self.bases + self.lengths[:, None] * turned

    def slopes(self, q: Array) -> tuple[Array, Array]:
        """First and second derivative of each end by its own angle, (k, 3) each."""
        arm = self.ends(q) - self.bases
        first = np.cross(self.axes, arm)
        return first, np.cross(self.axes, first)


def rssr_angles(arms: Arms, coupler: float, crank: float) -> Array:
    """Both rocker angles for a crank angle, by |a - b| = l; nan out of reach.

    With b = b0 + r (n cos phi + (e x n) sin phi): A cos phi + B sin phi = C. Source: Hartenberg, Denavit (1964), chapter 12.
    """
    a = arms.ends(np.array([crank, 0.0]))[0]
    n, across, r = arms.along[1], np.cross(arms.axes[1], arms.along[1]), arms.lengths[1]
    d = arms.bases[1] - a
    A, B, C = 2 * r * d @ n, 2 * r * d @ across, coupler**2 - d @ d - r**2
    with np.errstate(invalid="ignore"):
        return np.arctan2(B, A) + np.array([1.0, -1.0]) * np.arccos(C / np.hypot(A, B))


def joined_accelerations(
    arms: Arms, rods: list[tuple[Any, Any, float, float]], body: float, state: Any, torque: Array
) -> Array:
    """Accelerations of [q; x] with rods of given length and mass between arms' ends and points of a body that only shifts.

    rods: (arm, other, length, mass), where `other` is another arm or the place (3,) of a ball joint on the body; body: its mass;
    state: q, q', x, x'. Index-reduced: M s'' - J^T lambda = F, J s'' = -J' s'.
    """
    q, rate, x, speed = state
    k, n = len(q), len(q) + len(x)
    first, second = arms.slopes(q)
    inertia = arms.masses * arms.lengths**2 / 3
    M = np.diag([*inertia, *[body] * len(x)])
    F = np.zeros(n)
    F[:k] = torque - arms.masses / 2 * GRAVITY * first[:, 2]
    F[k:] = -body * GRAVITY * np.array([0.0, 0.0, 1.0])[: len(x)]
    J, bend = np.zeros((len(rods), n)), np.zeros(len(rods))

    def end(which: Any) -> tuple[Array, Array, Array, Array]:
        """Place, Jacobian (3, n), velocity and the part of the acceleration that no s'' makes."""
        D = np.zeros((3, n))
        if isinstance(which, int):
            D[:, which] = first[which]
            return arms.ends(q)[which], D, first[which] * rate[which], second[which] * rate[which] ** 2
        D[:, k:] = np.eye(3)
        return x + which, D, speed, np.zeros(3)

    for i, (one, other, _, mass) in enumerate(rods):
        (a, Da, va, ca), (b, Db, vb, cb) = end(one), end(other)
        M += mass / 6 * (2 * Da.T @ Da + Da.T @ Db + Db.T @ Da + 2 * Db.T @ Db)
        F -= mass / 6 * (Da.T @ (2 * ca + cb) + Db.T @ (ca + 2 * cb))
        F -= mass / 2 * GRAVITY * (Da[2] + Db[2])
        J[i] = (a - b) @ (Da - Db)
        bend[i] = (a - b) @ (ca - cb) + (va - vb) @ (va - vb)
    saddle = np.block([[M, -J.T], [J, np.zeros((len(rods), len(rods)))]])
    return np.linalg.solve(saddle, np.concatenate([F, -bend]))[:n]
