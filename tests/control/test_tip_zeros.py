"""The zeros from motors to tip: a link at rest beside SciPy's pencil, and what a report says of them."""

import numpy as np
from scipy.linalg import eigvals

import flexlin as fl
from flexlin.answers.analysis import analyse
from flexlin.control.sensors import tip_zeros
from flexlin.report.advice import comment_on_zeros

STILL = {"designs": [], "motion.joints": [{"mean": 0.0, "amplitude": 0.0}]}


def test_a_link_at_rest_has_the_zeros_of_rosenbrocks_pencil():
    scene = fl.load_scene("single-link", STILL)
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    n, t = lin.n, np.zeros(1)
    K, D = (np.linalg.solve(lin.M(0.0), part) for part in (lin.K(0.0), lin.D(0.0)))
    C = fl.control.tip_position(lin)(t)[0]
    row = C[:, :1].T @ C
    pencil, mass = np.zeros((2, 2 * n + 1, 2 * n + 1))
    pencil[:n, n : 2 * n], mass[:n, :n] = np.eye(n), np.eye(n)
    pencil[n : 2 * n, :n], pencil[n : 2 * n, n : 2 * n], pencil[n : 2 * n, 2 * n] = (
        -K,
        -D,
        lin.periodic_system().B(t)[0, n:, 0],
    )
    mass[n : 2 * n, n : 2 * n], pencil[2 * n :, : 2 * n] = np.eye(n), row
    known = eigvals(pencil, mass)
    known = known[np.abs(known) < 1e5]
    found = tip_zeros(lin)
    assert found.verdict == "non-minimum phase"
    np.testing.assert_allclose(np.sort(found.exponents.real), np.sort(known.real), rtol=1e-6, atol=1e-8)


def test_a_report_names_the_zero_that_bounds_every_controller():
    scene = fl.load_scene("single-link", {"designs": [], "links.0.modes": 1})
    found = analyse(scene)
    assert found.zeros.verdict == "non-minimum phase"
    assert "non-minimum phase" in comment_on_zeros(found)[0]
