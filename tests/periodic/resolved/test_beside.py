"""What a representation misses close to a jump or kink that it puts at a wrong place, against the integral in closed form."""

import numpy as np
import pytest

from flexlin.periodic.interpolation import ChebyshevPanels
from flexlin.periodic.resolved.panels import miss_beside
from flexlin.periodic.resolved.resolve import resolve
from flexlin.periodic.resolved.sampling import Sampler

T = 2.5


def built(place, kinked, edge=None):
    """A(t) with a jump of 3, or a jump of its slope of 3, at `place` and 0, and its two pieces continued to the edge."""
    edge = place if edge is None else edge
    value, slope = ([0.0, 0.0], [-1.0, 2.0]) if kinked else ([0.0, 3.0], [0.5, 0.5])

    def A(t):
        t = np.mod(t, T)
        late = (t >= place).astype(int)
        return (np.take(value, late) + np.take(slope, late) * (t - place))[:, None, None]

    edges = np.array([0.0, edge, T])
    half, middle = np.diff(edges) / 2, (edges[1:] + edges[:-1]) / 2
    rows = [[value[k] + slope[k] * (middle[k] - place), slope[k] * half[k]] for k in (0, 1)]
    return A, ChebyshevPanels(edges, np.array(rows)[:, :, None, None])


@pytest.mark.parametrize("kinked", [False, True])
@pytest.mark.parametrize("off", [1e-14, -3e-13, 7e-12])
def test_a_place_that_is_off_counts_for_what_it_costs(kinked, off):
    """3 |off| for a jump, 3 off^2 / 2 for a kink: never less, and not much more."""
    place = 0.9
    A, series = built(place, kinked, place + off)
    missed = miss_beside(Sampler(A, T), series, np.array([place + off]), np.array([place + off]))[0, 0]
    cost = 1.5 * off**2 if kinked else 3.0 * abs(off)
    assert cost <= missed <= 8 * cost + (1e-25 if kinked else 1e-15)


def test_what_the_places_cost_is_part_of_the_mean_error():
    """A jump found to the last bit costs half a bit of its height, whatever the marks; one that is named exactly is not looked at."""
    A, _ = built(1.2345678, kinked=False)
    found = resolve(A, T)
    assert found.beside is not None
    least = 1.5 * np.spacing(1.2345678)
    assert least <= found.beside[1, 0, 0] <= 4 * least
    for marks in (found.edges, np.linspace(0, T, 8)):
        total = (found.mean_error(marks) * np.diff(marks)[:, None, None]).sum()
        assert found.beside.sum() < total < found.beside.sum() + 1e-15 * T * 6
    assert resolve(A, T, breaks=(0.0, 1.2345678), complete=True).beside.max() == 0.0
