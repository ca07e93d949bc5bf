"""Connected periodic systems beside python-control's at the matrices of one time: they are connected time by time."""

import control
import numpy as np
import pytest

import flexlin as fl
from tests.periodic.dense import at


def plant(seed, n, m, p, through):
    rng = np.random.default_rng(seed)
    A, B, C = rng.standard_normal((n, n)) - 2 * np.eye(n), rng.standard_normal((n, m)), rng.standard_normal((p, n))
    return A, B, C, 0.3 * through * rng.standard_normal((p, m))


def ours(swing, *parts):
    """Each matrix constant, or waving."""
    wave = lambda M: lambda t: (1 + swing * np.cos(2 * np.pi * t))[:, None, None] * M  # noqa: E731
    A, B, C, D = map(wave, parts) if swing else parts
    return fl.PeriodicStateSpace(fl.PeriodicSystem(A, 1.0, B=B), C, D)


@pytest.mark.parametrize("through", [0.0, 1.0])
@pytest.mark.parametrize("swing", [0.0, 0.5])
def test_systems_answer_as_those_of_python_control(swing, through):
    first, second = plant(1, 3, 2, 2, through), plant(2, 2, 2, 2, through)
    G, H, size = ours(swing, *first), ours(swing, *second), 1 + swing * np.cos(0.6 * np.pi)
    g, h = (control.ss(*(size * part for part in parts)) for parts in (first, second))
    pairs = (G * H, g * h), (G + H, g + h), (G.feedback(H), g.feedback(h)), (G.feedback(H, 0.2), g.feedback(0.2 * h, 1))
    for got, want in (*pairs, (G.feedback(H) * H + G, g.feedback(h) * h + g)):
        A, B, C, D = (at(part, 0.3) for part in (got.system.A, got.system.B, got.C, got.D))
        for s in (0.3j, 1 + 2j):
            np.testing.assert_allclose(C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D, want(s), atol=1e-12)
