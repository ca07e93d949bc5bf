"""Spectra of many systems of one family: verdicts, functions that stay smooth where multipliers meet, and what a search may take."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import wrap_angle
from flexlin.precision import CUBE_ROOT_EPS, EPS
from flexlin.resources import Stopwatch

SCAN_SHARE = 0.6
"""Share of the time that the scan may take: the rest is for the places that it finds."""


class Columns:
    """A record of arrays with one row for each case."""

    def at(self, which: Array) -> Self:
        """Some of the cases."""
        return type(self)(*(column[which] for column in vars(self).values()))

    def beside(self, more: Self) -> Self:
        """These cases and more behind them."""
        return type(self)(*map(np.concatenate, zip(vars(self).values(), vars(more).values(), strict=True)))


@dataclass(frozen=True)
class Spectra(Columns):
    """Logs of the Floquet multipliers of V systems, (V, n), and their errors, (V, n); not finite where there is no answer."""

    logs: Array
    errors: Array

    @property
    def verdicts(self) -> Array:
        """1 where an exponent grows beyond its error, -1 where all decay beyond theirs, else 0, (V,)."""
        growth = self.logs.real
        decays = (growth < -self.errors) | (np.isinf(self.errors) & (growth < 0))
        return np.where((growth > self.errors).any(axis=1), 1, np.where(decays.all(axis=1), -1, 0))

    @property
    def felt(self) -> Array:
        """The logs, where what is lost within a period to rounding is lost at the same rate, however fast it decays, (V, n)."""
        return np.maximum(self.logs.real, np.log(EPS)) + 1j * self.logs.imag

    @property
    def known(self) -> Array:
        """Where there is an answer, (V,)."""
        return np.asarray(np.isfinite(self.logs).all(axis=1))

    @property
    def leading(self) -> Array:
        """Index (V,) of the log that grows fastest for certain."""
        return np.argmax(self.logs.real - np.where(np.isfinite(self.errors), self.errors, np.inf), axis=1)

    @property
    def lead(self) -> Array:
        """That log, (V,)."""
        return np.asarray(self.logs[np.arange(len(self.logs)), self.leading])


SpectraFunction = Callable[[Array], Spectra]
"""Points (V, P) of the parameters -> spectra."""


def count_resting(spectra: Spectra) -> int:
    """How many logs are zero at every value: free rigid motions, whose drift is no instability."""
    known = spectra.at(spectra.known)
    near = np.abs(known.logs) <= np.where(np.isfinite(known.errors), known.errors, 0.0) + CUBE_ROOT_EPS
    return int(near.sum(axis=1).min()) if len(near) else 0


def drop_resting(spectra: Spectra, count: int) -> Spectra:
    """The spectra without the `count` logs nearest to zero."""
    if not count:
        return spectra
    kept = np.sort(np.argsort(np.abs(spectra.logs), axis=1, kind="stable")[:, count:], axis=1)
    return Spectra(np.take_along_axis(spectra.logs, kept, axis=1), np.take_along_axis(spectra.errors, kept, axis=1))


def measure_meetings(spectra: Spectra) -> tuple[Array, Array]:
    """Squared half distances D (V, J) of multipliers that are neighbours in angle, and the pairs' growth (V, J).

        D = ((log mu_a - log mu_b) / 2)^2,   log mu = growth + D^(1/2)

    D is real and smooth where two multipliers meet: below zero while they pass each other by, above zero while they are locked
    in a resonance. Column 0: a pair and its conjugate at angle 0; the last: at angle pi; between them: neighbours in angle.
    Source: Seyranian, Mailybaev, Multiparameter Stability Theory (2003), section 1.4 (strong interaction of eigenvalues).
    """
    logs = spectra.felt
    if logs.shape[1] % 2:  # the fastest decaying meets nobody near the unit circle
        logs = np.take_along_axis(logs, np.argsort(logs.real, axis=1, kind="stable")[:, 1:], axis=1)
    angle = np.abs(wrap_angle(logs.imag))
    order = np.lexsort((-logs.real, np.round(angle, 9)), axis=1)
    angle, growth = np.take_along_axis(angle, order, axis=1), np.take_along_axis(logs.real, order, axis=1)
    across = np.concatenate(
        [angle[:, :1] + angle[:, 1:2], angle[:, 2::2] - angle[:, 1:-1:2], 2 * np.pi - angle[:, -1:] - angle[:, -2:-1]],
        axis=1,
    )
    first = np.concatenate([growth[:, :1], growth[:, 1:-1:2], growth[:, -2:-1]], axis=1)
    second = np.concatenate([growth[:, 1:2], growth[:, 2::2], growth[:, -1:]], axis=1)
    return (((first - second) / 2) ** 2 - (across / 2) ** 2), (first + second) / 2


def measure_margins(spectra: Spectra, undamped: Array, angles: Array) -> tuple[Array, Array]:
    """A function (V,) that is positive where a system is unstable and passes zero smoothly at the boundary, and its error (V,).

        undamped: D, the squared growth;   damped: -a b = D - delta^2,   a, b = log mu - i angle = -delta +- D^(1/2)

    of the two multipliers nearest to an angle. Where the growing one is not among these, the growth itself stands in.

    Parameters: undamped (V,): whether the stable side is neutral; angles (V,): of the multiplier that leaves the circle.
    """
    rows, lead = np.arange(len(spectra.logs)), spectra.leading
    growth, error = spectra.logs.real[rows, lead], spectra.errors[rows, lead]
    turned = spectra.logs - 1j * angles[:, None]
    turned = turned.real + 1j * wrap_angle(turned.imag)
    near = np.argsort(np.abs(turned), axis=1, kind="stable")[:, :2]
    pair, wrong = np.take_along_axis(turned, near, axis=1), np.take_along_axis(spectra.errors, near, axis=1)
    a, b = pair[:, 0], pair[:, -1]
    locked = np.where(np.abs((a - b).real) <= wrong.sum(axis=1), 1, -1)  # as far as is known
    passing = (locked * (a - b).real ** 2 - wrap_angle((a - b).imag) ** 2) / 4
    neutral = np.where(spectra.verdicts > 0, growth**2, passing)
    own = np.abs(np.sin(angles)) < CUBE_ROOT_EPS
    product = np.where(own, np.abs(a * b), np.abs(a.real * b.real))
    mirror = np.minimum(np.abs(wrap_angle(angles)), np.pi - np.abs(wrap_angle(angles)))
    partner = own | (np.abs(b.imag) < mirror)  # the conjugate of a is none
    inside = (near == lead[:, None]).any(axis=1) & partner & (spectra.logs.shape[1] > 1)
    damped = np.where(inside, np.sign(growth) * product, growth)
    damped_error = np.where(
        inside, wrong[:, 0] * np.abs(b) + wrong[:, -1] * np.abs(a) + wrong[:, 0] * wrong[:, -1], error
    )
    neutral_error = error**2 + 2 * error * np.sqrt(np.abs(neutral))
    return np.where(undamped, neutral, damped), np.where(undamped, neutral_error, damped_error)


class Effort:
    """Seconds of work for a search, by default without end, which should know most `about` a value.

    left (K, 2): parts of the range in which a change may hide, none where none can but in what the search cannot see; `unfinished`:
    whether a place was not narrowed as far as was asked.
    """

    def __init__(self, seconds: float = float("inf"), about: float = float("nan")):
        self.seconds, self.about, self.watch = seconds, about, Stopwatch()
        self.left, self.unfinished, self.values = np.empty((0, 2)), False, 0
        self._each = 0.0

    @property
    def gap(self) -> float:
        """The widest part that is left, 0 where nothing is."""
        return float(np.ptp(self.left, axis=1).max(initial=0.0))

    @property
    def searched(self) -> tuple[float, float]:
        """The ends of what is known about the value, up to the parts that are left; they do not rise where it lies in one."""
        low, high = self.left.T
        return float(high[low < self.about].max(initial=-np.inf)), float(low[high > self.about].min(initial=np.inf))

    def leave(self, low: Array, high: Array) -> None:
        """Parts of the range (K,) in which a change may hide when the search ends."""
        self.left = np.concatenate([self.left, np.stack([low, high], axis=1)])

    def timed(self, function: SpectraFunction) -> SpectraFunction:
        """The function, whose cost for each value is known from its latest call, but for the first one, which may prepare something."""

        def compute(values: Array) -> Spectra:
            before = self.watch.seconds
            found = function(values)
            if self.values:
                self._each = (self.watch.seconds - before) / max(len(values), 1)
            self.values += len(values)
            return found

        return compute

    def affords(self, values: int, share: float = 1.0) -> bool:
        """Whether so many values more are done within a share of the time."""
        return values <= self.count(share)

    def count(self, share: float) -> float:
        """How many values more are done within a share of the time; below 0 where it is over."""
        left = share * self.seconds - self.watch.seconds
        if left < 0:
            return -float("inf")
        return left / self._each if self._each else float("inf")
