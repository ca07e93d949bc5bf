"""Reports and results of an arm that leaves the plane."""

import json

import pytest
import xarray

from flexlin.cli import main

TILTED = [
    "links.0.mount.rpy=[1.5707963267948966,0,0]",
    "links.0.modes=1",
    "effects.gravity.direction=[0,0,-1]",
    "designs=[]",
]


@pytest.mark.slow
@pytest.mark.parametrize("extra", [[], ["effects.geometric_stiffening=off"]])
def test_an_arm_that_swings_in_another_plane_is_the_same_arm(extra, tmp_path):
    """The single link turned by a right angle about x, gravity with it: tip errors and exponents are those of the plane."""
    found = []
    for name, changes in (("plane", TILTED[1:2] + TILTED[3:]), ("tilted", TILTED)):
        out = tmp_path / name
        assert main(["report", "single-link", "--tol", "1e-6", "--set", *changes, *extra, "--out", str(out)]) == 0
        found.append(json.loads((out / "report.json").read_text()))
        assert main(["simulate", "single-link", "--periods", "0.1", "--set", *changes, *extra, "--out", str(out)]) == 0
    plane, tilted = found
    for (a, b), (c, d) in zip(plane["floquet"]["exponents"], tilted["floquet"]["exponents"], strict=True):
        assert (a, b) == pytest.approx((c, d), abs=1e-5 * max(1, abs(a)))
    with xarray.open_dataset(tmp_path / "tilted" / "simulation.nc", engine="scipy") as data:
        assert [str(axis) for axis in data["axis"].values] == ["x", "y", "z"]
