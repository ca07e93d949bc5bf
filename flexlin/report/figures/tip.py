"""How far the tip is from its rigid path in the periodic response."""

import numpy as np
from matplotlib.figure import Figure

from flexlin.report.analysis import Analysis
from flexlin.report.figures.style import BLUE, FAINT, GREEN, INK, canvas, time_axis
from flexlin.report.wording import quantity, scaled


def draw_tip(a: Analysis) -> tuple[Figure, str, str] | None:
    """The components over the period on the left, the path of the error on the right."""
    if a.response is None or not np.all(np.isfinite(a.response.tip)):
        return None
    largest = a.response.tip_error
    xy, unit = scaled(a.response.tip, "m")
    size = np.hypot(*xy.T)
    figure, axes = canvas(1, 2, 2.5, width_ratios=[1.9, 1])
    left, right = axes[0]
    left.plot(a.t, size, color=INK, lw=1.8, label="distance")
    left.plot(a.t, xy[:, 0], color=BLUE, label="x")
    left.plot(a.t, xy[:, 1], color=GREEN, label="y")
    left.axhline(0.0, color=FAINT, lw=0.6)
    left.set_title(f"tip minus rigid tip in {unit}")
    left.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.75, 1.0))
    time_axis(left, a.plant.period)
    right.plot(*xy.T, color=BLUE)
    right.plot(0.0, 0.0, "+", color=INK, ms=8)
    right.set_aspect("equal", adjustable="datalim")
    right.set_title(f"its path in {unit}")
    right.set_xlabel("x")
    right.set_ylabel("y")
    rms = float(np.sqrt(np.mean(largest[:-1] ** 2)))
    return (
        figure,
        "Tip error in steady motion",
        (
            f"Largest {quantity(float(largest.max()), 'm')}, root mean square {quantity(rms, 'm')}; known to "
            f"{quantity(a.response.solution.error, 'm', 1)} in the linear model."
        ),
    )
