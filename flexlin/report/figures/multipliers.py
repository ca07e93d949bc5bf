"""Floquet multipliers beside the unit circle, one panel a loop, with a radius that shows 1 and 1e-30 alike."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexlin.checks import Array
from flexlin.report.analysis import Analysis, Loop
from flexlin.report.figures.style import FAINT, GRID, INK, SHADE, VERDICTS, canvas
from flexlin.report.wording import largest_multiplier

COLUMNS = 4
RINGS = (-30.0, -10.0, -3.0, -1.0, 1.0)
"""Powers of ten at which a ring is drawn."""
HALF = 4.0
"""The power of ten that lies half-way between the centre and the unit circle."""


def draw_multipliers(a: Analysis) -> tuple[Figure, str, str]:
    """A unit circle for each loop."""
    loops = a.loops
    columns = min(COLUMNS, len(loops))
    rows = -(-len(loops) // columns)
    figure, axes = canvas(rows, columns, 2.35 * rows)
    for place, loop in zip(axes.flat, loops, strict=False):
        unit_circle(place)
        place.set_title(f"{loop.name}\n{loop.verdict}", loc="center", color=VERDICTS[loop.verdict])
        if loop.floquet is not None:
            multipliers(place, loop)
    for place in list(axes.flat)[len(loops) :]:
        place.remove()
    return (
        figure,
        "Multipliers on the unit circle",
        (
            "One dot a Floquet multiplier: what a disturbance is multiplied by over one period; inside the circle it decays. "
            "The angle is the multiplier's own; the distance from the centre follows the logarithm of its modulus (dashed rings), so that "
            "fast and slow modes can be read in one picture. The number below is the largest modulus."
        ),
    )


def radius(log10: Array) -> Array:
    """A monotone map of log10 |mu| with radius(-inf) = 0, radius(0) = 1, radius(inf) = 2, as smooth at 1 as it is elsewhere."""
    inside = HALF / (HALF + np.maximum(-log10, 0.0))
    outside = HALF / (HALF + np.maximum(log10, 0.0))
    return np.where(log10 <= 0, inside, 2.0 - outside)


def unit_circle(axes: Axes) -> None:
    """The circle, its inside, and rings with their moduli."""
    angle = np.linspace(0.0, 2 * np.pi, 181)
    axes.fill(np.cos(angle), np.sin(angle), color=SHADE, lw=0)
    axes.plot(np.cos(angle), np.sin(angle), color=INK, lw=1.1)
    for power in RINGS:
        r = float(radius(np.array(power)))
        axes.plot(
            r * np.cos(angle), r * np.sin(angle), color=GRID if power > 0 else FAINT, lw=0.5, ls=(0, (3, 3)), alpha=0.7
        )
        axes.annotate(f"1e{power:.0f}", (0.0, r), color=FAINT, fontsize=6, ha="center", va="bottom")
    axes.set_aspect("equal")
    axes.set_xlim(-1.35, 1.35)
    axes.set_ylim(-1.35, 1.35)
    axes.set_axis_off()


def multipliers(axes: Axes, loop: Loop) -> None:
    """The dots of one loop; the view grows where a multiplier lies far outside."""
    assert loop.floquet is not None
    logs = loop.floquet.log_multipliers
    r = radius(logs.real / np.log(10))
    axes.plot(
        r * np.cos(logs.imag),
        r * np.sin(logs.imag),
        "o",
        ms=5,
        mew=0.8,
        mec=INK,
        color=VERDICTS[loop.verdict],
        alpha=0.85,
    )
    reach = max(1.35, float(r.max()) + 0.15)
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.annotate(
        f"|µ| = {largest_multiplier(loop)}", (0.5, -0.02), xycoords="axes fraction", ha="center", va="top", fontsize=8
    )
