"""Plain words in code, pages and scenes: phrases that were replaced stay out."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PHRASES = {
    r"told": "is given, is named, knows",
    r"tells?": "says, shows, gives",
    r"tells of": "reports",
    r"(?:could|can|cannot|can't) (?:not )?be had": "is known, was found, is missing",
    r"for want of": "because ... is missing",
    r"mend(?:s|ed|ing)?": "correct, repair",
}
"""Each phrase with plain words in its place."""
FILES = sorted(
    path
    for pattern in (
        "flexlin/**/*.py",
        "flexlin/**/*.j2",
        "flexlin/**/*.html",
        "docs/**/*.md",
        "models/*",
        "studies/*.py",
        "*.md",
    )
    for path in ROOT.glob(pattern)
    if path.is_file() and path.suffix != ".svg"
)


def found(text: str) -> list[str]:
    """Every line with a phrase that has a plainer form."""
    banned = re.compile(rf"\b(?:{'|'.join(PHRASES)})\b", re.IGNORECASE)
    return [f"{number}: {line.strip()}" for number, line in enumerate(text.split("\n"), 1) if banned.search(line)]


def test_plain_words():
    texts = (path for path in FILES if path.suffix in (".py", ".md", ".toml", ".j2", ".html"))
    lines = {str(path.relative_to(ROOT)): found(path.read_text(encoding="utf-8")) for path in texts}
    assert {path: wrong for path, wrong in lines.items() if wrong} == {}


@pytest.mark.parametrize(
    "line", ["who is told", "The margin could not be had", "cannot be had", "Mend C[0, 0]", "it tells of"]
)
def test_the_phrases_are_recognised(line):
    assert found(line)


def test_other_words_pass():
    assert found("recommended, amended, intellectual, foretold would be one word, a stellar retell") == []


def test_the_walk_reaches_code_and_pages():
    assert {path.suffix for path in FILES} >= {".py", ".md"}
    assert len(FILES) > 200
