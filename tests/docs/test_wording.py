"""Plain words in code, pages and scenes: phrases that were replaced stay out."""

import re
from pathlib import Path

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
CODE = "flexlin/**/*.py", "flexlin/**/*.j2", "flexlin/**/*.html", "studies/*.py"
PATTERNS = *CODE, "docs/**/*.md", "models/*.toml", "*.md"
FILES = sorted(path for pattern in PATTERNS for path in ROOT.glob(pattern))


def found(text: str) -> list[str]:
    """Every line with a phrase that has a plainer form."""
    banned = re.compile(rf"\b(?:{'|'.join(PHRASES)})\b", re.IGNORECASE)
    return [f"{number}: {line.strip()}" for number, line in enumerate(text.split("\n"), 1) if banned.search(line)]


def test_plain_words():
    lines = {str(path.relative_to(ROOT)): found(path.read_text(encoding="utf-8")) for path in FILES}
    assert {path: wrong for path, wrong in lines.items() if wrong} == {}


def test_the_phrases_are_recognised_and_other_words_pass():
    for line in ("who is told", "The margin could not be had", "cannot be had", "Mend C[0, 0]", "it tells of"):
        assert found(line)
    assert not found("recommended, amended, intellectual, foretold would be one word, a stellar retell")
    assert {path.suffix for path in FILES} >= {".py", ".md", ".toml"}
    assert len(FILES) > 200
