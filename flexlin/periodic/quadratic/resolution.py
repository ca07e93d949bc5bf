"""Where the coefficients of a linear-quadratic problem change fast, so that no method steps over it."""

from dataclasses import replace
from functools import reduce

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.coefficients import PROBES, Constant, MatrixFunction
from flexlin.periodic.fourier import FourierSeries
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.resolved.companion import ResolvedCompanion
from flexlin.periodic.resolved.matrix import WAVES, divided
from flexlin.periodic.resolved.resolve import resolve
from flexlin.periodic.system import PeriodicSystem

OTHERS = ("B", "Q", "R", "N")
SEEN = 0.1
"""Harmonics below this part of tol, relative to the largest coefficient, need not be seen."""


def resolve_problem(problem: LinearQuadratic, system: PeriodicSystem) -> tuple[LinearQuadratic, Array]:
    """Return the problem with its coefficients as series, and the edges of their panels from 0 to T: two where all are smooth."""
    found: dict[str, MatrixFunction] = {"A": system.resolved}
    edges = system.resolved.edges
    for name in OTHERS:
        source = getattr(problem, name)
        if varies(source, system):
            series = resolve(source, system.period, system.breaks, system.features, complete=system.complete)
            found[name] = Constant(series.mean()) if series.constant else series
            edges = np.union1d(edges, series.edges)
    return replace(problem, **found), edges


def find_edges(problem: LinearQuadratic, system: PeriodicSystem) -> Array:
    """Return edges from 0 to T between which polynomials follow every coefficient, which need not repeat."""
    sources = (getattr(problem, name) for name in ("A", *OTHERS))
    corners = {0.0, *system.breaks}
    panels = (
        resolve(source, system.period, sorted(corners), system.features, complete=system.complete, repeats=False).edges
        for source in sources
        if varies(source, system)
    )
    return reduce(np.union1d, panels, np.array([*sorted(corners), system.period]))


def varies(source: MatrixFunction, system: PeriodicSystem) -> bool:
    """Whether a coefficient is more than one matrix that is handed out at all times."""
    return bool(source(system.period * PROBES).strides[0] != 0)


def divide_for_waves(problem: LinearQuadratic, edges: Array, tol: float) -> Array:
    """Divide the parts of the period until none holds more waves of a smooth coefficient than a panel follows."""
    return divided(edges, float(edges[-1]) * WAVES / max(last_harmonic(problem, tol), 1))


def last_harmonic(problem: LinearQuadratic, tol: float) -> int:
    """Return the highest harmonic of the smooth coefficients that matters at tol."""
    last = 0
    for name in ("A", *OTHERS):
        coefficient = getattr(problem, name)
        series = getattr(coefficient, "series", None)
        if isinstance(series, FourierSeries):
            waves = series.coefficients
            parts = coefficient.split(waves) if isinstance(coefficient, ResolvedCompanion) else (waves,)
            last = max(last, *(find_last(part, SEEN * tol) for part in parts))
    return last


def find_last(waves: Array, tol: float) -> int:
    """Return the highest harmonic larger than tol of the largest coefficient."""
    H, size = len(waves) // 2, np.abs(waves).max(axis=(1, 2))
    large = np.maximum(size[1 : H + 1], size[H + 1 :]) > tol * size.max()
    return int(np.flatnonzero(large).max(initial=-1)) + 1
