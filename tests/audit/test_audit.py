"""The audit: an effect that matters is called so, one that does not is not, and its figures are those of the two scenes."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigvals

import flexlin as fl
from flexlin.answers.audit import audit
from flexlin.errors import ArgumentError
from flexlin.scene.effects import known_effects
from flexlin.simulation import tip_positions


@pytest.fixture(scope="module")
def scene():
    return fl.load_scene("quanser-flexible-link", {"links.0.modes": 1, "designs": []})


@pytest.fixture(scope="module")
def result(scene):
    told = []
    answer = audit(scene, 0.02, told.append)
    assert len(told) == 1 + len(answer.effects) + len(answer.modes)
    return answer


def test_every_effect_is_tried(result):
    assert {row.subject for row in result.effects} == set(known_effects())
    assert {row.subject for row in result.effects if row.on} == {
        "hub",
        "geometric_stiffening",
        "modal_damping",
        "viscous_friction",
    }
    assert all(row.table or row.subject == "geometric_stiffening" for row in result.effects)


def test_rows_are_sorted_and_advice_follows_the_tolerance(result):
    significance = [row.significance for row in result.effects if np.isfinite(row.significance)]
    assert significance == sorted(significance, reverse=True)
    for row in result.effects:
        assert (row.significance > result.tolerance) == row.advice.startswith(("keep", "consider"))
    assert "hub" in result.needed
    assert "rotary_inertia" not in result.missing  # a slender strip
    assert set(result.needed) | set(result.droppable) == {row.subject for row in result.effects if row.on}


def figures_from_scratch(**overrides):
    """Margin, slower frequency, tip error and instructions of a scene read anew: integrated by SciPy, none of the audit's own code."""
    scene = fl.load_scene("quanser-flexible-link", {"links.0.modes": 1, "designs": [], **overrides})
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    system = lin.periodic_system()

    def rate(t, x):
        return (system.A(np.array([t]))[0] @ x.reshape(4, 4)).ravel()

    monodromy = (
        solve_ivp(rate, (0, lin.period), np.eye(4).ravel(), "DOP853", rtol=1e-9, atol=1e-12).y[:, -1].reshape(4, 4)
    )
    margin = np.log(np.abs(np.linalg.eigvals(monodromy)).max()) / lin.period
    times = lin.period * np.arange(9) / 9
    squares = [eigvals(K, M) for K, M in zip(lin.K(times), lin.M(times), strict=True)]
    slower = np.mean([np.sqrt(np.abs(values).min()) for values in squares])
    states = fl.forced_response(system, lin.forcing)(t := np.linspace(0, lin.period, 97, endpoint=False))
    away = tip_positions(lin, t, states) - tip_positions(lin, t, 0 * states)
    return margin, slower, np.linalg.norm(away, axis=1).max(), lin.coefficients.n_instructions()


def test_figures_are_those_of_the_two_scenes(result):
    """A row that compares the wrong versions, with the wrong sign, or leaves the feedback out is found out."""
    margin, slower, tip, instructions = figures_from_scratch()
    other_margin, other_slower, other_tip, other_instructions = figures_from_scratch(**{"effects.hub": "off"})
    row = next(row for row in result.effects if row.subject == "hub")
    assert row.margin == pytest.approx(other_margin - margin, abs=3e-4)
    assert row.tip_error == pytest.approx(other_tip - tip, rel=1e-4)
    assert row.instructions == other_instructions - instructions
    assert row.frequency == pytest.approx(abs(slower - other_slower) / max(slower, other_slower), rel=1e-9)
    assert abs(row.margin) > 1e-2  # so that no sign or version can be mixed up within the tolerances above


def test_tip_error_is_that_of_the_forced_response(scene, result):
    """Fourier collocation against the Gauss collocation of flexlin.periodic."""
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    t = np.linspace(0, lin.period, 97, endpoint=False)
    states = fl.forced_response(lin.periodic_system(), lin.forcing)(t)
    away = tip_positions(lin, t, states) - tip_positions(lin, t, 0 * states)
    assert result.base.tip_error == pytest.approx(np.linalg.norm(away, axis=1).max(), rel=1e-6)


def test_joint_flexibility_adds_a_coordinate(result):
    row = next(row for row in result.effects if row.subject == "joint_flexibility")
    assert row.coordinates == 1
    assert row.instructions > 0


def test_modes_are_tried_both_ways(result):
    assert {row.table["modes"] for row in result.modes} == {0, 2}
    fewer = next(row for row in result.modes if row.table["modes"] == 0)
    assert fewer.advice == "its last mode is needed"  # a strip of 3 Hz is not rigid


def test_a_softening_model_is_caught():
    """Without stiffening the spinning link loses stiffness with speed: the verdict of the beam at W = 3.6 changes (Khang's model)."""
    scene = fl.load_scene("rotating-beam", {"links.0.modes": 2, "motion.joints.0.rate": 3.6})
    row = next(row for row in audit(scene, 0.01).effects if row.subject == "geometric_stiffening")
    assert row.frequency > 0.5
    assert row.advice == "keep"


def test_what_cannot_be_judged_is_not_called_needless():
    """A one-way motion has no exponents: only the frequencies can tell, and their silence proves nothing."""
    joints = [{"waypoints": [0.0, 1.0]}]
    motion = {"kind": "point-to-point", "move_time": 1.0, "course": "one-way", "joints": joints}
    result = audit(fl.load_scene("quanser-flexible-link", {"motion": motion, "links.0.modes": 1, "designs": []}))
    assert result.base.verdict == "unknown"
    assert result.base.problems
    assert result.droppable == ()
    assert "hub" in result.needed
    row = next(row for row in result.effects if row.subject == "modal_damping")
    assert row.advice.startswith("undecided")


def test_registered_models_are_refused():
    with pytest.raises(ArgumentError, match="registered model"):
        audit(fl.load_scene("khang-2019"))
