"""Connected periodic systems: python-control at constant matrices, and an integration of the parts where they vary."""

import control
import numpy as np
import pytest

import flexlin as fl
from tests.periodic.dense import at, integrate


def plant(seed, n, m, p, through):
    rng = np.random.default_rng(seed)
    A, B, C = rng.standard_normal((n, n)) - 2 * np.eye(n), rng.standard_normal((n, m)), rng.standard_normal((p, n))
    return A, B, C, 0.3 * through * rng.standard_normal((p, m))


def ours(A, B, C, D):
    return fl.PeriodicStateSpace(fl.PeriodicSystem(A, 1.0, B=B), C, D)


@pytest.mark.parametrize("through", [0.0, 1.0])
def test_constant_systems_answer_as_those_of_python_control(through):
    first, second = plant(1, 3, 2, 2, through), plant(2, 2, 2, 2, through)
    G, H = ours(*first), ours(*second)
    g, h = control.ss(*first), control.ss(*second)
    pairs = (G * H, g * h), (G + H, g + h), (G.feedback(H), g.feedback(h)), (G.feedback(H, 0.2), g.feedback(0.2 * h, 1))
    for got, want in pairs:
        A, B, C, D = (part(np.zeros(1))[0] for part in (got.system.A, got.system.B, got.C, got.D))
        for s in (0.3j, 1 + 2j):
            np.testing.assert_allclose(C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D, want(s), atol=1e-12)


@pytest.mark.slow
def test_varying_systems_move_as_their_parts_do():
    """u = sin 3t into H, whose output and a feedback through H2 drive G: both integrated, whole and part by part."""

    def wave(size):
        return lambda t: (size * (1 + 0.5 * np.cos(2 * np.pi * t)))[:, None, None]

    G = fl.PeriodicStateSpace(fl.PeriodicSystem(wave(-1.0), 1.0, B=wave(2.0)), wave(0.7), wave(0.2))
    H = fl.PeriodicStateSpace(fl.PeriodicSystem(wave(-0.5), 1.0, B=[[1.0]]), wave(1.0), [[0.4]])
    whole = G.feedback(H) * H + G

    def direct(t, x):
        u, (g, h, before, alone), v = np.sin(3 * t), x, 1 + 0.5 * np.cos(2 * np.pi * t)
        r = v * before + 0.4 * u  # H, then G in feedback with another H, and G alone beside them
        g_in = (r - v * h - 0.4 * 0.7 * v * g) / (1 + 0.4 * 0.2 * v)
        y = 0.7 * v * g + 0.2 * v * g_in
        return [2 * v * g_in - v * g, y - 0.5 * v * h, u - 0.5 * v * before, 2 * v * u - v * alone]

    def joined(t, x):
        return at(whole.system.A, t) @ x + at(whole.system.B, t) @ [np.sin(3 * t)]

    ends = [integrate(f, np.zeros(4), [0.0, 1.2], rtol=1e-10)[-1] for f in (direct, joined)]
    np.testing.assert_allclose(*ends, atol=1e-8)
