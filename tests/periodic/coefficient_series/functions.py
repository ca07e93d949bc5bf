"""Matrix functions of time, and series that cover them."""

import numpy as np

from flexlin.periodic import resolve

SMOOTH = 2 * np.pi


def scalar(f):
    """A function of time as a 1 x 1 matrix function."""
    return lambda t: np.asarray(f(t), dtype=float)[:, None, None]


def background(rng, period, size=2, harmonics=5):
    """A random trigonometric polynomial, some entries constant."""
    waves = rng.standard_normal((2, harmonics, size * size)) * (rng.random(size * size) < 0.7)
    mean = rng.standard_normal(size * size)

    def f(t):
        angle = 2 * np.pi / period * np.outer(t, np.arange(1, harmonics + 1))
        return (mean + np.cos(angle) @ waves[0] + np.sin(angle) @ waves[1]).reshape(-1, size, size)

    return f


def resolved(A, T, near=(), below=np.inf, true=None, **options):
    """The series of A, whose stated errors lie below a bound and cover the true ones, at random times and ever closer to places."""
    series, rng = resolve(A, T, **options), np.random.default_rng(1)
    assert np.all(series.error < below)
    steps = T * 10.0 ** rng.uniform(-12, -1, 60)
    about = [np.mod(place + side * steps, T) for place in near for side in (-1, 1)]
    t = np.concatenate([rng.uniform(0, T, 3000), *about])
    assert np.all(np.abs(series(t) - (true or A)(t)) <= series.error)
    return series
