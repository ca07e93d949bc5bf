"""Robots from URDF files: the same mechanics, chains, beams and springs."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexlin as fl
from flexlin.cli import BAD_INPUT, main
from flexlin.scene import angles_of, models_folder, rotation_of
from tests.mechanics.scenes import swinging, value
from tests.mechanics.spatial import inverse_dynamics, random_chain

ROBOTS = Path(__file__).parents[1] / "robots"
R3 = models_folder() / "manutec-r3.urdf"
TEXT = R3.read_text(encoding="utf-8")
GRAVITY = {"acceleration": float(np.linalg.norm([1.3, -4.2, -8.5])), "direction": [1.3, -4.2, -8.5]}


def put(folder, text):
    """A robot's file."""
    path = folder / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    return path


def residual(scene, *state):
    """Forces of the arm under the gravity of the mechanics' tests."""
    raw = scene.model_dump(mode="json", by_alias=True, exclude_unset=True)
    arm = fl.build_manipulator(fl.parse_scene(raw, overrides={"effects.gravity": GRAVITY}))
    return value(arm, "residual", *state)[:, 0]


def xml_of(links):
    """A random chain of the mechanics' tests as a URDF file; names by number."""
    lines = ['<robot name="chain"><link name="l0"/>']
    for i, link in enumerate(links):
        (a, b, c), J, m = link["body"]["centre"], link["body"]["inertia"], link["mount"]
        entries = " ".join(f'i{key}="{value!r}"' for key, value in J.items())
        lines.append(
            f'<link name="l{i + 1}"><inertial><origin xyz="{a!r} {b!r} {c!r}"/><mass value="{link["body"]["mass"]!r}"/>'
            f"<inertia {entries}/></inertial><visual><geometry><mesh filename='/etc/passwd'/></geometry></visual></link>"
        )
        axis = " ".join(map(repr, link.get("axis", [1.0, 0.0, 0.0])))
        lines.append(
            f'<joint name="j{i + 1}" type="{link["joint"]}"><parent link="l{i}"/><child link="l{i + 1}"/>'
            f'<origin xyz="{" ".join(map(repr, m["xyz"]))}" rpy="{" ".join(map(repr, m["rpy"]))}"/><axis xyz="{axis}"/></joint>'
        )
    return "\n".join([*lines, "</robot>"])


@pytest.mark.parametrize("seed", range(6))
def test_the_same_mechanics(seed, tmp_path):
    """Fixed joints merged: an independent program on the chain as the file has it."""
    rng = np.random.default_rng(seed)
    links = random_chain(rng, 4, fixed=0.4)
    scene = fl.scene_from_urdf(put(tmp_path, xml_of(links)))
    assert len(scene.links) == 4
    assert "<visual>" in scene.source
    state = rng.normal(size=(3, 4))
    expected = inverse_dynamics(links, *state)
    np.testing.assert_allclose(residual(scene, *state), expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_branches_and_the_chosen_chain(tmp_path):
    """What hangs on the chain by fixed joints belongs to it; what moves beside it is left out, and named."""
    extra = """<link name="tool"><inertial><origin xyz="0 0.1 0"/><mass value="2"/></inertial></link>
    <joint name="mount" type="fixed"><parent link="link_4"/><child link="tool"/><origin xyz="0 0.2 0"/></joint>
    <link name="finger"/><joint name="grip" type="prismatic"><parent link="tool"/><child link="finger"/></joint></robot>"""
    path = put(tmp_path, TEXT.replace("</robot>", extra))
    scene = fl.scene_from_urdf(path, tip="link_4")
    assert [link.name for link in scene.links] == ["axis_1", "axis_2", "axis_3", "axis_4"]
    body = scene.links[3].body
    assert body.mass == pytest.approx(30.7)
    assert body.centre == pytest.approx((0, 0.6 / 30.7, 0))
    assert all(name in scene.source for name in ("grip", "axis_5"))
    for words, ends in (
        ("tip: got 2 possible links", {}),
        ("base: got 'nowhere'", {"base": "nowhere", "tip": "link_4"}),
    ):
        with pytest.raises(fl.errors.SceneError, match=words):
            fl.scene_from_urdf(path, **ends)


def test_a_joint_that_follows_another(tmp_path):
    """q3 = 2 q2 + 0.1 is no coordinate; its forces act on q2 twice."""
    links = random_chain(np.random.default_rng(3), 3, fixed=0.0)
    links[2]["joint"] = "revolute"
    mimic = '<mimic joint="j2" multiplier="2" offset="0.1"/><parent link="l2"'
    scene = fl.scene_from_urdf(put(tmp_path, xml_of(links).replace('<parent link="l2"', mimic)))
    assert sum(link.moves for link in scene.links) == 2
    q, rate, acceleration = np.random.default_rng(1).normal(size=(3, 2))
    full = [np.append(x, 2 * x[1] + extra) for x, extra in ((q, 0.1), (rate, 0.0), (acceleration, 0.0))]
    forces = inverse_dynamics(links, *full)
    expected = forces[:2] + np.array([0, 2 * forces[2]])
    np.testing.assert_allclose(residual(scene, q, rate, acceleration), expected, rtol=1e-10)


def test_springs_and_gears_of_the_r3():
    """Published springs on the motor's side, c gear^2: 474075, 352800, 208800 N m/rad; axes 4 to 6 are stiff."""
    scene = fl.load_scene("manutec-r3")
    assert scene.effects.joint_flexibility.stiffness == pytest.approx((474075, 352800, 208800, 0, 0, 0))
    arm = fl.build_manipulator(scene)
    assert arm.names[6:] == ("theta1", "theta2", "theta3")
    assert arm.drives == (6, 7, 8, 3, 4, 5)
    softer = fl.load_scene("manutec-r3", {"joints.axis_2.stiffness": 4.0})
    assert softer.effects.joint_flexibility.stiffness[1] == pytest.approx(176400)


def test_a_link_that_bends_keeps_its_place():
    """[flexible.LINK]: with stiff beams of no twist the arm moves as the rigid one, whose link is then a rod."""
    motion = swinging(*[{"amplitude": 0.1}] * 6)

    def scene_of(**flexible):
        raw = {"schema": 1, "title": "bent", "robot": {"urdf": R3.name}, "motion": motion, "flexible": flexible}
        return fl.parse_scene(raw, folder=R3.parent)

    beam, tube = {"modes": {"y": 1, "z": 1}}, {"diameter": "0.2 m", "wall": "8 mm", "material": "aluminium"}
    stiff = {**beam, "bending_stiffness": [2e4, 3e4]}
    bent, q, tips = scene_of(link_2=stiff), np.random.default_rng(0).normal(size=6), []
    assert bent.links[1].length == pytest.approx(0.65)
    assert bent.links[1].mass_per_length == pytest.approx(56.5 / 0.65)
    for arm in map(fl.build_manipulator, (scene_of(), bent)):
        tips.append(value(arm, "points", np.append(q, np.zeros(arm.n - 6)))[:, -1])
    np.testing.assert_allclose(tips[1], tips[0], rtol=0, atol=1e-12)
    other = scene_of(link_2={**beam, "section": tube})
    area, second = np.pi * (0.1**2 - 0.092**2), np.pi / 4 * (0.1**4 - 0.092**4)
    assert other.links[1].mass_per_length == pytest.approx(2710.0 * area)
    assert other.links[1].bending_stiffness == pytest.approx((68.9e9 * second,) * 2)
    assert "kg by its section" in other.source
    with pytest.raises(fl.errors.SceneError, match="no bending_stiffness beside section"):
        scene_of(link_2={**stiff, "section": tube})


def test_what_import_writes_is_the_same_arm(tmp_path, capsys):
    out = tmp_path / "arm.toml"
    assert main(["import", str(R3), "--out", str(out)]) == 0
    assert "axis_6" in capsys.readouterr().out
    same, own = (scene.model_dump_json(exclude={"source"}) for scene in (fl.load_scene(out), fl.scene_from_urdf(R3)))
    assert same == own
    assert main(["import", str(R3), "--out", str(out)]) == BAD_INPUT


def test_what_import_writes_has_no_minus_zero(tmp_path):
    """Half turns, quarter turns and backward axes: 0, not -0, and numbers that read as they should."""
    text = TEXT.replace('rpy="0 0 0"', 'rpy="-0 0 -1.5707963267948966"')
    path = put(tmp_path, text.replace('<axis xyz="1 0 0"/>', '<axis xyz="-1 -0.0 0"/>'))
    assert main(["import", str(path), "--out", str(tmp_path / "arm.toml")]) == 0
    assert not re.search(r"-0(\.0*)?(?![.\d])", (tmp_path / "arm.toml").read_text())


@pytest.mark.parametrize("slack", [0.0, 1e-15, 1e-13, 1e-12, 5e-12, 1e-9, 1e-6, 1e-3, 1.0])
def test_angles_make_the_rotation_again_also_near_a_quarter_turn(slack):
    """A product of rotations whose pitch is almost 90 degrees: what is lost of the yaw, the roll puts right."""
    rng = np.random.default_rng(5)
    for sign in (-1, 1):
        yaw, roll = rng.uniform(-3, 3, 2)
        first = Rotation.from_rotvec(rng.normal(size=3))
        last = first.inv() * Rotation.from_euler("ZYX", [yaw, sign * (np.pi / 2 - slack), roll])
        R = first.as_matrix() @ last.as_matrix()
        np.testing.assert_allclose(rotation_of(tuple(angles_of(R))), R, rtol=0, atol=3e-15)
        np.testing.assert_allclose(Rotation.from_euler("xyz", angles_of(R)).as_matrix(), R, rtol=0, atol=3e-15)


OUTSIDE = [
    ("panda", "panda_hand_tcp", 7),
    ("baxter", "l_gripper_r_finger_tip", 8),
    ("alexander", "LEFT_FOOT_IMU_LINK", 6),
]


@pytest.mark.parametrize(("name", "tip", "joints"), OUTSIDE)
def test_robots_from_outside_are_read(name, tip, joints, tmp_path, capsys):
    """Real files: package:// meshes, transmissions, missing inertials, continuous and mimicking joints, branches."""
    out = tmp_path / f"{name}.toml"
    assert main(["import", str(ROBOTS / f"{name}.urdf"), "--tip", tip, "--out", str(out)]) == 0
    assert "without mass" in capsys.readouterr().out
    scene = fl.load_scene(out)
    assert len(scene.motion.joints) == joints
    assert name != "panda" or scene.links[-1].joint == "fixed"


def test_limits_become_those_of_the_drives_and_joints_stand_within_them():
    """The Panda: 87 and 12 N m, and a fourth joint that cannot stand at zero."""
    scene = fl.scene_from_urdf(ROBOTS / "panda.urdf", tip="panda_link8")
    assert scene.drives.torque.peak == (87, 87, 87, 87, 12, 12, 12)
    assert [joint.mean for joint in scene.motion.joints[:4]] == pytest.approx([0, 0, 0, (-3.0718 - 0.0698) / 2])


def test_what_resists_a_joint_that_follows_resists_its_leader(tmp_path):
    """q3 = -2 q2 with damper 0.3 and friction 0.5: 1.2 and 1.0 more on q2; q4 follows one beside the chain, q5 with it."""
    links = random_chain(np.random.default_rng(3), 5, fixed=0.0)
    rows = xml_of(links).replace('type="prismatic"', 'type="revolute"').split("<joint ")
    rules = 'joint="j2" multiplier="-2"', 'joint="far" multiplier="2" offset="1"', 'joint="far" offset="3"'
    for i, rule in enumerate(rules, start=3):
        mimic = f'<mimic {rule}/><dynamics damping="0.3" friction="0.5"/><parent'
        rows[i] = rows[i].replace("<parent", mimic, 1)
    far = '<link name="side"/><joint name="far" type="revolute"><parent link="l0"/><child link="side"/></joint></robot>'
    scene = fl.scene_from_urdf(put(tmp_path, "<joint ".join(rows).replace("</robot>", far)), tip="l5")
    assert "j4 moves by itself" in scene.source
    assert [link.name for link in scene.links if link.moves] == ["j1", "j2", "j4"]
    rule = scene.links[4].mimic
    assert (rule.link, rule.multiplier, rule.offset) == (3, 0.5, 2.5)
    assert scene.effects.viscous_friction.coefficient == pytest.approx((0, 1.2, 0, 0.3 * 1.25, 0))
    assert scene.effects.coulomb_friction.torque == pytest.approx((0, 1.0, 0, 0.75, 0))


BODY = '<inertial><mass value="0.3"/><inertia ixx="{0}" iyy="{0}" izz="{0}"/></inertial>'


@pytest.mark.parametrize(("parent", "kind"), [("base", "fixed"), ("link_2", "revolute")])
def test_a_negative_inertia_beside_the_chain_is_not_judged(parent, kind, tmp_path):
    """On what stands still, and behind a joint that is left out: as the antennas of TIAGo and the legs of Romeo."""
    tip = fl.scene_from_urdf(R3).links[-1].name.replace("axis", "link")

    def scene_with(parent, kind):
        antenna = f'<link name="antenna">{BODY.format("-3e-3")}</link>'
        joint = f'<joint name="a" type="{kind}"><parent link="{parent}"/><child link="antenna"/></joint></robot>'
        return fl.scene_from_urdf(put(tmp_path, TEXT.replace("</robot>", antenna + joint)), tip=tip)

    assert scene_with(parent, kind).links == fl.scene_from_urdf(R3).links
    with pytest.raises(fl.errors.SceneError, match=r"line \d+.*negative principal inertia in the chain, of 'antenna'"):
        scene_with("link_2", "fixed")


@pytest.mark.parametrize(
    "entries",
    ['ixx="0" ixy="0" ixz="2.4e-35" iyy="0" iyz="0" izz="0"', " ".join(f'i{2 * a}="-5.42e-20"' for a in "xyz")],
)
def test_an_inertia_of_a_mass_point_may_be_rounding(entries, tmp_path):
    """As the iCub's file has them: products beside zeros, and a hip of 0.526 kg with less than nothing."""
    body = f'<inertial><mass value="0.526"/><inertia {entries}/></inertial>'
    path = put(tmp_path, re.sub(r"<inertial>.*?</inertial>", body, TEXT, count=1, flags=re.DOTALL))
    assert not any(fl.scene_from_urdf(path).links[0].body.inertia.entries().values())
