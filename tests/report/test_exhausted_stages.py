"""A report in which one stage after the other meets its limit of time: the page says nothing that the full one does not say."""

import re
from pathlib import Path

import pytest

import flexlin as fl
from flexlin.answers import Clock
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
