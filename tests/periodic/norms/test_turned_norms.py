"""H-infinity norms of random constant systems in coordinates that turn; the truth is a sum over modes, maximised on ever finer grids."""

import numpy as np
import pytest

import flexlin as fl
from tests.thinned import thin

J = np.array([[0.0, 1.0], [-1.0, 0.0]])


def draw_modes(seed):
    """Modes [[-s, v], [-v, -s]] or [[-s]] with inputs and outputs, damping ratios 1e-7 to 0.1; some unseen or not reached, or nearly."""
    rng = np.random.default_rng(seed)
    left, blocks = 1 + seed % 12, []
    while left:
        if left > 1 and rng.random() < 0.8:
            w, z = 10 ** rng.uniform(-1, 1.3), 10 ** rng.uniform(-7, -1)
            blocks.append(w * (np.sqrt(1 - z * z) * J - z * np.eye(2)))
        else:
            blocks.append(np.array([[-(10 ** rng.uniform(-2, 1))]]))
        left -= len(blocks[-1])
    m, p = rng.integers(1, 3, 2)
    inputs, outputs = ([rng.standard_normal((len(b), k)) for b in blocks] for k in (m, p))
    for k in range(1, len(blocks)):
        weak = (0.0, 10 ** rng.uniform(-14, -4))[rng.integers(0, 2)]
        kind = rng.integers(0, 6)
        inputs[k] *= weak if kind == 0 else 1.0
        outputs[k] *= weak if kind == 1 else 1.0
    return rng, blocks, inputs, [c.T for c in outputs]


def largest_gain(blocks, inputs, outputs):
    """The largest singular value of sum C (i w - A)^-1 B over w, each term written out, about every resonance."""

    def gains(w):
        total = 0.0
        for b, B, C in zip(blocks, inputs, outputs, strict=True):
            s, v = -b[0, 0], b[0, -1] if len(b) > 1 else 0.0
            if len(b) > 1:
                below = (s + 1j * (w - v)) * (s + 1j * (w + v))
                total = total + ((s + 1j * w)[:, None, None] * (C @ B) + v * (C @ J @ B)) / below[:, None, None]
            else:
                total = total + (C @ B) / (s + 1j * w)[:, None, None]
        return np.linalg.norm(total, 2, axis=(1, 2))

    beside = np.geomspace(1e-3, 1e3, 400)
    near = np.concatenate([-beside[::-1], [0.0], beside])
    every = [b[0, -1] * (len(b) > 1) - b[0, 0] * near for b in blocks]
    w = np.unique(np.abs(np.concatenate([[0.0], np.geomspace(1e-4, 1e3, 6000), *every])))
    found = gains(w)
    best = found.max()
    for k in np.argsort(found)[-12:]:
        low, high = w[max(k - 1, 0)], w[min(k + 1, len(w) - 1)]
        for _ in range(12):
            x = np.linspace(low, high, 33)
            y = gains(x)
            best, at = max(best, y.max()), int(y.argmax())
            low, high = x[max(at - 1, 0)], x[min(at + 1, 32)]
    return best


def turn(rng, blocks, inputs, outputs):
    """x = P(t) M z of modes z: M mixes them, P rotates planes with a period of 0.01 to 10 s; one state alone swells and shrinks."""
    n, period = sum(map(len, blocks)), 10 ** rng.uniform(-2, 1)
    A, B, C, at = np.zeros((n, n)), np.concatenate(inputs), np.concatenate(outputs, axis=1), 0
    for b in blocks:
        A[at : at + len(b), at : at + len(b)] = b
        at += len(b)
    scale, speed = 10 ** rng.uniform(-1, 1, n), 2 * np.pi / period
    mix = np.linalg.qr(rng.standard_normal((n, n)))[0] * scale
    back = (mix / scale**2).T
    A, B, C = mix @ A @ back, mix @ B, C @ back
    spin = np.zeros((n, n))
    for i in range(0, n - 1, 2):
        if i == 0 or rng.random() < 0.5:
            spin[i : i + 2, i : i + 2] = speed * J
    planes = np.abs(spin).sum(axis=1) > 0

    def P(t):
        if n == 1:
            return np.exp(0.5 * np.sin(speed * t))[:, None, None]
        c, s = np.cos(speed * t)[:, None, None], np.sin(speed * t)[:, None, None]
        return np.where(planes, c, 1.0) * np.eye(n) + s * spin / speed

    def rate(t):
        return (0.5 * speed * np.cos(speed * t))[:, None, None] if n == 1 else spin

    system = fl.PeriodicSystem(lambda t: rate(t) + P(t) @ A @ np.linalg.inv(P(t)), period, B=lambda t: P(t) @ B)
    return system, lambda t: C @ np.linalg.inv(P(t))


@pytest.mark.parametrize("seed", thin(range(50_000, 50_012), 3))
def test_no_norm_of_a_turned_system_misses_by_more_than_its_error(seed):
    rng, *modes = draw_modes(seed)
    found, exact = fl.hinf_norm(*turn(rng, *modes)), largest_gain(*modes)
    assert abs(found.value - exact) <= found.error + 1e-14 * exact
    assert found.error <= 0.05 * exact
