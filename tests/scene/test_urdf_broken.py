"""URDF files that are wrong, by hand and at random: each ends with a message that says where."""

import random
import re
import xml.etree.ElementTree as ET

import pytest

import flexlin as fl
from flexlin.cli import BAD_INPUT, main
from flexlin.scene import models_folder
from tests.mechanics.scenes import swinging

R3 = models_folder() / "manutec-r3.urdf"
TEXT = R3.read_text(encoding="utf-8")


def robot(**more):
    return {"robot": {"urdf": R3.name}, **more}


@pytest.mark.parametrize(
    ("tables", "key"),
    [
        ({"robot": {"urdf": "../" * 9 + "etc/passwd"}}, "robot.urdf"),
        ({"robot": {"urdf": "/etc/passwd"}}, "robot.urdf"),
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
