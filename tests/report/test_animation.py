"""The page that plays a simulation: self-contained, to scale, with the arm where the simulation has it."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from flexlin.cli import main
from flexlin.errors import ArgumentError
from flexlin.report import animation_page, collect_frames
from flexlin.simulation import simulate
from tests.closed_arm import both
from tests.files.reader import standing


@pytest.fixture(scope="module")
def played():
    scene, _, lin = both("single-link", {})
    return scene, lin, simulate(lin, 0.5, tol=1e-6)


def test_curves_end_where_the_simulation_has_the_tip(played):
    scene, lin, run = played
    first = collect_frames(scene, lin, run)["plays"][0]
    bent, rigid = ([links[-1] for links in shown] for shown in (first["links"][0], first["rigid"]))
    ends = np.array([[curve[0][-1], curve[1][-1]] for curve in bent])
    np.testing.assert_allclose(ends, run.tip, atol=2e-5)
    straight = np.array([curve[0][-1] ** 2 + curve[1][-1] ** 2 for curve in rigid])
    np.testing.assert_allclose(straight, 0.96**2, atol=1e-4)
    middle = np.array(bent[-1])[:, 4]
    assert abs(middle[0] * ends[-1, 1] - middle[1] * ends[-1, 0]) > 1e-3


def test_the_page_is_whole_and_asks_for_nothing(played):
    scene, lin, run = played
    page = animation_page(scene, lin, run, "flexlin simulate single-link")
    assert not re.search(r"(src|href)\s*=", page)
    assert "http" not in page
    data = json.loads(re.search(r"const data = (\{.*?\});", page, re.S).group(1))
    assert len(data["plays"][0]["t"]) == len(data["tip"]) == len(run.t)


def test_long_simulations_are_thinned(played, monkeypatch):
    """Wider steps over the whole simulation, not its beginning alone; the tips stay with their times."""
    monkeypatch.setattr("flexlin.report.animation.MOST_FRAMES", 20)
    run, data = played[2], collect_frames(*played)
    times, step = (data["plays"][0][name] for name in ("t", "step"))
    assert 10 < len(times) <= 20
    assert step == pytest.approx(times[1] - times[0], abs=1e-6)
    assert times[-1] > run.t[-1] - step
    at = [int(np.abs(run.t - t).argmin()) for t in times]
    np.testing.assert_allclose(data["tip"], run.tip[at], atol=2e-5)


@pytest.mark.slow
def test_every_moving_link_of_a_closed_loop_is_drawn_and_the_base_is_ground():
    """Four links of the 5-bar move; the line between its base joints is ground, and both hinges meet at the tip."""
    scene, _, lin = both("five-bar", {"designs": []})
    run = simulate(lin, 0.05, tol=1e-4)
    data = collect_frames(scene, lin, run)
    first = data["plays"][0]
    assert {len(links) for links in first["links"][0]} == {4}
    assert sorted(data["ground"]) == [[0.0, 0.0], [0.15, 0.0]]
    lengths = [np.hypot(xs[-1] - xs[0], ys[-1] - ys[0]) for xs, ys in first["rigid"][0]]
    assert sorted(np.round(lengths, 3)) == [0.2, 0.2, 0.3, 0.3]
    ends = [tuple(np.array(curve)[:, k]) for curve in first["links"][0][-1] for k in (0, -1)]
    assert sum(np.allclose(end, run.tip[-1], atol=2e-5) for end in ends) == 2
    assert [angle["name"] for angle in first["angles"]] == ["q1", "q3"]
    assert data["bodies"] == {"payload": True, "hub": True}


def test_bending_is_magnified_and_modes_are_played(played):
    scene, lin, run = played
    data = collect_frames(scene, lin, run)
    plain, larger = (np.array(data["plays"][0]["links"][k][-1][0]) for k in (0, 1))
    angle = np.radians(data["plays"][0]["angles"][0]["values"][-1])
    across = [-np.sin(angle) * curve[0, -1] + np.cos(angle) * curve[1, -1] for curve in (plain, larger)]
    assert across[1] == pytest.approx(5 * across[0], rel=5e-2)  # a bent link grows no longer
    names = [found["name"] for found in data["plays"]]
    assert names[0] == "simulation"
    assert len(names) > 2
    assert all(len(found["links"][0]) == len(found["t"]) for found in data["plays"])
    assert 0.05 < data["scale"] <= 0.96 / 4
    page = animation_page(scene, lin, run)
    assert all(f">{name}</option>" in page for name in names)


def test_the_simulation_stands_where_its_animation_meets_a_limit(tmp_path, monkeypatch, capsys):
    def endless(*_):
        assert set(standing(tmp_path / "out", "simulation")) == {"simulation.nc", "simulation.npz"}
        raise MemoryError("cannot allocate 3 TiB")

    monkeypatch.setattr("flexlin.report.animation.animation_page", endless)
    options = ["simulate", "single-link", "--periods", "0.3", "--animate", "--set", "links.0.modes=0"]
    assert main([*options, "--out", str(tmp_path / "out")]) == 4
    assert "animation: there is not enough memory" in capsys.readouterr().out
    assert set(standing(tmp_path / "out", "simulation")) == {"simulation.nc", "simulation.npz"}


def test_a_model_without_points_is_refused(played):
    """Equations that somebody typed in do not say where the tip is: an error, no empty page."""
    scene, lin, run = played
    blind = replace(lin, about=replace(lin.about, arm=replace(lin.arm.near, points=None)))
    with pytest.raises(ArgumentError, match="nothing to draw"):
        animation_page(scene, blind, run)
