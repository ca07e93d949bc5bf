"""The nonlinear equations beside the linear prediction."""

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.checks import Array
from flexlin.report.advice import agreement, sentence
from flexlin.report.figures.style import Picture, choose_colour
from flexlin.report.wording import in_unit, name_coordinate_unit, scale_values, time_label
from flexlin.simulation.result import Simulation
from flexlin.svg import Linear, Panel, Row, draw

TITLE = "Nonlinear against linear"


def draw_comparison(a: Analysis) -> Picture | None:
    """Both answers, and their difference: of the tip, or of the first coordinate where the model has no tip."""
    if a.simulation is None:
        return None
    s = a.simulation
    name, unit, nonlinear, linear, gap = (
        compare_tips(s) if np.all(np.isfinite(s.tip)) else compare_first_coordinate(a, s)
    )
    (both, both_unit), (apart, apart_unit) = scale_values(np.array([nonlinear, linear]), unit), scale_values(gap, unit)
    time = Linear(0.0, float(s.t[-1]))
    colour = choose_colour(a, a.own)
    upper = Panel(in_unit(name, both_unit), x=time, ticked=(False, True)).zero()
    upper.line(s.t, both[0], colour, width=4.5, opacity=0.5, label="nonlinear")
    upper.line(s.t, both[1], "ink", width=1.4, dash="5 3", label="linear")
    lower = Panel(in_unit("difference", apart_unit), x=time, x_label=time_label()).zero().line(s.t, apart, colour)
    spans = "periods" if a.plant.motion.periodic else "durations"
    caption = (
        f"The full nonlinear equations over {s.t[-1] / a.plant.period:g} {spans} under the scene's loop, started on the rigid motion, "
        f"beside the linear prediction from the same start. {sentence(agreement(a, s))}"
    )
    return Picture("comparison", TITLE, caption, draw([Row([upper], 120), Row([lower], 60)], TITLE))


Curves = tuple[str, str, Array, Array, Array]


def compare_tips(s: Simulation) -> Curves:
    """The component of the tip error that is largest, and the distance of the two tips."""
    nonlinear, linear = s.tip - s.tip_rigid, s.tip_linear - s.tip_rigid
    axis = int(np.argmax(np.abs(nonlinear).max(axis=0)))
    distance = np.linalg.norm(s.tip - s.tip_linear, axis=1)
    return f"tip error along {'xyz'[axis]}", "m", nonlinear[:, axis], linear[:, axis], distance


def compare_first_coordinate(a: Analysis, s: Simulation) -> Curves:
    """The first coordinate's deviation."""
    nonlinear, linear = s.nonlinear[:, 0], s.linear[:, 0]
    return f"{a.plant.names[0]}", name_coordinate_unit(a, 0), nonlinear, linear, nonlinear - linear
