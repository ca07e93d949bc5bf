"""Floquet exponents of systems with fast modes: decoupled first, where that is cheaper than following every oscillation."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import pair_conjugates
from flexlin.periodic.decoupling import whole
from flexlin.periodic.decoupling.compiled import Coefficients, Found, find_steady_solver, solve_compiled
from flexlin.periodic.decoupling.coupling import Coupled
from flexlin.periodic.decoupling.decouple import decouple
from flexlin.periodic.decoupling.decoupled import Decoupled, Refusal
from flexlin.periodic.decoupling.exponents import decoupled_exponents
from flexlin.periodic.decoupling.hidden import STILL, find_growth, hidden_effect
from flexlin.periodic.decoupling.parting import MAX_MERGES
from flexlin.periodic.decoupling.several import SAFETY, UNRESOLVED
from flexlin.periodic.decoupling.steady import LOOK, decouple_steady
from flexlin.periodic.floquet.result import find_reached
from flexlin.periodic.fourier import FourierSeries
from flexlin.periodic.resolved.companion import ResolvedCompanion
from flexlin.periodic.resolved.uncertainty import couple_uncertainty
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.setting import MAX_SEGMENTS, Setting

ENCLOSED = 0.1
"""An exponent that is known only to this part of its size, and to lie below the others, counts as unresolved."""
AGAIN = 0.1
"""The part of tol that is aimed at where the first attempt misses tol: the coupling was small enough for rates, not for exponents."""
NODES, FIRST = 128, 64
"""Nodes of a panel on which a system is decoupled, and of a period without breaks at first, those that check included."""


AtOnce = tuple[Array, Array, Setting, Decoupled | None]
"""Exponents (n,), errors (n,), how they were computed, and what was decoupled."""


@dataclass(frozen=True)
class HiddenMiss(Refusal):
    """Why tol is not met, and the answer all the same where it says what leads, and no other nodes or groups would make it better."""

    answer: AtOnce | None


def estimate_decoupling_work(n: int, panels: int) -> float:
    """Microseconds to decouple n states, as measured: overhead, and eigenvectors and products at every node; for each panel."""
    return panels * (6000 + (NODES if panels > 1 else FIRST) * (20 + 6 * n + 0.06 * n**3))


def solve_decoupled(
    system: PeriodicSystem, tol: float, tries: int = MAX_MERGES
) -> tuple[Array, Array, Decoupled | None] | Refusal:
    """Exponents (n,) and errors (n,) in 1/s, inf for enclosed ones, by decoupling; or why that does not serve.

    What was decoupled is handed on, where it was the whole period at once. tries: as of `decouple`.
    """
    coefficients, T = system.resolved, system.period
    if coefficients.breaks:
        from flexlin.periodic.decoupling.panels import panel_exponents

        panels = panel_exponents(coefficients, T, coefficients.breaks)
        if isinstance(panels, Refusal):
            return panels
        return panels.exponents, hide_enclosed(panels.exponents, panels.errors), None
    decoupled = decouple(coefficients, T, (), tol, partial(couple_uncertainty, coefficients), tries)
    if isinstance(decoupled, Refusal):
        return decoupled
    found = decoupled_exponents(decoupled, tol)
    return found.exponents, hide_enclosed(found.exponents, found.errors), decoupled


def solve_at_once(system: PeriodicSystem, tol: float, limit: int = MAX_SEGMENTS) -> AtOnce | Refusal:
    """Exponents, conjugates exactly, and errors of a smooth system by one call of compiled code, or why that does not serve.

    By few segments of the whole, `limit` at most, or by decoupling where A(t) mixes the modes of its mean by little. It serves only where
    every error is bounded by perturbation theory and meets tol.
    """
    coefficients = system.resolved
    if coefficients.breaks or not isinstance(coefficients.series, FourierSeries):
        return Refusal("A(t) is not one Fourier series")
    library = find_steady_solver(system.n)
    code = "NumPy" if library is None else "compiled code"
    for aim in (tol, AGAIN * tol):
        given = coefficients, aim, limit
        found = solve_by_numpy(*given) if library is None else solve_compiled(library, *given)
        if isinstance(found, Refusal):
            return found
        exponents, errors, rate, way = found
        if isinstance(way, int):
            reason = f"few do for tol {tol:.0e} with eigenvalues of the mean of A(t) up to {rate:.3g} 1/s, by {code}"
            return exponents, errors, Setting("gauss", 2 * whole.STAGES, way, reason, rate), None
        hidden = find_hidden(way)
        if library is not None and hidden is not None:
            exponents, errors = add_hidden(way, hidden, tol)
        reason = f"modes that keep their shapes, eigenvalues of A(t) up to {rate:.3g} 1/s, by {code}"
        answer = exponents, errors, Setting("decoupling", 0, 1, reason, rate), way
        missed = int(np.sum(~find_reached(exponents, errors, tol)))
        if not missed:
            return answer
        if hidden is not None and (beyond := count_beyond(way, hidden, tol)):
            known = missed <= beyond and leads_known(exponents, errors, coefficients.period)
            return HiddenMiss("rounding hides what it takes to meet tol", answer if known else None)
    return Refusal("tol is not met")


def find_hidden(decoupled: Decoupled) -> Array | None:
    """What coupling below rounding may add to the generator, entry by entry (n, n); None where no modes take turns in damping."""
    growth = find_growth(decoupled.generator, decoupled.period) if decoupled.growth is None else decoupled.growth
    if growth < STILL:
        return None
    coupled = decoupled.coupled or Coupled(decoupled.generator, decoupled.period, decoupled.groups)
    return hidden_effect(coupled, decoupled.rounding)


def add_hidden(decoupled: Decoupled, hidden: Array, tol: float) -> tuple[Array, Array]:
    """The exponents, conjugates exactly, and their errors with what is hidden, which compiled code leaves out; inf for enclosed ones."""
    found = decoupled_exponents(replace(decoupled, residual=decoupled.residual + hidden), tol, tame_only=True)
    logs, errors = pair_conjugates(found.exponents * decoupled.period, found.errors * decoupled.period)
    return logs / decoupled.period, hide_enclosed(logs / decoupled.period, errors / decoupled.period)


def leads_known(exponents: Array, errors: Array, period: float) -> bool:
    """Whether all exponents that are not resolved (n,) decay faster than one that is."""
    unresolved = ~(errors * period < UNRESOLVED) & np.isfinite(errors)
    known = errors * period < UNRESOLVED
    if not unresolved.any():
        return True
    return bool(known.any() and (exponents.real + errors)[unresolved].max() < exponents.real[known].max())


def count_beyond(decoupled: Decoupled, hidden: Array, tol: float) -> int:
    """How many modes miss tol because of what is hidden: no other nodes or groups take it away."""
    means = np.abs(np.einsum("tii->ti", decoupled.generator).real.mean(axis=0))
    return int(np.sum(SAFETY * np.diagonal(hidden) > tol * np.maximum(1.0, means)))


def solve_by_numpy(coefficients: Coefficients, tol: float, limit: int) -> Found | Refusal:
    """What `solve_compiled` finds, without compiled code."""
    T, H = coefficients.period, coefficients.degree
    values = np.linalg.eigvals(coefficients(T / LOOK * np.arange(LOOK)).mean(axis=0))
    rate = float(np.abs(values).max())
    second = coefficients if isinstance(coefficients, ResolvedCompanion) else None
    if second and (found := whole.whole_exponents(second, values, tol, min(whole.FIRST, limit))) is not None:
        return found[0], found[1], rate, found[2]
    decoupled = decouple_steady(coefficients, T, H, tol, partial(couple_uncertainty, coefficients))
    if not isinstance(decoupled, Refusal):
        slow = decoupled_exponents(decoupled, tol, tame_only=True)
        if np.isfinite(slow.errors).all():
            logs, uncertain = pair_conjugates(slow.exponents * T, slow.errors * T)
            fastest = float(np.abs(np.einsum("tii->ti", decoupled.generator)).max())
            return logs / T, uncertain / T, fastest, decoupled
        decoupled = Refusal("the modes of a group grow or decay by much against each other")
    if second and (found := whole.whole_exponents(second, values, tol, min(whole.MOST, limit))) is not None:
        return found[0], found[1], rate, found[2]
    return decoupled


def hide_enclosed(exponents: Array, errors: Array) -> Array:
    """Mark by inf what is only enclosed, if it lies below all that is known: the others keep their enclosures as errors."""
    known = errors <= ENCLOSED * np.maximum(1.0, np.abs(exponents))
    if not known.any():
        return errors
    lowest = float((exponents.real - errors)[known].min())
    return np.where(~known & (exponents.real + errors < lowest), np.inf, errors)
