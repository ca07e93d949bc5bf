"""Floquet exponents of all loops, and the natural frequencies that the arm would have if it were frozen along its motion."""

import numpy as np

from flexlin.about.linear import Linearization
from flexlin.answers.analysis import Analysis
from flexlin.answers.judging import Loop
from flexlin.checks import Array
from flexlin.report.figures.style import SHAPES, Picture, choose_loop_colour, make_period_panel
from flexlin.svg import Linear, Panel, Row, Symlog, draw

TITLE = "Exponents and frequencies"


def draw_exponents(a: Analysis) -> Picture:
    """The complex plane on the left, frozen frequencies over the period on the right."""
    rows = [Row([draw_plane(a), draw_frozen(a)], 190, (1.4, 1.0))]
    return Picture("exponents", TITLE, write_caption(1 / a.plant.period), draw(rows, TITLE))


def write_caption(frequency: float) -> str:
    """What the axes mean."""
    return (
        "Left: Floquet exponents by growth rate and frequency; a mode left of the line decays. Frequencies are known modulo "
        f"1/T = {frequency:.4g} Hz and shown from 0 to half of that. Right: natural frequencies of the coefficients frozen at "
        "each time, which show the physical mode behind it."
    )


def draw_plane(a: Analysis) -> Panel:
    """Growth rate, on a scale that is linear near zero and logarithmic beyond, against frequency."""
    known = [(loop, i) for i, loop in enumerate(a.loops) if loop.floquet is not None]
    half = 0.5 / a.plant.period
    panel = Panel(
        "Floquet exponents", x=Symlog(find_smallest_rate([loop for loop, _ in known])), y=Linear(-0.06 * half, 1.06 * half),
        x_label="growth rate in 1/s", y_label="frequency in Hz, modulo 1/T",
    )  # fmt: skip
    panel.line([0, 0], [-0.06 * half, 1.06 * half], "ink", width=1.3)
    for loop, i in known:
        assert loop.floquet is not None
        upper = loop.floquet.exponents[loop.floquet.exponents.imag >= -loop.floquet.errors]
        frequency = np.abs(upper.imag) / (2 * np.pi)
        texts = [f"{loop.name}: {value.real:.5g} 1/s, {f:.4g} Hz" for value, f in zip(upper, frequency, strict=True)]
        shape = SHAPES[i % len(SHAPES)]
        panel.dots(upper.real, frequency, choose_loop_colour(loop, i), shape, 4.2, label=loop.name, texts=texts)
    return panel


def find_smallest_rate(loops: list[Loop]) -> float:
    """The power of ten below the smallest growth rate that is not just noise."""
    known = [loop.floquet.exponents.real for loop in loops if loop.floquet is not None]
    rates = np.abs(np.concatenate([np.empty(0), *known]))
    clear = rates[rates > 1e-6 * max(1e-3, float(rates.max(initial=0.0)))]
    return float(10 ** np.floor(np.log10(clear.min()))) if clear.size else 1.0


def draw_frozen(a: Analysis) -> Panel:
    """Frequencies of the eigenvalues of A(t) over the period: open loop and own loop."""
    panel = make_period_panel(a.plant.period, "natural frequencies, frozen")
    curves: list[tuple[Linearization, str, str]] = [(a.plant, "faint", "open loop")]
    if a.own is not a.loops[0]:
        curves.append((a.closed, "blue", a.own.name))
    t, found = a.t[::2], []
    for linearization, colour, label in curves:
        found.append(compute_frozen_frequencies(linearization, t))
        for k, frequency in enumerate(found[-1].T):
            panel.line(t, frequency, colour, label=label if k == 0 else "")
    clear = np.concatenate([f.ravel() for f in found])
    clear = clear[clear > 1e-3 * max(float(clear.max()), 1e-12)]
    panel.y = Symlog(float(10 ** np.floor(np.log10(clear.min()))) if clear.size else 1.0)
    panel.y_label = "frequency in Hz"
    return panel


def compute_frozen_frequencies(linearization: Linearization, t: Array) -> Array:
    """|Im| / 2 pi of the eigenvalues of A(t), (N, n) in Hz, one of each pair."""
    values = np.linalg.eigvals(linearization.state_matrix(t))
    return np.sort(np.abs(values.imag), axis=1)[:, ::2] / (2 * np.pi)
