"""The page that plays a simulation: self-contained, to scale, with the arm where the simulation has it."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import flexlin as fl
from flexlin.cli.main import main
from flexlin.errors import ArgumentError
from flexlin.report.animation import animation_page, collect_frames
from flexlin.simulation import simulate


@pytest.fixture(scope="module")
def played():
    scene = fl.load_scene("single-link")
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    return scene, lin, simulate(lin, 0.5, tol=1e-6)


def test_curves_end_where_the_simulation_has_the_tip(played):
    scene, lin, run = played
    data = collect_frames(scene, lin, run)
    ends = np.array([[curve[0][-1], curve[1][-1]] for curve in data["arm"]])
    np.testing.assert_allclose(ends, run.tip, atol=2e-5)
    straight = np.array([curve[0][-1] ** 2 + curve[1][-1] ** 2 for curve in data["rigid"]])
    np.testing.assert_allclose(straight, 0.96**2, atol=1e-4)
    middle = np.array(data["arm"][-1])[:, 4]
    assert abs(middle[0] * ends[-1, 1] - middle[1] * ends[-1, 0]) > 1e-3


def test_the_page_is_whole_and_asks_for_nothing(played):
    scene, lin, run = played
    page = animation_page(scene, lin, run, "flexlin simulate single-link")
    assert not re.search(r"(src|href)\s*=", page)
    assert "http" not in page
    data = json.loads(re.search(r"const data = (\{.*?\});", page, re.S).group(1))
    assert len(data["t"]) == len(data["tip"]) == len(run.t)


def test_long_simulations_are_thinned(played, monkeypatch):
    """Wider steps over the whole simulation, not its beginning alone; the tips stay with their times."""
    monkeypatch.setattr("flexlin.report.animation.FRAMES", 20)
    run, data = played[2], collect_frames(*played)
    assert 10 < len(data["t"]) <= 20
    assert data["step"] == pytest.approx(data["t"][1] - data["t"][0], abs=1e-6)
    assert data["t"][-1] > run.t[-1] - data["step"]
    at = [int(np.abs(run.t - t).argmin()) for t in data["t"]]
    np.testing.assert_allclose(data["tip"], run.tip[at], atol=2e-5)


def test_the_command_writes_it(tmp_path):
    options = ["simulate", "single-link", "--periods", "0.3", "--feedforward", "tip-exact", "--animate"]
    assert main([*options, "--out", str(tmp_path)]) == 0
    assert "--feedforward tip-exact" in (tmp_path / "animation.html").read_text()


def test_a_model_without_points_is_refused(played):
    """Equations that somebody typed in do not say where the tip is: an error, no empty page."""
    scene, lin, run = played
    blind = replace(lin, about=replace(lin.about, arm=replace(lin.arm, points=None)))
    with pytest.raises(ArgumentError, match="nothing to draw"):
        animation_page(scene, blind, run)
