"""The page is whole, asks nobody for anything, shows extreme multipliers; one unit for one thing, none without dimensions."""

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import Analysis
from flexlin.cli import main
from flexlin.errors import SceneError
from flexlin.report import FIGURES, draw_pictures, format_quantity, scale_radius, scale_values, typeset, units_of
from tests.report.test_advice import page_of


def drawn_page_of(a: Analysis) -> str:
    return page_of(a, *draw_pictures(a))


def test_the_page_fetches_nothing_and_its_verdict_comes_before_the_figures(single_link: Analysis) -> None:
    html = drawn_page_of(single_link)
    fetched = r"@import|url\((?!#)|<script|<[^>]*[\s:](src|href|data)\s*=\s*(?!\"#|'#|#)"
    assert not re.search(fetched, html, re.IGNORECASE)
    assert html.index("Stable") < html.index("What to do next") < html.index("<svg")


def test_each_figure_is_well_formed_and_takes_its_colours_from_the_page(single_link: Analysis) -> None:
    drawn = list(draw_pictures(single_link))
    assert len(drawn) == len(FIGURES) - 3  # neither gains, sensitivities nor effects: nobody asks for them
    for picture in drawn:
        assert ElementTree.fromstring(picture.svg).find(".//{*}svg") is not None
        assert not re.search(r"(?:fill|stroke)(?:: |=\")#[0-9a-f]{6}", picture.svg), picture.name


def test_the_radius_of_a_multiplier_is_monotone_and_readable_at_both_ends() -> None:
    logs = np.array([-1e4, -400.0, -30.0, -1.0, -1e-3, 0.0, 1e-3, 1.0, 30.0, 400.0])
    r = scale_radius(logs)
    assert np.all(np.diff(r) > 0)
    assert r[5] == 1.0
    assert np.all((r >= 0) & (r <= 2))
    assert 0.1 < r[2] < 0.9  # 1e-30 is neither at the centre nor on the circle


def test_extreme_multipliers_can_be_drawn(single_link: Analysis) -> None:
    found = single_link.own.floquet
    exponents, errors = np.array([2e3 + 1j, -2e3 + 0j, -1.0 + 0j, -1.0 + 0j]), np.array([1e-9, np.inf, 1e-9, 1e-9])
    far = replace(found, exponents=exponents, errors=errors, verdict="unstable")
    html = drawn_page_of(replace(single_link, own=replace(single_link.own, floquet=far)))
    assert "nan" not in html.lower().replace("nanoseconds", "")
    assert "10¹⁷³⁷" in html  # exp(2e3 T) with T = 2 s
    assert '−2000</td><td class="number">–</td>' in html


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "mm"), (100.0, "m"), (1e-4, "µm")])
def test_deflections_are_said_in_one_unit(single_link: Analysis, factor: float, unit: str) -> None:
    """Tip errors in text, card, table and axes; the difference of the two answers is a deflection too."""
    r, s = single_link.response, single_link.simulation
    nonlinear, linear = (s.tip_rigid + factor * (tip - s.tip_rigid) for tip in (s.tip, s.tip_linear))
    run = replace(s, tip=nonlinear, tip_linear=linear, peaks=None)
    tip = replace(r, tip=factor * r.tip, tip_by_bending=factor * r.tip_by_bending)
    page = drawn_page_of(replace(single_link, own=replace(single_link.own, response=tip), simulation=run))
    text = re.sub(r"<[^>]+>", " ", page[: page.index("Everything that went in")])
    found = set(re.findall(r"[0-9][ \u00a0](nm|µm|mm|m)\b(?! of)(?!/)", text))
    assert found == {unit}
    assert f"tip minus rigid tip in {unit}" in text
    assert f"difference in {unit}" in text


def test_the_page_s_unit_is_forgotten_behind_the_page(single_link: Analysis) -> None:
    with units_of(single_link):
        assert format_quantity(1.0, "m") == "1000 mm" or "×10³ mm" in format_quantity(1.0, "m")
        assert format_quantity(1.0, "s") == "1 s"
    assert format_quantity(1.0, "m") == "1 m"
    assert scale_values(np.array([1e-3]), "m")[1] == "mm"


@pytest.mark.slow
def test_a_scene_without_dimensions_names_no_unit_of_length_or_time(report, tmp_path: Path) -> None:
    ran = report("spinning-link")
    page, said = ran.page, ran.out
    text = re.sub(r"<[^>]+>", " ", page[: page.index("Everything that went in")])
    for words in (text, said.partition("accuracy:")[0]):
        assert not re.search(r"[0-9][ \u00a0](nm|µm|mm|m)\b", words)
    assert "time in s" not in text
    assert "in m" not in re.findall(r"tip minus rigid tip[^<]*", page)[0]
    for unit in ("1/s", "Hz", "N m", "kg", "rad/s"):
        assert not re.search(rf"(?<![\w/]){re.escape(unit)}(?![\w/])", text), unit
    over = ["--over", "motion.joints.0.rate=2:3:5", "--tol", "1e-4", "--out", str(tmp_path)]
    assert main(["chart", "spinning-link", *over]) == 0
    drawn = (tmp_path / "chart.html").read_text()
    chart = re.sub(r"<script>.*?</script>|<style>.*?</style>|<[^>]+>", " ", drawn, flags=re.S)
    assert not re.search(r"1/s|Hz|rad/s", chart[: chart.index("How it was made")])
    with pytest.raises(SceneError, match="units"):
        fl.load_scene("spinning-link", {"units": "furlongs"})


WRITTEN = [
    ("0.0665 ± 1e-05 rad in q1", "0.0665 ±\u00a01×10⁻⁵\u00a0rad in q1"),
    ("up to 3.22e+03 1/s", "up to 3220\u00a01/s"),
    ("−4.5e+07 of 12 mN m, 3 %", "−4.5×10⁷ of 12\u00a0mN\u00a0m, 3\u00a0%"),
    ("0.06 kg m^2 of 3 s and 2 links", "0.06\u00a0kg m² of 3\u00a0s and 2 links"),
    ("file1e-05.toml, x1e+03, 5 measures", "file1e-05.toml, x1e+03, 5 measures"),
]


@pytest.mark.parametrize(("text", "written"), WRITTEN)
def test_numbers_stand_as_on_paper_and_keep_their_units(text: str, written: str) -> None:
    assert typeset(text) == written


def test_what_went_in_has_the_units_of_its_tables(single_link: Analysis) -> None:
    """Of every table; none beside a text that bears its own; TOML's true and false."""
    shown = re.sub(r"<[^>]+>", "", drawn_page_of(single_link)).replace("\u00a0", " ")
    shown = shown[shown.index("Everything that went in") :]
    numbers = "length = 0.96 m,", "bending_stiffness = 3.6866 N m²", "frequency = 0.5 Hz", "kp = 3 N m/rad,"
    for said in (*numbers, "passive = false", "casadi", "numpy"):
        assert said in shown, said
    assert "name = ," not in shown
