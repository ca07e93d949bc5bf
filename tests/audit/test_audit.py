"""The audit: an effect that matters is called so, one that does not is not, and its figures are those of the two scenes."""

import json
import tomllib

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import eigvals

import flexlin as fl
from flexlin.analyses import Judge, find_reach, read_scale
from flexlin.analyses.audit import again, audit, versions
from flexlin.cli import main
from flexlin.errors import TimeLimit
from flexlin.periodic.floquet.exponents import floquet
from flexlin.report import audit_block, audit_lines, draw_effects, fitting, minimal_text
from flexlin.scene import Table, known_effects, register_model, revise_scene
from flexlin.scene.base import Number
from flexlin.simulation import tip_positions
from tests.audit.test_advice_by_formulas import row_of
from tests.closed_arm import closed, control_loop


def quanser(**changes):
    return fl.load_scene("quanser-flexible-link", {"links.0.modes": 1, "designs": [], **changes})


def rows_of(result):
    return {row.subject: row for row in result.effects}


@pytest.fixture(scope="module")
def result():
    told = []
    answer = audit(quanser(), 0.05, told.append)
    assert len(told) >= 1 + len(answer.effects) + len(answer.modes)
    return answer


@pytest.mark.slow
def test_every_effect_and_modes_both_ways_are_tried_and_advice_follows_the_tolerance(result):
    rows = rows_of(result)
    assert set(rows) == set(known_effects()) - {"tip_force"}
    on = {name for name, row in rows.items() if row.on}
    assert on == {"hub", "geometric_stiffening", "modal_damping", "viscous_friction"}
    assert all(row.table or name in ("geometric_stiffening", "bending_torsion_coupling") for name, row in rows.items())
    significance = [row.significance for row in result.effects]
    assert np.all(np.diff(np.array(significance)[np.isfinite(significance)]) <= 0)
    for row in result.effects:
        assert (row.significance > result.tolerance) == row.advice.startswith(("keep", "consider"))
    assert "hub" in result.needed
    assert "rotary_inertia" not in result.missing  # a slender strip
    assert set(result.needed) | set(result.droppable) == on
    assert rows["joint_flexibility"].coordinates == 1
    assert rows["joint_flexibility"].instructions > 0
    modes = {row.table["modes"]: row.advice for row in result.modes}
    assert set(modes) == {0, 2}
    assert modes[0] == "its last mode is needed"  # a strip of 3 Hz is not rigid


@pytest.mark.slow
def test_figures_that_a_scene_does_not_bear_are_not_called_its_fault():
    """Rotors on a link whose tip has no inertia of its own make M indefinite: the scene was said to have no kinetic energy."""
    scene = fl.load_scene("de-luca-siciliano-1991")
    judge = Judge(scene, 0.01, 1e-9)
    spin = next(one for one in versions.list_effect_versions(scene) if one.subject == "rotor_spin")
    said = "left out, because the scene does not bear the figures it would be tried with: M is"
    assert judge.row(spin).problem.startswith(said)


def figures_from_scratch(**overrides):
    """Margin, slower frequency, tip error and instructions of a scene read anew, by none of the audit's own code."""
    lin = control_loop(quanser(**overrides))
    system, times, t = lin.periodic_system(), lin.period * np.arange(9) / 9, lin.period * np.arange(256) / 256
    slower = [np.sqrt(np.abs(eigvals(K, M)).min()) for K, M in zip(lin.K(times), lin.M(times), strict=True)]
    states = fl.forced_response(system, lin.forcing)(t)
    away = np.linalg.norm(tip_positions(lin, t, states) - tip_positions(lin, t, 0 * states), axis=1)
    return fl.floquet(system).exponents[0].real, np.mean(slower), away.max(), lin.coefficients.n_instructions()


@pytest.mark.slow
def test_figures_are_those_of_the_two_scenes(result):
    """A row that compares the wrong versions, with the wrong sign, or leaves the feedback out is found out."""
    margin, slower, tip, instructions = figures_from_scratch()
    other_margin, other_slower, other_tip, other_instructions = figures_from_scratch(**{"effects.hub": "off"})
    row = rows_of(result)["hub"]
    assert row.margin == pytest.approx(other_margin - margin, abs=3e-4)
    assert row.tip_error == pytest.approx(other_tip - tip, rel=1e-4)
    assert row.instructions == other_instructions - instructions
    assert row.frequency == pytest.approx(abs(slower - other_slower) / max(slower, other_slower), rel=1e-9)
    assert abs(row.margin) > 1e-2  # so that no sign or version can be mixed up within the tolerances above


@pytest.mark.slow
def test_what_cannot_be_judged_is_not_called_needless():
    """A one-way motion has no exponents: only the frequencies can tell, and their silence proves nothing."""
    joints = [{"waypoints": [0.0, 1.0]}]
    motion = {"kind": "point-to-point", "move_time": 1.0, "course": "one-way", "joints": joints}
    result = audit(quanser(motion=motion))
    assert result.base.verdict == "unknown"
    assert result.base.problems
    assert result.droppable == ()
    assert "hub" in result.needed
    assert rows_of(result)["modal_damping"].advice.startswith("undecided")


@pytest.mark.slow
def test_a_registered_model_s_own_table_is_switched():
    """Khang's arm: what may be zero is taken away in turn; its margins are those of the scenes without it."""
    result = audit(fl.load_scene("khang-2019", {"designs": []}))
    assert set(rows_of(result)) == {"hub_inertia", "payload_mass", "gravity"}
    row = rows_of(result)["payload_mass"]
    lins = [closed("khang-2019", {"parameters.payload_mass": mass}) for mass in (0.1, 0.0)]
    margins = [fl.floquet(lin.periodic_system()).exponents[0].real for lin in lins]
    assert row.margin == pytest.approx(margins[1] - margins[0], abs=3e-4)
    assert row.table == {"payload_mass": 0.1}


def test_what_time_allows_is_handed_back_with_what_was_left_out(monkeypatch, tmp_path):
    """The limit may ring in the middle of a version, where it must not be taken for that version's own failure."""
    calls = []

    def rings(*given, **options):
        calls.append(1)
        if len(calls) == 3:
            raise TimeLimit("audit: stopped at the time limit", todo="allow more time")
        return floquet(*given, **options)

    monkeypatch.setattr(versions, "floquet", rings)
    found = audit(fl.load_scene("khang-2019", {"designs": []}))
    assert len(found.effects) == 1
    assert (found.modes, found.pairs, found.minimal) == ((), (), None)
    assert found.problem.startswith("not tried in the time: without ")
    assert found.problem.endswith(", pairs of effects, the minimal scene; allow more time")
    for said in (draw_effects(found).caption, audit_lines(found), audit_block(found)["problem"]):
        assert found.problem in said
    calls.clear()
    assert main(["effects", "khang-2019", "--set", "designs=[]", "--out", str(tmp_path)]) == 4
    assert json.loads((tmp_path / "effects.json").read_text())["problem"] == found.problem


def test_modes_inside_a_model_s_table_are_found():
    scene = fl.load_scene("khang-2019", {"designs": []})
    made = {version.change: version for version in versions.list_model_versions(scene)}
    assert made["links.0 with 2 modes"].make(scene).parameters["links"][0]["modes"] == 2
    assert scene.parameters["links"][0]["modes"] == 1


def audit_springs(**changes):
    """An arm whose extra terms are known: x'' + 0.2 x' + (10 + a + b + 0.7 (c = d = 0)) x = 0 with numbers of the model's table."""
    motion = {"kind": "harmonic", "frequency": 0.5, "joints": [{"amplitude": 0.1}]}
    raw = {"schema": 1, "title": "springs", "model": "springs", "control": {"feedforward": "none"}, "motion": motion}
    return audit(fl.parse_scene(raw | {"parameters": dict.fromkeys("abcd", 0.0) | changes}), 0.01)


class Springs(Table):
    a: Number
    b: Number
    c: Number
    d: Number


def build_springs(p):
    s, rate = ca.SX.sym("s"), ca.SX.sym("rate")
    stiffness = 10.0 + p.a + p.b + (0.7 if p.c == p.d == 0.0 else 0.0)
    return fl.Manipulator.from_matrices(s, rate, ca.SX(1.0), ca.SX(0.0), stiffness * s, damping=0.2 * rate, B=ca.DM(1))


@pytest.fixture(scope="module", autouse=True)
def _registered():
    register_model("springs", Springs, build_springs)


def test_two_effects_that_cancel_are_found_and_dropped_together():
    """+1 and -1 of ten: each moves the frequency by 5 %, both by nothing."""
    result = audit_springs(a=1.0, b=-1.0)
    assert [(row.subject, row.advice) for row in result.pairs] == [("a and b", "cancel each other")]
    assert result.needed == ("a", "b")
    assert set(result.minimal.dropped) == {"without a", "without b"}
    assert result.minimal.error.significance < 1e-6
    assert result.minimal.scene.parameters["a"] == result.minimal.scene.parameters["b"] == 0.0
    assert audit_springs(a=1.0, b=1.0).pairs == ()  # they only add up


def test_two_effects_that_are_noticed_only_together_are_found_and_one_is_kept():
    result = audit_springs(c=1.0, d=1.0)
    assert [(row.subject, row.advice) for row in result.pairs] == [("c and d", "noticed only together")]
    assert result.droppable == ("c", "d")
    assert len(result.minimal.dropped) == 1
    assert result.minimal.error.significance <= 0.01


@pytest.mark.slow
def test_the_minimal_scene_makes_the_error_that_it_states(result):
    """Measured anew from the text that is written, and no larger than the tolerance."""
    text = minimal_text(result, result.minimal, "flexlin effects quanser-flexible-link")
    again = fl.parse_scene(tomllib.loads(text))
    grown = quanser(**{"links.0.modes": again.links[0].modes})
    judge = Judge(grown, 0.05, 1e-4)
    row = judge.row(versions.Version(lambda _: again, "", "minimal", "", True, {}))
    assert result.minimal.added == ("link 1 with 2 modes",)
    assert row.significance == pytest.approx(result.minimal.error.significance, rel=1e-3, abs=1e-12)
    assert 0 < row.significance <= 0.05
    assert f"{100 * row.significance:.2g} %" in text.split("\n[")[0]
    left_out = {row.subject for row in result.effects if row.on} - set(again.effects.on())
    assert {f"without {name}" for name in left_out} == set(result.minimal.dropped)


def test_designs_that_no_longer_fit_are_left_out_of_the_minimal_scene():
    listed = {"name": "listed", "kind": "periodic-lqr", "state_weight": [1.0] * 6, "input_weight": [1.0]}
    scene = fl.load_scene("single-link", {"designs": [listed]})
    smaller = versions.with_more(scene, "links.0.modes", -1)
    assert [design.name for design in fitting(scene)[0].designs] == ["listed"]
    kept, said = fitting(smaller)
    assert kept.designs == ()
    assert "listed" in said[0]


@pytest.mark.slow
def test_what_is_beyond_small_deflections_is_no_plain_advice():
    """Gravity on a soft strip: 8 m of deflection on an arm of 1 m is not something to consider."""
    scene = fl.load_scene("single-link", {"links.0.modes": 1, "effects": {"hub": {"inertia": 0.1}}, "designs": []})
    stiffness = "links.0.bending_stiffness"
    soft, stiffer = (row_of(revise_scene(scene, {stiffness: value}), "gravity") for value in (0.05, 5.0))
    assert soft.tip_error > 1.0
    assert soft.advice.startswith("with these figures the deflections are not small")
    assert stiffer.advice.startswith("consider it")


def test_a_mode_less_of_one_kind_is_followed_by_one_less_of_the_same_kind():
    """A blade that flaps, lags and twists: the ways to take modes from it end, and none ends below nothing."""
    scene = fl.load_scene("rotating-blade", {"links.0.modes": {"y": 1, "z": 2, "torsion": 1}})
    for version in versions.list_mode_versions(scene):
        if version.on:
            direction = version.subject.rpartition(".")[2]
            less, steps = version.make(scene), 1
            while following := again(less, version):
                assert [found.subject for found in following] == [version.subject]
                less, steps = following[0].make(less), steps + 1
            assert steps == getattr(scene.links[0].counts, direction)
            assert getattr(less.links[0].counts, direction) == 0


def test_a_robot_of_bodies_alone_has_a_reach_and_a_mass():
    """The r3 by its mounts and bodies: no division by the length of links that it has not."""
    scene = fl.load_scene("manutec-r3")
    assert find_reach(scene) == pytest.approx(np.hypot(0.324, 0.3) + 0.65 + np.hypot(0.414, 0.155) + 0.186 + 0.125)
    assert read_scale(scene).mass == pytest.approx(1 + 56.5 + 26.4 + 28.7 + 5.2 + 15.5)
