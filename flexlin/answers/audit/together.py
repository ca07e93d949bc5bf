"""Two changes at once: effects that are noticed only together, and effects that cancel."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from flexlin.answers.audit.judging import Judge
from flexlin.answers.audit.result import Row
from flexlin.answers.audit.versions import Version
from flexlin.progress import advance

NEED, CANCEL = "noticed only together", "cancel each other"


def find_interplay(
    judge: Judge, tried: Sequence[tuple[Version, Row]], report: Callable[[str], None]
) -> tuple[Row, ...]:
    """Try the pairs of effects whose members are both noticed or both not, both on or both off; keep those that act otherwise together.

        noticed only together: s_1 <= tolerance, s_2 <= tolerance, s_12 > tolerance
        cancel each other:     s_1 >  tolerance, s_2 >  tolerance, s_12 <= tolerance

    Of two that only one of is noticed, or of one that is on and one that is off, nothing is tried.
    """
    found = []
    pairs = list(list_pairs(tried, judge.tolerance))
    for done, ((one, first), (two, _)) in enumerate(pairs):
        both = joined(one, two)
        report(f"together: {both.change}")
        advance(done / len(pairs))
        row = judge.row(both, two.make(one.make(judge.scene)))
        alone, together = first.significance > judge.tolerance, row.significance > judge.tolerance
        if np.isfinite(row.significance) and row.judged and alone != together:
            found.append(named(row, CANCEL if alone else NEED))
        elif not alone and row.significance == np.inf:
            found.append(named(row, NEED))
    return tuple(sorted(found, key=lambda row: -row.significance))


def list_pairs(tried: Sequence[tuple[Version, Row]], tolerance: float) -> Iterator[tuple[tuple[Version, Row], ...]]:
    """Pairs of effects that were judged."""
    known = [item for item in tried if item[1].judged and item[1].kind == "effect"]
    for first, second in combinations(known, 2):
        same = (first[1].significance > tolerance) == (second[1].significance > tolerance)
        if same and first[0].on == second[0].on:
            yield first, second


def joined(one: Version, two: Version) -> Version:
    """Two changes as one."""
    change = f"{one.change} and {two.subject}"
    table = {f"{v.subject}.{key}": value for v in (one, two) for key, value in v.table.items()}
    units = {f"{v.subject}.{key}": value for v in (one, two) for key, value in v.units.items()}
    return Version(one.make, change, "pair", f"{one.subject} and {two.subject}", one.on, table, units)


def named(row: Row, advice: str) -> Row:
    """The row with what the pair does."""
    return replace(row, advice=advice)
