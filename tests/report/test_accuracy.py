"""One tol for every stage: it is asked of each, and what each reached is said. Progress: shares of parts of parts add up, nothing is said
of short work, lines in a pipe and not too many."""

import io
import time

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import Clock, Step, analyse
from flexlin.cli import Progress
from flexlin.cli import shared as shown
from flexlin.report import accuracy_lines
from flexlin.resources import advance, listening, part
from flexlin.scene import Accuracy

SMALL = ["links.0.modes=1"]


@pytest.fixture(scope="module")
def two_accuracies():
    design = {"name": "lqr", "kind": "periodic-lqr", "state_weight": [1.0] * 4, "input_weight": [1.0]}
    changes = {"links.0.modes": 1, "control.about": "elastic", "designs": [design]}
    return [analyse(fl.load_scene("single-link", changes | {"accuracy.tol": tol})) for tol in (1e-4, 1e-10)]


def test_every_stage_with_an_error_is_asked_for_the_scene_s_tol(two_accuracies) -> None:
    for found, tol in zip(two_accuracies, (1e-4, 1e-10), strict=True):
        asked = {step.name: step.asked for step in found.steps if step.asked is not None}
        assert set(asked.values()) == {tol}
        # three loops and one about the elastic motion, that motion, the gain, two responses, simulation
        assert len(asked) == 9


@pytest.mark.slow
def test_the_nonlinear_check_has_a_tol_of_its_own_only_where_none_is_given() -> None:
    scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": []})
    steps = {step.name: step for step in analyse(scene).steps}
    check = steps["nonlinear simulation of 3 periods"]
    assert check.asked == 1e-6 >= check.reached
    assert steps["forced response"].asked == scene.accuracy.tol == 1e-9


def test_what_is_said_to_be_reached_is_the_error_of_the_answer(two_accuracies) -> None:
    for found in two_accuracies:
        reached = {step.name: step.reached for step in found.steps}
        own = found.own.floquet
        assert reached["Floquet: the scene's loop"] == np.max(own.errors / np.maximum(1, np.abs(own.exponents)))
        assert reached["design: lqr"] == found.designs[0].design.error
        simulated = max(found.simulation.error, found.simulation.linear_error)
        assert reached["nonlinear simulation of 3 periods"] == simulated
    coarse, fine = (found.own.floquet for found in two_accuracies)
    assert np.all(np.abs(coarse.exponents - fine.exponents) <= coarse.errors + fine.errors)
    assert two_accuracies[1].simulation.error < 1e-3 * two_accuracies[0].simulation.error


@pytest.mark.slow
def test_the_option_stands_for_the_table(report) -> None:
    options = ["--set", *SMALL, "designs=[]", "accuracy.tol=1e-3", "--tol", "1e-5", "--limit-seconds", "50"]
    ran = report("single-link", *options)
    assert (ran.code, ran.err) == (0, "")
    assert ran.files == {"flexlin-results.json", "report.html", "report.json"}
    assert ran.data["accuracy"] == {"tol": 1e-5, "seconds": 50.0, "memory": 7e8}
    asked = [step for step in ran.data["steps"] if "asked" in step]
    assert {step["asked"] for step in asked} == {1e-5}
    assert all(step["reached"] >= 0 for step in asked)
    assert all({"seconds", "cpu_seconds"} <= set(step) for step in ran.data["steps"])
    assert "--tol 1e-05 --limit-seconds 50" in ran.page
    assert "1×10⁻⁵" in ran.page
    assert "accuracy: tol 1×10⁻⁵ reached in" in ran.out


def test_the_terminal_names_what_missed_and_what_has_no_answer() -> None:
    steps = [
        Step("one", 1.0, 0.5, 1e-9, 2e-10),
        Step("two", 2.0, 0.5, 1e-9, 3.4e-8),
        Step("three", 1.0, 0.5, 1e-9, None, "three: stopped"),
        Step("four", 1.0, 0.5),
        Step("five", 0.0, 0.0, 1e-6, 7e-8, "stopped"),
    ]
    said, one = accuracy_lines(steps), "accuracy: tol 1×10⁻⁹ reached in 1 of 3 stages, largest error 3×10⁻⁸; "
    assert said[0] == one + "tol 1×10⁻⁶ reached in 1 of 1 stage, largest error 7×10⁻⁸; took 5 s (2 s of a processor)"
    missed = "  two: error 3.4×10⁻⁸, above tol"
    assert said[1:] == [missed, "  no answer from three: stopped", "  no answer from five: stopped"]
    assert accuracy_lines(steps, "three: stopped")[1:] == said[1:2]
    assert accuracy_lines(steps[3:4]) == ["took 1 s (500 ms of a processor)"]


def test_parts_of_parts_say_shares_of_the_whole_and_end_where_an_error_ends_them() -> None:
    said: list[float] = []
    with listening(said.append):
        advance(0.1)
        with part(0.2, 0.6):
            advance(0.5)
            with part(0.5, 1.0):
                advance(0.5)
                advance(7.0)
        advance(0.9)
    advance(0.3)  # nobody listens any more
    assert said == pytest.approx([0.1, 0.2, 0.4, 0.4, 0.5, 0.6, 0.6, 0.6, 0.9])

    said.clear()  # the listener of before is back after an error
    with listening(said.append):
        with pytest.raises(ValueError, match="lost"), part(0.5, 1.0):
            raise ValueError("lost")
        advance(0.25)
    assert said == [0.5, 0.25]


def test_planned_stages_share_the_work_alike() -> None:
    said: list[float] = []
    clock = Clock(Accuracy(), planned=4)
    with listening(said.append):
        for _ in range(5):  # one more than was planned
            clock.stage("stage", lambda: advance(0.5))
    assert said == sorted(said)
    assert 0.375 in said
    assert said[-1] <= 1.0


def open_pipe(monkeypatch: pytest.MonkeyPatch, patience: float) -> io.StringIO:
    """Standard error of a program."""
    for name, seconds in {"SILENT_SECONDS": patience, "LOOK_INTERVAL": 0.01, "PROGRESS_SECONDS": 0.1}.items():
        monkeypatch.setattr(shown, name, seconds)
    pipe = io.StringIO()
    monkeypatch.setattr("sys.stderr", pipe)
    monkeypatch.setattr("sys.__stderr__", pipe)
    return pipe


def test_a_pipe_hears_of_a_step_without_news_once(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe = open_pipe(monkeypatch, 0.01)
    with Progress() as progress:
        for step in ("load", "solve"):
            progress(step)
            time.sleep(0.3)
    assert [line.split()[1] for line in pipe.getvalue().splitlines()] == ["load", "solve"]


@pytest.mark.parametrize(("patience", "words"), [(0.05, True), (60.0, False)])
def test_a_pipe_gets_lines_with_percentage_and_time_left(monkeypatch, patience: float, words: bool) -> None:
    pipe = open_pipe(monkeypatch, patience)
    with Progress() as progress:
        progress("first step")
        advance(0.25)
        time.sleep(0.35)
    lines = pipe.getvalue().splitlines()
    assert bool(lines) is words
    assert len(lines) <= 4
    assert all(line.startswith("flexlin: 25 %, ") and line.endswith(": first step") for line in lines)


def test_the_time_left_is_that_of_the_rest_and_never_counts_up() -> None:
    """Work that stands still, or is slower than it was, takes longer than was thought: no time is shown until less is left."""
    progress, lines = Progress(), []
    progress("step")
    done = ((30, 0.0), (10, 0.5), (12, 0.5), (25, 0.5), (25, 0.6), (40, 0.9), (80, 0.91), (80, 0.1), (80, 0.99))
    for elapsed, share in done:  # what was done once stays done
        progress._start = time.perf_counter() - elapsed
        progress._advance(share)
        lines.append(progress.line)
    assert lines == [
        "step (30 s so far)", "50 %, about 10 s left: step", "50 %, about 10 s left: step", "50 %, 25 s so far: step",
        "60 %, 25 s so far: step", "90 %, about 4 s left: step", "91 %, 80 s so far: step", "91 %, 80 s so far: step",
        "99 %, about 1 s left: step",
    ]  # fmt: skip


def test_stages_are_logged(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO", logger="flexlin"):
        Clock(Accuracy()).stage("a stage", lambda: None)
    assert [record.getMessage().partition(":")[0] for record in caplog.records] == ["a stage"]
