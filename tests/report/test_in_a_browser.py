"""The pages in a real browser, where one is present: nothing is cut at the width of a phone, a tablet or a desk."""

import json
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from flexlin.cli import main

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
WIDTHS = (390, 768, 1280)
MEASURE = """<body><script>
for (const width of WIDTHS) {
  const frame = document.createElement("iframe");
  Object.assign(frame, {width, height: 1000, src: "PAGE"});
  frame.onload = () => {
    const page = frame.contentDocument, style = (element) => page.defaultView.getComputedStyle(element);
    const shown = (element) => !element.closest("svg") && style(element).display !== "inline" && element.clientWidth > 0;
    const cut = [...page.body.querySelectorAll("*")].filter((element) => shown(element)
      && element.scrollWidth > element.clientWidth + 1 && !["auto", "scroll"].includes(style(element).overflowX));
    const found = document.createElement("p");
    const root = page.documentElement, names = cut.map((element) => element.outerHTML.slice(0, 80));
    const inks = [...page.querySelectorAll(".drawing:not(:has(.probe)) text")];
    const ink = Math.min(99, ...inks.map((text) => text.getBoundingClientRect().height));
    const map = page.querySelectorAll(".panels:has(.probe) > .panel");
    const feet = [...map].map((panel) => Math.round(panel.getBoundingClientRect().bottom));
    found.textContent = "measured " + JSON.stringify({width, wide: root.scrollWidth, room: root.clientWidth, cut: names, feet, ink});
    document.body.append(found);
  };
  document.body.append(frame);
}
</script></body>"""

pytestmark = [pytest.mark.xdist_group("browser"), pytest.mark.skipif(BROWSER is None, reason="no browser here")]


def browse(folder: Path, *options: str) -> str:
    """Run the browser without a window."""
    flags = "--headless=new --no-sandbox --disable-gpu --disable-dev-shm-usage --allow-file-access-from-files"
    command = [BROWSER, *flags.split(), f"--user-data-dir={folder / 'browser'}", *options]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout


def measure(page: Path) -> list[dict]:
    """Width asked and needed of a page in frames of all widths, and the elements in it that are cut."""
    frames = page.with_name("frames.html")
    frames.write_text(MEASURE.replace("PAGE", page.name).replace("WIDTHS", str(list(WIDTHS))), encoding="utf-8")
    text = browse(page.parent, "--virtual-time-budget=5000", "--window-size=2600,1200", "--dump-dom", frames.as_uri())
    return [json.loads(unescape(found)) for found in re.findall(r"<p>measured (.*?)</p>", text)]


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("pages")
    assert main(["report", "single-link", "--tol", "1e-5", "--out", str(folder / "report")]) == 0
    over = ["motion.frequency=0.2:3:6", "effects.payload.mass=0:0.3:6"]
    assert main(["chart", "single-link", "--tol", "1e-4", "--over", *over, "--out", str(folder / "chart")]) == 0
    simulation = ["simulate", "five-bar", "--tol", "1e-4", "--periods", "0.2", "--animate"]
    assert main([*simulation, "--out", str(folder / "animation")]) == 0
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("page", ["report/report.html", "chart/chart.html", "animation/animation.html"])
def test_nothing_is_cut_at_any_width(pages, page):
    measured = measure(pages / page)
    assert sorted(found["width"] for found in measured) == list(WIDTHS)
    for found in measured:
        assert found["wide"] <= found["room"]
        assert found["cut"] == []
        assert found["ink"] > 9 or "chart" in page
        assert len(set(found["feet"])) == ("chart" in page)  # the bar of colours stands beside the map


TURN = """<script>
running = false;
const there = () => place(...data.centre.map((value, i) => value + (i == 0 ? 1 : 0))), first = there();
stage.dispatchEvent(new KeyboardEvent("keydown", {key: "ArrowLeft"}));
stage.dispatchEvent(new PointerEvent("pointermove", {buttons: 1, movementX: 0, movementY: 40}));
const found = document.createElement("p"), second = there();
found.textContent = "turned " + JSON.stringify([first, second, [stage.width / 2, stage.height / 2], scale, around, above]);
document.body.append(found);
</script></body>"""


@pytest.mark.slow
def test_an_arm_in_space_is_turned_by_hand(tmp_path):
    """An arrow and a drag turn the picture: x lies where a camera at these angles sees it."""
    options = ["simulate", "rotating-blade", "--tol", "1e-4", "--periods", "0.2", "--animate"]
    assert main([*options, "--out", str(tmp_path)]) == 0
    page = tmp_path / "animation.html"
    page.write_text(page.read_text(encoding="utf-8").replace("</body>", TURN), encoding="utf-8")
    shown = browse(tmp_path, "--virtual-time-budget=2000", "--dump-dom", page.as_uri())
    first, second, middle, scale, around, above = json.loads(re.search(r"<p>turned (.*?)</p>", shown).group(1))
    assert around != pytest.approx(-np.pi / 3)
    assert above > 0.65
    for at, a, b in ((first, -np.pi / 3, np.arctan(np.sqrt(0.5))), (second, around, above)):
        expected = np.array(middle) + scale * np.array([-np.sin(a), np.sin(b) * np.cos(a)])
        np.testing.assert_allclose(at, expected, rtol=1e-6)


@pytest.mark.slow
def test_a_printed_report_is_a_few_pages(pages, tmp_path):
    assert main(["report", "manutec-r3", "--tol", "1e-5", "--out", str(tmp_path)]) == 0
    printed = tmp_path / "report.pdf"
    for folder, most in ((pages / "report", 6), (tmp_path, 10)):
        page = folder / "report.html"
        browse(tmp_path, "--virtual-time-budget=5000", f"--print-to-pdf={printed}", page.as_uri())
        assert 3 <= len(re.findall(rb"/Type\s*/Page\b", printed.read_bytes())) <= most
