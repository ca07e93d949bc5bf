"""A report in which one stage after the other meets its limit of time: the page says nothing that the full one does not say."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

import flexlin as fl
from flexlin.analyses import Budget, Clock
from flexlin.cli import main
from flexlin.errors import TimeLimit
from flexlin.report import write_report

WEIGHTS = {"state_weight": [1.0] * 4, "input_weight": [1.0]}
SCENES = {
    "single-link": {"links.0.modes": 1, "designs": [{"name": "lqr", "kind": "periodic-lqr", **WEIGHTS}]},
    "spinning-link": {"effects.gravity.acceleration": 10.0, "motion.joints.0.rate": 3.9, "accuracy.tol": 1e-7},
}
"""A stable one with a design, and one that is unstable by parametric resonance."""
RANGES = {"single-link": {"motion.frequency": (0.3, 0.6)}, "spinning-link": {"motion.joints.0.rate": (3.7, 4.1)}}
NONE = re.compile(
    r"[Nn]o design is better|nothing else compared|keeps its verdict[^;<]*|nothing has to be done|does not change inside"
    r"|are the same|agree to the error|the linear model holds for this motion|needed: none|may be dropped: none"
)
"""What a page says of things that are not there, or that make no difference."""


def report(scene: str, folder: Path, monkeypatch: pytest.MonkeyPatch, exhausted: str = "") -> tuple[str, list[str]]:
    """The page, and the names of the stages, of which one is given no time."""
    stage = Clock.stage

    def hurried(self, name, accuracy, work, *rest, **options):
        def late():
            raise TimeLimit(f"{name}: stopped at the time limit")

        return stage(self, name, accuracy, late if name == exhausted else work, *rest, **options)

    with monkeypatch.context() as patch:
        patch.setattr(Clock, "stage", hurried)
        analysis, paths = write_report(fl.load_scene(scene, SCENES[scene]), folder, margins=RANGES[scene])
    names = [step.name for step in getattr(analysis, "steps", ())]
    return re.sub(r"\s+", " ", paths[0].read_text(encoding="utf-8")), names


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_no_stage_that_met_its_limit_is_read_as_none(scene, tmp_path, monkeypatch):
    full, stages = report(scene, tmp_path, monkeypatch)
    said = set(NONE.findall(full))
    tried = [name for name in stages if not name.startswith(("load", "figures"))]
    assert len(tried) > 6
    for name in tried:
        page, _ = report(scene, tmp_path, monkeypatch, name)
        assert "stopped at the time limit" in page, name
        assert set(NONE.findall(page)) <= said, name


@pytest.mark.slow
def test_what_was_not_compared_or_not_searched_is_named(tmp_path, monkeypatch):
    page, _ = report("single-link", tmp_path, monkeypatch, "forced response: lqr")
    assert "tip error, peak torque and peak power could not be compared" in page
    page, _ = report("single-link", tmp_path, monkeypatch, "critical values of motion.frequency")
    assert "was not searched to the end over motion frequency, of which nothing is said" in page
    page, _ = report("spinning-link", tmp_path, monkeypatch, "cause of the instability")
    assert "What is behind it was not found: cause of the instability: stopped at the time limit" in page


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
    allow, arguments = Budget.allow, [command.split()[0], *COMMANDS[command], "--out"]

    def hurried(self, name, *rest, **options):
        allowed = allow(self, name, *rest, **options)
        return allowed if name in NEEDED else replace(allowed, seconds=min(allowed.seconds, 0.05))

    def statements(folder: Path) -> set[str]:
        main([*arguments, str(folder)])
        pages = [path.read_text(encoding="utf-8") for path in folder.rglob("*.html")]
        text = re.sub(r"\s+", " ", " ".join([*capsys.readouterr(), *pages]))
        return {re.sub(r"[\d.]+", "#", said) for said in SAID.findall(text)}

    full = statements(tmp_path / "full")
    monkeypatch.setattr(Budget, "allow", hurried)
    assert statements(tmp_path / "hurried") <= full
