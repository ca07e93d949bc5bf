"""One tol for every stage: it is asked of each, what each reached is said, and a limit that ends one leaves the rest."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import Step, analyse
from flexlin.report import accuracy_lines

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
