"""Advice on scenes whose answers are known by another formula."""

import tomllib

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import Judge, analyse, list_effect_versions
from flexlin.report import minimal_text

LENGTH, LINE_MASS = 1.2, 0.5
LOOP = {"kind": "pd", "kp": [200.0], "kd": [40.0]}


def arm(frequency, effects, amplitude=0.6, limits=None, drive="torque", **link):
    """An arm in the vertical plane on a stiff PD loop, whose torque is that of the rigid arm but for little."""
    known = {"gravity": {}, "modal_damping": {"ratio": 0.01}} | effects
    data = {
        "schema": 1,
        "title": "arm",
        "links": [{"length": LENGTH, "mass_per_length": LINE_MASS, "bending_stiffness": 2000.0, "modes": 1, **link}],
        "effects": {name: table for name, table in known.items() if table is not None},
        "control": {"feedforward": "rigid", **({"feedback": LOOP} if drive == "torque" else {})},
        "motion": {"kind": "harmonic", "frequency": frequency, "joints": [{"amplitude": amplitude, "drive": drive}]},
    }
    return fl.parse_scene(data | ({"drives": {"torque": limits}} if limits else {}))


def row_of(scene, name, tolerance=0.01):
    judge = Judge(scene, tolerance, 1e-4)
    version = next(v for v in list_effect_versions(scene) if v.subject == name)
    return judge.row(version)


def rigid_rms(frequency, payload, hub, gravity, amplitude=0.6):
    """RMS of J q'' + g (m_l l/2 + m l) cos q along q = a sin wt, by the sum over a period."""
    t = np.arange(512) / 512 / frequency
    w = 2 * np.pi * frequency
    q, acceleration = amplitude * np.sin(w * t), -amplitude * w**2 * np.sin(w * t)
    J = LINE_MASS * LENGTH**3 / 3 + payload * LENGTH**2 + hub
    moment = LINE_MASS * LENGTH**2 / 2 + payload * LENGTH
    return np.sqrt(np.mean((J * acceleration + gravity * moment * np.cos(q)) ** 2))


def test_gravity_of_a_slow_arm_stays_although_its_tip_hardly_moves():
    """Drive marks too: 24.8 N m of RMS torque fall to 0.4, below the limit of 20."""
    scene = arm(0.1, {"payload": {"mass": 2.0}}, limits={"continuous": "20 N m"})
    row = row_of(scene, "gravity")
    full, without = (rigid_rms(0.1, 2.0, 0.0, g) for g in (9.81, 0.0))
    assert row.torque == pytest.approx(1 - without / full, rel=0.01)
    assert row.path < 0.01
    assert row.marks == ("RMS torque of q1",)
    assert row.significance == np.inf
    assert row.advice == "keep"


def judge(scene, name, figure, share, needed):
    row = row_of(scene, name)
    assert getattr(row, figure) == pytest.approx(share, rel=0.02)
    assert (share > 0.01) == needed
    assert row.advice == ("keep" if needed else "may be dropped")


@pytest.mark.parametrize(("frequency", "needed"), [(2.0, True), (30.0, False)])
def test_gravity_of_a_fast_blade_is_judged_by_its_share_of_the_torque(frequency, needed):
    row = row_of(arm(frequency, {}, bending_stiffness=2e5), "gravity")
    share = 1 - rigid_rms(frequency, 0.0, 0.0, 0.0) / rigid_rms(frequency, 0.0, 0.0, 9.81)
    assert (share > 0.01) == (row.torque > 0.01) == needed
    assert row.advice == ("keep" if needed else "may be dropped")


@pytest.mark.parametrize(("share", "needed"), [(0.1, True), (0.001, False)])
def test_a_gear_with_its_rotor_is_judged_by_its_inertia(share, needed):
    """The reflected inertia J_h beside that of the arm: on a horizontal arm its share of the torque."""
    effects = {"gravity": None, "hub": {"inertia": share * LINE_MASS * LENGTH**3 / 3}}
    judge(arm(1.0, effects, modes=0, bending_stiffness=None), "hub", "torque", share / (1 + share), needed)


@pytest.mark.parametrize(("slenderness", "needed"), [(0.1, True), (0.02, False)])
def test_rotary_inertia_of_a_beam_is_judged_by_its_thickness(slenderness, needed):
    """First clamped-free mode: Rayleigh's quotient with r^2 (integral of phi'^2) beside the integral of phi^2, 4.648 / l^2."""
    effects = {"gravity": None, "rotary_inertia": {"radius_of_gyration": slenderness * LENGTH}}
    share = 1 - 1 / np.sqrt(1 + 4.648 * slenderness**2)
    judge(arm(0.1, effects, drive="prescribed", modes=2), "rotary_inertia", "frequency", share, needed)


@pytest.mark.parametrize("damping", [0.0, 1e-4])
def test_a_compliance_across_the_plane_that_nothing_reaches_changes_nothing(damping):
    """A planar arm never tilts in its bearing: neither on, undamped or damped, nor off does it change what is asked."""
    bearing = {"bearing_compliance": {"stiffness": 5e4, "inertia": 0.1, "damping": damping}}
    for effects in (bearing, {}):
        row = row_of(arm(0.5, effects), "bearing_compliance")
        assert row.significance < 1e-9
        assert row.unfelt == ("beta11", "beta12")
        assert "neither motors nor motion reach beta11, beta12" in row.advice


def test_a_compliance_that_gravity_bends_is_no_such_part():
    """Turned about an axis that is not across gravity, the same bearing tilts under the arm's weight."""
    bearing = {"bearing_compliance": {"stiffness": 200.0, "inertia": 0.1, "damping": 5.0}}
    row = row_of(arm(0.5, bearing, axis=[0.0, 0.6, 0.8]), "bearing_compliance")
    assert row.unfelt == ()
    assert row.path > 0.01
    assert row.advice == "keep"


@pytest.mark.slow
def test_full_and_minimal_scene_agree_in_every_mark_of_the_drives():
    bearing = {"bearing_compliance": {"stiffness": 5e4, "inertia": 0.1}}
    scene = arm(0.5, bearing, limits={"peak": "4 N m", "continuous": "3 N m"})
    found = fl.audit(scene)
    smaller = fl.parse_scene(tomllib.loads(minimal_text(found, found.minimal)))
    marks = []
    for one in (scene, smaller):
        answer = analyse(one)
        marks.append([(d.what, d.joint, d.exceeds) for d in answer.load(answer.own).demands])
    assert marks[0] == marks[1]
    assert any(exceeds for _, _, exceeds in marks[0])
