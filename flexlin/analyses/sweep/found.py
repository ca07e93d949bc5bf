"""What a sweep knows of each value."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from flexlin.checks import Array, try_to
from flexlin.periodic.circle import measure_distances

if TYPE_CHECKING:
    import xarray as xr

    from flexlin.periodic.floquet.result import FloquetResult
    from flexlin.periodic.system import PeriodicSystem


VERDICTS = np.array(["undecided", "stable", "unstable", "failed", "missing"])
FAILED, MISSING = np.flatnonzero(np.isin(VERDICTS, ["failed", "missing"]))
REASON_LENGTH = 240
"""Characters of a reason."""
WITHIN = "the growth rate is zero to within its error: a smaller tol may decide"


@dataclass
class Found:
    """What is known of each value so far."""

    exponents: Array
    error: Array
    verdict: Array
    period: Array
    one_by_one: Array
    reason: Array

    @classmethod
    def empty(cls, values: int, states: int) -> "Found":
        exponents, error, period = np.full((values, states), np.nan + 0j), *np.full((2, values), np.nan)
        verdict, one_by_one = np.zeros(values, dtype=np.int8), np.zeros(values, dtype=bool)
        return cls(exponents, error, verdict, period, one_by_one, np.full(values, "", dtype=object))

    def put(self, which: Array, exponents: Array, errors: Array) -> None:
        """Enter exponents and errors (V, n): unordered, and judge them."""
        order = np.argsort(-exponents.real, axis=1, kind="stable")
        self.exponents[which] = np.take_along_axis(exponents, order, axis=1)
        self.error[which] = errors.max(axis=1)
        growth = exponents.real
        self.verdict[which] = np.where((growth > errors).any(axis=1), 2, np.where((growth < -errors).all(axis=1), 1, 0))
        self.reason[which] = np.where(self.verdict[which] == 0, WITHIN, "")

    def put_alone(self, i: int, make: Callable[[], "PeriodicSystem"], tol: float) -> None:
        """Enter what `floquet` says of one value, or why its equations have no answer."""
        self.one_by_one[i] = True
        result = solve_alone(make, tol)
        if isinstance(result, Exception):
            self.verdict[i], self.reason[i] = FAILED, str(result)[:REASON_LENGTH]
            return
        self.exponents[i], self.error[i], self.period[i] = result.exponents, result.error, result.period
        self.verdict[i], self.reason[i] = VERDICTS.tolist().index(result.verdict), result.reason[:REASON_LENGTH]

    def is_confirmed(self, i: int, make: Callable[[], "PeriodicSystem"], tol: float) -> bool:
        """Whether `floquet` finds the exponents of a value too, but for those that it only bounds, within the errors of both; imaginary
        parts modulo 2 pi / T."""
        result, T = solve_alone(make, tol), self.period[i]
        if isinstance(result, Exception):
            return bool(self.verdict[i] == FAILED)
        resolved = result.log_multipliers[np.isfinite(result.errors)]
        apart = measure_distances(resolved, self.exponents[i] * T).min(axis=1)
        return bool((apart <= (self.error[i] + result.error) * T).all())

    def place(self, start: int, block: "Found") -> None:
        """Enter a block of values that begins at `start`."""
        for one in fields(self):
            part = getattr(block, one.name)
            getattr(self, one.name)[start : start + len(part)] = part


TAKEN = {*(one.name for one in fields(Found)), "mode"}
"""Names of what a result holds beside the numbers that vary."""


def solve_alone(make: Callable[[], "PeriodicSystem"], tol: float) -> "FloquetResult | Exception":
    """What `floquet` says of a system, or why there is no answer. Raises: TimeLimit."""
    from flexlin.periodic.floquet.exponents import floquet  # most workers do without

    return try_to(lambda: floquet(make(), tol))


def worst_error(data: "xr.Dataset") -> float:
    """The largest error of a sweep, in 1/s up to |exponent| = 1/s and relative beyond; those without a resolved exponent are left out."""
    size = np.abs(data["exponents"].values).max(axis=-1, initial=1.0)
    errors = data["error"].values / size
    return float(errors[np.isfinite(errors)].max(initial=0.0))
