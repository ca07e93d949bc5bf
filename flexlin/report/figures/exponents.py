"""Floquet exponents, multipliers and frozen frequencies of all loops, and how the arm swings about one place of its motion."""

from collections.abc import Sequence
from itertools import cycle

import numpy as np
from scipy.linalg import helmert

from flexlin.analyses.analysis import Analysis
from flexlin.analyses.judging import Loop
from flexlin.checks import Array
from flexlin.periodic.floquet.modes import follow_frozen_modes
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.plots.panel import Panel
from flexlin.plots.scales import Linear, Logarithmic
from flexlin.precision import CUBE_ROOT_EPS, ROOT_EPS, SLIGHT
from flexlin.report.figures import SHAPES, Picture, choose_colour, choose_scale, make_period_panel, make_picture, resize
from flexlin.report.figures.over_period import trace_arm
from flexlin.report.wording import colour, format_duration, format_modulus, in_unit, with_unit

FROZEN = (
    "the arm held still at each place of its motion (its coefficients frozen), and the frequencies at which it would ring there. A line "
    "follows one mode by its shape, through crossings; it ends where the mode does not oscillate, but creeps back or falls over."
)


def draw_exponents(a: Analysis) -> Picture:
    """The complex plane on the left, frozen frequencies over the period on the right; these alone where there are no exponents."""
    known = [(loop.floquet, loop, shape) for loop, shape in zip(a.loops, cycle(SHAPES), strict=False) if loop.floquet]
    if not known:
        alone = resize([draw_frozen(a)], 190.0, 2)
        return make_picture("exponents", "Frequencies", f"{FROZEN[0].upper()}{FROZEN[1:]}", alone)
    caption = (
        "Left: Floquet exponents by growth rate and frequency; a mode left of the line decays. Frequencies are known modulo "
        f"1/T = {with_unit(f'{1 / a.plant.period:.4g}', 'Hz')} and shown from 0 to half of that. Right: {FROZEN}"
    )
    panels = resize([draw_plane(a, known), draw_frozen(a)], 190.0, 2)
    return make_picture("exponents", "Exponents and frequencies", caption, panels)


def draw_plane(a: Analysis, known: Sequence[tuple[FloquetResult, Loop, str]]) -> Panel:
    """Growth rate, on a scale that is linear near zero and logarithmic beyond, against frequency."""
    rates = np.concatenate([found.exponents.real for found, *_ in known])
    errors = np.concatenate([found.errors for found, *_ in known])
    ends = Linear(-0.03 / a.plant.period, 0.53 / a.plant.period)
    panel = Panel("Floquet exponents", choose_scale(rates, errors), ends, in_unit("growth rate", "1/s"))
    panel.y_label = f"{in_unit('frequency', 'Hz')}, modulo 1/T"
    panel.line([0, 0], ends.ends, "ink", width=1.3)
    for found, loop, shape in known:
        upper = found.exponents[found.exponents.imag >= -found.errors]
        frequency = np.abs(upper.imag) / (2 * np.pi)
        said = zip(upper.real, (with_unit(f"{f:.4g}", "Hz") for f in frequency), strict=True)
        texts = [f"{loop.name}: growth rate {with_unit(f'{rate:.5g}', '1/s')}, frequency {f}" for rate, f in said]
        panel.dots(upper.real, frequency, choose_colour(a, loop), shape, 4.2, label=loop.name, texts=texts)
    return panel


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
    panels = resize([draw_circle(a, loop) for loop in a.loops], 165.0, 4)
    return make_picture("multipliers", "Multipliers on the unit circle", CIRCLE, panels)


def scale_radius(log10: Array) -> Array:
    """A monotone map of log10 |mu| with radius(-inf) = 0, radius(-4) = 1/2, radius(0) = 1, radius(inf) = 2, as smooth at 1 as elsewhere."""
    inside = 4 / (4 + np.abs(log10))
    return np.where(log10 <= 0, inside, 2 - inside)


def draw_circle(a: Analysis, loop: Loop) -> Panel:
    """The unit circle, its rings, and the multipliers of one loop; the view grows where one lies far outside."""
    logs = loop.floquet.log_multipliers if loop.floquet is not None else np.zeros(0, dtype=complex)
    footer = "no answer" if loop.floquet is None else f"{loop.verdict}, |µ| ≤ {format_modulus(logs[0].real)}"
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


SWING_SHARE = 0.15
"""The largest displacement in a picture, against the arm's size."""


def draw_modes(a: Analysis) -> Picture | None:
    """A panel for each mode of the scene's own loop at t = 0, slowest oscillation first; modes that do not oscillate come last."""
    if a.plant.arm.near.points is None:
        return None
    values, vectors = np.linalg.eig(a.closed.A(np.zeros(1))[0])
    turns = np.abs(values.imag) > ROOT_EPS * np.abs(values)
    kept = np.flatnonzero(~turns | (values.imag > 0))  # one of each pair, by frequency; then those without, by growth
    order = kept[np.lexsort([np.where(turns, values.imag, -values.real)[kept], ~turns[kept]])][:48]
    energy = np.sqrt(np.maximum(np.diagonal(a.coefficients.M[0]), 0.0))
    leading = [int(np.argmax(np.abs(vectors[: a.plant.n, i]) * energy)) for i in order]
    # when the leading coordinate is at the end of its swing
    turned = [np.real(vectors[: a.plant.n, i] / (vectors[k, i] or 1.0)) for i, k in zip(order, leading, strict=True)]
    rest, swings = bend_arm(a, [shape / (np.abs(shape).max() or 1.0) for shape in turned])
    modes = zip(values[order].tolist(), leading, swings, strict=True)
    panels = resize([draw_mode(a, value, k, rest, swing) for value, k, swing in modes], 130.0, 4)
    caption = (
        "How the arm swings under the scene's loop if it is held still at t = 0 (coefficients frozen there): the shapes behind the "
        "frequencies above. Strong and faint: the two ends of the swing, magnified. Grey: the arm at rest. Below each: the coordinate that "
        "moves most, by its share of the kinetic energy, and how fast the mode decays. A mode without frequency creeps back, or grows."
    )
    shown, others = panels[:8], panels[8:]
    return make_picture("modes", "Mode shapes", caption, shown, (), ("other modes", others))


def draw_mode(a: Analysis, value: complex, leading: int, rest: list[Array], swing: list[Array]) -> Panel:
    """One mode: both ends of its swing over the arm at rest."""
    frequency = with_unit(f"{value.imag / (2 * np.pi):.4g}", "Hz")
    panel = Panel(frequency if value.imag > ROOT_EPS * abs(value) else "no oscillation", equal=True, bare=True)
    panel.footer = f"{a.plant.names[leading]}, {describe_decay(value)}"
    for sign, opacity in ((-1, 0.35), (1, 1.0)):
        for still, moved in zip(rest, swing, strict=True):
            line = still + sign * moved
            panel.line(line[0], line[1], choose_colour(a, a.own), width=1.6, opacity=opacity)
    for still in rest:
        panel.line(still[0], still[1], "faint", width=1.0, dash="3 2")
    return panel.dots([rest[0][0, 0]], [rest[0][1, 0]], "ink", size=2.5)


def describe_decay(value: complex) -> str:
    """Halves in 12 ms, doubles in 2 s, undamped."""
    if abs(value.real) <= ROOT_EPS * abs(value) or value.real == 0:
        return "undamped" if abs(value) else "drifts"
    return f"{'halves' if value.real < 0 else 'doubles'} in {format_duration(np.log(2) / abs(value.real))}"


def bend_arm(a: Analysis, shapes: list[Array]) -> tuple[list[Array], list[list[Array]]]:
    """Curves of the links at rest at t = 0, and their displacements along deflections (n,), scaled to be seen.

    They are those of the linear equations: magnified from deflections of `CUBE_ROOT_EPS`, in rad or m.
    """
    states = CUBE_ROOT_EPS * np.array([np.zeros(a.plant.n), *shapes])
    sight = -helmert(3)  # the directions across and up in space, seen from (1, 1, 1) with z upwards
    arms = trace_arm(a.closed, np.zeros(len(states)), states)
    rest, *bent = ([curve if len(curve) == 2 else sight @ curve for curve in arm] for arm in arms)
    size = float(np.ptp(np.concatenate(rest, axis=1), axis=1).max()) or 1.0
    swings = []
    for curves in bent:
        moved = [(after - before) / CUBE_ROOT_EPS for before, after in zip(rest, curves, strict=True)]
        largest = max(float(np.linalg.norm(part, axis=0).max()) for part in moved)
        factor = SWING_SHARE * size / largest if np.isfinite(largest) and largest > 0 else 0.0
        swings.append([factor * part for part in moved])
    return rest, swings
