"""Bad input of every kind ends with exit code 2 and one clear message: no traceback, no half-written file."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from flexlin.cli import BAD_INPUT, main
from tests.scene.test_hostile import put_scene


def refused(capsys: pytest.CaptureFixture[str], arguments: list[str], *words: str, folder: Path) -> str:
    """Run a report that must be refused; returns the message after checking its form."""
    out = folder / "out"
    assert main(["report", *arguments, "--out", str(out)]) == BAD_INPUT
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("flexlin: ")
    assert captured.err.count("flexlin:") == 1
    assert "Traceback" not in captured.err
    for word in ("got ", *words):
        assert word in captured.err
    assert not out.exists()
    return captured.err


NAMELESS = [
    ["new", ""],
    ["check", "single-link", "--data", ""],
    ["check", "single-link", "--out", " "],
    ["chart", "single-link", "--over", "motion.frequency=1:2:3", "--store", ""],
]


@pytest.mark.parametrize("arguments", NAMELESS, ids=lambda words: " ".join(words[::2]))
def test_a_name_without_letters_is_not_the_current_folder(arguments, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert "got an empty name, expected that of a file or folder" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


ONE_WEIGHT = 'designs=[{name="a", kind="periodic-lqr", state_weight=[1.0], input_weight=[1.0]}]'
# One row each: the override, then what the message must name.
OVERRIDES = {
    "wrong type": ('links.0.length="long"', "links.0.length", "'long'", "expected a number"),
    "a link without mass": ("links.0.mass_per_length=0", "links.0.mass_per_length", "a positive number"),
    "no stiffness": ("links.0.bending_stiffness=0.0", "links.0.bending_stiffness", "greater than 0"),
    "too many modes": ("links.0.modes=100", "links.0.modes", "100", "60"),
    "not a number": ("links.0.length=nan", "links.0.length", "nan", "finite"),
    "a direction of no length": ("effects.gravity.direction=[0,1e-308,0]", "effects.gravity.direction", "1e-30"),
    "absurdly large": ("links.0.length=1e200", "links.0.length", "1e+200", "less than or equal to"),
    "an unknown key": ("links.0.lenght=2.0", "links.0.lenght", "unknown", "did you mean 'length'"),
    "a parameter of an effect that is off": ("effects.shear.stiffness=1e5", "effects.shear", "off"),
    "too many joints": ("motion.joints=[{amplitude=1.0},{amplitude=1.0}]", "motion.joints", "2 tables", "expected 1"),
    "no joints": ("motion.joints=[]", "motion.joints", "1 or more"),
    "too many gains": ("control.feedback.kp=[1.0, 2.0]", "control.feedback.kp", "got 2", "expected 1"),
    "integral action without its gain": ('control.feedback.kind="pid"', "control.feedback.ki", "required"),
    "too few weights": (ONE_WEIGHT, "designs.0.state_weight", "expected 6"),
    "weights twice": ("designs.0.state_weight=[1.0, 1.0, 1.0, 1.0, 1.0, 1.0]", "designs.0", "either weights"),
    "another dimension": ('designs.0.weights.tip="2 deg"', "designs.0.weights.tip", "'2 deg'", "a length such as 2 mm"),
    "an unknown design": ('designs.0.kind="magic"', "designs.0.kind", "'magic'", "periodic-lqr"),
    "one name for two designs": ('designs.1.name="frozen LQR"', "designs.1.name", "a second time"),
    "an index beyond the list": ("links.7.length=1.0", "links.7.length", "index '7'"),
    "an index from the end": ("links.-1.length=1.0", "links.-1.length", "index '-1'"),
    "parameters without a model": ("parameters={a=1.0}", "parameters", "without model"),
    "another version of the format": ("schema=99", "schema", "99", "expected 1"),
    "a list without brackets": ("control.feedback.kp=5,2", "expected a list [...]"),
    "a mass for a length": ("links.0.length=96kg", "expected a number in m, or a length such as 2 mm"),
    "a unit that is none": ("links.0.length=3 parsec", "expected a number in m, or a length such as 2 mm"),
    "an effect misspelt": ("effects.gravty=off", "did you mean 'gravity'?"),
    "no equals sign": ("links.0.length", "'links.0.length'", "key=value"),
}  # fmt: skip


@pytest.mark.parametrize("kind", OVERRIDES)
def test_a_bad_override_is_named(kind, tmp_path, capsys):
    override, *words = OVERRIDES[kind]
    message = refused(capsys, ["single-link", "--set", override], *words, "expected ", folder=tmp_path)
    assert "problems" not in message, "one mistake is one problem"


UNFIT = [('weights={joints="2 mm", input="1 N m"}', "weights.joints"), ("sample_time=0.0123", "sample_time")]


@pytest.mark.parametrize(("change", "words"), UNFIT)
def test_a_design_that_does_not_fit_is_refused_before_any_loop_is_judged(change, words, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("flexlin.analyses.analysis.judge_own_loops", lambda _: pytest.fail("too late"))
    refused(capsys, ["single-link", "--set", f"designs.1.{change}"], words, folder=tmp_path)


def test_all_mistakes_are_told_at_once(tmp_path, capsys):
    mistakes = ["links.0.length=-1", "motion.frequency=0", "effects.payload.mas=1", "control.feedback.kp=[1.0, 2.0]"]
    message = refused(capsys, ["single-link", "--set", *mistakes], "4 problems", folder=tmp_path)
    for mistake in mistakes:
        assert mistake.partition("=")[0] in message


EMPTY = "schema: got nothing, expected 1:", "title", 'table [motion] with kind = "harmonic" or', "links", "required"
FILES = {
    "missing": (None, ("no such file", "single-link")),
    "open text": (b'schema = 1\ntitle = "open\n', ('got title = "open in line 2', "expected a closing quote")),
    "twice": (b"a = 1\na = 2", ("got a = 2 in line 2", "expected each key once")),
    "no kind": (b"[motion]\n", ('motion.kind: got nothing, expected one of "harmonic"',)),
    "binary": (b"\xff\xfe\x00", ("no text in UTF-8, from byte 0 on", "a TOML file in UTF-8")),
    "empty": (b"", EMPTY),
}


@pytest.mark.parametrize("kind", FILES)
def test_a_file_that_is_no_scene(kind, tmp_path, capsys):
    path, (content, words) = tmp_path / "scene.toml", FILES[kind]
    if content is not None:
        path.write_bytes(content)
    refused(capsys, [str(path)], "scene.toml", *words, folder=tmp_path)


ONE_WAY = "motion={kind='point-to-point', course='one-way', move_time=1.0, joints=[{waypoints=[0.0, 1.0]}]}"
NO_ANSWER = [
    ("single-link --set model='khang-2019'", "links: got 1 table beside model"),
    ("single-lnk", "did you mean 'single-link'"),
    ("", "file: got an empty name, expected a TOML file"),
    ("khang-2019 --set model='os'", "khang-2019"),
    (f"single-link --set {ONE_WAY}", "there-and-back"),
]


@pytest.mark.parametrize(("arguments", "words"), NO_ANSWER)
def test_what_is_no_scene_or_has_no_answer(arguments, words, tmp_path, capsys):
    refused(capsys, arguments.split(" ", 2), words, folder=tmp_path)


ROWS = [f"{0.1 * k},{0.1 * k * (1 - k / 10):.6f}" for k in range(11)]
TABLES = {
    "not periodic": ([*ROWS[:-1], "1.0,0.5"], ("joint 1", "not periodic")),
    "times that do not increase": ([*ROWS[:5], ROWS[3], *ROWS[6:]], ("times", "row 6")),
    "too short": (ROWS[:3], ("3 rows", "expected")),
    "a column too many": ([f"{row},0" for row in ROWS], ("[3] columns", "2 columns")),
    "not a number": ([*ROWS[:4], "0.4,nan", *ROWS[5:]], ("row 5", "a number from")),
    "missing": (None, ("cannot be read",)),
}


@pytest.mark.parametrize("kind", TABLES)
def test_a_bad_table_motion(kind, tmp_path, capsys):
    rows, words = TABLES[kind]
    if rows is not None:
        (tmp_path / "motion.csv").write_text("\n".join(rows), encoding="utf-8")
    refused(capsys, [str(put_scene(tmp_path, "motion.csv"))], "scene.toml", "motion.file", *words, folder=tmp_path)


NO_LIMITS = "2_Hz:1_Hz", "1_mm:2_mm", "1:", "one:two", "nan:1"
NO_COMMANDS = """
dance single-link; report single-link --require luck; report single-link --colour; linearize single-link --points few
; simulate single-link --periods long; chart single-link; chart single-link --over motion.frequency=3
; chart single-link --over motion.frequency=1:3:few
"""
REFUSED = {
    **{command.strip(): "error:" for command in NO_COMMANDS.split(";")},
    **{f"chart single-link --over motion.frequency={limits}:3": "LOW below HIGH" for limits in NO_LIMITS},
    **{f"simulate spinning-link --periods {periods}": "periods" for periods in ("0", "-1", "nan")},
    **{f"chart single-link --over {path}=1:2": path for path in ("motion.speed", "title")},
    "chart single-link --over motion.frequency=1:2 motion.frequency=1:3": "motion.frequency",
    "chart single-link --over motion.frequency=-1:3": "motion.frequency: got ",
    "chart single-link --over links.0.length=5e-324:1:4": "links.0.length: got ",
    **{f"linearize single-link --points={count}": "expected a whole number from 2 on" for count in ("1e9", "-5", "1")},
    "design spinning-link": "[[designs]]",
    "check single-link --set links.0.modes=1 links.0.modes=2": "named twice; got links.0.modes, links.0.modes, expected each once",
    "check single-link --data nowhere": "--data names no folder; got nowhere",
    **{f"report single-link --tol={tol}": "accuracy.tol" for tol in ("0", "-1e-9", "nan", "inf", "1e9", "1e-30")},
    **dict.fromkeys(
        [
            "simulate single-link --periods 1e9",
            *(f"{command} single-link --points 1000000000" for command in ("linearize", "design", "export")),
            "chart single-link --over motion.frequency=0.2:3:40000 effects.payload.mass=0:0.3:40000",
            "linearize single-link --points 100000 --limit-memory 2e6",
            "respond single-link --push tip_1_N_20_ms --periods 1e12",
        ],
        "bytes, expected at most",
    ),
    "respond single-link --noise torque_1e308_N_m_1e308_Hz": "got 'torque 1e308 N m 1e308 Hz', expected a number from -1e+30 to",
    "respond single-link --push tip_1e-300_N_1_s": "--push cannot be read; got 'tip 1e-300 N 1 s', expected a number from 1e-30 to",
    "respond single-link --step joint_1_torque_0_N_m": "got 'joint 1 torque 0 N m', expected a number from 1e-30 to 1e+30",
}
"""Commands, with _ for a space within a word, and what is said of them: of requests that would not fit, how large they are."""


@pytest.mark.parametrize("words", REFUSED)
def test_what_cannot_be_asked_is_refused_before_any_file(words, tmp_path, capsys):
    """A range or length that is none, what is no parameter, what has no measure, what no memory holds."""
    with pytest.raises(SystemExit) as stop:
        sys.exit(main([*(word.replace("_", " ") for word in words.split()), "--out", str(tmp_path / "out")]))
    assert stop.value.code == BAD_INPUT
    assert REFUSED[words] in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_range_is_written_in_any_unit(tmp_path):
    """Also where one limit is a bare number, in SI units."""
    over = ["--over", "effects.payload.mass=100 g:0.3:3", "motion.joints.0.amplitude=10 deg:0.5:2"]
    assert main(["chart", "single-link", "--set", "links.0.modes=0", *over, "--out", str(tmp_path)]) == 0
    with np.load(tmp_path / "chart.npz") as data:
        np.testing.assert_allclose(data["payload_mass"], [0.1, 0.2, 0.3], rtol=1e-15)
        np.testing.assert_allclose(data["amplitude_of_joint_1"], [np.pi / 18, 0.5], rtol=1e-15)


def test_an_output_folder_that_is_none(tmp_path, capsys):
    occupied = tmp_path / "out"
    occupied.write_text("mine")
    for folder, got in ((str(occupied), "a file"), (str(occupied / "below"), "a file"), ("a\0b", "embedded null byte")):
        assert main(["report", "single-link", "--out", folder]) == BAD_INPUT
        assert re.search(rf"cannot be the output folder; got .*{got}, expected a folder", capsys.readouterr().err)
    assert occupied.read_text() == "mine"
