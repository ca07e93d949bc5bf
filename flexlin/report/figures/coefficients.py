"""The coefficients that vary over a period, entry by entry."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.checks import Array
from flexlin.report.figures.style import Picture, arrange_in_columns, make_period_panel
from flexlin.report.wording import name_coordinate_unit
from flexlin.svg import draw

MOST = 12
"""Entries shown; the others stand in the file that `flexlin linearize` writes."""
NOISE = 1e-9
TITLE = "The coefficients over a period"
SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
COLOURS = {"M": "green", "D": "purple", "K": "blue", "h": "vermilion"}
UNITS = {"M": ("kg", "kg m", "kg m²"), "D": ("N s/m", "N s", "N m s"), "K": ("N/m", "N", "N m")}


@dataclass(frozen=True)
class Entry:
    """One entry over a period: its matrix, its title with unit, its values (N,), and how much of its matrix's size it varies by."""

    matrix: str
    title: str
    values: Array
    swing: float


def draw_coefficients(a: Analysis) -> Picture:
    """A panel for each entry of M_L, D_L, K_L and h_L that varies."""
    varying = list(list_entries(a))
    least = sorted((entry.swing for entry in varying), reverse=True)[:MOST][-1:] or [0.0]
    shown = [entry for entry in varying if entry.swing >= least[0]][:MOST]
    panels = [
        make_period_panel(a.plant.period, entry.title).line(a.t, entry.values, COLOURS[entry.matrix]) for entry in shown
    ]
    svg = draw(arrange_in_columns(panels, 75), TITLE) if panels else ""
    return Picture("coefficients", TITLE, write_caption(len(varying), len(shown)), svg)


def write_caption(varying: int, shown: int) -> str:
    """What is shown, and what is not."""
    if not varying:
        return (
            "Every entry of M, D, K and h is constant along this motion: the linear system has constant coefficients."
        )
    rest = f" The {varying - shown} entries that vary least are left out." if varying > shown else ""
    return (
        "Entries of M y″ + D y′ + K y = h that vary along the rigid motion, open loop; y collects the deviations "
        f"(joints in rad, elastic coordinates in m).{rest} Constant entries stand in the table below."
    )


def list_entries(a: Analysis) -> Iterator[Entry]:
    """All entries that vary; of a pair that is equal at all times, the upper one."""
    for name in ("M", "D", "K"):
        matrix = getattr(a.coefficients, name)
        size = np.abs(matrix).max() or 1.0
        for i, j in np.ndindex(a.plant.n, a.plant.n):
            values, mirror = matrix[:, i, j], matrix[:, j, i]
            symmetric = bool(np.all(np.abs(values - mirror) <= NOISE * size))
            if np.ptp(values) > NOISE * size and not (symmetric and j < i):
                yield Entry(
                    name,
                    f"{name}{name_entry(i, j)} in {name_matrix_unit(a, name, i, j)}",
                    values,
                    float(np.ptp(values) / size),
                )
    size = np.abs(a.coefficients.h).max() or 1.0
    for i in range(a.plant.n):
        values = a.coefficients.h[:, i]
        if np.ptp(values) > NOISE * size:
            yield Entry(
                "h",
                f"h{str(i + 1).translate(SUBSCRIPTS)} in {name_force_unit(a, i)}",
                values,
                float(np.ptp(values) / size),
            )


def name_entry(i: int, j: int) -> str:
    """Subscripts, with a comma where an index has two digits."""
    comma = "," if max(i, j) > 8 else ""
    return f"{i + 1}{comma}{j + 1}".translate(SUBSCRIPTS)


def name_force_unit(a: Analysis, i: int) -> str:
    """N m for a row of a rotation, N for one of a displacement."""
    return "N" if name_coordinate_unit(a, i) == "m" else "N m"


def name_matrix_unit(a: Analysis, name: str, i: int, j: int) -> str:
    """The unit of an entry, by how many of its row and its column are rotations."""
    return UNITS[name][sum(name_coordinate_unit(a, k) == "rad" for k in (i, j))]
