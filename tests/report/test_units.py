"""One unit for one thing on a page, and none where a scene has no dimensions."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flexlin as fl
from flexlin.answers import Analysis
from flexlin.cli import main
from flexlin.errors import SceneError
from flexlin.report import draw_pictures, format_quantity, record, render_page, scale_values, typeset, units_of


def page_of(a: Analysis) -> str:
    return render_page(a, record(a), list(draw_pictures(a)), "")


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "mm"), (100.0, "m"), (1e-4, "µm")])
def test_deflections_are_said_in_one_unit(single_link: Analysis, factor: float, unit: str) -> None:
    """Tip errors in text, card, table and axes; the difference of the two answers is a deflection too."""
    r, s = single_link.response, single_link.simulation
    run = replace(
        s,
        tip=s.tip_rigid + factor * (s.tip - s.tip_rigid),
        tip_linear=s.tip_rigid + factor * (s.tip_linear - s.tip_rigid),
        peaks=None,
    )
    tip = replace(r, tip=factor * r.tip, tip_by_bending=factor * r.tip_by_bending)
    page = page_of(replace(single_link, response=tip, simulation=run))
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
def test_a_scene_without_dimensions_names_no_unit_of_length_or_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", "spinning-link", "--out", str(tmp_path)]) == 0
    page, said = (tmp_path / "report.html").read_text(), capsys.readouterr().out
    text = re.sub(r"<[^>]+>", " ", page[: page.index("Everything that went in")])
    for words in (text, said.partition("accuracy:")[0]):
        assert not re.search(r"[0-9][ \u00a0](nm|µm|mm|m)\b", words)
    assert "time in s" not in text
    assert "in m" not in re.findall(r"tip minus rigid tip[^<]*", page)[0]
    for unit in ("1/s", "Hz", "N m", "kg", "rad/s"):
        assert not re.search(rf"(?<![\w/]){re.escape(unit)}(?![\w/])", text), unit
    assert (
        main(
            ["chart", "spinning-link", "--over", "motion.joints.0.rate=2:3:5", "--tol", "1e-4", "--out", str(tmp_path)]
        )
        == 0
    )
    chart = re.sub(
        r"<script>.*?</script>|<style>.*?</style>|<[^>]+>", " ", (tmp_path / "chart.html").read_text(), flags=re.S
    )
    assert not re.search(r"1/s|Hz|rad/s", chart[: chart.index("How it was made")])
    with pytest.raises(SceneError, match="units"):
        fl.load_scene("spinning-link", {"units": "furlongs"})


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("0.0665 ± 1e-05 rad in q1", "0.0665 ±\u00a01×10⁻⁵\u00a0rad in q1"),
        ("up to 3.22e+03 1/s", "up to 3220\u00a01/s"),
        ("−4.5e+07 of 12 mN m, 3 %", "−4.5×10⁷ of 12\u00a0mN\u00a0m, 3\u00a0%"),
        ("0.06 kg m^2 of 3 s and 2 links", "0.06\u00a0kg m² of 3\u00a0s and 2 links"),
        ("file1e-05.toml, x1e+03, 5 measures", "file1e-05.toml, x1e+03, 5 measures"),
    ],
)
def test_numbers_stand_as_on_paper_and_keep_their_units(text: str, written: str) -> None:
    assert typeset(text) == written


def test_what_went_in_has_the_units_of_its_tables(single_link: Analysis) -> None:
    """Of every table; none beside a text that bears its own; TOML's true and false."""
    shown = re.sub(r"<[^>]+>", "", page_of(single_link)).replace("\u00a0", " ")
    shown = shown[shown.index("Everything that went in") :]
    for said in (
        "length = 0.96 m,",
        "bending_stiffness = 3.6866 N m²",
        "frequency = 0.5 Hz",
        "kp = 3 N m/rad,",
        "passive = false",
    ):
        assert said in shown, said
    assert "name = ," not in shown
