import numpy as np
import pytest

from flexlin.errors import ArgumentError
from flexlin.periodic import place_edges


def test_edges_hit_the_breaks():
    grid = place_edges(2.0, (0.3, 1.9), 10)
    assert grid[0] == 0
    assert grid[-1] == 2
    assert {0.3, 1.9} <= set(grid)
    assert np.diff(grid).max() <= 0.2 + 1e-15
    assert len(place_edges(1.0, (), 7)) == 8


@pytest.mark.parametrize("segments", [0, -5, 2.5, True, None])
def test_segments_are_a_whole_number(segments):
    with pytest.raises(ArgumentError, match="segments"):
        place_edges(1.0, (), segments)


def test_breaks_one_rounding_apart_leave_no_segment_without_length():
    grid = place_edges(1.0, (0.3, np.nextafter(0.3, 1.0)), 4, least=3)
    assert np.all(np.diff(grid) > 0)
    assert {0.3, np.nextafter(0.3, 1.0)} <= set(grid)
