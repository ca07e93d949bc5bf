"""The study of a real arm: the fitted numbers beat the data sheet's on logs that travel with it, and the ring is predicted."""

import pytest


@pytest.mark.slow
def test_the_fit_beats_the_data_sheet(study):
    found = study("measured_machine").compare("quanser-two-link", 6.0)
    assert all(found["fitted"][column] > found["data sheet"][column] + 3 for column in found["fitted"])
    assert min(found["fitted"].values()) > 75


@pytest.mark.slow
@pytest.mark.parametrize("name", ["quanser-two-link", "quanser-two-link-factory"])
def test_the_ring_is_within_three_percent(study, name):
    made = study("measured_machine")
    frequency, rate = made.predict_ring(name)
    for measured, decay in made.measure_ring(name):
        assert frequency == pytest.approx(measured, rel=0.03)
        assert 0 < rate < 2 * decay
