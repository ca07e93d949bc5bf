"""What the jury holds of one question to the engine, and the register of all kinds of random systems."""

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

import flexlin as fl
from tests.periodic.truths import folded


@dataclass(frozen=True)
class Case:
    """One question to `fl.floquet` with its answer; `complete`: of the system.

    `refuse`: only a typed refusal is right; `marginal`: no verdict of stability is.
    """

    A: Callable[[np.ndarray], np.ndarray]
    period: float
    exponents: np.ndarray
    doubt: np.ndarray
    tol: float = 1e-9
    breaks: tuple[float, ...] = ()
    options: dict = field(default_factory=dict)
    marginal: bool = False
    refuse: bool = False
    complete: bool = False

    def system(self):
        return fl.PeriodicSystem(self.A, self.period, breaks=self.breaks, complete=self.complete)

    def answer(self):
        return fl.floquet(self.system(), tol=self.tol, **self.options)

    @property
    def growth(self):
        """The true growth rate and its doubt."""
        first = int(np.argmax(self.exponents.real))
        return float(self.exponents[first].real), float(self.doubt[first])


KINDS: dict[str, Callable[[np.random.Generator], Case]] = {}
"""Each: a random generator -> Case."""
COUNTS: dict[str, int] = {}
"""How many of each kind the whole jury hears."""


def kind(name, count):
    """Register a maker of cases, of which the whole jury hears so many."""

    def register(make):
        KINDS[name], COUNTS[name] = make, count
        return make

    return register


def draw(name, seed):
    """The case of this kind and seed, always the same."""
    return KINDS[name](np.random.default_rng([zlib.crc32(name.encode()), seed]))


def tol_of(rng):
    return float(rng.choice((1e-9, 1e-4)))


def known(A, period, exponents, tol, doubt=0.0, undamped=False, **more):
    """A case; an undamped one is marginal where its growth rate is zero beyond doubt."""
    exponents = folded(np.asarray(exponents, complex), period)
    case = Case(A, period, exponents, doubt + 2.0**-52 * np.abs(exponents), tol, **more)
    return replace(case, marginal=case.marginal or (undamped and abs(case.growth[0]) <= min(case.growth[1], 1e-12)))
