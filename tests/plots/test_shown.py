"""What a result looks like: words, cards, drawings and datasets say the numbers that the result holds."""

import re
import sys
from xml.etree import ElementTree

import numpy as np
import pytest

import flexlin as fl
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
        assert all((ax.lines, ax.get_xlabel(), ax.get_ylabel()))
        assert result.plot().figure is not figure
        assert result.plot(ax, alpha=0.3).lines[-1].get_alpha() in (0.3, None)


def test_axes_of_own_systems_name_states_inputs_and_units():
    waving = fl.PeriodicSystem.from_second_order
    system = waving([[1.0]], [[0.1]], lambda t: 1 + 0.1 * np.cos(t)[:, None, None], 2 * np.pi, [[1.0]])
    design = fl.periodic_lqr(system, np.eye(2), [[1.0]], tol=1e-4)
    forced = fl.forced_response(system, [0.0, 1.0], tol=1e-4)
    answer = fl.frequency_response(system, [[1.0, 0.0]], [0.5, 0.7])
    for result, words, names in (
        (design, "in the input's unit per the state's", ("u1 per x1", "u1 per x2")),
        (forced, "each in its own unit", ("x1", "x2")),
        (system, "in the units of x' per x", ("x2' per x1",)),
        (fl.respond(system, [0.0, 1.0], [1.0, 0.0]), "states, each", ("x1", "x2")),
        (answer, "in the output's unit per the input's", ("y1 per u1",)),
    ):
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
        assert not re.search(r"(?:src|href)=|nan", card, re.IGNORECASE)
    assert f'<b style="color:#b03a00">{results["floquet"].verdict}</b>' in results["floquet"]._repr_html_()


def test_a_card_survives_what_cannot_be_drawn():
    def card(title, *series, words=()):
        return make_card(View(title, "", words, "x", "y", series))

    nothing = card("<script>", Series("gone", np.array([np.nan]), np.array([1.0])), words=("a < b",))
    assert not re.search("<script>|<svg", nothing)
    ElementTree.fromstring(card("one point", Series("flat", np.zeros(1), np.zeros(1), "dots")))
    x = np.arange(1e5)
    assert card("long", Series("long", x, np.where(x % 7 == 0, np.inf, 1.0))).count(",") < 2 * MOST_POINTS


def test_summaries_are_short_and_say_the_verdict(results):
    for name, result in results.items():
        assert 2 <= len(result.summary().splitlines()) <= 12, name
        assert isinstance(result, Shown)
        assert str(result) == result.summary(), name
    floquet = results["floquet"]
    assert floquet.summary().startswith(f"Floquet: {floquet.verdict}\n")
    assert f"{floquet.exponents[0].real:.6g}" in floquet.summary()


def test_datasets_bear_names_units_and_the_numbers(results):
    floquet, design, run, response = (results[name] for name in ("floquet", "periodic", "simulation", "response"))
    data = floquet.to_xarray()
    np.testing.assert_array_equal(data["exponents"], floquet.exponents)
    assert (data["growth_rate"].attrs["units"], data.attrs["verdict"]) == ("1/s", floquet.verdict)
    gains = design.to_xarray(9, ["q1", "w11", "q1_rate", "w11_rate"], ["q1"])
    np.testing.assert_array_equal(gains["K"].sel(input="q1"), design.K(gains["time"].values)[:, 0])
    assert (gains["time"].attrs["units"], gains.attrs["error"]) == ("s", design.error)
    series = run.to_xarray()
    units = dict(zip(series["state"].values, series["unit"].values, strict=True))
    assert units == {"q1": "rad", "w11": "m", "q1_rate": "rad/s", "w11_rate": "m/s"}
    assert series["tip"].attrs["units"] == "m"
    five = response.to_xarray(5)
    np.testing.assert_array_equal(five["response"].values, response(five["time"].values))
    for wrong in (lambda: design.to_xarray(9, ["q1"]), lambda: response.to_xarray(1), lambda: floquet.plot("left")):
        with pytest.raises(fl.errors.ArgumentError):
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
        with pytest.raises(fl.errors.ArgumentError):
            fl.plots.plot_chart(wrong)
    with pytest.raises(fl.errors.ArgumentError, match="'b'"):
        fl.plots.compare({"b": 3})


def test_a_scene_draws_its_arm_along_the_motion():
    """A blade of 1 m on a hub of 0.05 m turns once in a plane; a five-bar of 0.2 and 0.3 m is closed, each tip where the links end."""
    blade, loop = (fl.load_scene(name) for name in ("rotating-blade", "five-bar"))
    *arms, tip = (line.get_xydata() for line in blade.plot().lines)
    turned = 1.05 * np.exp(2j * np.pi * np.arange(3) / 3)
    np.testing.assert_allclose([arm[-1] @ [1, 1j] for arm in arms], turned, atol=1e-9)
    np.testing.assert_allclose(np.hypot(*tip.T), 1.05, rtol=1e-12)
    ax = loop.plot()
    *arms, tip = (line.get_xydata() for line in ax.lines)
    lengths = np.hypot(*np.diff(arms, axis=1).T).T
    bars = lengths[:, [0, 1, 4, 5, 7, 8]]
    np.testing.assert_allclose(bars, np.tile([0.2, 0.3, 0.3, 0.2, 0.2, 0.3], (3, 1)), rtol=1e-9)
    np.testing.assert_allclose(tip[0], tip[-1], atol=1e-9)
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_aspect(), ax.get_title()) == ("x in m", "y in m", 1.0, loop.title)
    assert loop.summary().startswith(f"{loop.title}\n  4 links")


def test_drawing_without_matplotlib_says_what_to_install(monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "matplotlib"] + ["matplotlib"]:
        monkeypatch.setitem(sys.modules, name, None)
    found = fl.floquet(fl.PeriodicSystem([[-1.0]], 1.0))
    assert "<svg" in found._repr_html_()
    with pytest.raises(fl.errors.ArgumentError, match="pip install matplotlib"):
        found.plot()


def test_a_linearization_serves_where_a_system_is_meant():
    lin = arm_results()["linearization"]
    plant = fl.linearize(lin.arm, lin.motion)
    same = fl.floquet(lin.periodic_system(), tol=1e-7).exponents
    np.testing.assert_allclose(fl.floquet(lin, tol=1e-7).exponents, same, rtol=1e-12)
    loops, Q = ((plant, 100.0), (plant.periodic_system(), [[100.0]])), np.diag([1.0, 1.0, 0.01, 0.01])
    np.testing.assert_array_equal(*[fl.periodic_lqr(system, Q, R, tol=1e-6).K(0.3) for system, R in loops])
    assert fl.control.pd_feedback(plant, [0], [10.0], [1.0]).K(np.zeros(1)).shape == (1, 1, 4)
