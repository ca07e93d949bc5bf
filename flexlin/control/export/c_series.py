"""C source that evaluates a matrix function of the phase: one Fourier series, or Chebyshev polynomials on panels."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.control.export.templates import fill_in
from flexlin.control.sampled import SampledGain
from flexlin.periodic.coefficient_series.matrix import Series
from flexlin.periodic.coefficient_series.resolve import resolve
from flexlin.periodic.coefficient_series.sampling import stratified
from flexlin.periodic.coefficients import MatrixFunction
from flexlin.periodic.interpolation import ChebyshevPanels, FourierSeries
from flexlin.precision import EPS, SAFETY

NEGLIGIBLE = SAFETY * EPS
"""Coefficients at the end of a series are left out when all together are smaller than this against the largest value."""


@dataclass(frozen=True, eq=False)
class CSeries:
    """A C function `static void name(double phase, double *out)`, entries row by row.

    source: its text; error: the largest deviation from the function that it stands for, relative to the largest value; layout: in words.
    """

    source: str
    error: float
    layout: str


def write_series(name: str, f: MatrixFunction, period: float, breaks: tuple[float, ...]) -> CSeries:
    """Write a function of time (N,) -> (N, rows, columns) as C; times in s, breaks in [0, T), 0 among them where it does not repeat."""
    edges = np.unique([0.0, *breaks, period])
    series = series_of(f, edges, bool(breaks))
    t = (edges[:-1, None] + np.diff(edges)[:, None] * stratified(499)).ravel()
    wanted = f(t)
    error = NEGLIGIBLE + float(np.abs(series(t) - wanted).max() / (np.abs(wanted).max() or 1.0))
    source, layout = write_fourier(name, series) if isinstance(series, FourierSeries) else write_panels(name, series)
    if isinstance(f, SampledGain):
        layout = f"that of the nearest of {len(f.gains)} samples; take it at a sample, and hold the torque to the next"
    return CSeries(source, error, layout)


def series_of(f: MatrixFunction, edges: Array, ends: bool) -> Series:
    """A function of time as the series that it is, or resolved into one, between the edges if it ends there."""
    if isinstance(f, SampledGain):
        return f.series
    if isinstance(f, FourierSeries | ChebyshevPanels):
        return shortened(f)
    breaks = edges[:-1].tolist() if ends else []
    return shortened(resolve(f, float(edges[-1]), breaks, complete=True, repeats=not ends).series)


def shortened(series: Series) -> Series:
    """The series without the end that is below rounding."""
    c = series.coefficients
    sizes = np.abs(c).reshape(*c.shape[:-2], -1).max(axis=-1)
    limit = NEGLIGIBLE * (sizes.max() or 1.0)
    if isinstance(series, FourierSeries):
        H = series.degree
        keep = needed(sizes[1 : H + 1] + sizes[H + 1 :], limit)
        return FourierSeries(np.concatenate([c[: keep + 1], c[H + 1 : H + 1 + keep]]), series.period)
    return ChebyshevPanels(series.edges, c[:, : max(1, needed(sizes.max(axis=0), limit))])


def needed(sizes: Array, limit: float) -> int:
    """How many of the first (N,) are needed for the sum of the rest to stay below the limit."""
    return int(np.count_nonzero(sizes[::-1].cumsum() > limit))


def write_fourier(name: str, series: FourierSeries) -> tuple[str, str]:
    """The text, and the layout in words."""
    H, flat = series.degree, series.coefficients.reshape(len(series.coefficients), -1)
    rows = [flat[0]] + [row for k in range(1, H + 1) for row in (flat[k], flat[H + k])]
    words = {"name": name, "rows": len(rows), "size": flat.shape[1], "table": table(rows), "harmonics": H}
    return fill_in("fourier_series.c.in", words), f"Fourier series of {H} harmonics: mean, then cosine and sine of each"


def write_panels(name: str, series: ChebyshevPanels) -> tuple[str, str]:
    """The text, and the layout in words."""
    c = series.coefficients
    flat = c.reshape(*c.shape[:2], -1)
    phases = numbers(series.edges / series.period)
    blocks = ",\n".join(f"  {{\n{table(list(panel))}\n  }}" for panel in flat)
    sizes = {"panels": len(flat), "degrees": flat.shape[1], "size": flat.shape[2], "edge_count": len(flat) + 1}
    source = fill_in("chebyshev_panels.c.in", {"name": name, "edges": phases, "table": blocks, **sizes})
    return source, f"Chebyshev series of degree {flat.shape[1] - 1} on {len(flat)} panels"


def table(rows: list[Array]) -> str:
    """Rows of numbers, each in braces."""
    return ",\n".join(f"    {{{numbers(row)}}}" for row in rows)


def numbers(row: Array) -> str:
    """Numbers that C reads back without loss."""
    return ", ".join(repr(float(value)) for value in row)
