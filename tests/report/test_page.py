"""The page is whole, asks nobody for anything, and shows extreme multipliers."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pytest

from flexlin.answers import Analysis
from flexlin.report import FIGURES, draw_pictures, record, render_page, scale_radius


class Links(HTMLParser):
    """Collects what a page would fetch, and its ids."""

    def __init__(self) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.ids: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("src", "href", "xlink:href", "data") and not (value or "").startswith("#"):
                self.fetched.append(f"{tag} {value}")
            if name == "id":
                self.ids.append(value or "")


@pytest.fixture(scope="module")
def html(single_link: Analysis) -> str:
    return render_page(single_link, record(single_link), list(draw_pictures(single_link)), "flexlin report single-link")


def test_the_page_fetches_nothing(html: str) -> None:
    links = Links()
    links.feed(html)
    assert links.fetched == []
    assert not re.search(r"@import|url\((?!#)|<script", html)


def test_the_verdict_comes_before_the_figures(html: str) -> None:
    assert html.index("Stable") < html.index("What to do next") < html.index("<svg")


def test_every_parameter_and_version_is_on_the_page(html: str, single_link: Analysis) -> None:
    for word in ("effects.payload", "mass = ", "0.03", "bending_stiffness = ", "3.6866", "casadi", "numpy"):
        assert word in html


def test_each_figure_is_well_formed_and_takes_its_colours_from_the_page(single_link: Analysis) -> None:
    drawn = list(draw_pictures(single_link))
    assert len(drawn) == len(FIGURES) - 1  # all but the gains: this scene asks for no design
    for picture in drawn:
        root = ElementTree.fromstring(picture.svg)
        assert root.find(".//{*}svg") is not None
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
    extreme = replace(single_link, own=replace(single_link.own, floquet=far))
    html = render_page(extreme, record(extreme), list(draw_pictures(extreme)), "")
    assert "nan" not in html.lower().replace("nanoseconds", "")
    assert "10¹⁷³⁷" in html  # exp(2e3 T) with T = 2 s
    assert '−2000</td><td class="number">–</td>' in html
