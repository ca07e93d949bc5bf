"""Mode shapes: how the arm swings about one place of its motion, if it is held still there."""

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.checks import Array
from flexlin.periodic.floquet.frozen import REAL
from flexlin.report.figures.style import Picture, choose_colour
from flexlin.report.tracing import trace_arm
from flexlin.report.wording import format_duration, is_dimensionless
from flexlin.svg import Panel, Row, draw

TITLE = "Mode shapes"
COLUMNS, MOST, FOLDED = 4, 8, 40
SWING = 0.15
"""The largest displacement in a picture, against the arm's size."""
SMALL = 1e-6
"""The deflection from which a picture is magnified, in rad or m: it is that of the linear equations."""
HEIGHT = 130.0
SIGHT = np.array([[-1.0, 1.0, 0.0], [-1.0, -1.0, 2.0]]) / np.sqrt([[2.0], [6.0]])
"""An arm in space is seen from (1, 1, 1), with z upwards."""


def draw_modes(a: Analysis) -> Picture | None:
    """A panel for each mode of the scene's own loop at t = 0, slowest oscillation first; modes that do not oscillate come last."""
    if a.arm.points is None:
        return None
    values, vectors = np.linalg.eig(a.closed.state_matrix(np.zeros(1))[0])
    order = order_modes(values)[: MOST + FOLDED]
    energy = np.sqrt(np.maximum(np.diagonal(a.coefficients.M[0]), 0.0))
    leading = [int(np.argmax(np.abs(vectors[: a.plant.n, i]) * energy)) for i in order]
    rest, swings = bend_arm(a, [turn_real(vectors[: a.plant.n, i], k) for i, k in zip(order, leading, strict=True)])
    panels = [
        draw_mode(a, complex(values[i]), k, rest, swing) for i, k, swing in zip(order, leading, swings, strict=True)
    ]
    rows, others = arrange_modes(panels[:MOST]), panels[MOST:]
    folded = tuple(draw(arrange_modes(others[i : i + MOST]), TITLE) for i in range(0, len(others), MOST))
    caption = (
        "How the arm swings under the scene's loop if it is held still at t = 0 (coefficients frozen there): the shapes behind the "
        "frequencies above. Strong and faint: the two ends of the swing, magnified. Grey: the arm at rest. Below each: the coordinate that "
        "moves most, by its share of the kinetic energy, and how fast the mode decays. A mode without frequency creeps back, or grows."
    )
    return Picture("modes", TITLE, caption, draw(rows, TITLE), folded, f"The {len(others)} other modes")


def arrange_modes(panels: list[Panel]) -> list[Row]:
    """Panels in rows of four."""
    columns = min(COLUMNS, max(3, len(panels)))
    return [Row(panels[i : i + columns], HEIGHT, (1.0,) * columns) for i in range(0, len(panels), columns)]


def order_modes(values: Array) -> list[int]:
    """One of each pair by rising frequency, then those without by falling growth rate."""
    turning = [i for i in range(len(values)) if values[i].imag > REAL * abs(values[i])]
    real = [i for i in range(len(values)) if abs(values[i].imag) <= REAL * abs(values[i])]
    return [*sorted(turning, key=lambda i: values[i].imag), *sorted(real, key=lambda i: -values[i].real)]


def turn_real(shape: Array, leading: int) -> Array:
    """The displacement (n,) of a mode when the leading coordinate is at the end of its swing, its largest entry 1."""
    turned = np.real(shape * np.conj(shape[leading]) / max(abs(shape[leading]) ** 2, 1e-300))
    return turned / (np.abs(turned).max() or 1.0)


def draw_mode(a: Analysis, value: complex, leading: int, rest: list[Array], swing: list[Array]) -> Panel:
    """One mode: both ends of its swing over the arm at rest."""
    frequency = f"{value.imag / (2 * np.pi):.4g}{'' if is_dimensionless() else ' Hz'}"
    panel = Panel(frequency if value.imag > REAL * abs(value) else "no oscillation", equal=True, bare=True)
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
    if abs(value.real) <= REAL * abs(value) or value.real == 0:
        return "undamped" if abs(value) else "drifts"
    return f"{'halves' if value.real < 0 else 'doubles'} in {format_duration(np.log(2) / abs(value.real))}"


def bend_arm(a: Analysis, shapes: list[Array]) -> tuple[list[Array], list[list[Array]]]:
    """Curves of the links at rest at t = 0, and their displacements along deflections (n,), scaled to be seen."""
    states = SMALL * np.array([np.zeros(a.plant.n), *shapes])
    seen = [
        [curve if len(curve) == 2 else SIGHT @ curve for curve in arm]
        for arm in trace_arm(a.closed, np.zeros(len(states)), states)
    ]
    rest, *bent = seen
    size = float(np.ptp(np.concatenate(rest, axis=1), axis=1).max()) or 1.0
    swings = []
    for curves in bent:
        moved = [(after - before) / SMALL for before, after in zip(rest, curves, strict=True)]
        largest = max(float(np.linalg.norm(part, axis=0).max()) for part in moved)
        factor = SWING * size / largest if np.isfinite(largest) and largest > 0 else 0.0
        swings.append([factor * part for part in moved])
    return rest, swings
