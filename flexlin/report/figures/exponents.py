"""Floquet exponents and multipliers of all loops, and the natural frequencies of the arm held still at each place of its motion."""

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.answers.judging import Loop
from flexlin.checks import Array
from flexlin.periodic.floquet.modes import follow_frozen_modes
from flexlin.periodic.precision import SLIGHT
from flexlin.plots.panel import Panel
from flexlin.plots.scales import Linear, Logarithmic, Symlog
from flexlin.report.figures import SHAPES, Picture, choose_colour, make_period_panel, make_picture, resize, share_width
from flexlin.report.wording import colour, format_largest_multiplier, format_modulus, in_unit, with_unit

FROZEN = (
    "the arm held still at each place of its motion (its coefficients frozen), and the frequencies at which it would ring there. A line "
    "follows one mode by its shape, through crossings; it ends where the mode does not oscillate, but creeps back or falls over."
)


def draw_exponents(a: Analysis) -> Picture:
    """The complex plane on the left, frozen frequencies over the period on the right; these alone where there are no exponents."""
    panels = [draw_frozen(a)] if all(loop.floquet is None for loop in a.loops) else [draw_plane(a), draw_frozen(a)]
    resize(panels, 190.0, (share_width(2),))
    if len(panels) == 1:
        return make_picture("exponents", "Frequencies", f"{FROZEN[0].upper()}{FROZEN[1:]}", panels)
    return make_picture("exponents", "Exponents and frequencies", write_caption(1 / a.plant.period), panels)


def write_caption(frequency: float) -> str:
    """What the axes mean."""
    return (
        "Left: Floquet exponents by growth rate and frequency; a mode left of the line decays. Frequencies are known modulo "
        f"1/T = {with_unit(f'{frequency:.4g}', 'Hz')} and shown from 0 to half of that. Right: {FROZEN}"
    )


def draw_plane(a: Analysis) -> Panel:
    """Growth rate, on a scale that is linear near zero and logarithmic beyond, against frequency."""
    known = [(loop, i) for i, loop in enumerate(a.loops) if loop.floquet is not None]
    half = 0.5 / a.plant.period
    panel = Panel(
        "Floquet exponents", x=Symlog(near=find_smallest_rate([loop for loop, _ in known])), y=Linear(-0.06 * half, 1.06 * half),
        x_label=in_unit("growth rate", "1/s"), y_label=f"{in_unit('frequency', 'Hz')}, modulo 1/T",
    )  # fmt: skip
    panel.line([0, 0], [-0.06 * half, 1.06 * half], "ink", width=1.3)
    for loop, i in known:
        assert loop.floquet is not None
        upper = loop.floquet.exponents[loop.floquet.exponents.imag >= -loop.floquet.errors]
        frequency = np.abs(upper.imag) / (2 * np.pi)
        pairs = zip(upper.real, frequency, strict=True)
        texts = [
            f"{loop.name}: growth rate {with_unit(f'{value:.5g}', '1/s')}, frequency {with_unit(f'{f:.4g}', 'Hz')}"
            for value, f in pairs
        ]
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
        frequencies = follow_frozen_modes((known or linearization.A)(t)).frequencies
        frequencies[frequencies * a.plant.period < SLIGHT] = np.nan  # where a mode begins to oscillate it falls to zero
        for k, frequency in enumerate(frequencies[:, np.isfinite(frequencies).any(axis=0)].T):
            panel.line(t, frequency, choose_colour(a, loop), label=loop.name if k == 0 else "")
    return panel


CIRCLE = (
    "One dot a Floquet multiplier µ: what a disturbance is multiplied by over one period. Inside the circle it decays. The angle "
    "is that of µ; the distance from the centre follows log |µ| (dashed rings: 0.1, 10⁻³, 10⁻¹⁰, 10⁻³⁰), so that slow and fast modes "
    "can be read in one picture."
)


def draw_multipliers(a: Analysis) -> Picture | None:
    """A unit circle for each loop; none for a motion that ends."""
    if not a.plant.motion.periodic:
        return None
    panels = resize([draw_circle(a, loop) for loop in a.loops], 165.0, (share_width(4),))
    return make_picture("multipliers", "Multipliers on the unit circle", CIRCLE, panels)


def scale_radius(log10: Array) -> Array:
    """A monotone map of log10 |mu| with radius(-inf) = 0, radius(-4) = 1/2, radius(0) = 1, radius(inf) = 2, as smooth at 1 as elsewhere."""
    inside = 4 / (4 + np.abs(log10))
    return np.where(log10 <= 0, inside, 2 - inside)


def draw_circle(a: Analysis, loop: Loop) -> Panel:
    """The unit circle, its rings, and the multipliers of one loop; the view grows where one lies far outside."""
    logs = loop.floquet.log_multipliers if loop.floquet is not None else np.zeros(0, dtype=complex)
    footer = "no answer" if loop.floquet is None else f"{loop.verdict}, largest |µ| = {format_largest_multiplier(loop)}"
    r = scale_radius(logs.real / np.log(10))
    reach, turn = max(1.24, float(r.max(initial=0.0)) + 0.15), np.linspace(0.0, 2 * np.pi, 91)
    view = Linear(-reach, reach)
    panel = Panel(loop.name, view, view, equal=True, bare=True, footer=footer)
    if loop.floquet is not None:
        panel.footer_colour = colour(loop, a.plant.period, a.validity(loop))
    panel.area(np.cos(turn), np.sin(turn), "shade")
    for power in (-30, -10, -3, -1):
        size = float(scale_radius(np.array(power)))
        panel.line(size * np.cos(turn), size * np.sin(turn), "faint", width=0.7, dash="2 3", opacity=0.7)
    panel.line([-1.12, 1.12], [0, 0], "grid", width=0.8).line([0, 0], [-1.12, 1.12], "grid", width=0.8)
    panel.line(np.cos(turn), np.sin(turn), "ink", width=1.3)
    texts = [f"|µ| = {format_modulus(log.real)}, angle {np.degrees(log.imag):.1f}°" for log in logs]
    return panel.dots(r * np.cos(logs.imag), r * np.sin(logs.imag), choose_colour(a, loop), size=4.2, texts=texts)
