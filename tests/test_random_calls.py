"""Random plain systems through every function that takes one: a result or a typed error, no warning, bounded memory."""

import resource
from contextlib import suppress

import numpy as np
import pytest

import flexlin as fl
from tests.thinned import thin

MOST = 300e6
"""Bytes that a call on at most 6 states may take."""


def draw(rng):
    """Matrices with two harmonics and, of some, a jump; stable, unstable, marginal or very fast; states unseen and inputs dead."""
    n, m, p, T = rng.integers(1, 7), rng.integers(1, 3), rng.integers(1, 3), 10 ** rng.uniform(-2, 1)
    size = 10 ** rng.uniform(-1, rng.choice([1, 3])) * rng.choice([0.1, 1.0]) / min(T, 1.0)
    parts = size * rng.standard_normal((3, n, n)) * np.array([1.0, *rng.choice([0.0, 0.3, 1.0], 2)])[:, None, None]
    parts[0] -= rng.choice([0.0, 1.0, 3.0]) * size * np.eye(n)
    jump = rng.choice([0.0, 1.0], p=[0.7, 0.3]) * size * rng.standard_normal((n, n)) * T
    B, C = rng.standard_normal((n, m)), rng.standard_normal((p, n))
    B[:, : rng.choice([0, 1], p=[0.8, 0.2])], C[: rng.choice([0, 1], p=[0.8, 0.2])] = 0.0, 0.0

    def A(t):
        phase = np.mod(np.asarray(t) / T, 1.0)[..., None, None]
        waves = parts[0] + parts[1] * np.cos(2 * np.pi * phase) + parts[2] * np.sin(4 * np.pi * phase)
        return waves + jump * (phase >= 0.5)

    return fl.PeriodicSystem(A, float(T), B=B, breaks=(0.0, T / 2) if jump.any() else ()), int(m), C


def calls(system, inputs, C, rng):
    """Each function with arguments that are right for the system."""
    n, m, T = system.n, inputs, system.period
    Q, R, V, h = np.eye(n), np.eye(m), np.eye(len(C)), T / rng.integers(1, 9)
    push = rng.standard_normal((n, 1))
    return {
        "floquet": lambda: fl.floquet(system),
        "floquet_modes": lambda: fl.floquet_modes(system),
        "h2_norm": lambda: fl.h2_norm(system, C),
        "hinf_norm": lambda: fl.hinf_norm(system, C),
        "periodic_lyapunov": lambda: fl.periodic_lyapunov(system, Q),
        "periodic_lqr": lambda: fl.periodic_lqr(system, Q, R),
        "sampled_lqr": lambda: fl.sampled_lqr(system, Q, R, h, delay=float(rng.choice([0.0, 0.3])) * h),
        "sampled_estimator": lambda: fl.sampled_estimator(system, C, Q, V, h),
        "output_lqr": lambda: fl.output_lqr(system, C, Q, R),
        "frequency_response": lambda: fl.frequency_response(system, C, np.array([0.0, 1.0, 20.0]) / T),
        "invariant_zeros": lambda: fl.invariant_zeros(system, C),
        "forced_response": lambda: fl.forced_response(system, lambda t: np.cos(2 * np.pi * t / T)[:, None] * push.T),
        "respond": lambda: fl.respond(system, T * np.linspace(0, 3, 50), x0=push[:, 0], noise=np.eye(m)),
        "margins": lambda: fl.margins(system, rng.standard_normal((m, n))),
        "averaged_lqr": lambda: fl.control.averaged_lqr(system, Q, R),
        "critical_values": lambda: fl.critical_values(lambda a: turned(system, a), "a", (0.5, 2.0), samples=65),
    }


def most_memory():
    """The most that this process has held, in bytes."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def turned(system, share):
    """The system run faster or slower."""
    return fl.PeriodicSystem(lambda t: share * system.A(t * share), system.period / share, breaks=system.breaks)


@pytest.mark.parametrize("seed", thin([10, 4, 6]))
def test_a_result_or_a_typed_error(seed):
    rng = np.random.default_rng(seed)
    system, inputs, C = draw(rng)
    for name, call in calls(system, inputs, C, rng).items():
        before = most_memory()
        with suppress(fl.errors.FlexlinError):
            assert repr(call()), name
        assert most_memory() < before + MOST, name
