"""Robots from URDF files: the same mechanics, chains, beams and springs; broken and hostile files refused with the line."""

import json
import random

import numpy as np
import pytest

import flexlin as fl
from flexlin.cli.main import BAD_INPUT, main
from flexlin.errors import SceneError
from flexlin.scene.library import models_folder
from tests.mechanics.spatial import inverse_dynamics, random_chain

R3 = models_folder() / "manutec-r3.urdf"
TEXT = R3.read_text(encoding="utf-8")
GRAVITY = {
    "effects.gravity": {"acceleration": float(np.linalg.norm([1.3, -4.2, -8.5])), "direction": [1.3, -4.2, -8.5]}
}


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
    """Fixed joints merged: Newton and Euler on the chain as the file has it."""
    rng = np.random.default_rng(seed)
    links = random_chain(rng, 4, fixed=0.4)
    path = tmp_path / "robot.urdf"
    path.write_text(xml_of(links), encoding="utf-8")
    scene = fl.scene_from_urdf(path)
    assert len(scene.links) == 4
    assert "<visual>" in scene.source
    scene = fl.parse_scene(scene.model_dump(mode="json", by_alias=True, exclude_unset=True), overrides=GRAVITY)
    arm = fl.build_manipulator(scene)
    q, rate, acceleration = rng.normal(size=(3, 4))
    expected = inverse_dynamics(links, q, rate, acceleration)
    got = np.array(arm.functions["residual"](q, rate, acceleration, []))[:, 0]
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_branches_and_the_chosen_chain(tmp_path):
    """What hangs on the chain by fixed joints belongs to it; what moves beside it is left out, and named."""
    extra = """<link name="tool"><inertial><origin xyz="0 0.1 0"/><mass value="2"/></inertial></link>
    <joint name="mount" type="fixed"><parent link="link_4"/><child link="tool"/><origin xyz="0 0.2 0"/></joint>
    <link name="finger"/><joint name="grip" type="prismatic"><parent link="tool"/><child link="finger"/></joint></robot>"""
    path = tmp_path / "robot.urdf"
    path.write_text(TEXT.replace("</robot>", extra), encoding="utf-8")
    with pytest.raises(SceneError, match="tip: got 2 possible links"):
        fl.scene_from_urdf(path)
    scene = fl.scene_from_urdf(path, tip="link_4")
    assert [link.name for link in scene.links] == ["axis_1", "axis_2", "axis_3", "axis_4"]
    body = scene.links[3].body
    assert body.mass == pytest.approx(30.7)
    assert body.centre == pytest.approx((0, 0.6 / 30.7, 0))
    assert "grip" in scene.source
    assert "axis_5" in scene.source
    with pytest.raises(SceneError, match="base: got 'nowhere'"):
        fl.scene_from_urdf(path, base="nowhere", tip="link_4")


def test_a_joint_that_follows_another(tmp_path):
    """q3 = 2 q2 + 0.1 is no coordinate; its forces act on q2 twice."""
    links = random_chain(np.random.default_rng(3), 3, fixed=0.0)
    path = tmp_path / "robot.urdf"
    path.write_text(
        xml_of(links).replace(
            'type="' + links[2]["joint"] + '"><parent link="l2"',
            'type="revolute"><mimic joint="j2" multiplier="2" offset="0.1"/><parent link="l2"',
        )
    )
    links[2]["joint"] = "revolute"
    scene = fl.scene_from_urdf(path)
    scene = fl.parse_scene(scene.model_dump(mode="json", by_alias=True, exclude_unset=True), overrides=GRAVITY)
    arm = fl.build_manipulator(scene)
    assert arm.names == ("q1", "q2")
    q, rate, acceleration = np.random.default_rng(1).normal(size=(3, 2))
    full = [np.append(x, 2 * x[1] + extra) for x, extra in ((q, 0.1), (rate, 0.0), (acceleration, 0.0))]
    forces = inverse_dynamics(links, *full)
    got = np.array(arm.functions["residual"](q, rate, acceleration, []))[:, 0]
    np.testing.assert_allclose(got, forces[:2] + np.array([0, 2 * forces[2]]), rtol=1e-10)


def test_springs_and_gears_of_the_r3():
    """Published springs on the motor's side, c gear^2: 474075, 352800, 208800 N m/rad; axes 4 to 6 are stiff."""
    scene = fl.load_scene("manutec-r3")
    assert scene.effects.joint_flexibility.stiffness == pytest.approx((474075, 352800, 208800, 0, 0, 0))
    arm = fl.build_manipulator(scene)
    assert arm.names[6:] == ("theta1", "theta2", "theta3")
    assert arm.drives == (6, 7, 8, 3, 4, 5)
    softer = fl.load_scene("manutec-r3", {"joints.axis_2.stiffness": 4.0})
    assert softer.effects.joint_flexibility.stiffness[1] == pytest.approx(176400)


def test_a_link_that_bends_keeps_its_place(tmp_path):
    """[flexible.LINK]: with stiff beams of no twist the arm moves as the rigid one, whose link is then a rod."""
    robot = {"urdf": R3.name}
    raw = {
        "schema": 1,
        "title": "bent",
        "robot": robot,
        "motion": {"kind": "harmonic", "frequency": 1.0, "joints": [{"amplitude": 0.1}] * 6},
    }
    beam = {"modes": {"y": 1, "z": 1}, "bending_stiffness": [2e4, 3e4]}
    bent = fl.parse_scene({**raw, "flexible": {"link_2": beam}}, folder=R3.parent)
    rigid = fl.parse_scene(raw, folder=R3.parent)
    assert bent.links[1].length == pytest.approx(0.65)
    assert bent.links[1].mass_per_length == pytest.approx(56.5 / 0.65)
    q = np.random.default_rng(0).normal(size=6)
    arms = [fl.build_manipulator(scene) for scene in (rigid, bent)]
    tips = [np.array(arm.functions["points"](np.append(q, np.zeros(arm.n - 6)), []))[:, -1] for arm in arms]
    np.testing.assert_allclose(tips[1], tips[0], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("tables", "key"),
    [
        ({"robot": {"urdf": "../" * 9 + "etc/passwd"}}, "robot.urdf"),
        ({"robot": {"urdf": "/etc/passwd"}}, "robot.urdf"),
        ({"robot": {"urdf": "nowhere.urdf"}}, "robot.urdf"),
        ({"robot": {}}, "robot.urdf"),
        ({"robot": {"urdf": R3.name, "meshes": True}}, "robot.meshes"),
        ({"robot": {"urdf": R3.name}, "joints": {"axis_9": {"stiffness": 1.0}}}, "joints.axis_9"),
        ({"robot": {"urdf": R3.name}, "joints": {"axis_1": {"gear": 0.0}}}, "joints.axis_1"),
        (
            {"robot": {"urdf": R3.name}, "joints": {"axis_1": {"stiffness": 3.0}}},
            "effects.joint_flexibility.motor_inertia.0",
        ),
        ({"robot": {"urdf": R3.name}, "flexible": {"link_9": {}}}, "flexible.link_9"),
        ({"robot": {"urdf": R3.name}, "flexible": {"link_2": {"EI": 1.0}}}, "flexible.link_2.EI"),
        ({"robot": {"urdf": R3.name}, "flexible": {"link_2": {"modes": 1}}}, "links.1.bending_stiffness"),
        ({"robot": {"urdf": R3.name}, "links": [{"length": 1.0}]}, "links"),
        ({"joints": {"axis_1": {"stiffness": 3.0}}}, "joints"),
    ],
)
def test_scenes_that_name_a_robot_wrongly(tables, key):
    motion = {"kind": "harmonic", "frequency": 1.0, "joints": [{"amplitude": 0.1}] * 6}
    with pytest.raises(SceneError) as caught:
        fl.parse_scene({"schema": 1, "title": "t", "motion": motion, **tables}, folder=R3.parent)
    assert key in {problem.key for problem in caught.value.problems}, caught.value


BROKEN = {
    "doctype": ('<robot name="Manutec', '<!DOCTYPE r [<!ENTITY a "b">]>\n<robot name="Manutec'),
    "external entity": ('<robot name="Manutec', '<!DOCTYPE r SYSTEM "file:///etc/passwd">\n<robot name="Manutec'),
    "unknown entity": ('value="56.5"', 'value="&lol;"'),
    "two ends": ('<child link="link_3"/>', '<child link="link_2"/>'),
    "circle": ('<parent link="base"/>', '<parent link="link_4"/>'),
    "no such link": ('<parent link="link_3"/>', '<parent link="link_33"/>'),
    "nan": ('value="56.5"', 'value="nan"'),
    "infinite": ('xyz="0 0.65 0"', 'xyz="0 inf 0"'),
    "two numbers": ('xyz="0 0.65 0"', 'xyz="0 0.65"'),
    "xacro": ('value="56.5"', 'value="${mass}"'),
    "negative mass": ('value="56.5"', 'value="-56.5"'),
    "negative inertia": ('iyy="0.64"', 'iyy="-0.64"'),
    "no inertia": ('ixy="-0.46"', 'ixy="-4.6"'),
    "no axis": ('<axis xyz="1 0 0"/>', '<axis xyz="0 0 0"/>'),
    "unknown type": ('type="continuous"', 'type="screw"'),
    "floating": ('type="continuous"', 'type="floating"'),
    "same name": ('name="link_3"', 'name="link_2"'),
    "same joint": ('name="axis_3"', 'name="axis_2"'),
    "not closed": ("</robot>", ""),
    "not a robot": ("robot", "sdf"),
    "control": ('name="link_3"', 'name="link_3\x1b[2J"'),
}


def spoiled(seed):
    """The r3's file with bytes lost, doubled, or put elsewhere."""
    rng, text = random.Random(seed), TEXT
    for _ in range(rng.randint(1, 4)):
        a, b = sorted(rng.randrange(len(text)) for _ in range(2))
        b = min(b, a + rng.choice([1, 3, 40, 400]))
        piece = rng.choice(
            ["", text[a:b] * 2, "<", '"', "&amp;&x;", "]]>", "\x00", "<!--", "9e999", "-", "<robot>", "é\U0001f600"]
        )
        text = text[:a] + piece + text[b:]
    return text


def test_two_hundred_broken_files_end_with_a_message_that_says_where(tmp_path, capsys):
    deep = "<a>" * 200_000
    cases = [TEXT.replace(old, new) for old, new in BROKEN.values()]
    cases += ["", "{}", "\ufeff", deep, "<robot>" + "<link name='a'/>" * 60_000, f"<robot>{'<link/>'}</robot>"]
    cases += ["<robot name='a'><link name='a'/></robot>", "<robot><link name='a'/><link name='b'/></robot>"]
    cases += [spoiled(seed) for seed in range(175)]
    assert len(cases) >= 200
    refused = 0
    for i, text in enumerate(cases):
        path, out = tmp_path / f"{i}.urdf", tmp_path / f"{i}.toml"
        path.write_bytes(text.encode("utf-8", errors="surrogatepass"))
        code, told = main(["import", str(path), "--out", str(out)]), capsys.readouterr().err
        assert code in (0, BAD_INPUT), text[:200]
        if code == BAD_INPUT:
            refused += 1
            assert not out.exists()
            assert "line " in told or "file:" in told or "tip:" in told or "base:" in told or "links." in told, (
                told,
                text[:300],
            )
            assert "\x1b" not in told
            assert len(told) < 4000
    assert refused >= 180, refused
    for text in cases[: len(BROKEN)]:
        (tmp_path / "again.urdf").write_text(text, encoding="utf-8")
        with pytest.raises(SceneError, match="line "):
            fl.scene_from_urdf(tmp_path / "again.urdf")


def test_what_import_writes_is_the_same_arm(tmp_path, capsys):
    out = tmp_path / "arm.toml"
    assert main(["import", str(R3), "--out", str(out)]) == 0
    assert "axis_6" in capsys.readouterr().out
    same = fl.load_scene(out).model_dump(mode="json", exclude={"source"})
    assert json.dumps(same) == json.dumps(fl.scene_from_urdf(R3).model_dump(mode="json", exclude={"source"}))
    assert main(["import", str(R3), "--out", str(out)]) == BAD_INPUT
