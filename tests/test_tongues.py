"""The whole path against Mathieu's stability chart: scene, equations, linearization, sweep, verdict."""

import numpy as np
from scipy.special import mathieu_a, mathieu_b

import flexlin as fl
from flexlin import sweep


def test_tongues_of_the_spinning_link():
    """Unstable exactly between b_n(q) and a_n(q) for some n. Source: McLachlan (1947), through scipy.special.

    a = 4 (k11 + (G - m11) W^2)/(m11 W^2), q = 2 g H/(m11 W^2); G and H of the first clamped mode by SciPy's quadrature.
    """
    axes = {"motion.joints.0.rate": np.linspace(1.5, 4.5, 31), "effects.gravity.acceleration": np.linspace(1.0, 6.0, 6)}
    data = sweep(fl.load_scene("spinning-link"), axes, grid=True)
    rate, gravity = np.meshgrid(*axes.values(), indexing="ij")
    k11, G, H = 12.362363368, 1.193336374, 1.570878190
    a, q = 4 * (k11 + (G - 1) * rate**2) / rate**2, 2 * gravity * H / rate**2
    inside = np.zeros(a.shape, dtype=bool)
    for n in range(1, 12):
        inside |= (mathieu_b(n, q) < a) & (a < mathieu_a(n, q))
    np.testing.assert_array_equal(data["verdict"].values == "unstable", inside)
    assert 10 < inside.sum() < inside.size / 2
