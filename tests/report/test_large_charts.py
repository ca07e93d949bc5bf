"""Charts of many values: the picture is of a size that can be looked at, and shows the worst of what it leaves out."""

import time
from pathlib import Path

import numpy as np
import pytest
import xarray

import flexlin as fl
from flexlin.cli import main
from flexlin.report import Chart, draw_charts, thin
from tests.files.reader import standing

SCENE = fl.load_scene("single-link", {"links.0.modes": 1, "designs": [], "control": {}})


def sweep_of(growth, **axes):
    """A sweep as `fl.sweep` returns it, with these growth rates."""
    dims = list(axes) if len(axes) > 1 else ["value"]
    coords = {name: (name if len(axes) > 1 else "value", values) for name, values in axes.items()}
    verdict = np.where(np.isnan(growth), "failed", np.where(growth > 0, "unstable", "stable"))
    exponents = np.stack([growth, growth - 1.0, growth - 2.0, growth - 3.0], axis=-1).astype(complex)
    named = {"verdict": (dims, verdict), "error": (dims, np.full(growth.shape, 1e-9))}
    return xarray.Dataset(
        {"exponents": ([*dims, "mode"], exponents), **named, "period": (dims, 2.0 + 0 * growth)}, coords
    )


@pytest.mark.parametrize("shape", [(1_001, 77), (300, 301), (650, 900)])
def test_a_thinned_map_shows_each_single_unstable_value(shape):
    rng = np.random.default_rng(shape[0])
    growth = -1.0 - rng.random(shape)
    hidden = tuple(int(rng.integers(n)) for n in shape)
    growth[hidden] = 0.5
    axes = {"motion.frequency": np.linspace(0.1, 2.0, shape[0]), "effects.payload.mass": np.linspace(0, 0.3, shape[1])}
    found = thin(sweep_of(growth, **axes))
    assert max(found["verdict"].shape) <= 300
    (i,), (j,) = np.nonzero(found["verdict"].values == "unstable")
    for index, at, axis in zip((i, j), hidden, axes.values(), strict=True):
        assert abs(found[next(k for k, v in axes.items() if v is axis)].values[index] - axis[at]) <= np.ptp(axis) / 100
        assert found[next(k for k, v in axes.items() if v is axis)].values[[0, -1]].tolist() == [axis[0], axis[-1]]


def test_a_thinned_line_keeps_values_and_their_numbers_together():
    growth = np.sin(np.linspace(0, 40, 10_007)) - 0.5
    growth[5_000] = np.nan
    data = sweep_of(growth, **{"effects.payload.mass": np.linspace(0, 0.3, len(growth))})
    found = thin(data)
    assert len(found["verdict"]) <= 2000
    assert (found["verdict"] == "unstable").sum() > 0
    again = data.sel(value=np.searchsorted(data["effects.payload.mass"], found["effects.payload.mass"]))
    np.testing.assert_array_equal(again["exponents"].values, found["exponents"].values)
    assert thin(found) is found


def test_a_search_that_met_a_limit_is_not_a_range_without_boundary():
    growth = np.array([[-1.0, 1.0], [-1.0, -1.0]])
    data = sweep_of(growth, **{"motion.frequency": np.array([0.2, 3.0]), "effects.payload.mass": np.array([0.0, 0.3])})
    (picture,) = draw_charts(Chart(SCENE, data))
    assert "does not change" not in picture.caption
    data.attrs["search"] = "the limit of 3 s was met"
    (picture,) = draw_charts(Chart(SCENE, data))
    assert "the limit of 3 s was met" in picture.caption
    line = (
        data.isel({"effects.payload.mass": 0})
        .rename({"motion.frequency": "value"})
        .assign_coords({"motion.frequency": ("value", [0.2, 3.0])})
        .drop_vars(["value", "effects.payload.mass"])
    )
    assert "the limit of 3 s was met" in draw_charts(Chart(SCENE, line))[0].caption


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["time", "memory"])
def test_numbers_are_written_where_a_picture_meets_a_limit(
    fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Drawing that never ends is ended; whatever becomes of it, the numbers stand since before it began."""
    stood = []

    def endless(*_: object) -> None:
        stood.extend(standing(tmp_path / "out", "chart") or ())
        if fault == "memory":
            raise MemoryError("cannot allocate 3 TiB")
        while True:
            time.sleep(0.01)

    monkeypatch.setattr("flexlin.report.charts.draw_charts", endless)
    over = ["--over", "effects.payload.mass=0:0.3:9", "--set", "links.0.modes=1", "designs=[]", "control={}"]
    limit = ["--limit-seconds", "2"] if fault == "time" else []
    assert main(["chart", "single-link", *over, *limit, "--out", str(tmp_path / "out")]) == 4
    assert set(stood) == {"chart.html", "chart.nc", "chart.npz"}
    with np.load(tmp_path / "out/chart.npz", allow_pickle=False) as found:
        assert found["error"].shape == (9,)
        assert np.isfinite(found["exponents_re" if "exponents_re" in found else "exponents"]).all()
    said, page = capsys.readouterr().out, (tmp_path / "out/chart.html").read_text()
    for text in (said, page):
        assert "The picture was not drawn (figures:" in text
