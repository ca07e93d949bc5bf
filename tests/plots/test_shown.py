"""What a result looks like: words, cards, drawings and datasets say the numbers that the result holds."""

import re
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest

import flexlin as fl
from flexlin.control import pd_feedback
from flexlin.errors import ArgumentError
from flexlin.plots import MOST_POINTS, Series, Shown, View, make_card
from tests.public_results import arm_results, stability_results

pyplot = pytest.importorskip("matplotlib.pyplot")
pyplot.switch_backend("Agg")


@pytest.fixture(autouse=True)
def closed():
    yield
    pyplot.close("all")


@pytest.fixture(scope="module")
def results():
    found = {name: arm_results()[name] for name in ("periodic", "finite horizon", "simulation", "response")}
    found |= {"floquet": stability_results()["floquet"]}
    found["compared"] = fl.plots.compare({"own": found["floquet"], "other": found["floquet"]})
    return found


@pytest.mark.slow
def test_each_draws_into_axes_and_opens_a_figure_where_none_are_given(results):
    for name, result in results.items():
        figure, ax = pyplot.subplots()
        assert result.plot(ax) is ax, name
        assert len(ax.lines) >= 1
        assert ax.get_xlabel()
        assert ax.get_ylabel()
        opened = result.plot()
        assert opened.figure is not figure
        assert result.plot(ax, alpha=0.3).lines[-1].get_alpha() in (0.3, None)


def test_axes_of_own_systems_name_states_inputs_and_units():
    waving = fl.PeriodicSystem.from_second_order
    system = waving([[1.0]], [[0.1]], lambda t: 1 + 0.1 * np.cos(t)[:, None, None], 2 * np.pi, [[1.0]])
    drawn = {
        "in the input's unit per the state's": fl.periodic_lqr(system, np.eye(2), [[1.0]], tol=1e-4),
        "each in its own unit": fl.forced_response(system, [0.0, 1.0], tol=1e-4),
        "in the units of x' per x": system,
        "states, each": fl.respond(system, [0.0, 1.0], [1.0, 0.0]),
        "in the output's unit per the input's": fl.frequency_response(system, [[1.0, 0.0]], [0.5, 0.7]),
    }
    curves = [("u1 per x1", "u1 per x2"), ("x1", "x2"), ("x2' per x1",), ("x1", "x2"), ("y1 per u1",)]
    for (words, result), names in zip(drawn.items(), curves, strict=True):
        view = result._view()
        assert words in view.y_label
        assert tuple(series.name for series in view.series) == names
        assert result.summary()
        assert result.to_xarray().sizes["time" if "omega" not in view.x_label else "omega"] > 1


def test_what_is_drawn_are_the_numbers(results):
    floquet, run = results["floquet"], results["simulation"]
    x, y = floquet.plot().lines[0].get_data()
    upper = floquet.exponents[floquet.exponents.imag >= 0]
    np.testing.assert_array_equal(x, upper.real)
    np.testing.assert_allclose(y, upper.imag / (2 * np.pi))
    t, away = run.plot().lines[0].get_data()
    np.testing.assert_array_equal(t, run.t)
    assert away.max() == pytest.approx(run.tip_error)


@pytest.mark.slow
def test_a_card_holds_verdict_and_picture_and_stays_small(results):
    for name, result in results.items():
        card = result._repr_html_()
        assert len(card) < 20_000, name
        ElementTree.fromstring(card)
        assert "<svg" in card
        assert "nan" not in card.lower()
        assert not re.search(r"(?:src|href)=", card)
    assert f'<b style="color:#b03a00">{results["floquet"].verdict}</b>' in results["floquet"]._repr_html_()


def test_a_card_survives_what_cannot_be_drawn():
    nothing = View("<script>", "", ("a < b",), "x", "y", (Series("gone", np.array([np.nan]), np.array([1.0])),))
    card = make_card(nothing)
    assert "<script>" not in card
    assert "<svg" not in card
    flat = Series("flat", np.zeros(1), np.zeros(1), "dots")
    ElementTree.fromstring(make_card(View("one point", "", (), "x", "y", (flat,))))
    long = Series("long", np.arange(1e5), np.where(np.arange(1e5) % 7 == 0, np.inf, 1.0))
    assert make_card(View("long", "", (), "x", "y", (long,))).count(",") < 2 * MOST_POINTS


def test_summaries_are_short_and_say_the_verdict(results):
    for name, result in results.items():
        lines = result.summary().splitlines()
        assert 2 <= len(lines) <= 12, name
        assert isinstance(result, Shown)
        assert str(result) == result.summary(), name
    floquet = results["floquet"]
    assert floquet.summary().startswith(f"Floquet: {floquet.verdict}\n")
    assert f"{floquet.exponents[0].real:.6g}" in floquet.summary()


def test_datasets_bear_names_units_and_the_numbers(results):
    floquet, design, run = results["floquet"], results["periodic"], results["simulation"]
    data = floquet.to_xarray()
    np.testing.assert_array_equal(data["exponents"], floquet.exponents)
    assert data["growth_rate"].attrs["units"] == "1/s"
    assert data.attrs["verdict"] == floquet.verdict
    gains = design.to_xarray(9, ["q1", "w11", "q1_rate", "w11_rate"], ["q1"])
    np.testing.assert_array_equal(gains["K"].sel(input="q1"), design.K(gains["time"].values)[:, 0])
    assert gains["time"].attrs["units"] == "s"
    assert gains.attrs["error"] == design.error
    series = run.to_xarray()
    assert dict(zip(series["state"].values, series["unit"].values, strict=True)) == {
        "q1": "rad", "w11": "m", "q1_rate": "rad/s", "w11_rate": "m/s",
    }  # fmt: skip
    assert series["tip"].attrs["units"] == "m"
    response = results["response"].to_xarray(5)
    np.testing.assert_array_equal(response["response"].values, results["response"](response["time"].values))
    for wrong in (lambda: design.to_xarray(9, ["q1"]), lambda: results["response"].to_xarray(1)):
        with pytest.raises(ArgumentError):
            wrong()


def test_charts_of_one_and_two_parameters_are_drawn():
    scene = fl.load_scene("spinning-link")
    one = fl.sweep(scene, {"motion.joints.0.rate": [2.0, 3.0, 4.0]}, 1e-5)
    x, y = fl.plots.plot_chart(one).lines[0].get_data()
    np.testing.assert_array_equal(x, [2.0, 3.0, 4.0])
    np.testing.assert_allclose(y, one["exponents"].values.real.max(axis=-1))
    grid = {"motion.joints.0.rate": [2.0, 3.0], "effects.gravity.acceleration": [0.0, 9.81, 20.0]}
    ax = fl.plots.plot_chart(fl.sweep(scene, grid, 1e-5, grid=True))
    assert (ax.get_xlabel(), ax.get_ylabel()) == tuple(grid)
    for wrong in (None, one["exponents"], {"verdict": 1}):
        with pytest.raises(ArgumentError):
            fl.plots.plot_chart(wrong)
    with pytest.raises(ArgumentError, match="'b'"):
        fl.plots.compare({"b": 3})


def test_a_scene_draws_its_arm_along_the_motion():
    """A blade of 1 m on a hub of 0.05 m turns once in a plane; a five-bar of 0.2 and 0.3 m is closed, each tip where the links end."""
    blade, loop = (fl.load_scene(name) for name in ("rotating-blade", "five-bar"))
    *arms, tip = (line.get_xydata() for line in blade.plot().lines)
    turned = 1.05 * np.exp(2j * np.pi * np.arange(3) / 3)
    np.testing.assert_allclose([arm[-1] for arm in arms], np.stack([turned.real, turned.imag], axis=1), atol=1e-9)
    np.testing.assert_allclose(np.hypot(*tip.T), 1.05, rtol=1e-12)
    ax = loop.plot()
    *arms, tip = (line.get_xydata() for line in ax.lines)
    lengths = np.hypot(*np.diff(arms, axis=1).T).T
    links = np.tile([0.2, 0.3, 0.3, 0.2, 0.2, 0.3], (3, 1))
    np.testing.assert_allclose(lengths[:, [0, 1, 4, 5, 7, 8]], links, rtol=1e-9)
    np.testing.assert_allclose(tip[0], tip[-1], atol=1e-9)
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_aspect(), ax.get_title()) == ("x in m", "y in m", 1.0, loop.title)
    assert loop.summary().startswith(f"{loop.title}\n  4 links")


@pytest.mark.slow
def test_drawing_without_matplotlib_says_what_to_install():
    program = """
import sys
sys.modules["matplotlib"] = None
import flexlin as fl
found = fl.floquet(fl.PeriodicSystem([[-1.0]], 1.0))
assert "stable" in found.summary() and "<svg" in found._repr_html_()
try:
    found.plot()
except fl.errors.ArgumentError as error:
    print(error)
"""
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "pip install matplotlib" in run.stdout


def test_axes_that_are_none_are_refused(results):
    with pytest.raises(ArgumentError, match="ax is of another kind"):
        results["floquet"].plot("left")


def test_a_linearization_serves_where_a_system_is_meant():
    lin = arm_results()["linearization"]
    plant = fl.linearize(lin.arm, lin.motion)
    same = fl.floquet(lin.periodic_system(), tol=1e-7).exponents
    np.testing.assert_allclose(fl.floquet(lin, tol=1e-7).exponents, same, rtol=1e-12)
    gains = [
        fl.periodic_lqr(system, np.diag([1.0, 1.0, 0.01, 0.01]), R, tol=1e-6).K(0.3)
        for system, R in ((plant, 100.0), (plant.periodic_system(), [[100.0]]))
    ]
    np.testing.assert_array_equal(*gains)
    assert pd_feedback(plant, [0], [10.0], [1.0]).K(np.zeros(1)).shape == (1, 1, 4)


def test_curves_beyond_the_colours_are_dashed():
    lin = fl.linearize(fl.build_manipulator(fl.load_scene("manutec-r3")), fl.load_scene("manutec-r3").motion)
    looks = {(line.get_color(), line.get_linestyle()) for line in lin.plot().lines}
    assert len(looks) == lin.n == 9
