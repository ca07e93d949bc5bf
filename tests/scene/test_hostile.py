"""Scenes and files that mean harm, or that an accident made: each is refused at once, by an error that names the place."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import flexlin as fl
from flexlin.bounds import SMALLEST_NUMBER
from flexlin.cli import BAD_INPUT, main
from flexlin.errors import FlexlinError, MotionError, SceneError
from flexlin.files import read_text
from flexlin.scene import builtin_scenes, get_value, numeric_paths, parse_assignment

TEXT = builtin_scenes()["single-link"].read_text(encoding="utf-8")
TABLE = "[motion]\nkind = 'table'\nfile = {}\n\n"
ROWS = "".join(f"{0.1 * k},{0.1 * k * (1 - k / 10):.6f}\n" for k in range(11))


def with_table(name: str) -> str:
    """The single link, moved by a table."""
    return re.sub(r"\[motion\].*?(?=\[control\])", lambda _: TABLE.format(name), TEXT, flags=re.DOTALL)


def linearized(path: Path) -> fl.Linearization:
    """Load a scene, with all that its motion needs."""
    scene = fl.load_scene(path)
    return fl.linearize(fl.build_manipulator(scene), scene.motion)


def problem_of(raw: str, folder: Path, key: str) -> str:
    """Write and load a scene that must be refused for one key; returns the problem."""
    path = folder / "scene.toml"
    path.write_text(raw, encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        fl.load_scene(path)
    found = [str(problem) for problem in caught.value.problems if problem.key == key]
    assert found, caught.value
    return found[0]


@pytest.mark.parametrize("size", [1e-300, 5e-324, SMALLEST_NUMBER / 2])
def test_numbers_too_small_to_divide_by_are_refused(size):
    beam = ["links.1.length", "links.1.mass_per_length", "links.1.bending_stiffness"]
    cases = [("three-link", {path: size}, path) for path in beam]
    cases += [("single-link", {path: size}, path) for path in ("motion.frequency", "effects.payload.mass")]
    for name, table, key in (
        ("coulomb_friction", {"torque": 1.0, "rate": size}, "rate"),
        ("motor", {"torque_constant": 1.0, "resistance": size}, "resistance"),
        ("shear", {"stiffness": size}, "stiffness"),
        ("joint_flexibility", {"stiffness": 1.0, "motor_inertia": [size]}, "motor_inertia.0"),
        ("modal_damping", {"ratio": [0.1, size]}, "ratio.1"),
    ):
        cases.append(("single-link", {f"effects.{name}": table, "designs": []}, f"effects.{name}.{key}"))
    for name, change, key in cases:
        with pytest.raises(SceneError, match="1e-30") as caught:
            fl.load_scene(name, change)
        assert [problem.key for problem in caught.value.problems] == [key]


@pytest.mark.slow
@pytest.mark.parametrize("size", [SMALLEST_NUMBER, 1e15])
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
    "over", ["motion.frequency=-1:3", "effects.payload.mass=-1:3:5", "links.0.mass_per_length=5e-324:1:4"]
)
def test_a_chart_over_what_no_arm_has_is_refused_by_its_key(over, tmp_path, capsys):
    assert main(["chart", "single-link", "--over", over, "--out", str(tmp_path / "out")]) == BAD_INPUT
    assert f"{over.partition('=')[0]}: got " in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("number", ["0x" + "f" * 300, "0x" + "f" * 5000, "-" + "7" * 40, "1_0" * 400])
def test_a_number_without_end_in_a_file_is_a_mistake_of_the_file(number, tmp_path):
    (tmp_path / "scene.toml").write_text(re.sub("(?m)^length = .*", f"length = {number}", TEXT), encoding="utf-8")
    with pytest.raises(SceneError, match=r"64 bits|400 characters"):
        fl.load_scene(tmp_path / "scene.toml")


def test_so_it_is_in_python():
    for number in (10**400, -(10**5000), 2**63):
        for key, value, place in (
            ("links.0.length", number, "links.0.length"),
            ("control.feedback.kp", [number], "control.feedback.kp.0"),
        ):
            with pytest.raises(SceneError, match=f"{re.escape(place)}: got a whole number beyond 64 bits"):
                fl.load_scene("single-link", {key: value})


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


@pytest.mark.parametrize("name", ["a\\u0000b", "x" * 5000, "loop"])
def test_names_of_tables_that_no_file_can_have(name, tmp_path):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    path = tmp_path / "scene.toml"
    path.write_text(with_table(f'"{name}"'), encoding="utf-8")
    with pytest.raises((SceneError, MotionError), match=r"motion\.file") as caught:
        linearized(path)
    assert len(str(caught.value)) < 1000


def test_pipes_and_devices_are_not_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for name in ("pipe", "folder"):
        (tmp_path / "scene.toml").write_text(with_table(f"'{name}'"), encoding="utf-8")
        with pytest.raises(MotionError, match=r"motion\.file.*regular file"):
            linearized(tmp_path / "scene.toml")
    for source, got in (("pipe", "no such file"), (".", "a folder")):
        with pytest.raises(SceneError, match=f"got {got}"):
            fl.load_scene(tmp_path / source)


@pytest.mark.slow
def test_a_scene_opens_no_file_outside_its_folder(tmp_path, capsys):
    """Neither by a path, nor by .., nor by a link; there is no telling whether such a file is there."""
    folder, secret = tmp_path / "scenes", tmp_path / "secret.csv"
    (folder / "below").mkdir(parents=True)
    secret.write_text("t,password\n" + ROWS + "hunter2,1\n", encoding="utf-8")
    (folder / "link.csv").symlink_to(secret)
    (folder / "out").symlink_to(tmp_path)
    path, said = folder / "scene.toml", set()
    for name in ("/dev/zero", "/etc/passwd", str(secret), "../secret.csv", "below/../../secret.csv", "link.csv", "out/secret.csv",
                 "../no-such.csv", ".", ".."):  # fmt: skip
        path.write_text(with_table(f"'{name}'"), encoding="utf-8")
        assert main(["check", str(path)]) == BAD_INPUT
        message = capsys.readouterr().err
        assert "expected a file below the scene's folder, or below a folder that you name (--data DIR)" in message
        said.add(message.replace(repr(name), "NAME"))
    assert len(said) == 1
    path.write_text(with_table("'secret.csv'"), encoding="utf-8")
    assert main(["check", str(path), "--data", str(tmp_path)]) == BAD_INPUT
    message = capsys.readouterr().err
    assert "motion.file" in message
    assert "row 13 is not numeric; got a cell that is none" in message
    assert "hunter2" not in message
    assert "password" not in message
    secret.write_text(ROWS, encoding="utf-8")
    assert main(["check", str(path), "--data", str(tmp_path)]) == 0
    assert fl.load_scene(path, data_folder=tmp_path).motion.file == str(secret)
    (folder / "below" / "own.csv").write_text(ROWS, encoding="utf-8")
    path.write_text(with_table("'below/own.csv'"), encoding="utf-8")
    assert main(["check", str(path)]) == 0


def test_a_scene_from_python_opens_no_file_outside_the_folder_that_one_works_in(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.csv").write_text(ROWS, encoding="utf-8")
    raw = {"schema": 1, "title": "", "links": [{"length": 1.0, "mass_per_length": 1.0}]}
    for name in ("own.csv", str(tmp_path / "own.csv")):
        scene = {**raw, "motion": {"kind": "table", "file": name}}
        assert fl.parse_scene(scene).motion.file == str(tmp_path / "own.csv")
        assert scene["motion"]["file"] == name, "what was given stays as it was"
    for name in ("../own.csv", "/etc/passwd"):
        with pytest.raises(SceneError, match=r"motion\.file"):
            fl.parse_scene({**raw, "motion": {"kind": "table", "file": name}})


def test_files_without_end_are_not_read(tmp_path, monkeypatch):
    """A file of the system that states no size, and a table of more rows than any motion has."""
    with pytest.raises(OSError, match="more than 10 bytes"):
        read_text(Path("/proc/self/status"), 10)
    (tmp_path / "long.csv").write_text("0,0\n" * (2**18 + 1), encoding="utf-8")
    (tmp_path / "scene.toml").write_text(with_table("'long.csv'"), encoding="utf-8")
    with pytest.raises(MotionError, match="262145 rows, expected at most 262144"):
        linearized(tmp_path / "scene.toml")


def test_files_of_absurd_size_are_not_read(tmp_path):
    with (tmp_path / "big.csv").open("wb") as file:
        file.truncate(2**26 + 1)
    (tmp_path / "scene.toml").write_text(with_table("'big.csv'"), encoding="utf-8")
    with pytest.raises(MotionError, match="67,108,865 bytes"):
        linearized(tmp_path / "scene.toml")
    with (tmp_path / "big.toml").open("wb") as file:
        file.truncate(2**20 + 1)
    with pytest.raises(SceneError, match="1,048,577 bytes"):
        fl.load_scene(tmp_path / "big.toml")


def test_a_byte_order_mark_is_no_mistake(tmp_path):
    (tmp_path / "motion.csv").write_text("t,q\n" + ROWS, encoding="utf-8-sig")
    (tmp_path / "plain.csv").write_text(ROWS, encoding="utf-8-sig")
    for name in ("motion.csv", "plain.csv"):
        (tmp_path / "scene.toml").write_text(with_table(f"'{name}'"), encoding="utf-8-sig")
        assert linearized(tmp_path / "scene.toml").period == pytest.approx(1.0)


def test_a_name_that_no_scene_has(tmp_path, capsys):
    for name in ("x" * 5000, "y" * 300):
        assert main(["check", name]) == BAD_INPUT
        told = capsys.readouterr().err
        assert "name" in told or "no such file" in told
        assert len(told) < 1000


@pytest.mark.slow
def test_a_file_name_that_is_not_utf_8(tmp_path):
    name = os.fsdecode(os.fsencode(tmp_path) + b"/\xff.toml")
    with pytest.raises(SceneError, match=r"udcff\.toml"):
        fl.load_scene(name)
    Path(name).write_text(TEXT, encoding="utf-8")
    run = subprocess.run([sys.executable, "-m", "flexlin", "check", name], capture_output=True, check=False)
    assert run.returncode == 0, run.stderr
    Path(name).write_text("schema = 2", encoding="utf-8")
    run = subprocess.run([sys.executable, "-m", "flexlin", "check", name], capture_output=True, check=False)
    assert run.returncode == BAD_INPUT
    assert b"udcff.toml" in run.stderr


@pytest.mark.slow
def test_a_folder_whose_name_is_not_utf_8_takes_results(tmp_path):
    out = os.fsdecode(os.fsencode(tmp_path) + b"/\xff")
    command = [sys.executable, "-m", "flexlin", "export", "khang-2019", "--points", "8", "--out", out]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    run = subprocess.run(command, capture_output=True, check=False, cwd=tmp_path, env=environment)
    assert b"fault of flexlin" not in run.stderr, run.stderr
    assert run.returncode == 0, run.stderr
    assert [path.name for path in tmp_path.iterdir()] == [os.path.basename(out)]
    assert (Path(out) / "c" / "linearization.h").read_text().startswith("/*")


def test_places_that_cannot_be_written_are_named(tmp_path, capsys):
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    for place in (tmp_path / "a", tmp_path / "a" / "deeper", tmp_path / ("x" * 300)):
        assert main(["linearize", "single-link", "--out", str(place)]) == 2
        assert "cannot be the output folder" in capsys.readouterr().err
