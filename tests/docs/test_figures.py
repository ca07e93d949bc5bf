"""The pages of docs/ show what the code and the studies give, and every link leads somewhere; `make links` asks those to other sites."""

import ast
import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from urllib.parse import urlsplit

import pytest

import flexlin as fl
from tests.closed_arm import closed

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


def script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"docs_{name}", DOCS / f"{name}.py")
    sys.modules[spec.name] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


figures, house, records, public = script("figures"), script("draw_house"), script("records"), script("public_names")
PAGES = {page.name: page.read_text(encoding="utf-8") for page in DOCS.glob("*.md")}
CHEAP = sorted(set(figures.BLOCKS) - {"hard-cases", "tracking", "mode-shapes", "licences"})
"""Blocks that read a record or the code; the others are computed when the site is built."""


def test_every_mark_has_its_function_and_every_function_its_place():
    marks = [name for page in DOCS.rglob("*.md") for name in figures.MARK.findall(page.read_text(encoding="utf-8"))]
    assert sorted(marks) == sorted(figures.BLOCKS)


def test_the_page_of_public_names_has_all_of_them_once():
    for module, column in ((fl, 2), (fl.control, 3)):
        listed = [name for question in public.QUESTIONS for name in question[column].split()]
        assert sorted(listed) == sorted(module.__all__)


@pytest.mark.parametrize("name", CHEAP)
def test_a_block_is_a_table_with_a_row_for_each_thing_it_is_about(name):
    lines = [line for line in figures.fill(f"<!-- built: {name} -->").splitlines() if line.startswith("|")]
    assert len(lines) > 2
    assert not re.search(r"\bnan\b", " ".join(lines))


@pytest.mark.slow
def test_a_figure_of_a_block_is_what_the_library_answers():
    left = 1e3 * fl.control.feedforward(closed(), "tip-exact").tip_error
    assert f"{left:.2g} mm" in figures.fill("<!-- built: tracking -->")


def test_every_study_has_its_picture():
    studies = (ROOT / "studies").glob("*.py")
    names = {path.stem for path in studies if ".savefig(" in path.read_text(encoding="utf-8")}  # the others only check
    pictures = {path.stem: path.read_bytes() for path in (DOCS / "pictures").glob("*.png")}
    assert names == set(pictures)
    for name, picture in pictures.items():
        assert picture.startswith(b"\x89PNG")
        assert len(picture) < 60_000
        assert f"](../studies/{name}.py)" in figures.BLOCKS["studies"]()


@pytest.mark.slow
def test_every_study_has_a_card_and_a_page(tmp_path):
    gallery = script("gallery")
    pages = {page.name: page.read_text(encoding="utf-8") for page in gallery.write_gallery(tmp_path)}
    names = [path.stem for path in (ROOT / "studies").glob("*.py")]
    assert set(pages) == {"gallery.md", *(f"{name}.md" for name in names)}
    for name in names:
        assert (f":target: gallery/{name}.html" in pages["gallery.md"]) == (DOCS / "pictures" / f"{name}.png").is_file()
        assert f"\ngallery/{name}\n" in pages["gallery.md"]
        assert f"studies/{name}.py" in pages[f"{name}.md"]
    for link in re.findall(r"\{figure\} (\S+)", pages["gallery.md"]):
        assert (DOCS / link).is_file()


@pytest.mark.slow
def test_the_picture_of_the_house_is_drawn_from_this_code_and_no_arrow_points_up():
    picture, (rooms, _) = house.picture(), house.house()
    assert all(f">{name}<" in picture for name in rooms)
    assert all(rooms[a].y + rooms[a].h < rooms[b].y for a, b in house.arrows(list(rooms)))


def test_every_place_that_the_walks_name_exists():
    """`room/file.py: name` is a class or function of that file; each walk names several places."""
    walks = PAGES["house.md"].split("## Three walks")[1].split("\n## ")[0]
    assert min(len(re.findall(r"\.py: \w+`", walk)) for walk in re.split(r"\n\*\*", walks)[1:]) >= 5
    for file, name in re.findall(r"`([\w/]+\.py): (\w+)`", walks):
        tree = ast.parse((ROOT / "flexlin" / file).read_text(encoding="utf-8"))
        defined = {node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
        assert name in defined, file
    assert not re.findall(r"`[\w/]+\.py`", walks), "a file is named without what it holds"


FOLDERS = ("*.md", "docs/*.md", "docs/tasks/*.md", "docs/theory/*.md", "docs/reference/*.md")
BUILT = {"gallery", "gallery.md", "house.svg"}
"""Pages and pictures that are made when the site is built."""
LINKED = sorted(page for pattern in FOLDERS for page in ROOT.glob(pattern) if page.name not in BUILT)


def collect_links(text: str) -> list[str]:
    """Targets of Markdown links and pictures, of figures and of {doc} roles; what stands in code is none."""
    prose = re.sub(r"`[^`\n]*`(?!\])", "", re.sub(r"```(?!\{figure).*?```", "", text, flags=re.S))
    plain = re.findall(r"(?<!\w)!?\[[^\]\n]*\]\(([^)\s]+)\)", prose)
    figures = re.findall(r"```\{figure\} (\S+)", text)
    return [*plain, *figures, *re.findall(r"https?://[^\s)>\"'`]+", prose)]


@pytest.mark.parametrize("page", LINKED, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page):
    text = page.read_text(encoding="utf-8")
    for link in collect_links(text):
        parts = urlsplit(link)
        if parts.scheme:
            assert parts.scheme == "https", link
            assert re.fullmatch(r"[a-z0-9.-]+\.[a-z]{2,}", parts.netloc), link
        elif parts.path:
            assert (page.parent / parts.path).exists() or parts.path in BUILT, link
    for name in re.findall(r"\{doc\}`([^`<>]+)`", text):
        base = DOCS if name.startswith("/") else page.parent
        assert (base / f"{name.lstrip('/')}.md").exists() or name.removeprefix("../") in BUILT, name
