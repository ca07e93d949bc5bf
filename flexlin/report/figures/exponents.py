"""Floquet exponents of all loops, and the natural frequencies of the arm held still at each place of its motion."""

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.answers.judging import Loop
from flexlin.periodic.floquet.frozen import follow_frozen_modes
from flexlin.report.figures.style import SHAPES, Picture, choose_colour, make_period_panel
from flexlin.report.wording import in_unit, is_dimensionless
from flexlin.svg import Linear, Logarithmic, Panel, Row, Symlog, draw

TITLE = "Exponents and frequencies"
FROZEN = (
    "the arm held still at each place of its motion (its coefficients frozen), and the frequencies at which it would ring there. A line "
    "follows one mode by its shape, through crossings; it ends where the mode does not oscillate, but creeps back or falls over."
)


def draw_exponents(a: Analysis) -> Picture:
    """The complex plane on the left, frozen frequencies over the period on the right; these alone where there are no exponents."""
    frozen = draw_frozen(a)
    if all(loop.floquet is None for loop in a.loops):
        caption = f"{FROZEN[0].upper()}{FROZEN[1:]}"
        return Picture("exponents", "Frequencies", caption, draw([Row([frozen], 190)], "Frequencies"))
    rows = [Row([draw_plane(a), frozen], 190, (1.2, 1.0))]
    return Picture("exponents", TITLE, write_caption(1 / a.plant.period), draw(rows, TITLE))


def write_caption(frequency: float) -> str:
    """What the axes mean."""
    return (
        "Left: Floquet exponents by growth rate and frequency; a mode left of the line decays. Frequencies are known modulo "
        f"1/T = {frequency:.4g}{'' if is_dimensionless() else ' Hz'} and shown from 0 to half of that. Right: {FROZEN}"
    )


def draw_plane(a: Analysis) -> Panel:
    """Growth rate, on a scale that is linear near zero and logarithmic beyond, against frequency."""
    known = [(loop, i) for i, loop in enumerate(a.loops) if loop.floquet is not None]
    half = 0.5 / a.plant.period
    panel = Panel(
        "Floquet exponents", x=Symlog(find_smallest_rate([loop for loop, _ in known])), y=Linear(-0.06 * half, 1.06 * half),
        x_label=in_unit("growth rate", "1/s"), y_label=f"{in_unit('frequency', 'Hz')}, modulo 1/T",
    )  # fmt: skip
    panel.line([0, 0], [-0.06 * half, 1.06 * half], "ink", width=1.3)
    for loop, i in known:
        assert loop.floquet is not None
        upper = loop.floquet.exponents[loop.floquet.exponents.imag >= -loop.floquet.errors]
        frequency = np.abs(upper.imag) / (2 * np.pi)
        rate, cycle = ("", "") if is_dimensionless() else (" 1/s", " Hz")
        pairs = zip(upper.real, frequency, strict=True)
        texts = [f"{loop.name}: growth rate {value:.5g}{rate}, frequency {f:.4g}{cycle}" for value, f in pairs]
        shape = SHAPES[i % len(SHAPES)]
        panel.dots(upper.real, frequency, choose_colour(a, loop), shape, 4.2, label=loop.name, texts=texts)
    return panel


def find_smallest_rate(loops: list[Loop]) -> float:
    """The power of ten below the smallest growth rate that is not just noise."""
    known = [loop.floquet.exponents.real for loop in loops if loop.floquet is not None]
    rates = np.abs(np.concatenate([np.empty(0), *known]))
    clear = rates[rates > 1e-6 * max(1e-3, float(rates.max(initial=0.0)))]
    return float(10 ** np.floor(np.log10(clear.min()))) if clear.size else 1.0


def draw_frozen(a: Analysis) -> Panel:
    """Frequencies of the eigenvalues of A(t) over the period: open loop and own loop."""
    panel = make_period_panel(a.plant.period, "natural frequencies, arm held still")
    panel.y, panel.y_label = Logarithmic(), in_unit("frequency", "Hz")
    curves = [(a.closed, a.own)] if a.own is a.loops[0] else [(a.plant, a.open_loop), (a.closed, a.own)]
    t = a.t[::2]
    for linearization, loop in curves:
        known = None if loop.floquet is None else loop.floquet.resolved
        frequencies = follow_frozen_modes((known or linearization.state_matrix)(t)).frequencies
        for k, frequency in enumerate(frequencies[:, np.isfinite(frequencies).any(axis=0)].T):
            panel.line(t, frequency, choose_colour(a, loop), label=loop.name if k == 0 else "")
    return panel
