"""Scenes and files that mean harm, or that an accident made: each is refused at once, by an error that names the place."""

import os
import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import flexlin as fl
from flexlin.bounds import SMALLEST_NUMBER, read_text
from flexlin.cli import BAD_INPUT, main
from flexlin.errors import FlexlinError, MotionError, SceneError
from flexlin.scene import builtin_scenes, get_value, numeric_paths, parse_assignment
from tests.closed_arm import closed
from tests.mechanics.scenes import linear

TEXT = builtin_scenes()["single-link"].read_text(encoding="utf-8")
TABLE = "[motion]\nkind = 'table'\nfile = {}\n\n"
ROWS = "".join(f"{0.1 * k},{0.1 * k * (1 - k / 10):.6f}\n" for k in range(11))


def put_scene(folder: Path, name: str = "", quote: str = "'", encoding: str = "utf-8") -> Path:
    """A scene's file: the single link, moved by a table where one is named."""
    text = re.sub(r"\[motion\].*?(?=\[control\])", lambda _: TABLE.format(quote + name + quote), TEXT, flags=re.DOTALL)
    path = folder / "scene.toml"
    path.write_text(text if name else TEXT, encoding=encoding)
    return path


def linearized(path: Path) -> fl.Linearization:
    """Load a scene, with all that its motion needs."""
    return linear(fl.load_scene(path))


def refuse_text(text: str, folder: Path, words: str) -> None:
    """A scene of this text is refused."""
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SceneError, match=words):
        fl.load_scene(path)


def problems(name: str, changes: dict) -> list[tuple[str, str]]:
    """Keys and what is expected there, of changes that must be refused in few words."""
    with pytest.raises(SceneError) as caught:
        fl.load_scene(name, changes)
    assert len(str(caught.value)) < 2000
    return [(problem.key, problem.expected) for problem in caught.value.problems]


DIVISORS = {
    **{f"links.0.{key}": lambda size: size for key in ("length", "mass_per_length", "bending_stiffness")},
    "motion.frequency": lambda size: size,
    "effects.payload.mass": lambda size: size,
    "effects.coulomb_friction rate": lambda size: {"torque": 1.0, "rate": size},
    "effects.motor resistance": lambda size: {"torque_constant": 1.0, "resistance": size},
    "effects.shear stiffness": lambda size: {"stiffness": size},
    "effects.joint_flexibility motor_inertia.0": lambda size: {"stiffness": 1.0, "motor_inertia": [size]},
    "effects.modal_damping ratio.1": lambda size: {"ratio": [0.1, size]},
}
"""What stands at a key; behind a space, where in it the number is."""


@pytest.mark.parametrize("size", [1e-300, 5e-324, SMALLEST_NUMBER / 2])
def test_numbers_too_small_to_divide_by_are_refused(size):
    for path, value in DIVISORS.items():
        ((key, expected),) = problems("single-link", {path.split()[0]: value(size), "designs": []})
        assert (key, "1e-30" in expected) == (path.replace(" ", "."), True)


@pytest.mark.slow
@pytest.mark.parametrize("size", [SMALLEST_NUMBER, 1e15])
@pytest.mark.parametrize("name", ["single-link", "flexible-joint-link"])
def test_every_number_may_be_extreme_without_a_fault(name, size):
    """What the schema lets through is either built and finite, or refused by a flexlin error: no overflow, no division by zero."""
    scene = fl.load_scene(name)
    for path in (path for path in numeric_paths(scene) if not path.startswith("designs") and get_value(scene, path)):
        with suppress(FlexlinError):
            lin = closed(name, {path: size})
            c = lin.sample(np.linspace(0, lin.period, 5))
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
    refuse_text(f"{deep}\n{TEXT}", tmp_path, "at most 32 tables and lists in each other")


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
    for call in (
        lambda: fl.parse_scene(endless),
        lambda: fl.load_scene("single-link", {"parameters": endless}),
        lambda: fl.load_scene("single-link", {"parameters" + ".a" * 20_000: 1}),
        lambda: parse_assignment("parameters.a=" + "[" * 5000 + "]" * 5000),
    ):
        with pytest.raises((SceneError, fl.errors.ArgumentError), match="at most 32"):
            call()
    assert main(["check", "single-link", "--set", "a." * 20_000 + "a=1"]) == BAD_INPUT
    assert main(["check", "single-link", "--set", "effects.payload={ " + "a." * 20_000 + "a = 1 }"]) == BAD_INPUT
    assert parse_assignment("title=" + "a." * 50 + "a") == ("title", "a." * 50 + "a")
    assert len(capsys.readouterr().err) < 1000


def test_lists_without_end_are_refused(tmp_path):
    design = "[[designs]]\nname = 'a'\nkind = 'periodic-lqr'\nstate_weight = [1.0]\ninput_weight = [1.0]\n"
    refuse_text(TEXT[: TEXT.index("[[designs]]")] + design * 1_000, tmp_path, "designs: .*at most")
    for key, item in (("designs", {}), ("links", {"length": 1.0, "mass_per_length": 1.0})):
        found = dict(problems("single-link", {key: [item] * 3_000}))
        assert "a list of 200 at most" in found[key]


@pytest.mark.parametrize("wrong", ["\x1b[2Jfree", "two\nlines", "\u202egnp", "bell\x07", "\x9b31m"])
def test_nothing_in_a_scene_steers_the_terminal(wrong):
    values = ("title", "source", "designs.0.name", "motion.file", "model")
    keys = (f"links.0.{wrong}", wrong, f"effects.{wrong}", f"links.{wrong}.length", f"title.{wrong}")
    for changes in (*({key: wrong} for key in values), *({key: 1.0} for key in keys)):
        with pytest.raises(SceneError) as caught:
            fl.load_scene("single-link", changes)
        assert wrong not in str(caught.value)
        (key,) = changes
        assert key in keys or key.split(".")[0] in {one.key.split(".")[0] for one in caught.value.problems}
    with pytest.raises(SceneError) as caught:
        fl.load_scene(wrong)
    assert wrong not in str(caught.value)


def test_letters_of_every_script_are_welcome():
    title = "Außenarm – Ω₁ = 3\u00a0rad/s, بازوی می\u200cچرخد, 机械臂"
    assert fl.load_scene("single-link", {"title": title}).title == title


@pytest.mark.parametrize("number", ["0x" + "f" * 300, "0x" + "f" * 5000, "-" + "7" * 40, "1_0" * 400])
def test_a_number_without_end_in_a_file_is_a_mistake_of_the_file(number, tmp_path):
    refuse_text(re.sub("(?m)^length = .*", f"length = {number}", TEXT), tmp_path, r"64 bits|400 characters")


def test_so_it_is_in_python():
    for number in (10**400, -(10**5000), 2**63):
        for key, value, place in (("links.0.length", number, ""), ("control.feedback.kp", [number], ".0")):
            with pytest.raises(SceneError, match=f"{re.escape(key + place)}: got a whole number beyond 64 bits"):
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
    with pytest.raises((SceneError, MotionError), match=r"motion\.file") as caught:
        linearized(put_scene(tmp_path, name, '"'))
    assert len(str(caught.value)) < 1000


def test_pipes_devices_and_files_without_end_are_not_read(tmp_path):
    """A file of the system that states no size, and a table of more rows than any motion has, among them."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    (tmp_path / "long.csv").write_text("0,0\n" * (2**18 + 1), encoding="utf-8")
    for name, size in (("big.csv", 2**26), ("big.toml", 2**20)):
        with (tmp_path / name).open("wb") as file:
            file.truncate(size + 1)
    for name, words in (
        ("pipe", r"motion\.file.*regular file"),
        ("folder", r"motion\.file.*regular file"),
        ("long.csv", "262145 rows, expected at most 262144"),
        ("big.csv", "67,108,865 bytes"),
    ):
        with pytest.raises(MotionError, match=words):
            linearized(put_scene(tmp_path, name))
    for source, words in (("pipe", "got no regular file"), (".", "got a folder"), ("big.toml", "1,048,577 bytes")):
        with pytest.raises(SceneError, match=words):
            fl.load_scene(tmp_path / source)
    with pytest.raises(OSError, match="more than 10 bytes"):
        read_text(Path("/proc/self/status"), 10)


OUTSIDE = (
    *("/dev/zero", "/etc/passwd", "SECRET", "../secret.csv", "below/../../secret.csv", "link.csv", "out/secret.csv"),
    *("../no-such.csv", ".", ".."),
)


@pytest.mark.slow
def test_a_scene_opens_no_file_outside_its_folder(tmp_path, capsys):
    """Neither by a path, nor by .., nor by a link; there is no telling whether such a file is there."""
    folder, secret, said = tmp_path / "scenes", tmp_path / "secret.csv", set()
    (folder / "below").mkdir(parents=True)
    secret.write_text("t,password\n" + ROWS + "hunter2,1\n", encoding="utf-8")
    (folder / "link.csv").symlink_to(secret)
    (folder / "out").symlink_to(tmp_path)
    for name in (name.replace("SECRET", str(secret)) for name in OUTSIDE):
        assert main(["check", str(put_scene(folder, name))]) == BAD_INPUT
        message = capsys.readouterr().err
        assert "expected a file below the scene's folder, or below a folder that you name (--data DIR)" in message
        said.add(message.replace(repr(name), "NAME"))
    assert len(said) == 1
    named = ["check", str(put_scene(folder, "secret.csv")), "--data", str(tmp_path)]
    assert main(named) == BAD_INPUT
    message = capsys.readouterr().err
    assert "motion.file" in message
    assert "row 13 is not numeric; got a cell that is none" in message
    assert not re.search("hunter2|password", message)
    secret.write_text(ROWS, encoding="utf-8")
    assert main(named) == 0
    assert fl.load_scene(folder / "scene.toml", data_folder=tmp_path).motion.file == str(secret)
    (folder / "below" / "own.csv").write_text(ROWS, encoding="utf-8")
    assert main(["check", str(put_scene(folder, "below/own.csv"))]) == 0


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


def test_a_byte_order_mark_is_no_mistake(tmp_path):
    for name, text in (("motion.csv", "t,q\n" + ROWS), ("plain.csv", ROWS)):
        (tmp_path / name).write_text(text, encoding="utf-8-sig")
        assert linearized(put_scene(tmp_path, name, encoding="utf-8-sig")).period == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["x" * 5000, "y" * 300])
def test_a_name_that_no_scene_has(name, capsys):
    assert main(["check", name]) == BAD_INPUT
    told = capsys.readouterr().err
    assert re.search("name|no such file", told)
    assert len(told) < 1000


@pytest.mark.slow
def test_names_that_are_not_utf_8(tmp_path):
    """Of a scene's file, and of a folder that takes results."""
    name, out = (os.fsdecode(os.fsencode(tmp_path) + end) for end in (b"/\xff.toml", b"/\xff"))

    def run(*words: str) -> subprocess.CompletedProcess:
        known = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
        words = (sys.executable, "-m", "flexlin", *words)
        return subprocess.run(words, capture_output=True, check=False, cwd=tmp_path, env=known)

    with pytest.raises(SceneError, match=r"udcff\.toml"):
        fl.load_scene(name)
    Path(name).write_text("schema = 2", encoding="utf-8")
    refused = run("check", name)
    assert refused.returncode == BAD_INPUT
    assert b"udcff.toml" in refused.stderr
    Path(name).write_text(TEXT, encoding="utf-8")
    for words in (["check", name], ["export", "khang-2019", "--points", "8", "--out", out]):
        done = run(*words)
        assert done.returncode == 0, done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {os.path.basename(name), os.path.basename(out)}
    assert (Path(out) / "c" / "linearization.h").read_text().startswith("/*")


def test_places_that_cannot_be_written_are_named(tmp_path, capsys):
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    for place in (tmp_path / "a", tmp_path / "a" / "deeper", tmp_path / ("x" * 300)):
        assert main(["linearize", "single-link", "--out", str(place)]) == 2
        assert "cannot be the output folder" in capsys.readouterr().err
