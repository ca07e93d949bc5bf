"""Text that is printed as it stands: nothing that somebody else wrote may steer the terminal or fill it."""

from collections.abc import Iterable
from unicodedata import category

JOINERS = "\u200c\u200d"
"""Format characters that some scripts spell with."""


def printable(text: object, longest: int = 200) -> str:
    """Text that a terminal shows as it stands: control characters escaped, the middle of a long text left out."""
    shown = "".join(c.encode("unicode_escape").decode() if steers(c) else c for c in str(text))
    half = longest // 2 - 2
    return shown if len(shown) <= longest else f"{shown[:half]} ... {shown[-half:]}"


def hint_at(word: str, known: Iterable[str], alike: float = 0.6) -> str:
    """What a message says behind the words that are known, where one of these is like a word that is not."""
    from difflib import get_close_matches  # 6 ms, which only a mistake needs

    close = get_close_matches(word, known, n=1, cutoff=alike)
    return f"; did you mean {close[0]!r}?" if close else ""


def steers(character: str) -> bool:
    """Whether a character is no part of a line of text: controls, line ends, changes of direction, halves of a pair."""
    return category(character) in ("Cc", "Cf", "Cs", "Zl", "Zp") and character not in JOINERS
