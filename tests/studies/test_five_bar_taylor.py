"""The 5-bar study, small: pinned numbers, each the outcome of a closed form or of a law."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

STUDIES = Path(__file__).parents[2] / "studies"


@pytest.fixture(scope="module")
def study():
    spec = importlib.util.spec_from_file_location("five_bar_taylor", STUDIES / "five_bar_taylor.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def result(study, tmp_path_factory):
    out = tmp_path_factory.mktemp("pictures")
    return study.main("small", out), out


def test_errors_fall_with_order_on_all_four_trajectories(result):
    errors = result[0].errors
    assert errors.shape == (10, 4)
    assert np.all(np.diff(errors, axis=0) < 0)
    assert errors[4] == pytest.approx([9.380e-7, 2.041e-4, 1.840e-4, 4.770e-4], rel=1e-3)
    assert errors[9, 0] < 3e-10


def test_radius_is_the_distance_to_the_reach_circles(result):
    assert result[0].radius_gap < 1e-6
    assert set(result[0].kinds) == {"real singularity"}


def test_error_estimate_holds_at_half_the_radius(result):
    assert result[0].error_ratio < 0.2


def test_picture_is_drawn(result):
    assert (result[1] / "five_bar_taylor.png").stat().st_size > 20_000
