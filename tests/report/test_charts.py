"""Charts: contours, scales that do not enlarge rounding, frequencies without ambiguity, plain names, pictures of many values."""

import time
from pathlib import Path

import numpy as np
import pytest
import xarray

import flexlin as fl
from flexlin.analyses import Clock, CriticalValue, find_margin, unfold_frequencies
from flexlin.cli import main
from flexlin.report import Chart, choose_scale, draw_charts, say_bending, thin, trace_contour
from flexlin.scene import label_number
from tests.files.reader import standing
from tests.mechanics.scenes import plain_scene, swinging


def test_a_contour_of_a_cone_is_a_circle():
    x, y = np.linspace(-1, 1, 41), np.linspace(-2, 2, 61)
    along, up = trace_contour(x, y, np.hypot(*np.meshgrid(x, y, indexing="ij")), 0.7)
    known = np.isfinite(along)
    assert np.allclose(np.hypot(along[known], up[known]), 0.7, atol=2e-3)
    length = np.hypot(np.diff(along), np.diff(up))
    assert np.nansum(length) == pytest.approx(2 * np.pi * 0.7, rel=1e-3)


def test_rounding_is_not_enlarged():
    noise = 1e-14 * np.random.default_rng(0).standard_normal((50, 2))
    low, high = choose_scale(noise, np.full(50, 1e-12)).ends
    assert high - low > 1e-6


def test_a_mode_that_is_only_bounded_does_not_widen_the_scale():
    low, high = choose_scale(np.linspace(-2.0, -1.0, 50), np.append(np.full(49, 1e-9), np.inf)).ends
    assert -3 < low < high < 1


def test_frequencies_follow_the_mode_through_its_tongues():
    """Without gravity the link has one frequency, sqrt(k11 + (G - 1) W^2); weak gravity hardly moves it, but its exponent jumps."""
    scene = fl.load_scene("spinning-link", {"effects.gravity.acceleration": 0.5})
    rates = np.linspace(0.6, 5.0, 60)
    data = fl.sweep(scene, {"motion.joints.0.rate": rates})
    found = unfold_frequencies(scene, "motion.joints.0.rate", data)
    assert found is not None
    exact = np.sqrt(12.362363368 + 0.193336374 * rates**2)
    assert np.abs(found["frequency"].values - exact[:, None]).max() < 0.01
    assert np.allclose(found["motion"], rates)


def test_numbers_have_plain_names_with_units():
    for path, words in (
        ("motion.frequency", "motion frequency in Hz"),
        ("links.0.bending_stiffness", "bending stiffness of link 1 in N m²"),
        ("control.feedback.kp.0", "stiffness of the feedback of joint 1 in N m/rad"),
        ("effects.modal_damping.ratio", "modal damping ratio"),
    ):
        assert label_number(fl.load_scene("single-link"), path) == words


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [0.0, 0.05, 0.3])
def test_critical_values_of_a_short_search_hold_those_of_the_long_one(seconds):
    scene, path = fl.load_scene("khang-2019"), "motion.frequency"
    short, full = find_margin(scene, path, (0.5, 3.0), seconds), find_margin(scene, path, (0.5, 3.0))
    assert full.gap == 0.0
    (exact,) = full.critical
    for one in short.critical:
        assert abs(one.value - exact.value) <= one.error + exact.error
        assert one.kind == exact.kind
    assert short.critical or short.gap > 0
    low, high = short.searched
    assert (low, high) == (0.5, 3.0) or short.gap > 0
    assert any(low < one.value < high for one in short.critical) or not low < exact.value < high


def test_a_chart_says_where_its_links_bend_too_far_for_linear_equations():
    """By w/l = m g l^2 / (3 EI) + rho A g l^3 / (8 EI), Euler-Bernoulli."""
    share, path = 9.81 * (0.6 * 0.8**2 / 3 + 0.3 * 0.8**3 / 8) / 5.0, "effects.payload.mass"
    strip = {"length": 0.8, "mass_per_length": 0.3, "bending_stiffness": 5.0, "modes": 4}
    control = {"feedforward": "rigid", "feedback": {"kind": "pd", "kp": [50.0], "kd": [5.0]}}
    level, loads = swinging({"amplitude": 1e-3}, frequency=0.01), {"gravity": {}, "payload": {"mass": 0.1}}
    scene = plain_scene([strip], level, effects=loads, control=control)
    onset = CriticalValue(path, 0.6, 1e-9, "onset", "not looked for", 0.5, np.nan)
    assert say_bending(scene, {path: (0.0, 0.3)}, [], Clock(scene.accuracy)) == ""
    said = say_bending(scene, {path: (0.0, 4.0)}, [onset], Clock(scene.accuracy))
    bent = f"A link bends by {100 * share:.3g} % of its length at payload mass = 0.6 kg"
    assert said.startswith(f"{bent}; by more than its length at")
    assert "linear model alone" in said


@pytest.mark.parametrize(("command", "option"), [("chart", "--over"), ("report", "--margins")])
def test_a_search_over_one_number_that_had_to_end_says_so(command, option, tmp_path, monkeypatch, capsys):
    for share in ("charts.BOUNDARY_SHARE", "writing.STAGE_SHARE"):
        monkeypatch.setattr(f"flexlin.report.{share}", 1e-4)
    asked = ["--out", str(tmp_path), option, "motion.joints.0.rate=2:4" + ":9" * (command == "chart")]
    assert main([command, "spinning-link", *asked]) == 4  # not all was answered
    said = capsys.readouterr().out
    assert "was not searched to the end" in said or "that time allowed" in said
    assert "does not change" not in said


SCENE = fl.load_scene("single-link", {"links.0.modes": 1, "designs": [], "control": {}})


def sweep_of(growth, **axes):
    """A sweep as `fl.sweep` returns it, with these growth rates."""
    dims = list(axes) if len(axes) > 1 else ["value"]
    coords = {name: (name if len(axes) > 1 else "value", values) for name, values in axes.items()}
    verdict = np.where(np.isnan(growth), "failed", np.where(growth > 0, "unstable", "stable"))
    exponents = np.stack([growth, growth - 1.0, growth - 2.0, growth - 3.0], axis=-1).astype(complex)
    data = xarray.Dataset({"exponents": ([*dims, "mode"], exponents), "verdict": (dims, verdict)}, coords)
    return data.assign(error=(dims, np.full(growth.shape, 1e-9)), period=(dims, 2.0 + 0 * growth))


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
    for index, at, (path, axis) in zip((i, j), hidden, axes.items(), strict=True):
        assert abs(found[path].values[index] - axis[at]) <= np.ptp(axis) / 100
        assert found[path].values[[0, -1]].tolist() == [axis[0], axis[-1]]


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
    line = sweep_of(growth[:, 0], **{"motion.frequency": np.array([0.2, 3.0])}).assign_attrs(data.attrs)
    assert "the limit of 3 s was met" in draw_charts(Chart(SCENE, line))[0].caption


@pytest.mark.slow
def test_numbers_are_written_where_a_picture_meets_a_limit(tmp_path: Path, monkeypatch, capsys) -> None:
    """Drawing that never ends is ended; whatever becomes of it, the numbers stand since before it began."""
    stood = []

    def endless(*_: object) -> None:
        stood.extend(standing(tmp_path / "out", "chart") or ())
        while True:
            time.sleep(0.01)

    monkeypatch.setattr("flexlin.report.charts.draw_charts", endless)
    over = ["--over", "effects.payload.mass=0:0.3:9", "--set", "links.0.modes=1", "designs=[]", "control={}"]
    assert main(["chart", "single-link", *over, "--limit-seconds", "2", "--out", str(tmp_path / "out")]) == 0
    assert set(stood) == {"chart.html", "chart.nc", "chart.npz"}
    with np.load(tmp_path / "out/chart.npz", allow_pickle=False) as found:
        assert found["error"].shape == (9,)
        assert np.isfinite(found["exponents_re" if "exponents_re" in found else "exponents"]).all()
    said, page = capsys.readouterr().out, (tmp_path / "out/chart.html").read_text()
    for text in (said, page):
        assert "The picture was not drawn (figures:" in text
