"""Harmonic balance: the nonlinear equations and a closing condition at equally spaced times of a period, by Newton's method."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from flexlin.checks import Array
from flexlin.errors import NumericalError
from flexlin.lazy import lazy
from flexlin.linearization.deviation import Deviation
from flexlin.linearization.law import Controller, Law
from flexlin.linearization.layers import LAYER_ARGUMENT, Layers
from flexlin.mechanics.beam.integrals import panels
from flexlin.periodic.coefficient_series.sampling import graded
from flexlin.periodic.interpolation import FourierSeries, circle_derivative, fourier_basis, fourier_nodes, place_edges
from flexlin.precision import FAINT, MINOR

NEWTON_STEPS = 25
SMALL_DEVIATION = 1e-6
"""Deviations below this, in rad or m, count as that large: those of a rigid arm are rounding. A step this small against |y| ends Newton's
method where steps shrink no further."""


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

    The last k rows are those of a controller: -rates [y; y'; z] - steer, to which z' is added. `speed`: the motion is passed through so
    many times as fast; only exact closings, which leave the torque open, mean anything at another speed than 1.
    """
    arm, kept, driven, n, m = about.arm, list(about.kept), list(about.driven), about.n, about.m
    k = 0 if controller is None else controller.states
    y, y_rate, y_acceleration, angles = about.symbols()
    torque, z = ca.SX.sym("torque", m), ca.SX.sym("z", k)
    sizes = {"offset": m, "gain": m * (2 * n + k), "steer": k, "speed": 1}
    given = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
    offset, gain, steer, speed = given.values()
    q, rate, acceleration = ca.vertsplit(angles, arm.joints)
    there, moved = ca.vertcat(q, speed * rate, speed**2 * acceleration), (y, speed * y_rate, speed**2 * y_acceleration)
    left, B = about.lift([arm.residual, arm.B[:, driven]], there, *moved)
    s, rigid = about.coordinates(there, y)[0], about.coordinates(there)[0]
    at = Unknowns(y, moved[1], torque, z, offset, ca.reshape(gain, m, 2 * n + k), s, rigid)
    rates = ca.DM(0, 2 * n) if controller is None else ca.DM(controller.rates)
    F = ca.vertcat((left - B @ torque)[kept], closing(about, at), -rates @ ca.vertcat(y, moved[1], z) - steer)
    others = ca.vertcat(torque, z)
    outputs = {"F": F} | {
        name: ca.jacobian(F, by) for name, by in (("K", y), ("D", y_rate), ("M", y_acceleration), ("T", others))
    }
    named = {"y": y, "y1": y_rate, "y2": y_acceleration, "others": others, **given}
    return about.function(angles, named, outputs)


@dataclass(frozen=True, eq=False)
class Solver:
    """Newton's method for the equations of `balance` at N equally spaced times; unknown are z = [y, torque, z] (N, n + m + k)."""

    about: Deviation
    equations: ca.Function
    law: Law
    points: int

    @property
    def size(self) -> int:
        """The number n + m + k of unknowns at one time."""
        return self.about.n + self.about.m + self.law.memory

    @lazy
    def given(self) -> tuple[Array, Array, Array, Array]:
        """The times; offset, gain and steer of the law there."""
        t = self.about.motion.period * np.arange(self.points) / self.points
        return t, *self.law_at(t)

    def law_at(self, t: Array) -> tuple[Array, Array, Array]:
        """Offset, gain and steer of the law at any times."""
        gain = np.swapaxes(self.law.gain(t), 1, 2).reshape(len(t), -1)
        return self.law.offset(t), gain, self.law.steer(self.law.reference(t))

    @lazy
    def derivatives(self) -> tuple[Array, Array]:
        """The matrices (N, N) of the first and second derivative."""
        first = circle_derivative(np.eye(self.points), self.about.motion.period)
        return first, first @ first

    def evaluate(self, z: Array, speed: float) -> tuple[Array, ...]:
        """F, and its Jacobians K, D, M and by [torque; z], at each time."""
        n, (first, second), (t, *law) = self.about.n, self.derivatives, self.given
        motion = z[:, :n], first @ z[:, :n], second @ z[:, :n], z[:, n:]
        return self.about.evaluate(self.equations, t, *motion, *law, np.full((len(t), 1), speed))

    def left(self, t: Array, series: FourierSeries) -> Array:
        """F (N, n + m + k) but for z' of a motion [y, torque, z] at any times t (N,)."""
        n, (values, first, second) = self.about.n, (series(t, order) for order in range(3))
        motion = values[:, :n], first[:, :n], second[:, :n], values[:, n:]
        return self.about.evaluate(self.equations, t, *motion, *self.law_at(t), np.ones((len(t), 1)))[0][:, :, 0]

    def residual(self, z: Array, speed: float) -> tuple[Array, Array]:
        """F (N, n + m + k) and its Jacobian, square."""
        n, size, k, (first, second) = self.about.n, self.size, self.law.memory, self.derivatives
        F, K, D, M, by_others = self.evaluate(z, speed)
        j = np.arange(self.points)
        F[:, size - k :, 0] += first @ z[:, size - k :]
        J = np.zeros((self.points, size, self.points, size))
        J[:, :, :, :n] = np.einsum("jab,jk->jakb", D, first) + np.einsum("jab,jk->jakb", M, second)
        J[j, :, j, :n] += K
        J[j, :, j, n:] += by_others
        for i in range(size - k, size):
            J[:, i, :, i] += first
        return F[:, :, 0], J.reshape(z.size, z.size)

    def solve(self, start: Array | None, speed: float = 1.0) -> tuple[Array, float] | None:
        """The solution from a start, or from the rigid motion, and the last step relative to |y|; None where it does not settle.

        It has settled too where steps shrink no further and are as small as rounding in the derivatives makes them. From a known solution
        nearby, a step much larger than the smallest so far leads away.
        """
        n, z, last = self.about.n, np.zeros((self.points, self.size)) if start is None else start, np.inf
        best = np.inf
        for _ in range(NEWTON_STEPS):
            try:
                z, moved = self.step(z, speed)
            except NumericalError:
                return None
            share = moved / size_of(z[:, :n])
            if share <= FAINT or (share <= SMALL_DEVIATION and share >= 0.5 * last):
                return z, share
            if not np.all(np.abs(z) < 1e8) or (start is not None and best < MINOR * share):
                return None
            last, best = share, min(best, share)
        return None

    def step(self, z: Array, speed: float = 1.0) -> tuple[Array, float]:
        """One step of Newton's method, and how far it moves y. Raises: NumericalError where the Jacobian is singular."""
        F, J = self.residual(z, speed)
        try:
            step = np.linalg.solve(J, F.reshape(-1)).reshape(z.shape)
        except np.linalg.LinAlgError as error:
            raise lost("the linear equations are singular: some coordinate is held by nothing") from error
        return z - step, float(np.abs(step[:, : self.about.n]).max())

    def singular_time(self, z: Array) -> float | None:
        """Where an exact closing c(y) = 0 leaves accelerations and torque undetermined: the determinant below changes its sign there.

        [[M, -B], [dc/dy, 0]] [y''; torque] = ...
        """
        n, size = self.about.n, self.size
        _, K, _, M, by_others = self.evaluate(z, 1.0)
        leading = np.zeros((self.points, size, size))
        leading[:, :n, :n], leading[:, n:, :n], leading[:, :n, n:] = M[:, :n], K[:, n:], by_others[:, :n]
        sign = np.linalg.slogdet(leading)[0]
        changed = np.flatnonzero(sign != sign[0])
        return float(self.given[0][changed[0]]) if len(changed) else None


def size_of(y: Array) -> float:
    """What errors of a deviation (N, n) are relative to, and steps towards it."""
    return max(float(np.abs(y).max()), SMALL_DEVIATION)


def lost(got: str, todo: str = "slow the motion down, lower its amplitude or stiffen the feedback") -> NumericalError:
    """What to say where no periodic motion is found."""
    return NumericalError("no periodic motion was found near the rigid one", got=got, todo=todo)


PANELS, FINER_SAMPLES = 64, 16
"""Panels of a period; Gauss nodes in each, and samples for each point among which passages are looked for."""


def find_passages(layers: Layers, y: FourierSeries, points: int) -> Array:
    """Edges about the times at which an argument goes through zero or comes near it, graded from the time it takes there."""
    T = y.period
    t = T * np.arange(-1, points * FINER_SAMPLES + 1) / (points * FINER_SAMPLES)
    values = layers.arguments(t, y(t), y(t, 1))
    edges = [np.empty(0)]
    for one in values.T:
        size, moved = np.abs(one), np.abs(np.diff(one))
        fastest = np.maximum(moved[1:], moved[:-1])
        low = (size[1:-1] <= size[:-2]) & (size[1:-1] < size[2:]) & (fastest > 0)
        low &= size[1:-1] - fastest < LAYER_ARGUMENT
        for i in np.flatnonzero(low) + 1:
            slope = (one[i + 1] - one[i - 1]) / (t[i + 1] - t[i - 1])
            crosses = one[i + 1] * one[i - 1] < 0
            width = (t[1] - t[0]) / fastest[i - 1]
            edges.append(graded([t[i] - one[i] / slope if crosses else t[i]], min(width, T / 8), T / 8, np.pi))
    return np.mod(np.concatenate(edges), T)


def passes_unseen(layers: Layers, motion: FourierSeries, points: int) -> bool:
    """Whether a motion [y, ...] passes through a layer in less time than lies between so many points."""
    t, n = motion.period * np.arange(points + 1) / points, layers.about.n
    return bool(layers.hurry(t[None], motion(t)[None, :, :n], motion(t, 1)[None, :, :n])[0] > 1)


def miss_between(solver: Solver, layers: Layers, values: Array) -> float:
    """How far y moves, to first order and relative to its size, when the equations hold for their Fourier coefficients instead.

    F between the points, with every passage resolved, onto the polynomials of N terms by quadrature; the Jacobian is that of the points.
    Parameters: values: the solution (N, n + m + k).
    """
    n, N, k, T = solver.about.n, solver.points, solver.law.memory, solver.about.motion.period
    series = FourierSeries.through(values, T)
    edges = place_edges(T, find_passages(layers, FourierSeries.through(values[:, :n], T), N), PANELS)
    t, weights = panels(edges, FINER_SAMPLES)
    left = solver.left(t, series)
    left[:, left.shape[1] - k :] += series(t, 1)[:, left.shape[1] - k :]
    onto = 2 * fourier_basis(t / T, N // 2).T @ (weights[:, None] * left) / T
    onto[0] /= 2
    projected = FourierSeries(onto, T)(fourier_nodes(N, T))
    jacobian = solver.residual(values, 1.0)[1]
    moved = np.linalg.solve(jacobian, projected.ravel()).reshape(values.shape)[:, :n]
    return float(np.abs(moved).max() / size_of(values[:, :n]))
