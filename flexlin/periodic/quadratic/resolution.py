"""Where the coefficients of a linear-quadratic problem change fast, so that no method steps over it."""

from dataclasses import replace
from functools import reduce

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.coefficients import Constant, MatrixFunction, has_nothing_narrow, varies
from flexlin.periodic.fourier import FourierSeries, fourier_nodes, real_fourier_coefficients
from flexlin.periodic.grid import divided, edges_of_short
from flexlin.periodic.precision import MINOR
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.resolved.companion import ResolvedCompanion
from flexlin.periodic.resolved.matrix import WAVES, ResolvedMatrix
from flexlin.periodic.resolved.resolve import resolve, resolve_port
from flexlin.periodic.resolved.sampling import BLOCKS
from flexlin.periodic.system import PeriodicSystem

FEW = 2
"""Harmonics so few that it does not matter which of them are small."""
OTHERS = ("B", "Q", "R", "N")


def resolve_problem(problem: LinearQuadratic, system: PeriodicSystem) -> tuple[LinearQuadratic, Array]:
    """Return the problem with its coefficients as series, and the edges of their panels from 0 to T."""
    state = system.resolved
    found: dict[str, MatrixFunction] = {"A": Constant(state.mean()) if state.constant else state}
    edges = system.resolved.edges
    for name in OTHERS:
        given = getattr(problem, name)
        complete = system.complete and has_nothing_narrow(given)
        named = system.period, system.breaks, system.features, complete
        series = system.resolved_input if given is system.B else resolve_port(given, *named)
        found[name] = Constant(series.mean()) if series.constant else series
        edges = edges if np.array_equal(edges, series.edges) else np.union1d(edges, series.edges)
    return replace(problem, **found), edges


def find_edges(problem: LinearQuadratic, system: PeriodicSystem) -> Array:
    """Return edges from 0 to T between which polynomials follow every coefficient, which need not repeat."""
    weights = (problem.Q, problem.R, problem.N)
    known = [(problem.A, True), (problem.B, True), *((one, has_nothing_narrow(one)) for one in weights)]
    corners = {0.0, *system.breaks}
    named = system.period, sorted(corners), system.features
    panels = (
        resolve(one, *named, complete=system.complete and nothing_narrow, repeats=False).edges
        for one, nothing_narrow in known
        if varies(one, system.period)
    )
    return reduce(np.union1d, panels, np.array([*sorted(corners), system.period]))


def divide_for_waves(problem: LinearQuadratic, edges: Array, tol: float) -> Array:
    """Divide the parts of the period until none holds more waves of a Fourier series than a panel follows."""
    smooth = (one for one in coefficients(problem) if isinstance(one.series, FourierSeries))
    waves = max((highest_wave(one, tol) for one in smooth), default=1.0)
    return divided(edges, float(edges[-1]) * WAVES / max(waves, 1.0))


def last_harmonic(problem: LinearQuadratic, tol: float) -> float:
    """Return the highest harmonic of the coefficients that matters at tol; infinity where one is not smooth or changes in a short time."""
    return max((highest_wave(one, tol) for one in coefficients(problem)), default=0.0)


def coefficients(problem: LinearQuadratic) -> list[ResolvedMatrix | ResolvedCompanion]:
    """Those that vary."""
    every = (getattr(problem, name) for name in ("A", *OTHERS))
    return [one for one in every if isinstance(one, ResolvedMatrix | ResolvedCompanion)]


def rough_places(problem: LinearQuadratic, longest: float) -> Array:
    """Return times in [0, T) at which a coefficient is not smooth, or about which it changes in a time below `longest`."""
    if all(one.panels == 1 for one in coefficients(problem)):
        return np.empty(0)
    edges = (np.mod(edges_of_short(one.edges, longest), one.period) for one in coefficients(problem))
    return reduce(np.union1d, edges, np.array([place for one in coefficients(problem) for place in one.breaks]))


def highest_wave(coefficient: ResolvedMatrix | ResolvedCompanion, tol: float) -> float:
    """Return the highest harmonic above tol of the largest and above what is known of the coefficient."""
    series, T = coefficient.series, coefficient.period
    if coefficient.breaks or np.diff(coefficient.edges).min() < T / BLOCKS:
        return np.inf
    if isinstance(series, FourierSeries) and series.degree <= FEW:
        return float(series.degree)
    values = None if isinstance(series, FourierSeries) else series(fourier_nodes(16 * BLOCKS, T))
    waves = series.coefficients if values is None else real_fourier_coefficients(values)
    H, last = len(waves) // 2, 0
    parts = coefficient.split if isinstance(coefficient, ResolvedCompanion) else lambda all_: (all_,)
    for part, known in zip(parts(waves), parts(coefficient.error), strict=True):
        size = np.abs(part).max(axis=(1, 2))
        floor = max(MINOR * tol * size.max(), float(known.max()))
        large = np.maximum(size[1 : H + 1], size[H + 1 :]) > floor
        last = max(last, int(np.flatnonzero(large).max(initial=-1)) + 1)
    return float(last)
