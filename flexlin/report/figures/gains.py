"""The gains of the designs over a period, beside the scene's own."""

from dataclasses import replace

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.checks import Array
from flexlin.report.figures.style import DASHES, Picture, arrange_in_columns, choose_loop_colour, make_period_panel
from flexlin.report.wording import name_input_units
from flexlin.svg import Panel, draw

MOST = 12
TITLE = "Gains over a period"


def draw_gains(a: Analysis) -> Picture | None:
    """A panel for each entry of K(t)."""
    if not any(loop.design is not None for loop in a.loops):
        return None
    states = [*a.plant.names, *[f"{name}′" for name in a.plant.names]]
    pairs = [(i, j) for i in range(len(a.plant.inputs)) for j in range(len(states))]
    panels = [make_period_panel(a.plant.period, f"{a.plant.inputs[i]} from {states[j]}") for i, j in pairs[:MOST]]
    for position, loop in enumerate(a.loops):
        if loop.design is not None:
            add_gain(
                panels,
                pairs,
                a,
                loop.design.K(a.t),
                choose_loop_colour(loop, position),
                DASHES[position % 2],
                loop.name,
            )
    own = a.closed.law.gain(a.t)
    if np.any(own):
        add_gain(panels, pairs, a, own, "faint", "2 3", a.own.name)
    legend = panels[0].legend
    for panel in panels:
        panel.marks = [replace(mark, label="") for mark in panel.marks]
    more = f" The first {MOST} of {len(pairs)} entries." if len(pairs) > MOST else ""
    unit = name_input_units(a)
    caption = f"Entries of the feedback gain in u = −K(t) [y; y′], in {unit} for each rad, m, rad/s or m/s of deviation.{more}"
    return Picture("gains", TITLE, caption, draw(arrange_in_columns(panels, 75), TITLE, legend))


def add_gain(
    panels: list[Panel], pairs: list[tuple[int, int]], a: Analysis, gain: Array, colour: str, dash: str, label: str
) -> None:
    """Add one gain to all panels."""
    for panel, (i, j) in zip(panels, pairs, strict=False):
        panel.line(a.t, gain[:, i, j], colour, dash=dash, label=label)
