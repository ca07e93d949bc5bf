"""Whatever breaks in one stage is that stage's message; the rest of the report stands, with the verdict of every design."""

import json
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from flexlin.answers import Clock, judging
from flexlin.answers import analysis as stages
from flexlin.cli import main
from flexlin.errors import NumericalError, TimeLimit, TooLarge
from flexlin.report import page as pages

WEIGHTS = "state_weight=[1, 1, 1, 1], input_weight=[1.0]"
DESIGNS = f"designs=[{{name='one', kind='periodic-lqr', {WEIGHTS}}}, {{name='two', kind='frozen-lqr', {WEIGHTS}}}]"
SCENE = ["single-link", "--set", "links.0.modes=1", DESIGNS]
BREAKS = {
    "memory": lambda: MemoryError("cannot allocate 3 TiB"),
    "LAPACK": lambda: np.linalg.LinAlgError("Singular matrix"),
    "size": lambda: TooLarge("a table is too large"),
}


def first_call_fails(work: Callable, fault: Callable[[], Exception]) -> Callable:
    """The work, but its first call fails."""
    calls: list[int] = []

    def fails(*arguments, **options):
        calls.append(1)
        if len(calls) == 1:
            raise fault()
        return work(*arguments, **options)

    return fails


ALL_BUT_THE_LOOP = {"simulate": "memory", "linear_range": "LAPACK", "find_response": "size"}


@pytest.mark.slow
@pytest.mark.parametrize("broken", [{"floquet": "memory"}, ALL_BUT_THE_LOOP], ids=lambda b: " ".join(b.values()))
def test_broken_stages_leave_the_rest(broken: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first call to `floquet` is that of the scene's own loop."""
    for stage, kind in broken.items():
        where = judging if stage == "floquet" else stages
        monkeypatch.setattr(where, stage, first_call_fails(getattr(where, stage), BREAKS[kind]))
    failed = "floquet" in broken
    assert main(["report", *SCENE, "--out", str(tmp_path)]) == (4 if failed else 0)
    data = json.loads((tmp_path / "report.json").read_text())
    assert {name: loop["verdict"] for name, loop in data["designs"].items()} == {"one": "stable", "two": "stable"}
    assert data["open_loop"]["verdict"] == "unstable"
    problems = " ".join(step["problem"] for step in data["steps"] if "problem" in step)
    for kind in broken.values():
        assert str(BREAKS[kind]()) in problems


@pytest.mark.parametrize("fault", [NumericalError("no equations within 1 s"), TooLarge("equations too large")])
def test_a_report_without_equations_says_why(
    fault: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails(*_: object) -> None:
        raise fault

    monkeypatch.setattr(stages, "linearize", fails)
    code = main(["report", *SCENE, "--out", str(tmp_path)])
    assert code == (2 if isinstance(fault, TooLarge) else 4)
    data, page = json.loads((tmp_path / "report.json").read_text()), (tmp_path / "report.html").read_text()
    assert data["problem"] == str(fault)
    assert [step["name"] for step in data["steps"] if "problem" in step] == ["linearization"]
    assert data["scene"]["links"][0]["length"] == 0.96
    assert str(fault) in page.replace("\u00a0", " ")
    said = capsys.readouterr()
    assert f"wrote {tmp_path / 'report.html'}" in said.out
    assert f"single-link: {fault}" in said.err


@pytest.mark.slow
def test_a_figure_that_meets_a_limit_leaves_the_others_and_the_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails(_: object) -> None:
        raise TimeLimit("figures: stopped at the time limit")

    monkeypatch.setattr(pages, "FIGURES", (*pages.FIGURES[:2], fails, *pages.FIGURES[2:]))
    assert main(["report", *SCENE[:3], "designs=[]", "--out", str(tmp_path)]) == 0
    data, page = json.loads((tmp_path / "report.json").read_text()), (tmp_path / "report.html").read_text()
    assert data["floquet"]["verdict"] == "stable"
    assert data["steps"][-1]["problem"] == "figures: stopped at the time limit"
    assert page.count("<figure") == 2
    assert "figures: stopped at the time limit" in page
    assert "no answer from figures" in capsys.readouterr().out


@pytest.mark.slow
def test_numbers_stand_before_the_figures_are_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A call that no alarm ends, a kill: what was found is there, and says that the figures are not."""

    def fails(_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(pages, "FIGURES", (fails,))
    assert main(["report", *SCENE[:3], "designs=[]", "--out", str(tmp_path)]) == 1
    data, page = json.loads((tmp_path / "report.json").read_text()), (tmp_path / "report.html").read_text()
    assert data["floquet"]["verdict"] == "stable"
    assert "the program was ended before they were drawn" in data["steps"][-1]["problem"]
    assert "the program was ended before they were drawn" in page


@pytest.mark.slow
def test_what_libraries_warn_of_is_a_note_of_the_stage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    work = stages.simulate

    def warns(*arguments, **options):
        warnings.warn("lsoda: excess work <b>done</b>", UserWarning, stacklevel=1)
        np.array([1e300]) * 1e300
        return work(*arguments, **options)

    monkeypatch.setattr(stages, "simulate", warns)
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        assert main(["report", *SCENE[:3], "designs=[]", "--out", str(tmp_path)]) == 0
    steps = json.loads((tmp_path / "report.json").read_text())["steps"]
    noted = {step["name"]: step["notes"] for step in steps if "notes" in step}
    said = [
        "UserWarning in test_broken_stages: lsoda: excess work <b>done</b>",
        "RuntimeWarning in test_broken_stages: overflow encountered in multiply",
    ]
    assert noted == {"nonlinear simulation of 3 periods": said}
    captured = capsys.readouterr()
    assert captured.err == ""
    assert all(line in captured.out for line in said)
    page = (tmp_path / "report.html").read_text()
    assert "excess work &lt;b&gt;done" in page


def test_a_note_is_one_line_and_steers_nothing() -> None:
    clock = Clock()
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        with clock.step("work"):
            for _ in range(3):
                warnings.warn("two\nlines \x1b[2J" + "x" * 5000, RuntimeWarning, stacklevel=1)
    (note,) = clock.steps[0].notes
    assert "\n" not in note
    assert "\x1b" not in note
    assert len(note) <= 210
