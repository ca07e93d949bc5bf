"""Weights in physical sizes: Bryson's rule through the arm's own tip, for any number of modes."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.control import design, physical_weights
from flexlin.errors import ArgumentError
from flexlin.periodic import FourierSeries
from flexlin.scene import Weights
from flexlin.simulation import tip_positions
from tests.closed_arm import opened
from tests.periodic.dense import at, integrate

WITH_DESIGNS = [name for name in fl.scenes() if fl.load_scene(name).designs]


def weigh(lin, **sizes):
    return physical_weights(lin, Weights.model_validate({"input": 1.0, **sizes}))


def test_a_state_at_its_sizes_costs_their_number():
    """Each deviation at its acceptable size costs 1; the tip's part is measured by moving the nonlinear arm."""
    _, lin = opened("de-luca-siciliano-1991")
    sizes = {"joints": ["0.5 deg", "1 deg"], "rates": "5 deg/s", "deflection": "1 mm", "w21": "3 mm"}
    sizes["input"] = ["3 N m", 2.0]
    Q, R = weigh(lin, tip="2 mm", **sizes)
    bare, _ = weigh(lin, **sizes)
    deg, t = np.pi / 180, np.array([0.0, 0.7, 3.1])
    at_sizes = np.array([0.5 * deg, deg, 1e-3, 1e-3, 3e-3, 1e-3, 5 * deg, 5 * deg, 0, 0, 0, 0])
    assert at_sizes @ bare(t)[0] @ at_sizes == pytest.approx(8.0, rel=1e-12)
    assert np.diag(R) == pytest.approx([1 / 9, 1 / 4])
    y = np.random.default_rng(1).normal(size=(1, 12)) * 1e-6
    moved = [tip_positions(lin, t, np.repeat(sign * y, 3, axis=0)) for sign in (1, -1)]
    by_tip = np.sum((moved[0] - moved[1]) ** 2, axis=1) / 4 / 2e-3**2
    assert [(y @ (Q(t) - bare(t))[k] @ y.T).item() for k in range(3)] == pytest.approx(by_tip, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", WITH_DESIGNS)
def test_built_in_designs_bear_any_number_of_modes(name):
    for modes in (1, 2 if name == "spatial-four-bar" else 4):  # its links bend and twist, each in so many shapes
        scene, lin = opened(name, {"links.0.modes": modes})
        for table in scene.designs:
            made = design(lin, table, tol=1e-6)
            assert fl.floquet(made.closed_loop, tol=1e-6).verdict == "stable"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["flexible-joint-link", "five-bar"])
def test_fast_modes_ask_for_no_more_nodes(name):
    """Modes up to 80,000 rad/s: the cost has the few harmonics of the motion, which the ringing of a coarse start must not hide."""
    scene, lin = opened(name, {"links.0.modes": 5})
    solution = design(lin, scene.designs[0], tol=1e-9).solution
    assert isinstance(solution.series, FourierSeries)
    assert solution.error < 1e-9


def test_sizes_that_do_not_fit_the_arm_are_refused():
    lin, two = (opened(name)[1] for name in ("arm-on-carriage", "three-link"))
    for sizes, words in (
        ({"joints": "2 mm"}, "weights.joints has another unit"),
        ({"input": "3 V"}, "weights.input has another unit"),
        ({"w13": "2 mm"}, "unknown key"),
        ({"w11": "2 deg"}, "weights.w11|unknown key"),
        ({"joints": ["1 deg", "1 deg"]}, "2 quantities|2 sizes"),
        ({"input": [1.0, 1.0]}, "2 quantities|2 sizes"),
    ):
        with pytest.raises(ArgumentError, match=words):
            weigh(lin, **sizes)
    assert weigh(two, joints=["1 deg", "2 deg", "3 deg"])[0](np.zeros(1)).shape[-1] == 2 * two.n
    with pytest.raises(ArgumentError, match="to know the coordinates"):
        design(lin.periodic_system(), fl.load_scene("single-link").designs[0])


@pytest.mark.slow
def test_strict_weights_on_cheap_inputs_are_solved():
    """Modes of the loop decay in microseconds and X changes in kinks: it keeps Riccati's equation, integrated by SciPy."""
    _, lin = opened("pick-and-place")
    Q, R = weigh(lin, tip="5 mm", joints="0.5 deg", rates="10 deg/s", input="3 N m")
    found, system = fl.periodic_lqr(lin, Q, R, tol=1e-9), lin.periodic_system()
    assert found.status == "converged"
    assert found.error <= 1e-9

    def fall(t, X):
        A, pull = at(system.A, t), at(system.B, t).T @ X
        return -(X @ A + A.T @ X - pull.T @ np.linalg.solve(R, pull) + at(Q, t))

    wanted = integrate(fall, found.X(1.0), [1.0, 0.996], rtol=1e-8, atol=1e-12)[-1]
    assert np.abs(found.X(0.996) - wanted).max() <= max(1e-7, found.error) * np.abs(wanted).max()
