"""The study of charts, small: every value is right. Times are printed, never tested."""

import pytest


@pytest.mark.slow
def test_charts_speed(study, pictures, tmp_path):
    data = study("charts_speed").main(size="small", out=tmp_path)
    assert max(row["distance_in_tol"] for row in data["rows"]) < 1
    assert "flexlin, all exponents" in data["peers_us"]
    assert (tmp_path / "charts_speed.json").exists()
    assert "charts_speed.svg" in pictures
    assert set(data["sharing"]) == {"one process, s", "two threads", "two processes"}
