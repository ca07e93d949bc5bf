"""How the entries of matrices are named, in which units they are, and which of many are shown."""

from collections.abc import Sequence

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.checks import Array
from flexlin.report.wording import format_decimal, in_unit, is_dimensionless, name_coordinate_unit
from flexlin.svg.scales import SUPERSCRIPTS

UNITS = {"M": ("kg", "kg m", "kg m²"), "D": ("N s/m", "N s", "N m s"), "K": ("N/m", "N", "N m")}
GAINS = {("N m", "m"): "N", ("N m", "rad"): "N m/rad", ("N", "m"): "N/m", ("N", "rad"): "N/rad"}
RATES = {("N m", "m"): "N s", ("N m", "rad"): "N m s/rad", ("N", "m"): "N s/m", ("N", "rad"): "N s/rad"}
PLAIN = (1e-2, 1e4)
"""Sizes between which numbers are shown as they are; others as multiples of a power of ten."""
FLAT = 1e-3
"""A curve that varies by less than this share of its size is drawn from its mean."""


def name_entry(a: Analysis, matrix: str, i: int, j: int | None = None) -> str:
    """An entry by its coordinates: K(q1, w11), h(q1)."""
    return f"{matrix}({', '.join(a.plant.names[k] for k in (i, j) if k is not None)})"


def name_force_unit(a: Analysis, i: int) -> str:
    """N m for a row of a rotation, N for one of a displacement."""
    return "N" if name_coordinate_unit(a, i) == "m" else "N m"


def name_matrix_unit(a: Analysis, name: str, i: int, j: int) -> str:
    """The unit of an entry of M, D or K, by how many of its row and its column are rotations; none without dimensions."""
    return "" if is_dimensionless() else UNITS[name][sum(name_coordinate_unit(a, k) == "rad" for k in (i, j))]


def name_gain_unit(a: Analysis, i: int, j: int) -> str:
    """The unit of what input i gets from state j of x = [y; y']."""
    n, force = a.plant.n, a.plant.input_units[i]
    unit = name_coordinate_unit(a, j % n)
    known = GAINS if j < n else RATES
    return known.get((force, unit), f"{force}{'' if j < n else ' s'}/{unit}")


def shift_and_scale(title: str, values: Array, unit: str) -> tuple[str, Array]:
    """A title with unit, and values whose axis can be read: in powers of ten where large or small, from the mean where nearly flat."""
    largest, swing = float(np.abs(values).max(initial=0.0)), float(np.ptp(values))
    if 0 < swing < FLAT * largest:
        mean = float(f"{np.mean(values):.5g}")
        title, values, largest = (
            f"{title} {'−' if mean > 0 else '+'} {format_decimal(abs(mean), 5)}",
            values - mean,
            swing,
        )
    if largest == 0 or not np.isfinite(largest) or PLAIN[0] <= largest < PLAIN[1]:
        return in_unit(title, unit), values
    power = 3 * int(np.floor(np.log10(largest) / 3))
    times = f"10{str(power).translate(SUPERSCRIPTS)}"
    return in_unit(title, unit, times), values / 10.0**power


def choose_shown(weights: Array, groups: Sequence[Sequence[int]], most: int) -> list[int]:
    """Which of some panels are shown: the heaviest of each group (one a joint, say), then the heaviest of all, in their own order."""
    heaviest = [max(group, key=lambda i: weights[i]) for group in groups if len(group)]
    shown = dict.fromkeys(heaviest)
    for i in np.argsort(-weights, kind="stable"):
        if len(shown) >= most:
            break
        shown[int(i)] = None
    return sorted(shown)
