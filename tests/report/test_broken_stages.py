"""Whatever breaks in one stage, or meets its limit of time, is that stage's message; the rest of the report stands, with the verdict of
every design, and the page says nothing that the full one does not say."""

import re
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import Clock
from flexlin.analyses import analysis as stages
from flexlin.cli import main
from flexlin.errors import ArgumentError, NumericalError, TimeLimit, TooLarge
from flexlin.report import page as pages
from flexlin.report import write_report
from tests.test_limits import raising

WEIGHTS = "state_weight=[1, 1, 1, 1], input_weight=[1.0]"
DESIGNS = f"designs=[{{name='one', kind='periodic-lqr', {WEIGHTS}}}, {{name='two', kind='frozen-lqr', {WEIGHTS}}}]"
SCENE = ["single-link", "--set", "links.0.modes=1", DESIGNS]
BREAKS = {
    "memory": lambda: MemoryError("cannot allocate 3 TiB"),
    "LAPACK": lambda: np.linalg.LinAlgError("Singular matrix"),
    "size": lambda: TooLarge("a table is too large"),
    "input": lambda: ArgumentError("s is not finite"),
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


ALL_BUT_THE_LOOP = {"simulate": "memory", "linear_range": "LAPACK", "find_response": "size", "tip_zeros": "input"}


@pytest.mark.slow
@pytest.mark.parametrize("broken", [{"floquet": "memory"}, ALL_BUT_THE_LOOP], ids=lambda b: " ".join(b.values()))
def test_broken_stages_leave_the_rest(broken: dict[str, str], report, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first call to `floquet` is that of the scene's own loop."""
    for stage, kind in broken.items():
        monkeypatch.setattr(stages, stage, first_call_fails(getattr(stages, stage), BREAKS[kind]))
    ran = report(*SCENE)
    assert ran.code == (4 if "floquet" in broken else 0)
    assert {name: loop["verdict"] for name, loop in ran.data["designs"].items()} == {"one": "stable", "two": "stable"}
    assert ran.data["open_loop"]["verdict"] == "unstable"
    problems = " ".join(step["problem"] for step in ran.data["steps"] if "problem" in step)
    assert all(str(BREAKS[kind]()) in problems for kind in broken.values())
    assert (ran.data["floquet"]["verdict"] == "failed") is ("floquet" in broken)
    assert ("scene's PD           failed" in ran.out) is ("floquet" in broken)


@pytest.mark.parametrize("fault", [NumericalError("no equations within 1 s"), TooLarge("equations too large")])
def test_a_report_without_equations_says_why(fault: Exception, report, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stages, "linearize", raising(fault))
    ran = report(*SCENE)
    assert (ran.code, ran.data["problem"]) == (2 if isinstance(fault, TooLarge) else 4, str(fault))
    assert [step["name"] for step in ran.data["steps"] if "problem" in step] == ["linearization"]
    assert ran.data["scene"]["links"][0]["length"] == 0.96
    assert str(fault) in ran.page.replace("\u00a0", " ")
    assert "report.html" in ran.out
    assert f"single-link: {fault}" in ran.err


FAULTS = [(TimeLimit("figures: stopped at the time limit"), 2), (KeyboardInterrupt(), 0)]


@pytest.mark.slow
@pytest.mark.parametrize(("fault", "drawn"), FAULTS)
def test_numbers_stand_whatever_becomes_of_the_figures(fault, drawn, report, monkeypatch: pytest.MonkeyPatch) -> None:
    """A figure that meets a limit leaves the others; a kill, or a call that no alarm ends, leaves the numbers."""
    monkeypatch.setattr(pages, "FIGURES", (*pages.FIGURES[:drawn], raising(fault), *pages.FIGURES[drawn:]))
    ran = report(*SCENE[:3], "designs=[]")
    why = "figures: stopped at the time limit" if drawn else "the program was ended before they were drawn"
    assert (ran.code, ran.data["floquet"]["verdict"]) == (0 if drawn else 1, "stable")
    assert why in ran.data["steps"][-1]["problem"]
    assert why in ran.page
    assert ran.page.count("<figure") == drawn
    assert ("no answer from figures" in ran.out) is bool(drawn)


@pytest.mark.slow
def test_what_libraries_warn_of_is_a_note_of_the_stage(report, monkeypatch: pytest.MonkeyPatch) -> None:
    work = stages.simulate

    def warns(*arguments, **options):
        warnings.warn("lsoda: excess work <b>done</b>", UserWarning, stacklevel=1)
        np.array([1e300]) * 1e300
        return work(*arguments, **options)

    monkeypatch.setattr(stages, "simulate", warns)
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        ran = report(*SCENE[:3], "designs=[]")
    said = [
        "UserWarning in test_broken_stages: lsoda: excess work <b>done</b>",
        "RuntimeWarning in test_broken_stages: overflow encountered in multiply",
    ]
    noted = {step["name"]: step["notes"] for step in ran.data["steps"] if "notes" in step}
    assert noted == {"nonlinear simulation of 3 periods": said}
    assert (ran.code, ran.err) == (0, "")
    assert all(line in ran.out for line in said)
    assert "excess work &lt;b&gt;done" in ran.page


def test_a_note_is_one_line_and_steers_nothing() -> None:
    clock = Clock(fl.load_scene("khang-2019").accuracy)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        with clock.step("work"):
            for _ in range(3):
                warnings.warn("two\nlines \x1b[2J" + "x" * 5000, RuntimeWarning, stacklevel=1)
    (note,) = clock.steps[0].notes
    assert "\n" not in note
    assert "\x1b" not in note
    assert len(note) <= 210


@pytest.mark.slow
def test_a_chart_of_values_without_equations_stands(tmp_path, capsys):
    """The search behind a chart met a value whose mass matrix is indefinite, and the values that had an answer were lost."""
    spin = "effects.rotor_spin={inertia=[0.0,1e-8],gear_ratio=[0.0,100.0]}"
    over = ["--over", "effects.rotor_spin.inertia.1=1e-8:1e-3:4"]
    assert main(["chart", "de-luca-siciliano-1991", "--set", spin, *over, "--out", str(tmp_path)]) == 4
    said = capsys.readouterr().out
    assert re.search("0 undecided, 3 failed.*\nFailed, first at rotor spin inertia.* M is not positive definite", said)
    assert "no answer from critical values: M is not positive definite" in said
    assert (tmp_path / "chart.nc").exists()


LQR = {"name": "lqr", "kind": "periodic-lqr", "state_weight": [1.0] * 4, "input_weight": [1.0]}
SCENES = {
    "single-link": {"links.0.modes": 1, "designs": [LQR]},
    "spinning-link": {"effects.gravity.acceleration": 10.0, "motion.joints.0.rate": 3.9, "accuracy.tol": 1e-7},
}
"""A stable one with a design, and one that is unstable by parametric resonance."""
RANGES = {"single-link": {"motion.frequency": (0.3, 0.6)}, "spinning-link": {"motion.joints.0.rate": (3.7, 4.1)}}
NONE = re.compile(
    r"[Nn]o design is better|nothing else compared|keeps its verdict[^;<]*|nothing has to be done|does not change inside"
    r"|are the same|agree to the error|the linear model holds for this motion|needed: none|may be dropped: none"
)
"""What a page says of things that are not there, or that make no difference."""


def exhaust(scene: str, folder: Path, monkeypatch: pytest.MonkeyPatch, exhausted: str = "") -> tuple[str, list[str]]:
    """The page, and the names of the stages, of which one is given no time."""
    stage = Clock.stage

    def hurried(self, name, work, *rest, **options):
        late = raising(TimeLimit(f"{name}: stopped at the time limit"))
        return stage(self, name, late if name == exhausted else work, *rest, **options)

    with monkeypatch.context() as patch:
        patch.setattr(Clock, "stage", hurried)
        analysis, paths = write_report(fl.load_scene(scene, SCENES[scene]), folder, margins=RANGES[scene])
    names = [step.name for step in getattr(analysis, "steps", ())]
    return re.sub(r"\s+", " ", paths[0].read_text(encoding="utf-8")), names


NOTED = {
    "forced response: lqr": "tip error, peak torque and peak power could not be compared",
    "critical values of motion.frequency": "was not searched to the end over motion frequency, of which nothing more is said",
    "cause of the instability": "What is behind it was not found: cause of the instability: stopped at the time limit",
}
"""Of stages what is said where they met their limit."""


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_no_stage_that_met_its_limit_is_read_as_none(scene, tmp_path, monkeypatch):
    full, stages = exhaust(scene, tmp_path, monkeypatch)
    said = set(NONE.findall(full))
    tried = [name for name in stages if not name.startswith(("load", "figures"))]
    assert len(tried) > 6
    assert len(NOTED.keys() & {*tried}) == (2 if scene == "single-link" else 1)
    for name in tried:
        page, _ = exhaust(scene, tmp_path, monkeypatch, name)
        assert "stopped at the time limit" in page, name
        assert NOTED.get(name, "") in page
        assert set(NONE.findall(page)) <= said, name


COMMANDS = {
    "report": ["single-link", "--sensitivity", "--loop-margins", "--set", "links.0.modes=1", "designs=[]"],
    "chart": ["single-link", "--over", "motion.frequency=0.3:3:9", "effects.payload.mass=0.01:0.5:9"],
    "chart line": ["spinning-link", "--over", "motion.joints.0.rate=2:4:9"],
    "tune": ["single-link", "--gain", "control.feedback.kp.0=1:9", "--vary", "effects.payload.mass=0.01:0.1"],
    "cost": ["single-link", "--set", "links.0.modes=0", "designs=[]"],
    "effects": ["single-link", "--set", "links.0.modes=0", "designs=[]"],
    "design": ["single-link"],
    "respond": ["single-link", "--push", "tip 1 N 20 ms"],
}
NEEDED = "equations of motion", "linearization", "coefficients over a period", "exponents of all values", "figures"
"""Stages without which there is no page."""
WHOLE = NONE.pattern.replace("[^;<]*", "")
SAID = re.compile(rf"{WHOLE}|noticed with the figures tried: none|(?:is|are) (?:stable|unstable|undecided)")


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_what_is_made_in_a_hurry_says_nothing_that_the_full_answer_does_not(command, tmp_path, monkeypatch, capsys):
    allow, arguments = Clock.allow, [command.split()[0], *COMMANDS[command], "--out"]

    def hurried(self, name, *rest, **options):
        allowed = allow(self, name, *rest, **options)
        return allowed if name in NEEDED else replace(allowed, seconds=min(allowed.seconds, 0.05))

    def statements(folder: Path) -> set[str]:
        main([*arguments, str(folder)])
        pages = [path.read_text(encoding="utf-8") for path in folder.rglob("*.html")]
        text = re.sub(r"\s+", " ", " ".join([*capsys.readouterr(), *pages]))
        return {re.sub(r"[\d.]+", "#", said) for said in SAID.findall(text)}

    full = statements(tmp_path / "full")
    monkeypatch.setattr(Clock, "allow", hurried)
    assert statements(tmp_path / "hurried") <= full
