"""The nonlinear equations beside the linear prediction."""

import numpy as np
from matplotlib.figure import Figure

from flexlin.report.analysis import Analysis
from flexlin.report.figures.style import BLUE, FAINT, VERMILION, canvas
from flexlin.report.wording import coordinate_unit, scaled


def draw_comparison(a: Analysis) -> tuple[Figure, str, str] | None:
    """Tip error by both, and their difference; where the model has no tip, its first coordinate."""
    if a.simulation is None:
        return None
    s = a.simulation
    tip = bool(np.all(np.isfinite(s.tip)))
    both = np.array([s.tip - s.tip_rigid, s.tip_linear - s.tip_rigid]) if tip else np.array([s.nonlinear, s.linear])
    axis = int(np.argmax(np.abs(both[0]).max(axis=0)))
    name = f"tip error along {'xy'[axis]}" if tip else f"{a.plant.names[axis % a.plant.n]}"
    curves, unit = scaled(both[:, :, axis], "m" if tip else coordinate_unit(a, axis % a.plant.n))
    gap, gap_unit = scaled(
        np.linalg.norm(both[0] - both[1], axis=1) if tip else (both[0] - both[1])[:, axis], "m" if tip else "rad"
    )
    figure, axes = canvas(2, 1, 3.2, sharex=True, height_ratios=[1.7, 1])
    upper, lower = axes[:, 0]
    upper.plot(s.t, curves[0], color=BLUE, lw=2.4, alpha=0.55, label="nonlinear")
    upper.plot(s.t, curves[1], color=VERMILION, lw=1.1, ls="--", label="linear")
    upper.set_title(f"{name} in {unit}")
    upper.legend(ncols=2, loc="lower right", bbox_to_anchor=(1.0, 0.98))
    lower.plot(s.t, gap, color=FAINT)
    lower.set_title(f"{'distance of the two tips' if tip else 'difference'} in {gap_unit}")
    lower.set_xlabel("time in s")
    lower.set_xlim(0.0, s.t[-1])
    return (
        figure,
        "Nonlinear against linear",
        (
            f"The full nonlinear equations, started on the rigid motion and integrated over {s.t[-1] / a.plant.period:g} periods with the "
            f"scene's own loop, beside the linear prediction from the same start. {s.status[0].upper()}{s.status[1:]}."
        ),
    )
