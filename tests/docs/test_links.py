"""Every link of the pages leads somewhere: inside the repository to a file, outside to an https address; `make links` asks the latter."""

import re
from pathlib import Path
from urllib.parse import urlsplit

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
FOLDERS = ("*.md", "docs/*.md", "docs/tasks/*.md", "docs/theory/*.md", "docs/reference/*.md")
BUILT = {"gallery", "gallery.md", "house.svg"}
"""Pages and pictures that are made when the site is built."""
PAGES = sorted(page for pattern in FOLDERS for page in ROOT.glob(pattern) if page.name not in BUILT)


def collect_links(text: str) -> list[str]:
    """Targets of Markdown links and pictures, of figures and of {doc} roles; what stands in code is none."""
    prose = re.sub(r"`[^`\n]*`(?!\])", "", re.sub(r"```(?!\{figure).*?```", "", text, flags=re.S))
    plain = re.findall(r"(?<!\w)!?\[[^\]\n]*\]\(([^)\s]+)\)", prose)
    figures = re.findall(r"```\{figure\} (\S+)", text)
    return [*plain, *figures, *re.findall(r"https?://[^\s)>\"'`]+", prose)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
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


def test_links_are_recognised():
    text = "see [a](b.md), ![c](d.png) and <https://e.org/f>; `[g](h)` is code\n```{figure} i.png\n```\n"
    assert sorted(set(collect_links(text))) == ["b.md", "d.png", "https://e.org/f", "i.png"]
