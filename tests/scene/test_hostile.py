"""Scenes that mean harm, or that an accident made: each is refused at once, by an error that names the place."""

import re

import numpy as np
import pytest

import flexlin as fl
from flexlin.bounds import SMALLEST
from flexlin.cli import BAD_INPUT, main
from flexlin.errors import FlexlinError, SceneError
from flexlin.scene import get_value, numeric_paths, parse_assignment
from tests.scene.hostile import TEXT, problem_of

TINY = {
    "three-link": ["links.1.length", "links.1.mass_per_length", "links.1.bending_stiffness"],
    "single-link": ["motion.frequency", "effects.payload.mass"],
    "flexible-joint-link": ["effects.joint_flexibility.stiffness"],
}


@pytest.mark.parametrize("size", [1e-300, 5e-324, SMALLEST / 2])
@pytest.mark.parametrize(("name", "path"), [(name, path) for name, paths in TINY.items() for path in paths])
def test_numbers_too_small_to_divide_by_are_refused(name, path, size):
    with pytest.raises(SceneError) as caught:
        fl.load_scene(name, {path: size})
    assert [problem.key for problem in caught.value.problems] == [path]
    assert "1e-30" in str(caught.value)


@pytest.mark.parametrize("size", [1e-300, 5e-324])
def test_the_same_for_the_figures_of_effects(size):
    tables = {
        "coulomb_friction": ({"torque": 1.0, "rate": size}, "rate"),
        "motor": ({"torque_constant": 1.0, "resistance": size}, "resistance"),
        "shear": ({"stiffness": size}, "stiffness"),
        "joint_flexibility": ({"stiffness": 1.0, "motor_inertia": [size]}, "motor_inertia.0"),
        "modal_damping": ({"ratio": [0.1, size]}, "ratio.1"),
    }
    for name, (table, key) in tables.items():
        with pytest.raises(SceneError) as caught:
            fl.load_scene("single-link", {f"effects.{name}": table, "designs": []})
        assert [problem.key for problem in caught.value.problems] == [f"effects.{name}.{key}"]


@pytest.mark.slow
@pytest.mark.parametrize("size", [SMALLEST, 1e15])
@pytest.mark.parametrize("name", ["single-link", "flexible-joint-link"])
def test_every_number_may_be_extreme_without_a_fault(name, size):
    """What the schema lets through is either built and finite, or refused by a flexlin error: no overflow, no division by zero."""
    scene = fl.load_scene(name)
    for path in (path for path in numeric_paths(scene) if not path.startswith("designs")):
        if not get_value(scene, path):
            continue
        try:
            changed = fl.load_scene(name, {path: size})
            lin = fl.linearize(fl.build_manipulator(changed), changed.motion, changed.control)
            c = lin.sample(np.linspace(0, lin.period, 5))
        except FlexlinError:
            continue
        assert all(np.all(np.isfinite(part)) for part in (c.M, c.D, c.K, c.h, c.B)), path


@pytest.mark.parametrize(
    "deep",
    [
        "x = " + "[" * 900 + "]" * 900,
        ".".join("a" * 20_000) + " = 1",
        "x" + ".x" * 40 + "=1",
        " . ".join(["'a#'", '"b."'] * 20) + " = 1",
        "[" + ".".join("a" * 20_000) + "]",
        "x = { y = {" + ".".join("a" * 20_000) + " = 1 } }",
    ],
)
def test_tables_in_tables_without_end(deep, tmp_path):
    (tmp_path / "scene.toml").write_text(f"{deep}\n{TEXT}", encoding="utf-8")
    with pytest.raises(SceneError, match="at most 32 tables and lists in each other"):
        fl.load_scene(tmp_path / "scene.toml")


@pytest.mark.parametrize("quote", ['"', "'", '"""', "'''"])
def test_dots_in_texts_and_comments_are_no_tables(quote, tmp_path):
    dots = ".".join("a" * 50)
    title = f"title = {quote}{dots}{quote}  # {dots} it's"
    path = tmp_path / "scene.toml"
    path.write_text(re.sub("(?m)^title = .*", lambda _: title, TEXT, count=1), encoding="utf-8")
    assert fl.load_scene(path).title == dots


def test_the_same_from_python_and_the_command_line(capsys):
    endless: dict = {}
    node = endless
    for _ in range(5000):
        node["a"] = node = {}
    with pytest.raises(SceneError, match="at most 32"):
        fl.parse_scene(endless)
    with pytest.raises(SceneError, match="at most 32"):
        fl.load_scene("single-link", {"parameters": endless})
    with pytest.raises(SceneError, match="at most 32"):
        fl.load_scene("single-link", {"parameters" + ".a" * 20_000: 1})
    with pytest.raises(fl.errors.ArgumentError, match="at most 32"):
        parse_assignment("parameters.a=" + "[" * 5000 + "]" * 5000)
    assert main(["check", "single-link", "--set", "a." * 20_000 + "a=1"]) == BAD_INPUT
    assert main(["check", "single-link", "--set", "effects.payload={ " + "a." * 20_000 + "a = 1 }"]) == BAD_INPUT
    assert parse_assignment("title=" + "a." * 50 + "a") == ("title", "a." * 50 + "a")
    assert len(capsys.readouterr().err) < 1000


def test_lists_without_end_are_refused(tmp_path):
    design = "[[designs]]\nname = 'a'\nkind = 'periodic-lqr'\nstate_weight = [1.0]\ninput_weight = [1.0]\n"
    bare = TEXT[: TEXT.index("[[designs]]")]
    assert "at most" in problem_of(bare + design * 1_000, tmp_path, "designs")
    raw = {"schema": 1, "title": "", "motion": {"kind": "harmonic", "frequency": 1.0, "joints": [{"amplitude": 1.0}]}}
    for key, item in (("designs", {}), ("links", {"length": 1.0, "mass_per_length": 1.0})):
        with pytest.raises(SceneError) as caught:
            fl.parse_scene({**raw, "links": [{"length": 1.0, "mass_per_length": 1.0}], key: [item] * 3_000})
        assert any(p.key == key and "a list of 200 at most" in p.expected for p in caught.value.problems)
        assert len(str(caught.value)) < 2000


ESCAPE = "\x1b[2Jfree"


@pytest.mark.parametrize("wrong", [ESCAPE, "two\nlines", "\u202egnp", "bell\x07", "\x9b31m"])
def test_nothing_in_a_scene_steers_the_terminal(wrong):
    for key in ("title", "source", "designs.0.name", "motion.file", "model"):
        with pytest.raises(SceneError) as caught:
            fl.load_scene("single-link", {key: wrong})
        assert key.split(".")[0] in {problem.key.split(".")[0] for problem in caught.value.problems}
        assert wrong not in str(caught.value)
    for key in (f"links.0.{wrong}", wrong, f"effects.{wrong}", f"links.{wrong}.length", f"title.{wrong}"):
        with pytest.raises(SceneError) as caught:
            fl.load_scene("single-link", {key: 1.0})
        assert wrong not in str(caught.value)
    with pytest.raises(SceneError) as caught:
        fl.load_scene(wrong)
    assert wrong not in str(caught.value)


def test_letters_of_every_script_are_welcome():
    title = "Außenarm – Ω₁ = 3\u00a0rad/s, بازوی می\u200cچرخد, 机械臂"
    assert fl.load_scene("single-link", {"title": title}).title == title


@pytest.mark.parametrize(
    ("over", "key"),
    [
        ("motion.frequency=-1:3", "motion.frequency"),
        ("links.0.length=-1:3:5", "links.0.length"),
        ("effects.payload.mass=-1:3:5", "effects.payload.mass"),
        ("links.0.mass_per_length=5e-324:1:4", "links.0.mass_per_length"),
    ],
)
def test_a_chart_over_what_no_arm_has_is_refused_by_its_key(over, key, tmp_path, capsys):
    assert main(["chart", "single-link", "--over", over, "--out", str(tmp_path / "out")]) == BAD_INPUT
    message = capsys.readouterr().err
    assert f"{key}: got " in message
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("number", ["0x" + "f" * 300, "0x" + "f" * 5000, "-" + "7" * 40, "1_0" * 400])
def test_a_number_without_end_in_a_file_is_a_mistake_of_the_file(number, tmp_path):
    (tmp_path / "scene.toml").write_text(re.sub("(?m)^length = .*", f"length = {number}", TEXT), encoding="utf-8")
    with pytest.raises(SceneError, match=r"64 bits|400 characters"):
        fl.load_scene(tmp_path / "scene.toml")


@pytest.mark.parametrize("number", [10**400, -(10**5000), 2**63], ids=["large", "endless", "65 bits"])
def test_so_it_is_in_python(number):
    with pytest.raises(SceneError, match=r"links\.0\.length: got a whole number beyond 64 bits"):
        fl.load_scene("single-link", {"links.0.length": number})
    with pytest.raises(SceneError, match=r"control\.feedback\.kp\.0"):
        fl.load_scene("single-link", {"control.feedback.kp": [number]})


def test_digits_in_texts_and_keys_are_no_numbers(tmp_path):
    (tmp_path / "scene.toml").write_text(f"{TEXT}# {'9' * 5000}\n", encoding="utf-8")
    assert fl.load_scene(tmp_path / "scene.toml", {"source": "1" * 500}).source == "1" * 500
    with pytest.raises(SceneError, match="title"):
        fl.load_scene("single-link", {"title": "x" * 900_000})


def test_many_mistakes_are_counted_not_described():
    with pytest.raises(SceneError) as found:
        fl.load_scene("single-link", {f"wrong{k}": 1 for k in range(5000)})
    assert len(found.value.problems) < 300
    assert "4800 further mistakes" in found.value.problems[-1].got
