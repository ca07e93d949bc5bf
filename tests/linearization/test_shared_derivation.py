"""Equations that are derived once, with numbers left free for later: against separate derivations."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import analyse, build_with_free, find_margin


@pytest.mark.slow
def test_numbers_left_free_move_no_answer():
    scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": []})
    ranges = {"motion.frequency": (0.125, 4.0), "effects.payload.mass": (0.01, 0.2)}
    free, plain = analyse(scene, free=tuple(ranges)), analyse(scene)
    assert free.plant.arm.parameters.paths == tuple(ranges)
    np.testing.assert_allclose(free.own.floquet.exponents, plain.own.floquet.exponents, atol=1e-9)
    np.testing.assert_allclose(free.linear_range.amplitudes, plain.linear_range.amplitudes, rtol=1e-3)
    for path, limits in ranges.items():
        alone = find_margin(scene, path, limits)
        shared = find_margin(scene, path, limits, known=free.closed)
        assert [one.kind for one in shared.critical] == [one.kind for one in alone.critical]
        np.testing.assert_allclose([o.value for o in shared.critical], [o.value for o in alone.critical], rtol=1e-6)


def test_what_cannot_stay_free_is_derived_as_before():
    unfit = ("single-link", "links.0.modes"), ("khang-2019", "parameters.payload_mass"), ("single-link", "no")
    for name, free in unfit:
        assert build_with_free(fl.load_scene(name), [free]).parameters.paths == ()
    one_way = {"kind": "point-to-point", "course": "one-way", "move_time": 0.6, "joints": [{"waypoints": [-1.2, -0.4]}]}
    scene = fl.load_scene("single-link", {"motion": one_way, "designs": []})
    assert build_with_free(scene, ["effects.payload.mass"]).parameters.paths == ()
