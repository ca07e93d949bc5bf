"""Does the error that `fl.floquet` claims cover the true one? A jury of random systems whose exponents are known without it.

Lyapunov transformations, reparametrised and kinked time, Jordan chains, multipliers from 1e-300 to 1e300, non-normal matrices, narrow
pulses, jumps that nobody names, stiff systems, boundaries of stability, wrong periods, and settings fixed by hand: `tests/periodic/
random_systems.py` makes them. For each kind a row: answered, refused (typed errors), crashed, wrong verdicts, exponents whose claim is
missed (by more than 1 and by more than 3 times), the worst miss, the median of claim / true error, share that reached tol, time.

    OMP_NUM_THREADS=1 python studies/own_error.py [--size small|medium|full] [--kind NAME ...] [--seed 0] [--workers 2] [--out DIR]
"""

import json
import sys
import warnings
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import asdict, dataclass
from math import ceil
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from shared.running import run_study

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the jury lives with the tests

from tests.periodic.judge import Outcome, judged
from tests.periodic.random_systems import COUNTS, draw

SIZES = {"small": 2000, "medium": 8, "full": 1}
"""The whole jury is divided by this."""
LIMIT = 60.0
"""Seconds that one answer may take."""
SHOWN = 40
"""Broken claims that are printed; all are written."""


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    kind: str
    cases: int
    answered: int
    refused: int
    crashed: int
    wrong: int
    exponents: int
    missed: int
    missed3: int
    worst: float
    overestimate: float
    reached: float
    undecided: int
    milliseconds: float


def heard(question: tuple[str, int]) -> Outcome:
    """Make one case and judge the engine's answer."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            case = draw(*question)
        except ArithmeticError as error:  # shown among the findings; the other cases still count
            return Outcome(0, 0.0, crash=f"no truth: {error}")
        return judged(case, limit=LIMIT)


def outcomes(kinds: list[str], divisor: int, seed: int, workers: int) -> Iterator[tuple[str, list[Outcome]]]:
    """All outcomes of one kind after the other; a case depends on its kind and number only, not on the size of the jury."""
    with get_context("fork").Pool(workers) if workers > 1 else nullcontext() as pool:
        for kind in kinds:
            count = ceil(COUNTS[kind] / divisor)
            questions = [(kind, 1_000_000 * seed + k) for k in range(count)]
            chunk = max(1, min(16, count // (4 * workers)))
            yield kind, [heard(q) for q in questions] if pool is None else pool.map(heard, questions, chunksize=chunk)


def summed(kind: str, found: list[Outcome]) -> Row:
    answered = [o for o in found if not o.refusal and not o.crash]
    misses = np.array([m for o in answered for m in o.misses])
    over = [v for o in answered for v in o.overestimates]
    return Row(
        kind,
        len(found),
        len(answered),
        sum(bool(o.refusal) for o in found),
        sum(bool(o.crash) for o in found),
        sum(bool(o.wrong) for o in found),
        misses.size,
        int((misses > 1).sum()),
        int((misses > 3).sum()),
        float(misses.max(initial=0.0)),
        float(np.median(over)) if over else float("nan"),
        float(np.mean([o.reached for o in answered])) if answered else float("nan"),
        sum(o.verdict == "undecided" for o in answered),
        1e3 * float(np.median([o.seconds for o in found])),
    )


HEAD = (
    f"{'kind':32s} cases  answ refus crash wrong expon  >1x  >3x    worst  claim/true  tol met undecided       ms\n"
    + 130 * "-"
)


def line(row: Row) -> str:
    return (
        f"{row.kind:32s} {row.cases:5d} {row.answered:5d} {row.refused:5d} {row.crashed:5d} {row.wrong:5d} {row.exponents:5d}"
        f" {row.missed:4d} {row.missed3:4d} {row.worst:8.2g} {row.overestimate:11.3g} {100 * row.reached:7.1f}% {row.undecided:9d}"
        f" {row.milliseconds:8.1f}"
    )


def findings(kind: str, seed: int, found: list[Outcome]) -> list[str]:
    """The cases that broke a claim, each as `kind seed`: what."""
    lines = []
    for k, o in enumerate(found):
        what = [o.wrong] if o.wrong else []
        what += [f"missed {o.worst:.3g} times"] if o.worst > 1 else []
        what += [o.crash] if o.crash else []
        if what:
            lines.append(f"{kind!r}, {1_000_000 * seed + k}: n = {o.n}, tol {o.tol:.0e}: {'; '.join(what)}")
    return lines


def main(
    size: str = "full",
    out: str | Path = "out/studies",
    seed: int = 0,
    workers: int = 2,
    kinds: list[str] | None = None,
) -> dict[str, object]:
    """Run the study, print the table, write own_error.json; returns rows, outcomes by kind, and findings."""
    rows, every, broken, chosen = [], {}, [], kinds or list(COUNTS)
    print(HEAD)
    for kind, found in outcomes(chosen, SIZES[size], seed, workers):
        rows.append(summed(kind, found))
        every[kind] = found
        broken += findings(kind, seed, found)
        print(line(rows[-1]), flush=True)
    judged_kinds = [o for kind, found in every.items() if kind != "wrong period" for o in found]
    total = summed("all but wrong periods", judged_kinds) if judged_kinds else None
    if total is not None:
        print(line(total))
        print(f"claims that cover the true error: {100 * (1 - total.missed / max(1, total.exponents)):.3f} %")
    print(
        *broken[:SHOWN],
        *([f"... and {len(broken) - SHOWN} more in own_error.json"] if len(broken) > SHOWN else []),
        sep="\n",
    )
    data = {"rows": [asdict(row) for row in rows], "findings": broken}
    cases = {kind: [asdict(o) for o in found] for kind, found in every.items()}
    (Path(out) / "own_error.json").write_text(json.dumps({**data, "cases": cases}, indent=1))
    draw_ratios(
        {kind: [v for o in found for v in o.overestimates] for kind, found in every.items()},
        Path(out) / "own_error.png",
    )
    return {**data, "outcomes": every, "total": total}


def draw_ratios(ratios: dict[str, list[float]], path: Path) -> None:
    """The claimed against the true error of every exponent, one row for each kind; left of 1 a claim is missed."""
    from matplotlib.figure import Figure

    kinds = [kind for kind, found in ratios.items() if found]
    figure = Figure(figsize=(9, 0.28 * len(kinds) + 1.2), layout="constrained")
    axes = figure.subplots()
    for row, kind in enumerate(kinds):
        axes.semilogx(ratios[kind], np.full(len(ratios[kind]), row), "|", color="#22628f", markersize=9, alpha=0.5)
    axes.axvline(1, color="#a8522f", linewidth=1)
    axes.set_yticks(range(len(kinds)), kinds)
    axes.invert_yaxis()
    axes.set(xlabel="claimed error / true error", title="Does the claim cover the error?")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path)


if __name__ == "__main__":
    run_study(
        main,
        sizes=SIZES,
        seed={"type": int, "default": 0},
        workers={"type": int, "default": 2},
        kind={"nargs": "*", "choices": COUNTS, "dest": "kinds"},
    )
