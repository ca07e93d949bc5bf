import numpy as np

import flexlin as fl
from flexlin.periodic import factor_by, gauss_transitions, place_edges, radau
from tests.periodic.systems import meissner


def test_three_stages_are_hairer_s():
    """Solving ODEs II, table IV.5.6."""
    r = np.sqrt(6)
    np.testing.assert_allclose(radau(3).c, [(4 - r) / 10, (4 + r) / 10, 1], atol=1e-15)
    np.testing.assert_allclose(radau(3).b, [(16 - r) / 36, (16 + r) / 36, 1 / 9], atol=1e-15)


def test_the_last_stage_stays_before_a_break():
    grid = place_edges(np.pi, (np.pi / 3,), 8)
    found = factor_by(fl.PeriodicSystem(meissner, np.pi, breaks=(np.pi / 3,)), grid, "radau", 11)
    np.testing.assert_allclose(found, gauss_transitions(meissner, grid, 6), atol=1e-11)
