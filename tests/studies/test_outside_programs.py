"""What the studies share: programs from outside with machine code and without a compiler, and what is known without a run."""

import shutil
from importlib import import_module

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin import symbolic
from flexlin.analyses import accuracy as own
from flexlin.errors import ArgumentError
from flexlin.linearization import parametric_loop
from flexlin.periodic import Setting

COMPILER = bool(shutil.which("gcc") or shutil.which("cc"))


@pytest.mark.slow
@pytest.mark.parametrize("compiler", [True, False])
@pytest.mark.parametrize("stiff", [True, False], ids=["BDF", "Adams"])
def test_cvodes_integrates_the_same_equations(compiler, stiff, monkeypatch):
    compiled, cvodes = import_module("outside.compiled"), import_module("outside.cvodes")
    if not compiler:
        monkeypatch.setattr("shutil.which", lambda name: None)
    overrides = {"links.0.modes": 1, "designs": [], "effects.hub.inertia": 0.02, "control.feedback.kd.0": 0.1}
    loop = parametric_loop(fl.load_scene("single-link", overrides), ["effects.payload.mass"])
    exact = own.multiply_period(loop.linearization.periodic_system(), Setting("gauss", 20, 64, ""))
    assert compiled.compile_product(loop).is_a("External") == (compiler and COMPILER)
    assert np.abs(cvodes.prepare_cvodes(loop, 1e-9, stiff=stiff)() - exact).max() < 1e-5 * np.abs(exact).max()


def test_heyoka_is_named_where_it_is_missing():
    heyoka = import_module("outside.heyoka_taylor")
    with pytest.raises(ArgumentError, match="peers"):
        heyoka.import_heyoka("no_such_module_heyoka")


def test_remainders_fall_with_the_order(study):
    costs = study("taylor_variables").main("small")
    for tool in {cost.tool for cost in costs}:
        errors = [cost.error for cost in costs if cost.tool == tool]
        assert errors[0] > 20 * errors[1] > 400 * errors[2] > 0, tool


def test_the_table_counts_what_the_judge_found(study):
    module = study("own_error")
    found = [
        module.Outcome(2, 1e-9, (0.5, 4.0), (2.0, 10.0), verdict="stable", wrong="stable, growth is 1", seconds=0.1),
        module.Outcome(2, 1e-9, (1.5,), (6.0,), hidden=1, verdict="undecided", seconds=0.2),
        module.Outcome(2, 1e-9, refusal="TooManySegments", seconds=0.3),
        module.Outcome(2, 1e-9, crash="ValueError: no", seconds=0.4),
    ]
    row = module.summed("some", found)
    assert (row.cases, row.answered, row.refused, row.crashed, row.wrong, row.undecided) == (4, 2, 1, 1, 1, 1)
    assert (row.exponents, row.missed, row.missed3, row.worst, row.overestimate) == (3, 2, 1, 4.0, 6.0)
    lines = module.findings("some", 1, found)
    assert len(lines) == 3
    assert "1000001: n = 2" in lines[1]


@pytest.mark.skipif(not COMPILER, reason="no C compiler")
def test_compiled_code_gives_the_same_numbers(study, tmp_path):
    """Compiled twice under one name: the second call must not get the first library. Often enough called for a tape of its own."""
    x, points = ca.SX.sym("x", 2), np.linspace(0.1, 0.9, 8000).reshape(-1, 2)
    for expression in (ca.sin(x) * x[0], ca.cos(x) + x[1]):
        function = ca.Function("f", [x], [expression])
        fast = study("scaling").compiled(function, tmp_path)
        found, exact = (symbolic.evaluate(one, points)[0] for one in (fast, function))
        np.testing.assert_allclose(found, exact, rtol=1e-15)


def test_without_a_compiler_nothing_is_compiled(study, tmp_path, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda name: None)
    x = ca.SX.sym("x")
    assert study("scaling").compiled(ca.Function("f", [x], [x]), tmp_path) is None
    assert not list(tmp_path.iterdir())


def test_without_numba_the_study_times_designs_alone(study, tmp_path, monkeypatch, capsys):
    race = study("compiled_peers")
    monkeypatch.setattr(race, "NUMBA", False)
    data = race.main(size="small", out=tmp_path)
    assert {row["group"] for row in data["rows"]} == {"periodic LQR"}
    assert "numba is not installed" in capsys.readouterr().out
