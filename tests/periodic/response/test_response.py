"""Forced responses, harmonic transfer functions and transients: closed forms, manufactured solutions and SciPy's DOP853."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import ResonantForcing, TooManySegments
from tests.periodic.dense import at, integrate
from tests.periodic.systems import colaneri, lyapunov_transformed, turned
from tests.thinned import thin


def beat(t):
    return np.column_stack([0 * t, np.cos(2 * t)])


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def motion(amplitude, w, A):
    """Two waves (2, n) of a state, and the force under which x' = A(t) x + f moves so."""

    def exact(t):
        return np.sin(w * t)[:, None] * amplitude[0] + np.cos(2 * w * t)[:, None] * amplitude[1]

    def force(t):
        slope = w * (np.cos(w * t)[:, None] * amplitude[0] - 2 * np.sin(2 * w * t)[:, None] * amplitude[1])
        return slope - (A(t) @ exact(t)[..., None])[..., 0]

    return exact, force


def answer(system, force, exact, tol):
    """The stated error of a forced response, which lies within it along more than the period."""
    response, t = fl.forced_response(system, force, tol=tol), system.period * np.linspace(-0.7, 1.4, 501)
    assert np.abs(response(t) - exact(t)).max() <= response.error
    return response.error


@pytest.mark.parametrize("exponents", [[2.0, -1.0], [80.0, -90.0], [-0.5, -300.0], [-0.5, -1e6], [-0.5, 1e6]])
def test_manufactured_solution_of_a_stiff_or_unstable_system(exponents, rng):
    A = lyapunov_transformed(np.diag(exponents), 1.0, 2, rng)
    exact, force = motion(np.array([[1.0, 0.2], [0.3, 1.0]]), 1.0, A)
    error = answer(fl.PeriodicSystem(A, 2 * np.pi), force, exact, 1e-10)
    assert error <= 2e-10 + 1e-15 * np.abs(exponents).max()  # A itself is known to rounding only


def test_a_mode_that_rings_behind_each_jump_of_the_force_is_followed():
    """x'' + 2 z w x' + w^2 x = w^2 f, f = 1, then 0: exponentials from jump to jump, too fast for Radau's method to reach tol."""
    w, z, T, jump = 3000.0, 1e-4, 4.0, 1.3
    system = fl.PeriodicSystem(np.array([[0.0, 1.0], [-(w**2), -2 * z * w]]), T, breaks=[jump])
    found = fl.forced_response(system, lambda t: np.stack([0 * t, w**2 * (t < jump)], axis=1), breaks=[jump])
    fall = -z * w + 1j * w * np.sqrt(1 - z**2)
    up, down = (np.exp(fall * part) for part in (jump, T - jump))
    ringing = (1 - down) / (1 - up * down)  # x = 1 + Re(c ringing): left of a jump after a period and before the next
    t = np.linspace(0.01, 0.99, 37) * jump
    rings = (1 - 1j * z / np.sqrt(1 - z**2)) * ringing * np.exp(fall * t)
    known = np.stack([1 - rings.real, -(fall * rings).real], axis=1)
    assert np.abs(found(t) - known).max() <= found.error <= 1e-9 * w * 2


def test_resonance_names_the_multiplier_and_units_far_apart_are_none():
    for system, force, words, advice in (
        (fl.PeriodicSystem([[0, 1.0], [-4.0, 0]], np.pi), beat, "the multiplier 1 with", "damping"),
        (fl.PeriodicSystem(colaneri, 2 * np.pi), [0.0, 1.0], "multiplier", "damping"),
        (fl.PeriodicSystem([[-1.0, 1e11], [0.0, -2.0]], 1.0), [1.0, 1.0], "no multiplier is near 1", "units"),
    ):
        with pytest.raises(ResonantForcing, match=f"{words}.*{advice}"):
            fl.forced_response(system, force)


def test_near_resonance_keeps_what_rounding_allows():
    """x' = -1e-5 x + 1 has x = 1e5."""
    response = fl.forced_response(fl.PeriodicSystem(np.array([[-1e-5]]), 1.0), [1.0], tol=1e-9)
    assert abs(response(0.3)[0] - 1e5) <= response.error < 1e-3 < 9e4 < response.amplification


def test_too_few_segments_for_tol_give_an_answer_with_its_error_or_none():
    """x' = -x + cos(w t) has x = (cos w t + w sin w t) / (1 + w^2)."""

    def respond(w, most):
        system, force = fl.PeriodicSystem([[-1.0]], 1.0), lambda t: np.cos(w * t)[:, None]
        return fl.forced_response(system, force, tol=1e-13, max_segments=most)

    w, t = 40 * np.pi, np.linspace(0.0, 1.0, 50)
    for found in (respond(w, 60), respond(w, 120)):
        missed = np.abs(found(t)[:, 0] - (np.cos(w * t) + w * np.sin(w * t)) / (1 + w * w)).max()
        assert missed <= found.error < 1e-2 / w
        assert "was not reached" in found.status
    for given in ((w, 40), (3 * w, 120)):
        with pytest.raises(TooManySegments):
            respond(*given)


@pytest.mark.parametrize("stiffness", thin([30.0, 1e7]))
def test_second_order_systems_answer_as_their_state_equations_do(stiffness, rng):
    """Under a force on rates and places alike: by accelerations, and by states where nobody knows of M, D, K."""
    n, T, R = 2, 1.3, rng.standard_normal((3, 2, 2))
    M, D = R[0] @ R[0].T + np.eye(n), 0.2 * R[1] @ R[1].T + 0.3 * np.eye(n)

    def K(t):
        return stiffness * (np.eye(n) + 0.1 * (R[2] + R[2].T) * np.cos(2 * np.pi / T * t)[:, None, None])

    second = fl.PeriodicSystem.from_second_order(M, D, K, T)
    exact, force = motion(rng.standard_normal((2, 2 * n)), 2 * np.pi / T, second.A)
    for system in (second, fl.PeriodicSystem(second.A, T)):
        assert answer(system, force, exact, 1e-9) <= 2e-9 + 500 * np.finfo(float).eps * stiffness


@pytest.mark.parametrize("seed", [15, 34, 95, 105])
def test_rounding_that_fast_growing_modes_multiply_is_covered(seed):
    """The states at the edges are right to the last digit; the polynomials between them missed by 3 to 20 times the error."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    A = 10 ** rng.uniform(1, 2.5) * rng.standard_normal((n, n))
    exact, force = motion(rng.standard_normal((2, n)), 2 * np.pi, lambda t: A)
    for tol in (1e-5, 1e-8, 1e-10):
        assert answer(fl.PeriodicSystem(A, 1.0), force, exact, tol) <= 3 * tol


A0, B0, C0 = np.array([[-0.2, 1.5], [-1.5, -0.3]]), np.array([[1.0], [0.4]]), np.array([[1.0, 2.0]])


def test_a_plant_in_turning_coordinates_answers_in_two_sidebands():
    """x = exp(J t) z, y = C0 x: with P+- = (I -+ i J) / 2 the answer at w + k is C0 P_k (i w - A0)^-1 B0."""
    J, (system, _) = np.array([[0.0, 1.0], [-1.0, 0.0]]), turned(A0, B0, C0, speed=1.0)
    omega = np.array([0.0, 0.7, 3.0])
    found = fl.frequency_response(system, C0, omega)
    for w, H in zip(omega, found.H[:, :, 0, 0], strict=True):
        z = np.linalg.solve(1j * w * np.eye(2) - A0, B0)
        exact = {k: (C0 @ (np.eye(2) - 1j * k * J) / 2 @ z).item() for k in (-1, 1)}
        for k, value in zip(found.orders, H, strict=True):
            assert abs(value - exact.get(int(k), 0.0)) <= found.error * np.abs(H).max() + 1e-13


@pytest.mark.parametrize("sharp", [1e2, 3e5])
def test_a_pulse_of_the_coefficients_is_followed_and_what_is_not_known_of_it_stated(sharp):
    """x = z exp c(t), z' = -z / 100 + u with a pulse c: u(t) = exp(i w t) leads to z = u / (i w + 1/100)."""

    def c(t):
        return np.exp(sharp * (np.cos(2 * np.pi * t) - 1))[:, None, None]

    def A(t):
        return -2 * np.pi * sharp * np.sin(2 * np.pi * t)[:, None, None] * c(t) - 0.01

    system, poles = fl.PeriodicSystem(A, 1.0, lambda t: np.exp(c(t))), np.array([[0.01], [0.01 + 0.3j]])
    found = fl.frequency_response(system, lambda t: np.exp(-c(t)), poles[:, 0].imag)
    assert np.abs(found.H[:, :, 0, 0] * poles - (found.orders == 0)).max() <= found.error < 1e-8
    spread = np.exp(c(T_END)[:, 0, 0]) * np.sqrt(50 - 50 * np.exp((T_END[0] - T_END) / 50))
    noisy = fl.respond(system, T_END, noise=[[1.0]])
    assert np.abs(np.sqrt(noisy.covariance[:, 0, 0]) - spread).max() <= noisy.error * spread.max() < 1e-6


def square(t):
    return np.where(np.mod(t, 1.0) < 0.5, 1.0, -1.0)[:, None, None]


def test_inputs_and_outputs_that_jump():
    """The waves of a square wave are 2 / (i pi k) for odd k, and 1 / (i w + 1) is what a lag makes of each."""
    w, lag = np.array([0.0, 3.0]), fl.PeriodicSystem([[-1.0]], 1.0, B=[[1.0]], breaks=(0.0, 0.5))
    k = np.arange(-9, 10)
    waves = np.where(k % 2 == 1, 2 / (1j * np.pi * np.where(k, k, 1)), 0.0)
    seen = fl.frequency_response(lag, square, w)
    driven = fl.frequency_response(fl.PeriodicSystem([[-1.0]], 1.0, B=square, breaks=(0.0, 0.5)), [[1.0]], w)
    for found, shift in ((seen, w[:, None]), (driven, w[:, None] + 2 * np.pi * k)):
        near = found.H[:, np.abs(found.orders) <= 9, 0, 0]
        np.testing.assert_allclose(near, waves / (1j * shift + 1), atol=1e-8, rtol=0)


T_END = np.linspace(0.3, 11.0, 23)


def A(t):
    out = np.zeros((len(t), 2, 2))
    out[:, 0, 1], out[:, 1, 1] = 1.0, np.where(np.mod(t, 2.0) < 0.7, -0.1, -0.6)
    out[:, 1, 0] = -2.0 - 0.8 * np.cos(np.pi * t)
    return out


def B(t):
    return np.stack([0.2 * np.sin(np.pi * t), 1.0 + 0 * t], axis=1)[:, :, None]


SYSTEM = fl.PeriodicSystem(A, 2.0, B=B, breaks=(0.0, 0.7))


def integrated(rate, start):
    """At T_END, between all jumps."""
    jumps = np.add.outer(2.0 * np.arange(6), [0.0, 0.7]).ravel()
    stops = np.unique([*T_END, *jumps[(jumps > T_END[0]) & (jumps < T_END[-1])]])
    return integrate(rate, start, stops)[np.isin(stops, T_END)]


def test_states_from_a_state_a_push_and_an_input():
    def u(t):
        return np.sin(1.7 * t)[:, None]

    start = np.array([0.4, -0.2])
    found = fl.respond(SYSTEM, T_END, x0=start, u=u, push=[0.3])
    exact = integrated(lambda t, x: at(A, t) @ x + at(B, t) @ at(u, t), start + 0.3 * B(T_END[:1])[0, :, 0])
    assert np.abs(found.x - exact).max() <= found.error * np.abs(exact).max() + 1e-10 <= 1e-8
    assert not found.covariance.any()


def test_noise_spreads_the_states():
    def rate(t, P):
        return at(A, t) @ P + P @ at(A, t).T + 0.5 * at(B, t) @ at(B, t).T

    found = fl.respond(SYSTEM, T_END, noise=[[0.5]])
    np.testing.assert_allclose(found.covariance, integrated(rate, np.zeros((2, 2))), atol=1e-8)
    assert not found.x.any()
