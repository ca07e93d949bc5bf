"""The gains of the designs over a period, beside the scene's own."""

import numpy as np
from matplotlib.figure import Figure

from flexlin.report.analysis import Analysis
from flexlin.report.figures.style import FAINT, canvas, loop_colour, time_axis
from flexlin.simulation import own_gain

COLUMNS = 3
MOST = 12


def draw_gains(a: Analysis) -> tuple[Figure, str, str] | None:
    """A panel for each entry of K(t)."""
    made = [(loop, i) for i, loop in enumerate(a.loops) if loop.design is not None]
    if not made:
        return None
    states = [*a.plant.names, *[f"{name}′" for name in a.plant.names]]
    pairs = [(i, j) for i in range(len(a.plant.inputs)) for j in range(len(states))]
    rows = -(-min(len(pairs), MOST) // COLUMNS)
    figure, axes = canvas(rows, COLUMNS, 0.6 + 1.25 * rows, sharex=True)
    gains = [(loop, colour, loop.design.K(a.t)) for loop, colour in made if loop.design is not None]
    own = own_gain(a.closed)
    for place, (i, j) in zip(axes.flat, pairs, strict=False):
        for loop, position, gain in gains:
            place.plot(a.t, gain[:, i, j], color=loop_colour(loop, position), label=loop.name)
        if np.any(own):
            place.axhline(own[i, j], color=FAINT, ls="--", lw=1.0, label=a.own.name)
        place.set_title(f"{a.plant.inputs[i]} from {states[j]}")
        place.ticklabel_format(axis="y", useOffset=False)
        time_axis(place, a.plant.period, label=False)
    for place in axes[-1]:
        place.set_xlabel("time in s")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=4)
    return (
        figure,
        "Gains over a period",
        (
            "Entries of the feedback gain K(t) in u = −K(t) [y; y′], N m for each rad, m, rad/s or m/s; dashed: the scene's own feedback."
            + (f" The first {MOST} of {len(pairs)} entries." if len(pairs) > MOST else "")
        ),
    )
