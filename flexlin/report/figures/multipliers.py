"""Floquet multipliers beside the unit circle, one panel a loop, with a radius that shows 1 and 1e-30 alike."""

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.answers.judging import Loop
from flexlin.checks import Array
from flexlin.report.figures.style import Picture, choose_colour
from flexlin.report.wording import format_largest_multiplier, format_modulus
from flexlin.svg import Linear, Panel, Row, draw

COLUMNS = 4
RINGS = (-30, -10, -3, -1)
"""Powers of ten at which a dashed ring is drawn."""
HALF = 4.0
"""The power of ten that lies half-way between the centre and the unit circle."""
REACH = 1.24
TURN = np.linspace(0.0, 2 * np.pi, 91)
TITLE = "Multipliers on the unit circle"
CAPTION = (
    "One dot a Floquet multiplier µ: what a disturbance is multiplied by over one period. Inside the circle it decays. The angle "
    "is that of µ; the distance from the centre follows log |µ| (dashed rings: 0.1, 10⁻³, 10⁻¹⁰, 10⁻³⁰), so that slow and fast modes "
    "can be read in one picture."
)


def draw_multipliers(a: Analysis) -> Picture | None:
    """A unit circle for each loop; none for a motion that ends."""
    if not a.plant.motion.periodic:
        return None
    panels = [draw_circle(loop, choose_colour(a, loop)) for loop in a.loops]
    columns = min(COLUMNS, max(3, len(panels)))
    rows = [Row(panels[i : i + columns], 165) for i in range(0, len(panels), columns)]
    return Picture("multipliers", TITLE, CAPTION, draw(rows, TITLE))


def scale_radius(log10: Array) -> Array:
    """A monotone map of log10 |mu| with radius(-inf) = 0, radius(0) = 1, radius(inf) = 2, as smooth at 1 as it is elsewhere."""
    inside = HALF / (HALF + np.maximum(-log10, 0.0))
    outside = HALF / (HALF + np.maximum(log10, 0.0))
    return np.where(log10 <= 0, inside, 2.0 - outside)


def write_footer(loop: Loop) -> str:
    """The verdict with the largest modulus, or that there is none."""
    return "no answer" if loop.floquet is None else f"{loop.verdict}, largest |µ| = {format_largest_multiplier(loop)}"


def draw_circle(loop: Loop, colour: str) -> Panel:
    """The unit circle, its rings, and the multipliers of one loop; the view grows where one lies far outside."""
    logs = loop.floquet.log_multipliers if loop.floquet is not None else np.zeros(0, dtype=complex)
    r = scale_radius(logs.real / np.log(10))
    reach = max(REACH, float(r.max(initial=0.0)) + 0.15)
    view = Linear(-reach, reach)
    panel = Panel(
        loop.name,
        x=view,
        y=view,
        equal=True,
        bare=True,
        footer=write_footer(loop),
        footer_colour=loop.verdict if loop.floquet is not None else "faint",
    )
    panel.area(np.cos(TURN), np.sin(TURN), "shade")
    for power in RINGS:
        size = float(scale_radius(np.array(power)))
        panel.line(size * np.cos(TURN), size * np.sin(TURN), "faint", width=0.7, dash="2 3", opacity=0.7)
    panel.line([-1.12, 1.12], [0, 0], "grid", width=0.8).line([0, 0], [-1.12, 1.12], "grid", width=0.8)
    panel.line(np.cos(TURN), np.sin(TURN), "ink", width=1.3)
    texts = [f"|µ| = {format_modulus(log.real)}, angle {np.degrees(log.imag):.1f}°" for log in logs]
    return panel.dots(r * np.cos(logs.imag), r * np.sin(logs.imag), colour, size=4.2, texts=texts)
