"""The study of cost, small: every program reaches the same matrix. Times are printed, never tested."""

from importlib.util import find_spec

import pytest

MULTISTEP = ("CasADi cvodes", "SciPy LSODA")
"""They need smaller tolerances than the small run tries."""


@pytest.mark.slow
def test_cost_of_accuracy(study, tmp_path):
    """With heyoka where it is installed; without it the study leaves it out, as its message says."""
    data = study("cost_of_accuracy").main(size="small", out=tmp_path)
    reached = {row["program"]: row["reached"] for row in data["rows"]}
    assert reached["flexlin, all exponents"]
    assert reached["flexlin, transition matrix"]
    assert reached["SciPy DOP853"]
    assert not find_spec("heyoka") or reached["heyoka, evaluation alone"]
    assert max(row["error"] for row in data["rows"] if row["program"] not in MULTISTEP) < 1e-10
    assert data["batch_error"] < 1e-8
    assert (tmp_path / "cost_of_accuracy.json").exists()
