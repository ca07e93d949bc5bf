"""The studies of Taylor polynomials, small: all routes and tools find the same polynomial; no time is judged here."""

import pytest


@pytest.mark.slow
def test_all_routes_agree(study, monkeypatch):
    made = study("taylor_cost")
    monkeypatch.setattr(made, "best_time", lambda call: 0.0)
    errors = {cost.route: cost.error for cost in made.main("small")}
    assert {"dense recursion", "nested CasADi", "CasADi rootfinder", "series, numbers"} <= set(errors)
    for route, error in errors.items():
        assert error == pytest.approx(errors["dense recursion"], rel=1e-8), route
    assert errors["dense recursion"] == pytest.approx(1.24e-4, rel=0.01)


def test_remainders_fall_with_the_order(study):
    costs = study("taylor_variables").main("small")
    for tool in {cost.tool for cost in costs}:
        errors = [cost.error for cost in costs if cost.tool == tool]
        assert errors[0] > 20 * errors[1] > 400 * errors[2] > 0, tool
