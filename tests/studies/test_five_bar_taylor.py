"""The 5-bar study, small: pinned numbers, each the outcome of a closed form or of a law."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def result(study, pictures, tmp_path_factory):
    return study("five_bar_taylor").main("small", tmp_path_factory.mktemp("pictures")), pictures


@pytest.mark.slow
def test_errors_fall_with_order_on_all_four_trajectories(result):
    errors = result[0].errors
    assert errors.shape == (10, 4)
    assert np.all(np.diff(errors, axis=0) < 0)
    assert errors[4] == pytest.approx([9.380e-7, 2.041e-4, 1.840e-4, 4.770e-4], rel=1e-3)
    assert errors[9, 0] < 3e-10


@pytest.mark.slow
def test_radius_is_the_distance_to_the_reach_circles(result):
    assert result[0].radius_gap < 1e-6
    assert set(result[0].kinds) == {"real singularity"}


@pytest.mark.slow
def test_error_estimate_holds_at_half_the_radius(result):
    assert result[0].error_ratio < 0.2


@pytest.mark.slow
def test_picture_shows_errors_that_fall_inside_the_radius_and_the_radius_itself(result):
    """A curve drawn for another order, in other units, or against the wrong distance is found out."""
    data, pictures = result
    drawn = pictures.curves("five_bar_taylor.png", 1)
    radius = drawn["radius of convergence"][0][0]
    inside = [np.interp(radius / 2, *drawn[f"order {order}"]) for order in range(1, 11)]
    assert np.all(np.diff(inside) < 0)
    edge = pictures.curves("five_bar_taylor.png", 2)["radius of convergence"]
    assert edge.shape == (2, len(data.radii))
    centre = np.array(
        next(line for line in pictures["five_bar_taylor.png"].axes[2].lines if line.get_marker() == "+").get_data()
    )
    assert np.linalg.norm(edge - centre.reshape(2, 1), axis=0) == pytest.approx(data.radii)
