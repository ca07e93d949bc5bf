"""Hold an answer of the engine against the truth: does each claimed error cover the true one, and is the verdict right?"""

import signal
from contextlib import contextmanager
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from scipy.optimize import linear_sum_assignment

from flexlin.errors import FlexlinError
from tests.periodic.cases import Case
from tests.periodic.truths import apart

ROUNDING = 1e-15
"""True errors below this (relative beyond 1/s) say nothing of an overestimate."""


@dataclass(frozen=True)
class Outcome:
    """What became of one case.

    misses: (true error - doubt) / claim of each resolved exponent, above 1 the claim is missed; overestimates: claim / true error
    where that is above rounding; hidden: exponents without a claim; wrong: why the answer as a whole is wrong, or "";
    refusal, crash: names of the typed refusal and of any other exception.
    """

    n: int
    tol: float
    misses: tuple[float, ...] = ()
    overestimates: tuple[float, ...] = ()
    hidden: int = 0
    reached: bool = False
    verdict: str = ""
    wrong: str = ""
    seconds: float = 0.0
    refusal: str = ""
    crash: str = ""

    @property
    def worst(self):
        return max(self.misses, default=0.0)


def judged(case: Case, answer=Case.answer, limit: float = 0.0) -> Outcome:
    """Ask and judge; `limit` seconds of patience, 0 for any number."""
    asked, start = Outcome(len(case.exponents), case.tol), perf_counter()
    try:
        with patience(limit):
            result = answer(case)
    except Exception as error:  # what is not typed is a finding
        name = type(error).__name__
        why = {"refusal": name} if isinstance(error, FlexlinError) else {"crash": f"{name}: {str(error)[:80]}"}
        return replace(asked, seconds=perf_counter() - start, **why)
    seconds, wrong = perf_counter() - start, wrong_answer(case, result.verdict)
    answered = replace(asked, verdict=result.verdict, wrong=wrong, seconds=seconds)
    if case.refuse:
        return answered
    claims = np.asarray(result.errors, float)
    shown = ~np.isinf(claims)
    claims = np.where(np.isnan(claims[shown]), 0.0, claims[shown])
    errors, doubt, sizes = true_errors(case, np.asarray(result.exponents)[shown], claims)
    floor = np.maximum(doubt, ROUNDING * np.maximum(1, sizes))
    with np.errstate(all="ignore"):
        misses = np.where(errors > doubt, (errors - doubt) / claims, 0.0)
        over = (claims / errors)[errors > floor]
    reached = bool(np.all(claims <= 1.01 * case.tol * np.maximum(1, sizes)))
    lists = {"misses": tuple(misses.tolist()), "overestimates": tuple(over.tolist())}
    return replace(answered, **lists, hidden=asked.n - len(misses), reached=reached)


def true_errors(case, found, claims):
    """Errors of the exponents found, held against as many true ones of largest real part; their doubts; their sizes.

    Those without a claim are thereby held to lie below the others. Distances are modulo 2 pi i / T. Of two assignments, of least
    total distance and of least total distance / claim, the one that misses less counts.
    """
    order = np.argsort(-case.exponents.real, kind="stable")[: len(found)]
    truth, doubt = case.exponents[order], case.doubt[order]
    distance = apart(np.where(np.isfinite(found), found, 1e30), truth, case.period)
    ratio = np.minimum(distance / np.maximum(np.asarray(claims)[:, None] + doubt, 1e-300), 1e15)
    matchings = [linear_sum_assignment(cost) for cost in (distance, ratio)]
    rows, columns = min(matchings, key=lambda match: ratio[match].max(initial=0.0))
    return distance[rows, columns], doubt[columns], np.abs(truth[columns])


def covers(found, known, period, doubt=0.0, factor=1.0):
    """Whether there is a known exponent for each one found within its error, times a factor, and that one's doubt (modulo 2 pi i / T)."""
    missed = apart(found.exponents, known, period) > factor * found.errors[:, None] + doubt
    return len(missed) <= len(known) and not missed[linear_sum_assignment(missed)].any()


def wrong_answer(case, verdict):
    """Why the answer as a whole is wrong, or "". Undecided never is."""
    growth, doubt = case.growth
    if case.refuse:
        return "answered"
    if verdict not in ("stable", "unstable"):
        return ""
    if case.marginal:
        return f"{verdict}, is marginal"
    if (verdict == "stable" and growth > doubt) or (verdict == "unstable" and growth < -doubt):
        return f"{verdict}, growth is {growth:.2g}"
    return ""


@contextmanager
def patience(seconds):
    """Raise TimeoutError when the time is over (main thread of a process only); 0 for any time."""

    def end(number, frame):
        raise TimeoutError(f"no answer within {seconds:.0f} s")

    if not seconds:
        yield
        return
    signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
