"""The periodic response of the scene's own loop, coordinate by coordinate, with the torque it takes."""

import numpy as np
from matplotlib.figure import Figure

from flexlin.checks import Array
from flexlin.report.analysis import Analysis
from flexlin.report.figures.style import BLUE, FAINT, SERIES, canvas, time_axis
from flexlin.report.wording import coordinate_unit, scaled
from flexlin.simulation import own_gain

COLUMNS = 3
MOST = 11


def draw_response(a: Analysis) -> tuple[Figure, str, str] | None:
    """A panel for each deviation, and one for the torques."""
    if a.response is None:
        return None
    shown = min(a.plant.n, MOST)
    panels = shown + bool(a.plant.inputs)
    rows = -(-panels // COLUMNS)
    figure, axes = canvas(rows, COLUMNS, 0.35 + 1.45 * rows, sharex=True)
    for i, place in enumerate(axes.flat):
        if i >= panels:
            place.remove()
            continue
        if i < shown:
            values, unit = scaled(a.response.states[:, i], coordinate_unit(a, i))
            place.plot(a.t, values, color=BLUE)
            place.set_title(f"{a.plant.names[i]} in {unit}")
        else:
            for k, torque in enumerate(torques(a).T):
                place.plot(a.t, a.coefficients.tau[:, k], color=FAINT, lw=1.0, ls="--")
                place.plot(a.t, torque, color=SERIES[(k + 1) % len(SERIES)], label=a.plant.inputs[k])
            place.set_title("torque in N m")
        place.axhline(0.0, color=FAINT, lw=0.6)
        time_axis(place, a.plant.period, label=i >= panels - COLUMNS)
        place.tick_params(labelbottom=i >= panels - COLUMNS)
    left_out = f" Only the first {MOST} coordinates are shown." if a.plant.n > MOST else ""
    return (
        figure,
        "Forced periodic response",
        (
            "Steady deviations from the rigid motion under the scene's own loop: q of joints, w of elastic modes (the tip's share of each "
            f"mode is its shape's tip value times w). Torque: feedforward alone dashed, with feedback solid.{left_out}"
        ),
    )


def torques(a: Analysis) -> Array:
    """Feedforward and feedback together in the periodic response, (N, m)."""
    assert a.response is not None
    forward = a.coefficients.tau * (a.scene.control.feedforward == "rigid")
    return np.asarray(forward - a.response.states @ own_gain(a.closed).T)
