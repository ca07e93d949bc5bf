"""The coefficients that vary over a period, entry by entry: those that matter first, the others folded."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.checks import Array
from flexlin.report.figures.entries import (
    choose_shown,
    name_entry,
    name_force_unit,
    name_matrix_unit,
    shift_and_scale,
)
from flexlin.report.figures.style import Picture, arrange_in_columns, draw_folded, make_period_panel
from flexlin.svg import Panel, draw

MOST, FOLDED = 12, 240
"""Entries shown, and folded; the others stand in the file that `flexlin linearize` writes."""
THIN = 4
"""Every so many times are drawn of what is folded."""
NOISE = 1e-9
HEIGHT = 75.0
TITLE = "The coefficients over a period"
COLOURS = {"M": "teal", "D": "wine", "K": "indigo", "h": "rose"}


@dataclass(frozen=True)
class Entry:
    """One entry over a period: its matrix, row and column, values (N,), unit, and how much its variation matters."""

    matrix: str
    row: int
    column: int | None
    values: Array
    unit: str
    weight: float


def draw_coefficients(a: Analysis) -> Picture:
    """A panel for each entry of M, D, K and h that varies; each joint has one at the least."""
    varying = list(list_entries(a))
    joints = [[k for k, entry in enumerate(varying) if entry.row == i] for i in list_joints(a)]
    shown = choose_shown(np.array([entry.weight for entry in varying]), joints, MOST)
    rest = sorted((k for k in range(len(varying)) if k not in shown), key=lambda k: -varying[k].weight)
    folded = [varying[k] for k in sorted(rest[:FOLDED])]
    panels = [draw_entry(a, varying[k]) for k in shown]
    svg = draw(arrange_in_columns(panels, HEIGHT), TITLE) if panels else ""
    under = draw_folded([draw_entry(a, entry, THIN) for entry in folded], HEIGHT, TITLE)
    heading = f"The {len(folded)} other entries that vary"
    return Picture("coefficients", TITLE, write_caption(len(varying), len(shown), len(folded)), svg, under, heading)


def list_joints(a: Analysis) -> list[int]:
    """Which coordinates of the linear equations are joints."""
    return [i for i, coordinate in enumerate(a.plant.coordinates) if coordinate.kind == "joint"]


def draw_entry(a: Analysis, entry: Entry, every: int = 1) -> Panel:
    """One entry over the period, at every so many times."""
    name = name_entry(a, entry.matrix, entry.row, entry.column)
    title, values = shift_and_scale(name, entry.values, entry.unit)
    return make_period_panel(a.plant.period, title).line(a.t[::every], values[::every], COLOURS[entry.matrix])


def write_caption(varying: int, shown: int, folded: int) -> str:
    """What is shown, and what is not."""
    if not varying:
        return (
            "Every entry of M, D, K and h is constant along this motion: the linear system has constant coefficients."
        )
    rest = ""
    if varying > shown:
        rest = (
            " Shown are those whose variation moves frequencies and the response most, one of each joint at the least"
        )
        rest += "; the others are folded below"
        rest += f", {varying - shown - folded} stand in coefficients.nc of flexlin linearize alone" * (
            varying > shown + folded
        )
        rest += "."
    return (
        "Entries of M y″ + D y′ + K y = h that vary along the rigid motion, open loop; y collects the deviations of joints (q), "
        f"elastic coordinates and motors.{rest} Constant entries stand in the table below."
    )


def list_entries(a: Analysis) -> Iterator[Entry]:
    """All entries that vary; of a pair that is equal at all times, the upper one."""
    scales = weigh_entries(a)
    for name in ("M", "D", "K"):
        matrix = getattr(a.coefficients, name)
        size = np.abs(matrix).max() or 1.0
        for i, j in np.ndindex(a.plant.n, a.plant.n):
            values, mirror = matrix[:, i, j], matrix[:, j, i]
            symmetric = bool(np.all(np.abs(values - mirror) <= NOISE * size))
            if np.ptp(values) > NOISE * size and not (symmetric and j < i):
                weight = float(np.ptp(values) * scales[name][i, j])
                yield Entry(name, i, j, values, name_matrix_unit(a, name, i, j), weight)
    size = np.abs(a.coefficients.h).max() or 1.0
    for i in range(a.plant.n):
        values = a.coefficients.h[:, i]
        if np.ptp(values) > NOISE * size:
            yield Entry("h", i, None, values, name_force_unit(a, i), float(np.ptp(values) * scales["h"][i, 0]))


def weigh_entries(a: Analysis) -> dict[str, Array]:
    """By what each entry's variation is multiplied to see what it does, in numbers without unit.

        M_ij / (m_i m_j),   D_ij / (m_i m_j sqrt(w_i w_j)),   K_ij / (m_i m_j w_i w_j),   h_i / (m_i w_i) against the largest

    with m_i = sqrt(M_ii), w_i^2 = |K_ii| / M_ii, not below the motion's frequency: the share by which w_i^2 would move.
    """
    M, K = (np.abs(np.einsum("tii->ti", getattr(a.coefficients, name))).mean(axis=0) for name in ("M", "K"))
    mass = np.sqrt(np.maximum(M, 1e-12 * M.max(initial=0.0)))
    mass[mass == 0] = 1.0
    rate = np.maximum(np.sqrt(K) / mass, 2 * np.pi / a.plant.period)
    both = np.outer(mass, mass)
    force = 1 / (mass * rate)
    largest = float((np.ptp(a.coefficients.h, axis=0) * force).max(initial=0.0)) or 1.0
    geometric = np.sqrt(np.outer(rate, rate))
    return {"M": 1 / both, "D": 1 / (both * geometric), "K": 1 / (both * geometric**2), "h": force[:, None] / largest}
