"""Floquet exponents of systems with fast modes: decoupled first, where that is cheaper than following every oscillation."""

from functools import partial

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.decoupling.decouple import decouple
from flexlin.periodic.decoupling.decoupled import Decoupled, Refusal
from flexlin.periodic.decoupling.exponents import decoupled_exponents
from flexlin.periodic.decoupling.parting import MAX_MERGES
from flexlin.periodic.resolved.uncertainty import couple_uncertainty
from flexlin.periodic.system import PeriodicSystem

ENCLOSED = 0.1
"""An exponent that is known only to this part of its size, and to lie below the others, counts as unresolved."""
NODES, FIRST = 128, 64
"""Nodes of a panel on which a system is decoupled, and of a period without breaks at first, those that check included."""


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


def hide_enclosed(exponents: Array, errors: Array) -> Array:
    """Mark by inf what is only enclosed, if it lies below all that is known: the others keep their enclosures as errors."""
    known = errors <= ENCLOSED * np.maximum(1.0, np.abs(exponents))
    if not known.any():
        return errors
    lowest = float((exponents.real - errors)[known].min())
    return np.where(~known & (exponents.real + errors < lowest), np.inf, errors)
