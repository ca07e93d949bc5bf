"""The bridge: two routes, known answers of independent programs, limits. Of an arm at rest natural frequencies with the joints held, and
quasi-static bending, against closed forms."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import examine
from flexlin.cli import main
from flexlin.errors import ArgumentError, InputError, MotionError
from flexlin.linearization import by_jacobian, by_kronecker
from tests.mechanics.scenes import linear, plain_scene, scene_of, swinging

LINK = {"length": 0.7, "mass_per_length": 0.4, "bending_stiffness": 3.0, "modes": 2}
ALL = {
    "gravity": {},
    "payload": {"mass": 0.2, "inertia": 0.01},
    "hub": {"inertia": [0.05, 0.02], "mass": [0.0, 0.3], "radius": [0.05, 0.02]},
    "geometric_stiffening": {},
    "modal_damping": {"ratio": 0.02},
    "viscous_friction": {"coefficient": 0.1},
}


def two_links(effects=None):
    joints = [{"amplitude": 0.7, "mean": 0.3}, {"amplitude": -0.9, "mean": 0.8, "phase": 0.5}]
    return plain_scene([LINK, {**LINK, "length": 0.5}], swinging(*joints, frequency=0.8), effects=effects or {})


@pytest.mark.parametrize("effects", [{}, {"gravity": {}}, ALL], ids=["none", "gravity", "all"])
def test_both_routes_agree_on_two_links(effects):
    scene = two_links(effects)
    arm = fl.build_manipulator(scene)
    fast, paper = (fl.linearize(arm, scene.motion, route=route) for route in ("jacobian", "kronecker"))
    t = np.linspace(0.0, fast.period, 11)
    for name in ("M", "D", "K", "h", "B"):
        a, b = getattr(fast, name)(t), getattr(paper, name)(t)
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * np.abs(a).max())
    assert np.abs(fast.D(t)).max() > 0.1  # on two links D_L is full


def test_rigid_two_link_arm():
    """l = m = 1, centre inertias 1/12, g = 9.81: K and D as computed with CasADi, SymPy and Pinocchio, which agree to the digits given."""
    q, q1, q2 = np.array([0.3, 0.7]), np.array([1.5, -2.0]), np.array([3.0, -5.0])
    link = {"length": 1.0, "mass_per_length": 1.0}
    arm = fl.build_manipulator(plain_scene([link] * 2, swinging(*[{"amplitude": 0.0}] * 2), effects={"gravity": {}}))
    for route in (by_jacobian, by_kronecker):
        matrices = ca.Function("f", [arm.s, arm.s_dot, arm.s_ddot], list(route(arm)))
        _, D, K = (m.full() for m in matrices(q, q1, q2))
        np.testing.assert_allclose(K, [[-8.475995, -3.684682], [-4.127415, -4.233294]], atol=5e-7)
        np.testing.assert_allclose(D, [[1.288435, 0.322109], [0.966327, 0.0]], atol=5e-7)


TWO = two_links()
QUANSER, STIFFNESS = fl.load_scene("quanser-two-link"), "effects.joint_flexibility.stiffness.0"
LED = {"kind": "rotation", "joints": [{"rate": 1.0, "drive": "prescribed"}]}


def linearize(*given, **more):
    return fl.linearize(fl.build_manipulator(TWO), *given, **more)


BAD = [
    (ArgumentError, "route", lambda: linearize(TWO.motion, route="guess")),
    (MotionError, "number of joints", lambda: linearize(fl.load_scene("single-link").motion)),
    (ArgumentError, "kp", lambda: linearize(TWO.motion, fl.load_scene("single-link").control)),
    (InputError, "nothing is left", lambda: linear(plain_scene([{"length": 1.0, "mass_per_length": 1.0}], LED))),
    (ArgumentError, "another kind", lambda: linearize("harmonic")),
    (ArgumentError, "cannot be left free", lambda: fl.build_manipulator(TWO, ["links.0.modes"])),
    # the symbol would let the joint go: fits of such a number ended in overflow
    (ArgumentError, "for a joint that is stiff", lambda: fl.build_manipulator(QUANSER, [STIFFNESS])),
    (ArgumentError, "complex", lambda: fl.PeriodicSystem(1j * np.eye(2), 1.0)),
]


@pytest.mark.parametrize(("error", "words", "call"), BAD, ids=range(len(BAD)))
def test_bad_requests(error, words, call):
    with pytest.raises(error, match=words):
        call()


UNIT = {"length": 1.0, "mass_per_length": 1.0, "bending_stiffness": 1.0, "modes": 6}


def examined(*links, effects=None, frequency=0.01, **motion):
    still = swinging(*[{"mean": 0.0, "amplitude": 0.0, **motion} for _ in links], frequency=frequency)
    scene = scene_of(*links, effects=effects, motion=still)
    return examine(linear(scene), np.array([link.length for link in scene.links]))


def test_a_cantilever_with_its_own_mass_at_the_tip():
    """beta l = 1.24792, 4.03114 for a tip mass of the beam's own; the joint is held although a torque drives it."""
    rest = examined({**UNIT, "mode_shapes": "clamped-loaded"}, effects={"payload": {"mass": 1.0}})
    assert 2 * np.pi * rest.frequencies[:2] == pytest.approx([1.24792**2, 4.03114**2], rel=1e-5)


def test_bending_under_gravity_and_along_a_motion():
    """w = rhoA g l^4 / (8 EI) where the link lies level; turned by a cos(W t) near its first frequency, 0.56 Hz, its tip goes by

    a l (sin k + sinh k) / (k (1 + cos k cosh k)), k^4 = rhoA W^2 l^4 / EI; only the loads' static deflection was found.
    """
    still = examined(UNIT, effects={"gravity": {"acceleration": 0.08}}).bending
    assert [one[0] for one in (still.at_rest, still.moving, still.largest)] == pytest.approx([0.01] * 3, rel=1e-3)
    swung, k = examined(UNIT, amplitude=1e-3, frequency=0.5).bending, np.sqrt(np.pi)
    known = 1e-3 * ((np.sin(k) + np.sinh(k)) / (k * (1 + np.cos(k) * np.cosh(k))) - 1)
    assert [swung.at_rest[0], swung.moving[0]] == pytest.approx([0, known], rel=1e-3, abs=0)


def test_the_second_of_two_links_bends_by_itself():
    """Each link's deflection is against its own base, whatever those before it do."""
    two = examined({**UNIT, "bending_stiffness": 100.0}, UNIT, effects={"gravity": {"acceleration": 0.08}})
    assert two.bending.at_rest == pytest.approx([0.01 * (1 / 8 + 1 / 3 + 1 / 4) * 8 / 100, 0.01], rel=5e-3)


def test_a_soft_link_beside_a_stiff_one_does_not_give_way():
    """It was said to, where its square was less than 1e-12 of the largest: the other is as good as rigid."""
    stiff, rigid = {**UNIT, "bending_stiffness": 1e9, "modes": 12}, {**UNIT, "modes": 0}
    assert examined(UNIT, stiff).frequencies[0] == pytest.approx(examined(UNIT, rigid).frequencies[0], rel=1e-6)


BUCKLED = [(2.6, "world", 0, True), (2.4, "world", 0, False), (21.0, "tip", 0, True), (-2.6, "world", np.pi, True)]


@pytest.mark.parametrize(("load", "frame", "swung", "gives"), BUCKLED)
def test_an_arm_that_buckles(load, frame, swung, gives):
    """As it begins, or swung half round: a load that pulled it then pushes."""
    effects = {"geometric_stiffening": {}, "tip_force": {"force": [-load, 0.0, 0.0], "frame": frame}}
    assert examined(UNIT, effects=effects, amplitude=swung).gives_way == gives


def test_a_coordinate_without_a_spring_gives_way_and_a_rigid_arm_has_nothing_to_bend():
    """An arm of one's own, whose mass slides along it freely."""
    s, s_dot = ca.SX.sym("s", 2), ca.SX.sym("s_dot", 2)
    T = (2 + (1 + s[1]) ** 2) * s_dot[0] ** 2 / 2 + s_dot[1] ** 2 / 2
    arm = fl.Manipulator.from_lagrangian(s, s_dot, T, 9.81 * ca.sin(s[0]), B=ca.DM([1, 0]))
    assert examine(fl.linearize(arm, swinging({"amplitude": 0.2})), np.ones(1)).gives_way
    assert examined({**UNIT, "modes": 0}) is None


STRIP = """schema = 1
title = "A strip"
motion = { kind = "harmonic", frequency = 0.1, joints = [{ amplitude = 0.3 }] }
effects = { gravity = {} }
[[links]]
length = 1.0
section = { width = "30 mm", thickness = "2 mm", material = "aluminium" }
modes = 3
"""


def test_check_prints_sections_frequencies_and_what_bends_too_far(tmp_path, capsys):
    (path := tmp_path / "strip.toml").write_text(STRIP)
    assert main(["check", str(path)]) == 0
    said = capsys.readouterr().out
    for words in (
        "link 1       0.1626 kg/m, EI in y 1.378 N m^2, EI in z 310.1 N m^2, GJ 1.956 N m^2, rho I_p 1.225e-05 kg m",
        "at rest      1.629, 10.21, 28.59 Hz, its joints held where the motion begins",
        "link 1       bends by 145 mm under gravity",
    ):
        assert words in said
    assert "stiffen" not in said
    assert main(["check", str(path), "--set", "links.0.section.thickness=1 mm", "effects.tip_force={}"]) == 0
    said = capsys.readouterr().out.partition("579 mm at rest and 581 mm along the motion, 58 % of its length")[2]
    assert "stiffen the link" in said


def test_a_missing_unit_is_asked_for(capsys):
    """A strip of 1000 m where 1000 mm was meant."""
    change = ["links.0.length=1000", "designs=[]", "effects.geometric_stiffening=off"]
    assert main(["check", "single-link", "--set", *change]) == 0
    assert "no arm does; is a unit missing?" in capsys.readouterr().out


def test_rounding_bends_no_link():
    """The links of an unloaded arm, and rigid ones without a length, were said to bend by some 1e-16 m."""
    effects = {"payload": {"mass": 0.1}, "geometric_stiffening": {}}
    for scene in (scene_of({**UNIT, "modes": 2}, effects=effects, motion=LED), fl.load_scene("puma-560")):
        bending = examine(linear(scene), np.array([link.length for link in scene.links])).bending
        assert not np.any([bending.at_rest, bending.moving])
