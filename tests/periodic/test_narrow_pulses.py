"""Narrow pulses in A(t) and in a force, named or not: no answer steps over one. The truth integrates through them piece by piece.

Their standard deviations lie between T/400 and T/18,000, their places anywhere.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import schur

import flexlin as fl
from flexlin import periodic_lyapunov
from flexlin.control import kalman_filter, output_feedback, periodic_lqr, sampled_floquet
from flexlin.lazy import lazy
from flexlin.periodic import finite_horizon_riccati, periodic_riccati

SIGMAS = np.array([-8.0, -4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0, 8.0])
"""Standard deviations about a pulse between which the truth is integrated piece by piece."""


@dataclass(frozen=True, eq=False)
class Pulsed:
    """A stable oscillator in mixed coordinates whose stiffness has one Gaussian pulse a period, and a force with another."""

    period: float
    place: float
    width: float
    area: float
    mixing: np.ndarray

    @classmethod
    def draw(cls, seed: int) -> "Pulsed":
        rng = np.random.default_rng([seed, 20_260])
        T = rng.uniform(0.5, 4.0)
        width = T * np.exp(rng.uniform(np.log(1 / 9000), np.log(1 / 200))) / 2
        mixing = np.eye(2) + 0.4 * rng.standard_normal((2, 2))
        return cls(T, rng.uniform(0.0, T), width, rng.uniform(-1.0, 1.0), mixing)

    def pulse(self, t: np.ndarray) -> np.ndarray:
        distance = np.mod(t - self.place + self.period / 2, self.period) - self.period / 2
        return np.exp(-0.5 * (distance / self.width) ** 2) / (self.width * np.sqrt(2 * np.pi))

    def A(self, t: np.ndarray) -> np.ndarray:
        plain = np.zeros((len(t), 2, 2))
        plain[:, 0, 1], plain[:, 1, 1] = 1.0, -0.9
        plain[:, 1, 0] = -3.0 - 0.5 * np.sin(2 * np.pi * t / self.period) - self.area * self.pulse(t)
        return self.mixing @ plain @ np.linalg.inv(self.mixing)

    def force(self, t: np.ndarray) -> np.ndarray:
        return np.stack([np.cos(2 * np.pi * t / self.period), self.pulse(t)], axis=1)

    @property
    def B(self) -> np.ndarray:
        return self.mixing @ np.array([[0.0], [1.0]])

    def system(self, named: bool) -> fl.PeriodicSystem:
        features = [(self.place, self.width)] if named else ()
        return fl.PeriodicSystem(self.A, self.period, B=self.B, features=features, complete=named)

    @lazy
    def pieces(self) -> np.ndarray:
        """Edges from 0 to T with the pulse between its own."""
        about = (self.place + self.width * SIGMAS[:, None] + self.period * np.array([-1.0, 0.0, 1.0])).ravel()
        inside = about[(about > 0) & (about < self.period)]
        return np.unique([0.0, *np.linspace(0, self.period, 9)[1:-1], *inside, self.period])

    def integrate(self, rate, start: np.ndarray, begin: float = 0.0, end: float | None = None) -> np.ndarray:
        """Integrate from begin to end (to T), piece by piece, forward or backward."""
        end = self.period if end is None else end
        low, high = min(begin, end), max(begin, end)
        edges = np.array([low, *self.pieces[(self.pieces > low) & (self.pieces < high)], high])
        y = np.asarray(start, dtype=float)
        for a, b in pairwise(edges if begin < end else edges[::-1]):
            y = solve_ivp(rate, (a, b), y.ravel(), "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        return y

    def cost(self, X: np.ndarray, effort: float) -> np.ndarray:
        """X(0) from X(T) by the Riccati equation with unit weights, or effort times its quadratic term."""
        S = effort * self.B @ self.B.T

        def rate(t: float, x: np.ndarray) -> np.ndarray:
            x, A = x.reshape(2, 2), self.A(np.array([t]))[0]
            return -(A.T @ x + x @ A + np.eye(2) - x @ S @ x).ravel()

        return self.integrate(rate, X, self.period, 0.0).reshape(2, 2)

    def periodic_cost(self, effort: float) -> np.ndarray:
        """X(0) = X(T) from the decaying half of the Hamiltonian's monodromy matrix."""
        S = effort * self.B @ self.B.T

        def rate(t: float, x: np.ndarray) -> np.ndarray:
            A = self.A(np.array([t]))[0]
            return (np.block([[A, -S], [-np.eye(2), -A.T]]) @ x.reshape(4, 4)).ravel()

        monodromy = self.integrate(rate, np.eye(4)).reshape(4, 4)
        _, vectors, _ = schur(monodromy, sort=lambda re, im=0.0: abs(complex(re, im)) < 1)
        return vectors[2:, :2] @ np.linalg.inv(vectors[:2, :2])

    def from_circle(self, level: float) -> float:
        """The least | |multiplier| - 1 | of [[A, B B'/g], [-C'C/g, -A']], C = [1, 0]."""
        lower, upper = np.diag([-1.0 / level, 0.0]), self.B @ self.B.T / level

        def rate(t: float, x: np.ndarray) -> np.ndarray:
            A = self.A(np.array([t]))[0]
            return (np.block([[A, upper], [lower, -A.T]]) @ x.reshape(4, 4)).ravel()

        multipliers = np.linalg.eigvals(self.integrate(rate, np.eye(4)).reshape(4, 4))
        return float(np.abs(np.abs(multipliers) - 1).min())

    def mean_output(self) -> float:
        """The H2 norm for the first state as output, from the covariance P: P' = A P + P A' + B B'."""

        def rate(t: float, x: np.ndarray) -> np.ndarray:
            P, A = x[:4].reshape(2, 2), self.A(np.array([t]))[0]
            return np.append((A @ P + P @ A.T + self.B @ self.B.T).ravel(), P[0, 0])

        columns = [self.integrate(rate, np.append(unit, 0.0)) for unit in np.vstack([np.zeros(4), np.eye(4)])]
        maps = np.array([column - columns[0] for column in columns[1:]]).T
        P = np.linalg.solve(np.eye(4) - maps[:4], columns[0][:4])
        return float(np.sqrt((columns[0][4] + maps[4] @ P) / self.period))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_costs_and_norms_see_every_pulse(seed):
    pulsed = Pulsed.draw(seed)
    costs = {effort: pulsed.periodic_cost(effort) for effort in (1.0, 0.0)}
    last = pulsed.cost(np.diag([1.0, 2.0]), 1.0)
    size = pulsed.mean_output()
    for system in (pulsed.system(named=True), pulsed.system(named=False)):
        solved = (
            (periodic_riccati(system, np.eye(2), np.eye(1)), costs[1.0]),
            (periodic_lyapunov(system, np.eye(2)), costs[0.0]),
            (finite_horizon_riccati(system, np.eye(2), np.eye(1), np.diag([1.0, 2.0])), last),
        )
        for found, truth in solved:
            assert np.abs(found.X(0.0) - truth).max() <= found.error * np.abs(truth).max() + 1e-9
            assert found.error < 1e-8
        norm = fl.h2_norm(system, [[1.0, 0.0]])
        assert abs(norm.value - size) <= norm.error + 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_the_forced_response_sees_every_pulse(seed):
    pulsed = Pulsed.draw(seed)

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        at = np.array([t])
        return pulsed.A(at)[0] @ x + pulsed.force(at)[0]

    free = pulsed.integrate(rate, np.zeros(2))
    maps = np.array([pulsed.integrate(rate, unit) - free for unit in np.eye(2)]).T
    truth = np.linalg.solve(np.eye(2) - maps, free)
    for system in (pulsed.system(named=True), pulsed.system(named=False)):
        found = fl.forced_response(system, pulsed.force)
        assert np.abs(found(0.0) - truth).max() <= found.error + 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("named", [True, False])
def test_a_loop_through_an_estimator_sees_every_pulse(named):
    """It has the exponents of the design's loop and of the estimator's own."""
    pulsed = Pulsed.draw(35 if named else 30)
    system, C = pulsed.system(named), np.array([[1.0, 0.0]])
    design = periodic_lqr(system, np.eye(2), np.eye(1))
    estimator = kalman_filter(system, C, np.eye(2), np.eye(1))
    both = fl.floquet(output_feedback(design, estimator)).exponents.real
    apart = [decay_of(pulsed, lambda t: pulsed.B @ design.K(t)), decay_of(pulsed, lambda t: estimator.L(t) @ C)]
    assert np.abs(np.sort(both) - np.sort(np.concatenate(apart))).max() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("named", [True, False])
def test_the_h_infinity_norm_sees_every_pulse(named):
    """Just above the norm no multiplier of the bounded-real Hamiltonian lies on the unit circle, just below two do."""
    pulsed = Pulsed.draw(35 if named else 30)
    norm = fl.hinf_norm(pulsed.system(named), [[1.0, 0.0]], tol=1e-6)
    distance = [pulsed.from_circle(norm.value * (1 + shift)) for shift in (-1e-3, 1e-3)]
    assert distance[0] < 1e-7 < distance[1]


@pytest.mark.slow
@pytest.mark.parametrize("named", [True, False])
def test_a_sampled_loop_sees_every_pulse(named):
    """Three samples a period: x_(k+1) = (Phi_k - Gamma_k K) x_k, the product's multipliers by integration of [x; u]."""
    pulsed, K = Pulsed.draw(35 if named else 30), np.array([[0.4, 0.3]])

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        z = z.reshape(3, 3)
        return np.vstack([pulsed.A(np.array([t]))[0] @ z[:2] + pulsed.B @ z[2:], np.zeros((1, 3))]).ravel()

    product = np.eye(2)
    for k in range(3):
        step = pulsed.integrate(rate, np.eye(3), k * pulsed.period / 3, (k + 1) * pulsed.period / 3).reshape(3, 3)
        product = (step[:2, :2] - step[:2, 2:] @ K) @ product
    truth = np.log(np.abs(np.linalg.eigvals(product))) / pulsed.period
    found = sampled_floquet(pulsed.system(named), K, pulsed.period / 3)
    assert np.abs(np.sort(found.exponents.real)[-2:] - np.sort(truth)).max() <= found.errors.max() + 1e-9


def decay_of(pulsed: Pulsed, taken) -> np.ndarray:
    """Real parts of the exponents of x' = (A - taken) x."""

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        at = np.array([t])
        return ((pulsed.A(at)[0] - taken(at)[0]) @ x.reshape(2, 2)).ravel()

    multipliers = np.linalg.eigvals(pulsed.integrate(rate, np.eye(2)).reshape(2, 2))
    return np.log(np.abs(multipliers)) / pulsed.period


@pytest.mark.slow
@pytest.mark.parametrize("named", [True, False])
def test_hills_matrix_sees_every_pulse(named):
    system = Pulsed.draw(35 if named else 30).system(named)
    found, truth = fl.floquet(system, method="hill"), fl.floquet(system)
    pairs = (one.exponents[np.argsort(one.exponents.imag)] for one in (found, truth))
    apart = np.abs(np.subtract(*pairs))
    assert np.all(apart <= found.errors)
    assert found.errors.max() > 1e-9
