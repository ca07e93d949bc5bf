"""What every panel of a page keeps: axes that say their size, legends, one colour a loop, one name an entry."""

import itertools
import re
from dataclasses import replace

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import Analysis, Clock, Loop, analyse
from flexlin.analyses.judging import find_response
from flexlin.plots import SMALL_FONT, Linear, Logarithmic, Mark, Panel, Symlog, draw, measure_text
from flexlin.report import draw_pictures, figures
from flexlin.report.figures import choose_colour
from flexlin.report.figures.chart import follow_lines
from flexlin.report.figures.over_period import choose_shown, shift_from_mean
from tests.closed_arm import control_loop
from tests.mechanics.scenes import plain_scene

LINK = {"length": 0.3, "mass_per_length": 0.5, "bending_stiffness": 20.0, "modes": 1}
TURNING = [{"mean": 0.2 * k, "sin": [0.1 * k + 0.1]} for k in range(5)]
PD = {"feedback": {"kind": "pd", "kp": [40.0] * 5, "kd": [4.0] * 5}}


@pytest.fixture(scope="module")
def two_loops() -> Analysis:
    return analyse(fl.load_scene("single-link", {"links.0.modes": 1}))


@pytest.fixture(scope="module")
def large() -> Analysis:
    """An arm of five joints and five elastic coordinates."""
    motion = {"kind": "fourier", "period": 1.0, "joints": TURNING}
    scene = plain_scene([LINK] * 5, motion, effects={"gravity": {}}, control=PD)
    closed = control_loop(scene)
    plant = fl.linearize(closed.arm, scene.motion)
    t = np.linspace(0.0, plant.period, 129)
    response = find_response(closed, closed.periodic_system(), t, 1e-6)
    own = Loop("PD", "pd", None, "not asked", response=response)
    found = {"coefficients": plant.sample(t), "open_loop": Loop("open loop", "open", None, "not asked")}
    return Analysis(scene, Clock(scene.accuracy), plant, closed, t, own=own, **found)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[tuple[list[Panel], list]]:
    """Panels and legend of every call of draw."""
    calls: list[tuple[list[Panel], list]] = []

    def record(panels, legend=()):
        calls.append((list(panels), list(legend)))
        return draw(panels, legend)

    monkeypatch.setattr(figures, "draw", record)
    return calls


def find_look(mark: Mark) -> str:
    """Its colour and dash."""
    return re.sub(r"stroke-(width|opacity):[^;]*;?", "", mark.style).strip(";")


@pytest.mark.slow
@pytest.mark.parametrize("which", ["two_loops", "large"])
def test_every_axis_says_its_size_and_every_line_its_name(request, drawn, which) -> None:
    list(draw_pictures(request.getfixturevalue(which)))
    pictured = ("the arm", "its path")
    for panels, legend in drawn:
        for panel in panels:
            if panel.bare:
                continue
            _, y = panel.fitted()
            assert len(y.ticks(3)) >= 2, panel.title
            assert len({label for _, label in y.ticks(3)}) == len(y.ticks(3)), panel.title
            # curves are more than a border or a picture of the arm
            looks = {find_look(mark) for mark in panel.marks if mark.kind == "line" and len(mark.x) > 2}
            if len(looks) > 1 and not panel.title.startswith(pictured):
                assert looks <= {find_look(mark) for mark in (*legend, *panel.legend)}, panel.title


def test_one_loop_has_one_colour(two_loops: Analysis, drawn) -> None:
    list(draw_pictures(two_loops))
    found: dict[str, set[str]] = {loop.name: set() for loop in two_loops.loops}
    for panels, legend in drawn:
        for mark in itertools.chain(legend, *(panel.legend for panel in panels)):
            if mark.label in found:
                found[mark.label] |= set(re.findall(r"(?:stroke|fill):var\(--(\w+)\)", mark.style)) - {"ink"}
        for panel in panels:
            if panel.title in found:  # the circles
                dots = next(mark for mark in panel.marks if mark.kind == "dots")
                found[panel.title] |= set(re.findall(r"fill:var\(--(\w+)\)", dots.style))
    assert len(found) == 4
    assert all(len(colours) == 1 for colours in found.values())
    assert len(set.union(*found.values())) == 4


def test_colours_stay_apart_for_six_loops(two_loops: Analysis) -> None:
    more = replace(two_loops, designs=tuple(replace(two_loops.designs[0], name=str(k)) for k in range(5)))
    assert len({choose_colour(more, loop) for loop in more.loops}) == 7


def test_large_arms_show_all_joints_and_fold_the_rest(large: Analysis) -> None:
    pictures = {picture.name: picture for picture in draw_pictures(large)}
    response, coefficients = pictures["response"], pictures["coefficients"]
    titles = re.findall(r"<b>([^<>]*) in [^<>]*</b>", response.svg)
    for name in (f"q{k + 1}" for k in range(5)):
        assert {name, f"input {name}"} <= set(titles)
        assert re.search(rf">[MDKh]\({name}[,)]", coefficients.svg)
    for picture in (response, coefficients):
        everything = re.findall(r"<b>([^<>]+) in [^<>]*</b>", picture.svg + picture.folded)
        assert len(everything) == len(set(everything))
        assert picture.folded
    assert {f"w{k + 1}1" for k in range(5)} <= set(re.findall(r">(w\d\d) in", response.svg + response.folded))
    entries = re.findall(r">([MDK])\((\w+), (\w+)\)", coefficients.svg + coefficients.folded)
    assert len(entries) > 40
    assert {row for _, row, _ in entries} | {column for _, _, column in entries} == set(large.plant.names)


def test_panels_are_chosen_by_weight_with_one_of_each_group() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        weights, groups = rng.random(30), [list(rng.choice(30, 4, replace=False)) for _ in range(5)]
        shown, folded = choose_shown(weights, groups)
        assert len(shown) == 12
        assert all(set(shown) & set(group) for group in groups)
        left = np.setdiff1d(np.arange(30), shown)
        assert folded == left.tolist()
        forced = {max(group, key=lambda i: weights[i]) for group in groups}
        assert weights[left].max() <= min(weights[i] for i in shown if i not in forced)
    assert choose_shown(np.zeros(0), [[], []]) == ([], [])


def test_titles_bear_offsets() -> None:
    t = np.linspace(0, 1, 9)
    title, values = shift_from_mean("M(q1, q1)", 2.0 + 1e-7 * t)
    assert title == "M(q1, q1) − 2"
    np.testing.assert_allclose(values, 1e-7 * t, atol=1e-15)
    assert shift_from_mean("K(q1, q1)", 2e7 + 1e7 * t)[0] == "K(q1, q1)"


def test_every_scale_has_two_numbers_that_differ() -> None:
    rng = np.random.default_rng(11)
    for _ in range(400):
        centre, size = rng.standard_normal() * 10.0 ** rng.integers(-8, 9), 10.0 ** rng.uniform(-9, 9)
        size = max(size, 1e-9 * abs(centre))
        low, high = centre - size * rng.random() - 1e-3 * size, centre + size * rng.random() + 1e-3 * size
        for scale in (Linear(low, high), Symlog(low, high, near=10.0 ** rng.integers(-6, 3))):
            for most in (2, 3, 7):
                ticks = scale.ticks(most)
                assert 2 <= len({label for _, label in ticks}) == len(ticks) <= 2 * most + 3, (scale, ticks)
                assert len({bool(re.search("[⁰¹²³⁴⁵⁶⁷⁸⁹]", label)) for _, label in ticks if label != "0"}) == 1, ticks
        positive = Logarithmic(10.0 ** rng.uniform(-9, 0), 10.0 ** rng.uniform(0.01, 9))
        for most in (3, 7, 20):
            ticks = positive.ticks(most)
            assert 2 <= len({label for _, label in ticks}) == len(ticks) <= 2 * most, (positive, ticks)
            assert len({bool(re.search("[⁰¹²³⁴⁵⁶⁷⁸⁹]", label)) for _, label in ticks}) == 1, ticks


def test_words_stay_inside_their_axes() -> None:
    """Labels at corners, where tongues and critical values often lie."""
    for x, y, asked in itertools.product((0.0, 1.0), (0.0, 1.0), ("start", "middle", "end")):
        panel = Panel(x=Linear(0.0, 1.0), y=Linear(0.0, 1.0)).words(x, y, "principal, order 2", anchor=asked)
        svg = draw([panel])
        frame = re.search(r'd="M([\d.]+),([\d.]+)V([\d.]+)H([\d.]+)"', svg)
        left, top, bottom, right = (float(number) for number in frame.groups())
        written = r'<text x="([\d.]+)" y="([\d.]+)" style="[^"]*text-anchor:(\w+)[^"]*">principal'
        ((x, y, anchor),) = re.findall(written, svg)
        assert anchor == asked
        width = measure_text("principal, order 2", SMALL_FONT)
        start = float(x) - {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor] * width
        assert left <= start <= start + width <= right
        assert top <= float(y) <= bottom


def test_words_are_not_written_over_each_other() -> None:
    """The later ones stay: labels of resonances before those of contours."""
    panel = Panel(x=Linear(0.0, 1.0), y=Linear(0.0, 1.0))
    for at, text in ((0.5, "0.2"), (0.9, "0.4"), (0.51, "principal, order 2")):
        panel.words(0.5, at, text)
    svg, said = draw([panel]), ("0.2", "0.4", "principal, order 2")
    assert [text for text in said if f'font-size:{SMALL_FONT}px;text-anchor:middle">{text}<' in svg] == [*said[1:]]


def test_lines_of_the_campbell_diagram_cross_without_a_kink() -> None:
    x = np.linspace(0.0, 1.0, 60)
    lines = np.stack([1 + 2 * x, 2.5 - x + 0.3 * x**2, 2.0 + 0.1 * np.sin(3 * x), 0.2 + 0 * x], axis=1)
    found = follow_lines(np.sort(lines, axis=1))
    np.testing.assert_allclose(np.sort(found, axis=1), np.sort(lines, axis=1))
    assert np.abs(np.diff(found, 2, axis=0)).max() < 1e-3
    gap = np.sort(lines, axis=1)
    gap[20:23] = np.nan
    assert np.isnan(follow_lines(gap)[21]).all()
