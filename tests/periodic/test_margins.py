"""Margins of constant loops against python-control, of periodic ones against integrations of the perturbed loop by other means."""

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexlin as fl
from flexlin.errors import TimeLimit, TooManySegments
from flexlin.periodic import margins as search
from tests.periodic.dense import transition

T = 2.0
B = np.array([[0.0], [1.0]])


def matrices(t, *entries):
    """Matrices with two columns at one time or at many."""
    return np.stack(np.broadcast_arrays(t, *entries)[1:], axis=-1).reshape(*np.shape(t), -1, 2)


def A(t):
    return matrices(t, 0.0, 1.0, -1.0 - 0.6 * np.cos(np.pi * t), 0.1)


def K(t):
    return matrices(t, 1.5 + 0.5 * np.sin(np.pi * t), 1.0)


PLANT = fl.PeriodicSystem(A, T, B=B)


@pytest.fixture(scope="module")
def found():
    return fl.margins(PLANT, K)


def radius(factor):
    """Spectral radius of the monodromy matrix under the feedback factor * K."""
    eye = np.eye(2, dtype=complex)
    monodromy = transition(lambda t: A(t) - factor * B @ K(t), eye, (0, T), rtol=1e-10, atol=1e-12)
    return np.abs(np.linalg.eigvals(monodromy)).max()


def growth_with_delay(tau, periods=60):
    """The growth over late periods of x' = A x - B K(t - tau) x(t - tau), by SciPy's DOP853 from one delay to the next."""
    x, past, sizes = np.array([1.0, 0.3]), lambda t: np.zeros(2), []
    for k in range(int(periods * T / tau)):

        def rate(t, x, past=past):
            return A(t) @ x - B @ K(t - tau) @ past(t - tau)

        run = solve_ivp(rate, (k * tau, (k + 1) * tau), x, "DOP853", rtol=1e-8, atol=1e-12, dense_output=True)
        x, past = run.y[:, -1], run.sol
        sizes.append(np.linalg.norm(run.y, axis=0).max())
    third = len(sizes) // 3
    return max(sizes[-third:]) / max(sizes[third : 2 * third])


@pytest.mark.slow
def test_gain_and_phase_of_a_periodic_loop(found):
    assert 0 < found.gain[0] < 1
    for factor in (found.gain[0], np.exp(1j * found.phase), np.exp(-1j * found.phase)):
        assert radius(factor) == pytest.approx(1.0, abs=1e-5)
    assert radius(0.99 * found.gain[0]) > 1 > radius(1.01 * found.gain[0])
    assert radius(np.exp(0.99j * found.phase)) < 1 < radius(np.exp(1.01j * found.phase))
    assert found.gain[1] == np.inf
    assert radius(100.0) < 1


@pytest.mark.slow
def test_delay_of_a_periodic_loop_against_simulation(found):
    assert growth_with_delay(0.97 * found.delay) < 1 < growth_with_delay(1.03 * found.delay)
    assert 0 < found.errors[3] < 1e-4 * found.delay


@pytest.mark.slow
def test_constant_loops_against_python_control():
    rng = np.random.default_rng(4)
    for _ in range(3):
        A0, B0 = rng.standard_normal((3, 3)), rng.standard_normal((3, 1))
        gain = control.lqr(A0, B0, np.eye(3), [[1.0]])[0] * rng.uniform(0.6, 2)  # from a half on the loop is stable
        found = fl.margins(fl.PeriodicSystem(A0, 1.0, B=B0), gain)
        gm, pm, _, _, wc, _ = control.stability_margins(control.ss(A0, B0, gain, 0), returnall=True)
        lower = max([g for g in gm if g < 1], default=0.0)
        upper = min([g for g in gm if g > 1], default=np.inf)
        assert found.gain == pytest.approx((lower, upper), rel=1e-5, abs=1e-3)
        angles = np.radians(np.mod(pm, 360))
        assert found.phase == pytest.approx(np.minimum(angles, 2 * np.pi - angles).min(), rel=1e-5)
        assert found.delay == pytest.approx((angles / wc).min(), rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("error", [TooManySegments, TimeLimit])
@pytest.mark.parametrize(("kind", "lost", "kept"), [(search.delay, "delay", "phase"), (search.turn, "phase", "delay")])
def test_a_margin_whose_loops_have_no_verdict_is_said_to_be_unknown(kind, lost, kept, error, found, monkeypatch):
    """The margins that are known stay as they are; a limit of time ends the search, and leaves what is not sought yet."""
    growth, kinds = search.judge_growth, [kind]

    def refuse(loop, *tol):
        if getattr(getattr(loop.A, "rule", None), "func", None) in kinds:
            raise error("no verdict")
        return growth(loop, *tol)

    monkeypatch.setattr(search, "judge_growth", refuse)
    some = fl.margins(PLANT, K)
    assert some.gain == found.gain
    assert np.isnan(getattr(some, lost))
    assert getattr(some, kept) == getattr(found, kept) or (error is TimeLimit and np.isnan(getattr(some, kept)))
    assert some.reason == "no verdict"
    assert not found.reason
    kinds.append(None)  # all loops
    if error is TimeLimit:
        with pytest.raises(TimeLimit):
            fl.margins(PLANT, K)
