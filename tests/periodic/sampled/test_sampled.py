"""Sampled loops beside long simulations and constant plants; digital designs beside python-control, the lifted problem, published ones."""

import control
import numpy as np
import pytest
from scipy.linalg import block_diag, expm

import flexlin as fl
from flexlin.control import lifted_model, sampled_floquet
from flexlin.errors import ArgumentError, TooManySegments
from flexlin.periodic.sampled_cost import SampledProblem, solve_samples
from tests.periodic.dense import integrate

T = np.pi
LOOPS = 16
"""Trials of the suite; 50 of them take half a minute."""


def matrices(t):
    """A damped pendulum whose pivot shakes: the plant of the random trials, written without flexlin."""
    A = np.zeros((*np.shape(t), 2, 2))
    A[..., 0, 1], A[..., 1, 1] = 1.0, -0.1
    A[..., 1, 0] = 0.6 + 0.5 * np.cos(2 * t)
    B = np.zeros((*np.shape(t), 2, 1))
    B[..., 1, 0] = 1.0 + 0.3 * np.sin(2 * t)
    return A, B


PLANT = fl.PeriodicSystem(lambda t: matrices(t)[0], T, lambda t: matrices(t)[1])


def gains(t):
    return np.stack([4.0 + np.cos(2 * t), 1.5 + 0.5 * np.sin(2 * t)], axis=-1)[..., None, :]


def growth_by_simulation(h, delay, samples=600, steps=8):
    """The growth rates (L,) of L loops, each with its own sampling time and delay, by classical Runge-Kutta steps."""
    rng = np.random.default_rng(8)
    x, u, logs, marks = rng.normal(size=(len(h), 2, 1)), np.zeros((len(h), 1, 1)), np.zeros(len(h)), []

    def rate(t, x, u):
        A, B = matrices(t)
        return A @ x + B @ u

    for k in range(samples):
        measured = -gains(k * h) @ x
        for begin, end, held in ((k * h, k * h + delay, u), (k * h + delay, (k + 1) * h, measured)):
            d = ((end - begin) / steps)[:, None, None]
            for s in range(steps):
                t = begin + d[:, 0, 0] * s
                half, whole = t + d[:, 0, 0] / 2, t + d[:, 0, 0]
                k1 = rate(t, x, held)
                k2 = rate(half, x + d / 2 * k1, held)
                k3 = rate(half, x + d / 2 * k2, held)
                x = x + d / 6 * (k1 + 2 * k2 + 2 * k3 + rate(whole, x + d * k3, held))
        u = measured
        size = np.sqrt((x**2).sum(axis=(1, 2)) + (u**2).sum(axis=(1, 2)))
        x, u, logs = x / size[:, None, None], u / size[:, None, None], logs + np.log(size)
        marks.append(logs.copy())
    return (marks[-1] - marks[samples // 5]) / (h * (samples - 1 - samples // 5)), 12 / (h * samples)


@pytest.mark.slow
def test_verdicts_agree_with_long_simulations_around_the_limit():
    """Random sampling times with random delays, most of them incommensurate with the period, a third close to the limit."""
    rng = np.random.default_rng(11)
    part = rng.uniform(0, 1, LOOPS)
    h = rng.uniform(0.15, 0.75, LOOPS)
    h[::10] = T / rng.integers(5, 12, len(h[::10]))
    simulated, blur = growth_by_simulation(h, part * h)
    found = [sampled_floquet(PLANT, gains, step, share * step, 1e-6) for step, share in zip(h, part, strict=True)]
    rates, errors = np.array([(result.exponents[0].real, result.errors[0]) for result in found]).T
    verdicts = np.array([result.verdict for result in found])
    assert np.abs(rates - simulated).max() < 0.05
    assert np.all(np.abs(rates - simulated) < blur + errors)
    decided = (np.abs(simulated) > blur) & (verdicts != "undecided")
    assert np.array_equal(verdicts[decided] == "stable", simulated[decided] < 0)
    assert (verdicts == "undecided").sum() <= 2
    assert LOOPS / 5 < (verdicts == "stable").sum() < 4 * LOOPS / 5


@pytest.mark.parametrize("part", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("memory", [0, 2])
def test_a_constant_plant_has_the_eigenvalues_of_one_sample(memory, part):
    """Without and with states of the controller, which follow a plant that was measured at the beginning of the sample."""
    rng, eye = np.random.default_rng(5), np.eye(memory)
    A, B, K = rng.normal(size=(3, 3)), rng.normal(size=(3, 2)), rng.normal(size=(2, 3 + memory))
    rates = np.hstack([rng.normal(size=(memory, 3)), 0.3 * rng.normal(size=(memory, memory)) - 2 * eye])
    for h in (0.1, 0.23, 2.0):
        held = np.block([[A, B], [np.zeros((2, 5))]])
        (P0, G0), (P1, G1) = ((E[:3, :3], E[:3, 3:]) for E in (expm(held * part * h), expm(held * (1 - part) * h)))
        wide = expm(h * np.block([[rates[:, 3:], rates[:, :3]], [np.zeros((3, memory + 3))]]))[:memory]
        moved = [P1 @ P0 - G1 @ K[:, :3], -G1 @ K[:, 3:], P1 @ G0]
        step = np.block([moved, [wide[:, memory:], wide[:, :memory], np.zeros((memory, 2))], [-K, np.zeros((2, 2))]])
        known = np.linalg.eigvals(step)
        found = sampled_floquet(fl.PeriodicSystem(A, 2.0, B), K, h, part * h, rates=rates if memory else None)
        sound = np.isfinite(found.errors)
        off = np.abs(found.exponents.real[sound, None] - np.log(np.abs(known) + 1e-300) / h)
        assert np.all(off.min(axis=1) <= found.errors[sound] + 1e-12)
        assert off[0].argmin() == np.abs(known).argmax()
        assert found.errors[0] < 1e-9
        if h == 0.1:
            assert np.abs(found.multipliers[sound, None] - known**20).min(axis=1).max() < 1e-9


def test_a_sample_longer_than_a_period_passes_over_no_jump():
    """x' = a(t) x: the exponent is the mean of a. A sample beyond all numbers is refused."""
    plant = fl.PeriodicSystem(lambda t: np.where(t % 2 < 0.7, 1.0, -0.3)[:, None, None], 2.0, np.ones((1, 1)))
    found = sampled_floquet(plant, np.zeros((1, 1)), 5.0)
    assert abs(found.exponents[0] - (0.7 - 0.3 * 1.3) / 2) <= found.errors[0] < 1e-12
    with pytest.raises(TooManySegments, match="too many steps"):
        sampled_floquet(plant, np.zeros((1, 1)), 1e300)


def test_the_lifted_model_is_the_sampled_plant():
    """Poles under the feedback of all samples, and the response to a random input, sample by sample."""
    N, part = 6, 0.3
    lifted = lifted_model(PLANT, T / N, part * T / N)
    assert isinstance(lifted, control.StateSpace)
    assert lifted.state_labels == ["x1", "x2", "u1_held"]
    assert lifted.dt == pytest.approx(T)
    K = gains(T * np.arange(N) / N)
    feed = block_diag(*K)
    poles = np.linalg.eigvals(lifted.A - lifted.B @ np.linalg.solve(np.eye(N) + feed @ lifted.D, feed @ lifted.C))
    found = sampled_floquet(PLANT, gains, T / N, part * T / N)
    assert np.abs(poles).max() == pytest.approx(np.abs(found.multipliers).max(), rel=1e-9)
    with pytest.raises(ArgumentError, match="such as sample_time"):
        lifted_model(PLANT, 0.5)


SAMPLES = 5
H = T / SAMPLES
Q, R = np.diag([2.0, 0.5]), np.array([[0.3]])


def weight(t):
    return (1.5 + np.sin(2 * np.asarray(t)))[..., None, None] * Q


def span(begin, end):
    """Transition matrix and cost of [x; u] over a span, u held, by DOP853."""

    def rate(t, y):
        whole, W = np.zeros((2, 3, 3))
        (whole[:2, :2], whole[:2, 2:]), W[:2, :2], W[2:, 2:] = matrices(t), weight(t), R
        return np.array([whole @ y[0], y[0].T @ W @ y[0]])

    return integrate(rate, [np.eye(3), np.zeros((3, 3))], [begin, end])[-1]


def lifted_problem(delay):
    """F, G and the cost of [z; u_0 ... u_(N-1)] over a period, z = [x; u_(-1)]."""
    now = np.eye(3, 3 + SAMPLES)
    cost = np.zeros((3 + SAMPLES, 3 + SAMPLES))
    for k in range(SAMPLES):
        for begin, end, late in ((k * H, k * H + delay, True), (k * H + delay, (k + 1) * H, False)):
            if not late:
                now[2] = np.eye(3 + SAMPLES)[3 + k]
            if end > begin:
                P, S = span(begin, end)
                cost += now.T @ S @ now
                now = P @ now
    return now[:, :3], now[:, 3:], cost


@pytest.mark.parametrize("delay", [0.0, 0.4 * H, H])
def test_the_lifted_problem_has_the_same_cost_and_gain(delay):
    F, G, S = lifted_problem(delay)
    S = (S + S.T) / 2
    made = fl.sampled_lqr(PLANT, weight, R, H, delay)
    later = R[0, 0] * H * (delay == H)  # the last input costs in the next round only, of which dare needs a weight here
    S[-1, -1] += later
    S[2, 2] -= later
    X, _, K = control.dare(F, G, S[:3, :3], S[3:, 3:], S[:3, 3:], np.eye(3))
    X[2, 2] += later
    r = made.X.shape[1]
    np.testing.assert_allclose(made.X[0], X[:r, :r], rtol=0, atol=1e-8 * np.abs(X).max())
    np.testing.assert_allclose(made.K[0, 0], K[0, :r], rtol=0, atol=1e-8 * np.abs(K).max())
    assert made.error < 1e-9
    assert made.floquet().verdict == "stable"


def hold(A, W, h):
    """Transition matrix P(h) and the integral of P' W P. Source: Van Loan (1978)."""
    n = len(A)
    block = expm(h * np.block([[-A.T, W], [np.zeros((n, n)), A]]))
    S = block[n:, n:].T @ block[:n, n:]
    return block[n:, n:], (S + S.T) / 2


@pytest.mark.parametrize("seed", range(3))
def test_constant_plants_against_python_control(seed):
    rng = np.random.default_rng(seed)
    n, m, h = int(rng.integers(2, 6)), int(rng.integers(1, 3)), float(rng.uniform(0.05, 0.5))
    A0, B0 = rng.standard_normal((n, n)), rng.standard_normal((n, m))
    root = rng.standard_normal((n, n))
    W, V = root @ root.T, np.diag(rng.uniform(0.1, 1, m))
    system = fl.PeriodicSystem(A0, 4 * h, B=B0)
    P, S = hold(np.block([[A0, B0], [np.zeros((m, n + m))]]), block_diag(W, V), h)
    K, X, _ = control.dlqr(P[:n, :n], P[:n, n:], S[:n, :n], S[n:, n:], S[:n, n:])
    made = fl.sampled_lqr(system, W, V, h)
    np.testing.assert_allclose(made.K, np.broadcast_to(K, made.K.shape), rtol=0, atol=1e-10 * np.abs(K).max())
    np.testing.assert_allclose(made.X, np.broadcast_to(X, made.X.shape), rtol=0, atol=1e-10 * np.abs(X).max())
    units, own = 10.0 ** rng.uniform(-6, 6, n), 10.0 ** rng.uniform(-20, 0, B0.shape[1])
    far = fl.PeriodicSystem(units[:, None] * A0 / units, 4 * h, B=units[:, None] * B0 * own)
    same = fl.sampled_lqr(far, W / np.outer(units, units), V * np.outer(own, own), h)
    assert max(np.abs(own[:, None] * same.K * units - made.K).max() / np.abs(K).max(), same.error) < 1e-10
    weak = fl.sampled_lqr(fl.PeriodicSystem([[0.5]], h, B=[[0.5e-12]]), 1.0, 1.0, h)
    assert weak.K.item() == pytest.approx(1e12 * (1 + np.exp(-h / 2)), rel=1e-12)  # of least effort
    back, noise = hold(A0.T, W, h)
    L, covariance, _ = control.dlqe(back.T, np.eye(n), B0.T, noise, V)
    estimator = fl.sampled_estimator(system, B0.T, W, V, h)
    np.testing.assert_allclose(estimator.P[0], covariance, rtol=0, atol=1e-10 * np.abs(covariance).max())
    assert min(np.abs(gain - L).max() for gain in (estimator.L[0], estimator.M[0])) < 1e-10 * np.abs(L).max()
    np.testing.assert_allclose(estimator.L, back.T @ estimator.M, rtol=0, atol=1e-10 * np.abs(L).max())


def test_the_covariance_of_a_varying_plant_repeats():
    """One round of the filter's own recursion from P, with F and W_k by DOP853."""
    C, V = np.array([[1.0, 0.0]]), np.array([[0.02]])
    made = fl.sampled_estimator(PLANT, C, weight, V, H)
    P = made.P[0]
    for k in range(SAMPLES):
        np.testing.assert_allclose(made.P[k], P, rtol=0, atol=1e-8 * np.abs(P).max())
        P = P - P @ C.T @ np.linalg.solve(C @ P @ C.T + V, C @ P)

        def rate(t, P):
            Y = matrices(t)[0] @ P
            return Y + Y.T + weight(t)

        P = integrate(rate, P, [k * H, (k + 1) * H])[-1]
    np.testing.assert_allclose(made.P[0], P, rtol=0, atol=1e-8 * np.abs(P).max())


@pytest.mark.parametrize("delay", [0.0, 0.4 * H])
def test_a_loop_with_an_estimator_has_the_multipliers_of_both(delay):
    """The separation of the design's loop and the estimate's error."""
    design = fl.sampled_lqr(PLANT, weight, R, H, delay)
    estimator = fl.sampled_estimator(PLANT, [[1.0, 0.0]], weight, [[0.02]], H)
    parts = np.concatenate([design.floquet().exponents.real, estimator.floquet().exponents.real])
    known = np.sort(estimator.floquet(design).exponents.real)[::-1][:4]
    np.testing.assert_allclose(known, np.sort(parts)[::-1][:4], rtol=1e-7)


def test_samples_that_fill_several_periods_share_their_gains_by_phase():
    made = fl.sampled_lqr(PLANT, Q, R, 2 * T / 5)
    assert made.K.shape == (5, 1, 2)
    at = np.mod(made.instants, T)
    np.testing.assert_array_equal(made.gain(at), made.K)
    assert made.floquet().verdict == "stable"


HENCH = np.array(
    [
        [[-3, 2, 9], [0, 0, -4], [3, -2, 3]],
        [[6, -3, 0], [4, -2, 2], [2, -1, 4]],
        [[2, -3, -3], [4, -15, -3], [-2, 9, 1]],
    ]
)


def hench_and_laub():
    """Hench, Laub, IEEE Trans. Automat. Control 39 (1994) 1197, example 2."""
    return HENCH, [[[1], [1], [0]], [[0], [1], [0]], [[0], [1], [1]]], [np.diag(row) for row in np.eye(3)], 1.0


def pittelkaus_satellite():
    """Pittelkau, J. Guidance Control Dynamics 16 (1993) 1078: roll and yaw by magnetic torque, 120 samples an orbit."""
    w, count = 0.00103448, 120
    wide = np.zeros((6, 6))  # [x; sin; cos]
    wide[0, 2] = wide[1, 3] = 5.318064566757217e-02
    wide[2, 0], wide[2, 3] = -1.352134256362805e-03, -7.099273035392090e-02
    wide[3, 1], wide[3, 2] = -7.557182037479544e-04, 3.781555288420663e-02
    wide[2, 4], wide[3, 5], wide[4, 5], wide[5, 4] = 0.1389735e-6, -0.3701336e-7, w, -w
    step = expm(2 * np.pi / w / count * wide)
    angle = 2 * np.pi * np.arange(count) / count
    G = (np.stack([np.sin(angle), np.cos(angle)], axis=1) @ step[:4, 4:].T)[:, :, None]
    return count * [step[:4, :4]], G, count * [np.diag([2.0, 1.0, 0.0, 0.0])], 1e-11


@pytest.mark.parametrize("example", [hench_and_laub, pittelkaus_satellite])
def test_published_problems_in_discrete_time(example):
    """The one X that repeats under the recursion and leaves a stable loop is the solution."""
    F, G, Q, r = (np.array(part, dtype=float) for part in example())
    count, n = len(F), len(F[0])
    none = np.zeros((count, n, 1))
    X, K = solve_samples(SampledProblem(F, G, Q, none, np.full((count, 1, 1), r), none))
    loop = np.eye(n)
    for k in range(count):
        after = X[(k + 1) % count]
        gain = np.linalg.solve(r + G[k].T @ after @ G[k], G[k].T @ after @ F[k])
        closed = F[k] - G[k] @ gain
        known = Q[k] + closed.T @ after @ closed + r * gain.T @ gain
        np.testing.assert_allclose(X[k], known, rtol=0, atol=1e-9 * np.abs(known).max())
        np.testing.assert_allclose(K[k], gain, rtol=0, atol=1e-8 * np.abs(gain).max())
        loop = closed @ loop
    assert np.abs(np.linalg.eigvals(loop)).max() < 1
