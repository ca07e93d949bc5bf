"""The cost study, small: all routes find the same polynomial; no time is judged here."""

import importlib.util
import sys
from pathlib import Path

import pytest

STUDIES = Path(__file__).parents[2] / "studies"


@pytest.mark.slow
def test_all_routes_agree(monkeypatch):
    spec = importlib.util.spec_from_file_location("taylor_cost", STUDIES / "taylor_cost.py")
    study = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "taylor_cost", study)
    spec.loader.exec_module(study)
    monkeypatch.setattr(study, "best_time", lambda call: 0.0)
    costs = study.main("small")
    errors = {cost.route: cost.error for cost in costs}
    assert {"dense recursion", "nested CasADi", "CasADi rootfinder", "series, numbers"} <= set(errors)
    for route, error in errors.items():
        assert error == pytest.approx(errors["dense recursion"], rel=1e-8), route
    assert errors["dense recursion"] == pytest.approx(1.24e-4, rel=0.01)
