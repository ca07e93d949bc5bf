"""The studies of control, small: tip tracking, Kane's spin-up, and the survival of designs."""

import numpy as np
import pytest


def test_tracking(study, tmp_path):
    data = study("tracking").main(size="small", out=tmp_path)["data"]
    assert np.all(data.gain > 20)
    assert data.nonlinear["tip-exact"] == pytest.approx(data.linear["tip-exact"], rel=0.2)
    assert (tmp_path / "tracking.svg").stat().st_size > 1000


def test_spin_up(study, tmp_path):
    """Kane, Ryan, Banerjee (1987); Simo, Vu-Quoc: the largest lag is 0.574 m near 6.8 s; without stiffening it diverges."""
    stiff, without = study("spin_up").main(size="small", out=tmp_path).values()
    lag, time = stiff.lag
    assert lag == pytest.approx(0.574, abs=0.001)
    assert time == pytest.approx(6.8, abs=0.15)
    assert abs(stiff.tip[-1]) < 0.02
    assert without.t[-1] < 15
    assert (tmp_path / "spin_up.svg").stat().st_size > 1000


def test_lqr_designs(study, tmp_path):
    result = study("lqr_designs").main(size="small", out=tmp_path)
    assert np.all(result["survival"].own["periodic"] < 0)
    assert all(error < 1e-3 for _, error in result["times"].values())
    assert (tmp_path / "lqr_designs.svg").stat().st_size > 1000
