"""Narrow pulses in A(t), in B(t), gains, weights and forces, named or not: no answer steps over one.

The truth integrates through those of A(t) piece by piece; their standard deviations lie between T/400 and T/18,000, their places anywhere.
What changes fast beside a constant A has closed forms of one state.
"""

import numpy as np
import pytest
from scipy.linalg import schur

import flexlin as fl
from flexlin import periodic_lyapunov
from flexlin.control import kalman_filter, output_feedback, periodic_lqr, sampled_floquet
from flexlin.periodic import finite_horizon_riccati, periodic_riccati
from tests.periodic.coefficient_series.functions import scalar
from tests.periodic.dense import at, transition
from tests.periodic.systems import oscillator

SIGMAS = np.array([-8.0, -4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0, 8.0])
"""Standard deviations about a pulse between which the truth is integrated piece by piece."""


class Pulsed:
    """A stable oscillator in mixed coordinates whose stiffness has one Gaussian pulse a period, and a force with another."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng([seed, 20_260])
        self.period = T = rng.uniform(0.5, 4.0)
        self.width = T * np.exp(rng.uniform(np.log(1 / 9000), np.log(1 / 200))) / 2
        self.mixing = np.eye(2) + 0.4 * rng.standard_normal((2, 2))
        self.place, self.area = rng.uniform(0.0, T), rng.uniform(-1.0, 1.0)
        self.B = self.mixing @ np.array([[0.0], [1.0]])

    def pulse(self, t: np.ndarray) -> np.ndarray:
        distance = np.mod(t - self.place + self.period / 2, self.period) - self.period / 2
        return np.exp(-0.5 * (distance / self.width) ** 2) / (self.width * np.sqrt(2 * np.pi))

    def A(self, t: np.ndarray) -> np.ndarray:
        stiffness = 3.0 + 0.5 * np.sin(2 * np.pi * t / self.period) + self.area * self.pulse(t)
        return self.mixing @ oscillator(stiffness, 0.9) @ np.linalg.inv(self.mixing)

    def force(self, t: np.ndarray) -> np.ndarray:
        return np.stack([np.cos(2 * np.pi * t / self.period), self.pulse(t)], axis=1)

    def system(self, named: bool) -> fl.PeriodicSystem:
        features = [(self.place, self.width)] if named else ()
        return fl.PeriodicSystem(self.A, self.period, B=self.B, features=features, complete=named)

    def stops(self, begin: float = 0.0, end: float | None = None) -> np.ndarray:
        """Times from begin to end (to T) with the pulse between its own."""
        end = self.period if end is None else end
        about = (self.place + self.width * SIGMAS[:, None] + self.period * np.array([-1.0, 0.0, 1.0])).ravel()
        return np.unique([begin, *about[(about > begin) & (about < end)], end])

    def flow(self, matrix, n: int, *span: float, kind=float) -> np.ndarray:
        """The transition matrix of x' = matrix(A(t), t) x over a span of time, or the period."""
        return transition(lambda t: matrix(at(self.A, t), t), np.eye(n, dtype=kind), self.stops(*span), atol=1e-14)

    def costs(self, effort: float, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """X(0) = X(T), and X(0) from X(T) = end, with unit weights and effort times the quadratic term, by the Hamiltonian's flow."""
        S = effort * self.B @ self.B.T
        F = self.flow(lambda A, _: np.block([[A, -S], [-np.eye(2), -A.T]]), 4)
        _, vectors, _ = schur(F, sort=lambda re, im=0.0: abs(complex(re, im)) < 1)
        from_end = np.linalg.solve(F[2:, 2:] - end @ F[:2, 2:], end @ F[:2, :2] - F[2:, :2])
        return vectors[2:, :2] @ np.linalg.inv(vectors[:2, :2]), from_end


def pad(*blocks: np.ndarray) -> np.ndarray:
    """Blocks side by side above rows of zeros: what stands in the last columns is constant."""
    row = np.hstack(blocks)
    return np.vstack([row, np.zeros((row.shape[1] - len(row), row.shape[1]))])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_costs_and_responses_see_every_pulse(seed):
    pulsed, end = Pulsed(seed), np.diag([1.0, 2.0])
    (cost, last), (free, _) = pulsed.costs(1.0, end), pulsed.costs(0.0, end)
    F = pulsed.flow(lambda A, t: pad(A, at(pulsed.force, t)[:, None]), 3)
    driven = np.linalg.solve(np.eye(2) - F[:2, :2], F[:2, 2])
    for system in (pulsed.system(named=True), pulsed.system(named=False)):
        solved = (
            (periodic_riccati(system, np.eye(2), np.eye(1)), cost),
            (periodic_lyapunov(system, np.eye(2)), free),
            (finite_horizon_riccati(system, np.eye(2), np.eye(1), end), last),
        )
        for found, truth in solved:
            assert np.abs(found.X(0.0) - truth).max() <= found.error * np.abs(truth).max() + 1e-9
            assert found.error < 1e-8
        response = fl.forced_response(system, pulsed.force)
        assert np.abs(response(0.0) - driven).max() <= response.error + 1e-9


@pytest.fixture(params=[True, False], ids=["named", "not named"])
def case(request):
    pulsed = Pulsed(35 if request.param else 30)
    return pulsed, pulsed.system(request.param)


@pytest.mark.slow
def test_a_loop_through_an_estimator_sees_every_pulse(case):
    """It has the exponents of the design's loop and of the estimator's own."""
    (pulsed, system), C = case, np.array([[1.0, 0.0]])
    design = periodic_lqr(system, np.eye(2), np.eye(1))
    estimator = kalman_filter(system, C, np.eye(2), np.eye(1))
    both = fl.floquet(output_feedback(design, estimator)).exponents.real
    loops = lambda A, t: A - pulsed.B @ design.K(t), lambda A, t: A - estimator.L(t) @ C
    multipliers = np.concatenate([np.linalg.eigvals(pulsed.flow(loop, 2)) for loop in loops])
    np.testing.assert_allclose(np.sort(both), np.sort(np.log(np.abs(multipliers))) / pulsed.period, atol=1e-6, rtol=0)


@pytest.mark.slow
def test_the_h_infinity_norm_sees_every_pulse(case):
    """Just above g no multiplier of [[A, B B'/g], [-C'C/g, -A']], C = [1, 0], lies on the unit circle, just below two do."""
    (pulsed, system), distance = case, []
    norm = fl.hinf_norm(system, [[1.0, 0.0]], tol=1e-6)
    for level in norm.value * np.array([1 - 1e-3, 1 + 1e-3]):
        lower, upper = np.diag([-1.0 / level, 0.0]), pulsed.B @ pulsed.B.T / level
        F = pulsed.flow(lambda A, _, C=lower, B=upper: np.block([[A, B], [C, -A.T]]), 4)
        distance.append(np.abs(np.abs(np.linalg.eigvals(F)) - 1).min())
    assert distance[0] < 1e-7 < distance[1]


@pytest.mark.slow
def test_a_margin_sees_every_pulse(case):
    """Under a feedback turned by the phase margin a multiplier lies on the unit circle, by more outside, by less inside."""
    (pulsed, system), K = case, np.array([[2.0, 3.0]])
    phase, radii = fl.margins(system, K).phase, []
    for turn in np.exp(1j * (phase + np.array([-0.01, 0.0, 0.01]))):
        loop = pulsed.flow(lambda A, _, turn=turn: A - turn * pulsed.B @ K, 2, kind=complex)
        radii.append(np.abs(np.linalg.eigvals(loop)).max())
    assert radii[1] == pytest.approx(1.0, abs=1e-5)
    assert radii[0] < 1 < radii[2]


@pytest.mark.slow
def test_a_sampled_loop_sees_every_pulse(case):
    """Three samples a period: x_(k+1) = (Phi_k - Gamma_k K) x_k, the product's multipliers by integration of [x; u]."""
    (pulsed, system), K, product = case, np.array([[0.4, 0.3]]), np.eye(2)
    h = pulsed.period / 3
    for k in range(3):
        step = pulsed.flow(lambda A, _: pad(A, pulsed.B), 3, k * h, (k + 1) * h)
        product = (step[:2, :2] - step[:2, 2:] @ K) @ product
    truth = np.log(np.abs(np.linalg.eigvals(product))) / pulsed.period
    found = sampled_floquet(system, K, h)
    assert np.abs(np.sort(found.exponents.real)[-2:] - np.sort(truth)).max() <= found.errors.max() + 1e-9


T, DECAY, PLACE = 2.0, 0.7, 0.8123


def pulse(t: np.ndarray, place: float, width: float = 2e-4 * T) -> np.ndarray:
    """A Gaussian pulse of the area sqrt(pi)."""
    return np.exp(-(((np.mod(t, T) - place) / width) ** 2)) / width


@pytest.mark.parametrize("width", [1e-2, 1e-3, 2e-4])
def test_norms_and_held_inputs_see_a_pulse_of_the_input(width: float) -> None:
    """H2^2 = mean of b^2 / (2 a), the pulse's square from -inf to inf. Of a ten-thousandth of the period nothing was seen: 0.56 for 31.

    Held: x_(k+1) = (exp(-a h) - G_k K) x_k, both from [x; u] integrated with the pulse's place.
    """
    system = fl.PeriodicSystem([[-DECAY]], T, scalar(lambda t: 1 + pulse(t, PLACE, width)))
    square = 1 + (2 * np.sqrt(np.pi) + np.sqrt(np.pi / 2) / width) / T
    found = fl.h2_norm(system, [[1.0]])
    assert abs(found.value - np.sqrt(square / (2 * DECAY))) <= found.error + 1e-14 * found.value
    assert found.error < 1e-9 * found.value
    count, gain, factor = 10, 0.3, 1.0
    h, about = T / count, PLACE + width * np.arange(-9, 10)
    for k in range(count):
        stops = np.unique(np.clip([k * h, *about, (k + 1) * h], k * h, (k + 1) * h))
        step = transition(lambda t: np.array([[-DECAY, at(system.B, t).item()], [0.0, 0.0]]), np.eye(2), stops)
        factor *= step[0, 0] - step[0, 1] * gain
    loop = sampled_floquet(system, np.array([[gain]]), h)
    assert abs(loop.exponents[0].real - np.log(abs(factor)) / T) <= loop.errors[0] + 1e-13
    assert loop.errors[0] < 1e-9


PLANT = fl.PeriodicSystem([[-DECAY]], T, [[1.0]], complete=True)
"""It promises that nothing of its own is narrow, and says nothing of what others put beside it."""
PLACES = (0.7171 * T, 0.5555 * T)


@pytest.mark.parametrize("place", PLACES)
def test_a_complete_plant_hides_no_pulse_of_the_gain_or_force(place: float) -> None:
    found = fl.floquet(PLANT.feedback(scalar(lambda t: 0.3 * (1 + pulse(t, place)))))
    assert found.exponents[0].real == pytest.approx(-DECAY - 0.3 * (1 + np.sqrt(np.pi) / T), abs=1e-9)
    response = fl.forced_response(PLANT, lambda t: pulse(t, place)[:, None])
    decayed = np.exp(-DECAY * (T - place)) * np.sqrt(np.pi)  # from the pulse's place to the end of the period
    assert response(0.0).item() == pytest.approx(decayed / (1 - np.exp(-DECAY * T)), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("place", PLACES)
def test_a_complete_plant_hides_no_pulse_of_the_weight_or_output(place: float) -> None:
    """2 a X - X' = Q (R so large that no control is worth it), H2^2 = mean of c^2 / (2 a)."""
    narrow = scalar(lambda t: pulse(t, place))
    made = fl.periodic_lqr(PLANT, narrow, [[1e9]])
    before = np.exp(-2 * DECAY * place) * np.sqrt(np.pi) / (1 - np.exp(-2 * DECAY * T))
    assert made.X(np.zeros(1)).item() == pytest.approx(before, rel=1e-6)
    norm = fl.h2_norm(PLANT, narrow)
    assert norm.value == pytest.approx(np.sqrt(np.sqrt(np.pi / 2) / (2e-4 * T) / T / (2 * DECAY)), rel=1e-6)
    assert fl.hinf_norm(PLANT, narrow).value > norm.value
    estimator = fl.control.kalman_filter(PLANT, [[1e-5]], narrow, [[1.0]])
    after = np.exp(-2 * DECAY * (T - place)) * np.sqrt(np.pi) / (1 - np.exp(-2 * DECAY * T))
    assert estimator.P(np.zeros(1)).item() == pytest.approx(after, rel=1e-6)
