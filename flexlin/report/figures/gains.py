"""The gains of the designs over a period, beside the scene's own: those that matter first, the others folded."""

from dataclasses import replace

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.checks import Array
from flexlin.report.figures.coefficients import THIN, weigh_entries
from flexlin.report.figures.entries import choose_shown, name_gain_unit
from flexlin.report.figures.style import (
    Picture,
    arrange_in_columns,
    choose_colour,
    choose_dash,
    draw_folded,
    make_period_panel,
)
from flexlin.report.wording import in_unit
from flexlin.svg import draw

MOST, FOLDED = 12, 240
HEIGHT = 75.0
TITLE = "Gains over a period"
OWN_DASH = "2 3"


def draw_gains(a: Analysis) -> Picture | None:
    """A panel for each entry of the gain; each input has one at the least."""
    if not any(loop.design is not None for loop in a.loops):
        return None
    states = 2 * a.plant.n
    gains = [(loop, loop.design.K(a.t), choose_dash(a, loop)) for loop in a.loops if loop.design is not None]
    own = a.closed.law.gain(a.t)
    gains += [(a.own, own, OWN_DASH)] if np.any(own) else []
    remembers = any(gain.shape[2] > states for _, gain, _ in gains)
    gains = [(loop, gain[:, :, :states], dash) for loop, gain, dash in gains]
    weights = weigh_gains(a, np.max([np.abs(gain).max(axis=0) for _, gain, _ in gains], axis=0))
    groups = [range(i * states, (i + 1) * states) for i in range(len(a.plant.inputs))]
    shown = choose_shown(weights.ravel(), groups, MOST)
    rest = sorted((k for k in range(weights.size) if k not in shown), key=lambda k: -weights.flat[k])
    panels = {k: make_period_panel(a.plant.period, name_gain(a, *divmod(k, states))) for k in (*shown, *rest[:FOLDED])}
    for loop, gain, dash in gains:
        for k, panel in panels.items():
            (i, j), every = divmod(k, states), 1 if k in shown else THIN
            panel.line(a.t[::every], gain[::every, i, j], choose_colour(a, loop), dash=dash, label=loop.name)
    legend = next(iter(panels.values())).legend
    for panel in panels.values():
        panel.marks = [replace(mark, label="") for mark in panel.marks]
    svg = draw(arrange_in_columns([panels[k] for k in shown], HEIGHT), TITLE, legend)
    folded = draw_folded([panels[k] for k in sorted(rest[:FOLDED])], HEIGHT, TITLE)
    caption = "Entries of the feedback gain in u = −gain(t) [y; y′]: gain(input, state)."
    if remembers:
        caption += " What a controller's integrals and filters add is not drawn."
    if rest:
        caption += " Shown are those that act most on deflections of equal energy, one of each input at the least; others are folded below."
    return Picture("gains", TITLE, caption, svg, folded, f"The {len(rest[:FOLDED])} other entries")


def name_gain(a: Analysis, i: int, j: int) -> str:
    """The title of an entry: gain(q1, w11′) in N s."""
    n = a.plant.n
    state = f"{a.plant.names[j % n]}{'′' if j >= n else ''}"
    return in_unit(f"gain({a.plant.inputs[i]}, {state})", name_gain_unit(a, i, j))


def weigh_gains(a: Analysis, size: Array) -> Array:
    """What each input gives to deflections of equal energy, against its largest: |gain_ij| times 1/(m_j w_j), or 1/m_j for rates."""
    scales = weigh_entries(a)
    deflection = 1 / np.sqrt(1 / np.diagonal(scales["K"]))
    speed = np.sqrt(np.diagonal(scales["M"]))
    weight = size * np.concatenate([deflection, speed])
    return weight / np.maximum(weight.max(axis=1, keepdims=True), 1e-300)
