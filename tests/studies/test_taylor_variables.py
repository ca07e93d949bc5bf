"""The study of many variables, small: each tool gives the tip to the order asked."""

import importlib.util
import sys
from pathlib import Path

STUDIES = Path(__file__).parents[2] / "studies"


def test_remainders_fall_with_the_order(monkeypatch):
    spec = importlib.util.spec_from_file_location("taylor_variables", STUDIES / "taylor_variables.py")
    study = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "taylor_variables", study)
    spec.loader.exec_module(study)
    costs = study.main("small")
    for tool in {cost.tool for cost in costs}:
        errors = [cost.error for cost in costs if cost.tool == tool]
        assert errors[0] > 20 * errors[1] > 400 * errors[2] > 0, tool
