"""Robots from URDF files: the same mechanics, chains, beams and springs; wrong files end with a message that says where."""

import random
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexlin as fl
from flexlin.cli import BAD_INPUT, main
from flexlin.scene import angles_of, models_folder, rotation_of
from tests.mechanics.scenes import swinging, value
from tests.mechanics.spatial import random_chain, scene_table

ROBOTS = Path(__file__).parents[1] / "robots"
R3 = models_folder() / "manutec-r3.urdf"
TEXT = R3.read_text(encoding="utf-8")


def put(folder, text):
    """A robot's file."""
    path = folder / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    return path


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
    """Fixed joints merged: the forces are those of the links as a scene has them, which the mechanics' jury judges."""
    rng = np.random.default_rng(seed)
    links = random_chain(rng, 4, fixed=0.4)
    table = fl.parse_scene(scene_table(links))
    raw = fl.scene_from_urdf(put(tmp_path, xml_of(links))).model_dump(mode="json", by_alias=True, exclude_unset=True)
    read = fl.parse_scene(raw, overrides={"effects.gravity": table.effects.gravity.model_dump()})
    assert len(read.links) == 4
    assert "<visual>" in raw["source"]
    state = rng.normal(size=(3, 4))
    forces, expected = (value(fl.build_manipulator(scene), "residual", *state) for scene in (read, table))
    np.testing.assert_allclose(forces, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


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


@pytest.mark.parametrize(("parent", "kind"), [("base", "fixed"), ("link_2", "revolute")])
def test_a_negative_inertia_beside_the_chain_is_not_judged(parent, kind, tmp_path):
    """On what stands still, and behind a joint that is left out: as the antennas of TIAGo and the legs of Romeo."""
    tip = fl.scene_from_urdf(R3).links[-1].name.replace("axis", "link")

    def scene_with(parent, kind):
        body = '<inertial><mass value="0.3"/><inertia ixx="-3e-3" iyy="-3e-3" izz="-3e-3"/></inertial>'
        antenna = f'<link name="antenna">{body}</link>'
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


def robot(**more):
    return {"robot": {"urdf": R3.name}, **more}


@pytest.mark.parametrize(
    ("tables", "key"),
    [
        ({"robot": {"urdf": "../" * 9 + "etc/passwd"}}, "robot.urdf"),
        ({"robot": {"urdf": "nowhere.urdf"}}, "robot.urdf"),
        ({"robot": {}}, "robot.urdf"),
        ({"robot": {"urdf": R3.name, "meshes": True}}, "robot.meshes"),
        (robot(joints={"axis_9": {"stiffness": 1.0}}), "joints.axis_9"),
        (robot(joints={"axis_1": {"gear": 0.0}}), "joints.axis_1"),
        (robot(joints={"axis_1": {"stiffness": 3.0}}), "effects.joint_flexibility.motor_inertia.0"),
        (robot(flexible={"link_9": {}}), "flexible.link_9"),
        (robot(flexible={"link_2": {"EI": 1.0}}), "flexible.link_2.EI"),
        (robot(flexible={"link_2": {"modes": 1}}), "links.1.bending_stiffness"),
        (robot(links=[{"length": 1.0}]), "links"),
        ({"joints": {"axis_1": {"stiffness": 3.0}}}, "joints"),
    ],
)
def test_scenes_that_name_a_robot_wrongly(tables, key):
    motion = swinging(*[{"amplitude": 0.1}] * 6)
    with pytest.raises(fl.errors.SceneError) as caught:
        fl.parse_scene({"schema": 1, "title": "t", "motion": motion, **tables}, folder=R3.parent)
    assert key in {problem.key for problem in caught.value.problems}, caught.value


def test_a_scene_whose_robot_file_is_broken_names_its_key_and_the_line(tmp_path):
    (tmp_path / "half.urdf").write_text(TEXT[: len(TEXT) // 2], encoding="utf-8")
    with pytest.raises(fl.errors.SceneError, match=r"robot\.urdf: line \d+") as caught:
        fl.parse_scene({"schema": 1, "title": "t", "robot": {"urdf": "half.urdf"}}, folder=tmp_path)
    assert "half.urdf" in str(caught.value)


NUMBERS = re.compile(r"(-?\d*\.?\d+([eE]-?\d+)?\s*)+")
ROBOT, MASS, PLACE, AXIS = '<robot name="Manutec', 'value="56.5"', 'xyz="0 0.65 0"', '<axis xyz="1 0 0"/>'
ORIGIN, JOINT_3 = f'<origin {PLACE} rpy="0 0 0"/>', '<joint name="axis_3" type="continuous">'
BROKEN = {
    "doctype": (ROBOT, f'<!DOCTYPE r [<!ENTITY a "b">]>\n{ROBOT}'),
    "external entity": (ROBOT, f'<!DOCTYPE r SYSTEM "file:///etc/passwd">\n{ROBOT}'),
    "unknown entity": (MASS, 'value="&lol;"'),
    "two ends": ('<child link="link_3"/>', '<child link="link_2"/>'),
    "circle": ('<parent link="base"/>', '<parent link="link_4"/>'),
    "no such link": ('<parent link="link_3"/>', '<parent link="link_33"/>'),
    "nan": (MASS, 'value="nan"'),
    "infinite": (PLACE, 'xyz="0 inf 0"'),
    "two numbers": (PLACE, 'xyz="0 0.65"'),
    "xacro": (MASS, 'value="${mass}"'),
    "negative mass": (MASS, 'value="-56.5"'),
    "negative inertia": ('iyy="0.64"', 'iyy="-0.64"'),
    "no inertia": ('ixy="-0.46"', 'ixy="-4.6"'),
    "no axis": (AXIS, '<axis xyz="0 0 0"/>'),
    "an axis of hardly any length": (AXIS, '<axis xyz="1e-300 0 0"/>'),
    "unknown type": ('type="continuous"', 'type="screw"'),
    "floating": ('type="continuous"', 'type="floating"'),
    "same name": ('name="link_3"', 'name="link_2"'),
    "same joint": ('name="axis_3"', 'name="axis_2"'),
    "not closed": ("</robot>", ""),
    "not a robot": ("robot", "sdf"),
    "control": ('name="link_3"', 'name="link_3\x1b[2J"'),
    "misspelt attribute": ('xyz="0.172 0.205 0"', 'xyy="0.172 0.205 0"'),
    "misspelt key": ('ixy="-0.46"', 'ixyz="-0.46"'),
    "misspelt element": (ORIGIN, ORIGIN.replace("origin", "orgin")),
    "misspelt inertial": ('<inertial>\n      <origin xyz="0.172', '<inertail/><inertial>\n      <origin xyz="0.172'),
    "text": (ORIGIN, "9e999"),
    "xacro macro": ('<link name="base"/>', '<link name="base"/><xacro:arm xmlns:xacro="http://ros.org/wiki/xacro"/>'),
    "xacro name": ('name="axis_3"', 'name="${prefix}axis_3"'),
    "mimic in a circle": (
        f"{AXIS}\n  </joint>\n  {JOINT_3}", f'{AXIS}<mimic joint="axis_3"/></joint>{JOINT_3}<mimic joint="axis_2"/>'
    ),
    "mimic of a later joint": (JOINT_3, f'{JOINT_3}<mimic joint="axis_5"/>'),
}  # fmt: skip


PIECES = ["<", '"', "&amp;&x;", "]]>", "\x00", "<!--", "9e999", "-", "<robot>", "é\U0001f600"]


def spoil(seed):
    """The r3's file with bytes lost, doubled, or put elsewhere."""
    rng, text = random.Random(seed), TEXT
    for _ in range(rng.randint(1, 4)):
        a, b = sorted(rng.randrange(len(text)) for _ in range(2))
        b = min(b, a + rng.choice([1, 3, 40, 400]))
        text = text[:a] + rng.choice(["", text[a:b] * 2, *PIECES]) + text[b:]
    return text


def is_sound(text):
    """Whether a spoiled file still is the r3's but for comments and the values of numbers, by a parser of its own."""

    def shape(element):
        stray = (element.text or "").strip() or any((child.tail or "").strip() for child in element)
        values = [(k, "number" if NUMBERS.fullmatch(v.strip()) else v) for k, v in sorted(element.attrib.items())]
        return stray, element.tag, values, [shape(child) for child in element]

    try:
        return shape(ET.fromstring(text)) == shape(ET.fromstring(TEXT))
    except (ET.ParseError, ValueError):
        return False


@pytest.mark.slow
def test_two_hundred_broken_files_end_with_a_message_that_says_where(tmp_path, capsys):
    cases = [TEXT.replace(old, new) for old, new in BROKEN.values()]
    assert TEXT not in cases
    cases += ["", "{}", "\ufeff", "<a>" * 200_000, "<robot>" + "<link name='a'/>" * 60_000, "<robot><link/></robot>"]
    cases += [re.sub(r"<inertial>.*?</inertial>", "", TEXT, flags=re.S)]
    cases += ["<robot name='a'><link name='a'/></robot>", "<robot><link name='a'/><link name='b'/></robot>"]
    cases += [spoiled for seed in range(400) if not is_sound(spoiled := spoil(seed))][:200]
    assert len(cases) >= 230
    for i, text in enumerate(cases):
        path, out = tmp_path / f"{i}.urdf", tmp_path / f"{i}.toml"
        path.write_bytes(text.encode("utf-8", errors="surrogatepass"))
        code, told = main(["import", str(path), "--out", str(out)]), capsys.readouterr().err
        assert code == BAD_INPUT, text[:200]
        assert not out.exists()
        assert re.search(r"line \d|file:|tip:|base:", told), (told, text[:300])
        assert "\x1b" not in told
        assert len(told) < 4000
        if i < len(BROKEN):
            with pytest.raises(fl.errors.SceneError, match="line "):
                fl.scene_from_urdf(path)
