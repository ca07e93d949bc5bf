"""LQR with integrals of the joints' errors: gains, loops, estimators, exports and simulation with the same states."""

import numpy as np
import pytest
import scipy.io
import xarray
from scipy.integrate import cumulative_simpson
from scipy.linalg import solve_continuous_are

import flexlin as fl
from flexlin.control import design, output_feedback, scene_sensors
from flexlin.control.export.files import Labels
from flexlin.errors import SceneError
from flexlin.report import export_all
from flexlin.scene import EstimatorTable
from tests.closed_arm import both

WEIGHTS = {"joints": "0.5 deg", "rates": "5 deg/s", "deflection": "8 mm", "input": "0.25 N m", "integrals": "0.2 deg s"}
TABLE = {"name": "LQI", "kind": "periodic-lqr", "weights": WEIGHTS}


def arm_of(**changes):
    return both("single-link", {"designs": [TABLE], "links.0.modes": 1, **changes})


@pytest.fixture(scope="module")
def made():
    scene, plant, closed = arm_of()
    return scene, plant, closed, design(plant, scene.designs[0])


@pytest.mark.parametrize("kind", ["periodic-lqr", "frozen-lqr", "averaged-lqr"])
def test_the_gain_of_an_arm_at_rest_is_that_of_the_widened_riccati_equation(kind):
    scene, plant, _ = arm_of(**{"motion.joints": [{"amplitude": 0.0}], "designs": [TABLE | {"kind": kind}]})
    found = design(plant, scene.designs[0])
    A, B = plant.A(np.zeros(1))[0], plant.input_matrix(np.zeros(1))[0]
    deg = np.pi / 180
    wide_A = np.block([[A, np.zeros((4, 1))], [np.eye(5)[:1]]])
    wide_B = np.vstack([B, np.zeros((1, 1))])
    Q = np.diag(1 / np.array([0.5 * deg, 8e-3, 5 * deg, np.inf, 0.2 * deg]) ** 2)
    X = solve_continuous_are(wide_A, wide_B, Q, [[0.25**-2]])
    np.testing.assert_allclose(found.K(np.zeros(1))[0], 0.25**2 * wide_B.T @ X, rtol=1e-7)
    assert found.controller.names == ("q1_integral",)
    assert found.controller.units == ("rad s",)


def test_a_constant_torque_leaves_no_mean_error(made):
    _, plant, closed, found = made
    assert fl.floquet(found.closed_loop).verdict == "stable"
    shifted = fl.forced_response(found.closed_loop, lambda t: 0.3 * found.closed_loop.B(t)[:, :, 0])
    t = plant.period * np.arange(64) / 64
    assert abs(shifted(t)[:, 0].mean()) < 1e-9
    law = closed.law.with_gain(found.K, found.controller)
    run = fl.simulate(closed, 0.5, initial=[1e-3, 0.0, 0.0, 0.0], law=law, tol=1e-8, points_per_period=1024)
    assert run.controller_names == ("q1_integral",)
    integral = cumulative_simpson(run.nonlinear[:, 0], x=run.t, initial=0)
    np.testing.assert_allclose(run.controller[:, 0], integral, atol=1e-7)


def test_an_estimated_loop_keeps_its_separation(made):
    scene, plant, _, found = made
    table = EstimatorTable.model_validate({"encoders": "0.02 deg", "tip": "1 mm", "torque": "10 mN m"})
    estimator = scene_sensors(scene, plant, table).filter(plant)
    loop = fl.floquet(output_feedback(found, estimator))
    parts = [fl.floquet(one).exponents for one in (found.closed_loop, estimator.closed_loop)]
    apart = np.abs(loop.exponents[:, None] - np.concatenate(parts)[None]).min(axis=1)
    assert np.all(apart < np.maximum(1e-6, 10 * loop.errors))


def test_files_hold_gain_and_rates_in_one_order(made, tmp_path):
    scene, plant, _, found = made
    from flexlin.analyses import Loop

    export_all(plant, (Loop("LQI", "periodic-lqr", None, design=found),), tmp_path, 16, scene)
    mat = scipy.io.loadmat(tmp_path / "system.mat", simplify_cells=True)["designs"]
    np.testing.assert_array_equal(np.atleast_2d(mat["rates"]), found.controller.rates)
    wanted = found.K(plant.period * np.array([3 / 16]))[0, 0]
    np.testing.assert_allclose(np.atleast_1d(mat["K"][..., 3]).ravel(), wanted, rtol=1e-15)
    with xarray.open_dataset(tmp_path / "system.nc", engine="scipy") as data:
        assert data["K_0"].shape == (16, 1, 5)
        assert data["rates_0"].shape == (1, 5)
    assert Labels.fitting(plant, 5, 1, found.controller).states[-1] == "q1_integral"


def test_a_size_of_another_dimension_is_refused():
    with pytest.raises(SceneError, match=r"designs\.0\.weights\.integrals"):
        arm_of(designs=[TABLE | {"weights": WEIGHTS | {"integrals": "0.2 deg/s"}}])
