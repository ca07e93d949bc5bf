"""The arm along its motion, bent by the periodic response, and how it swings about one place of it."""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import helmert

from flexlin.about.linearization import Linearization
from flexlin.answers.analysis import Analysis
from flexlin.checks import Array
from flexlin.control.tracking import arm_positions
from flexlin.mechanics.axes import COLUMNS
from flexlin.periodic.precision import CUBE, ROOT
from flexlin.plots.panel import Panel
from flexlin.report.figures import (
    Picture,
    choose_colour,
    choose_views,
    make_period_panel,
    make_picture,
    resize,
    share_width,
    style_part,
)
from flexlin.report.wording import format_duration, in_unit, name_joint_unit, with_unit


def trace_arm(lin: Linearization, t: Array, states: Array) -> list[list[Array]]:
    """The axis of each link at each time, (2, k) or (3, k), for deviations (N, n) or (N, 2n) from the rigid motion.

    Each link begins where the one before it ends. Links of a model that does not say how they bend are straight, from joint to joint.
    """
    if lin.arm.near.axes is None:
        points, _ = arm_positions(lin, t, states)
        return [[at[:, i : i + 2] for i in range(at.shape[1] - 1)] for at in points]
    axes = lin.about.of_arm("axes", t, states[:, : lin.n])
    links = np.split(axes, axes.shape[2] // COLUMNS, axis=2)
    kept = [find_corners(curves) for curves in links]
    return [[curves[k][:, own] for curves, own in zip(links, kept, strict=True)] for k in range(len(t))]


def find_corners(curves: Array) -> list[int]:
    """Which points of a link's axis (N, d, COLUMNS) draw it: both ends of a straight one, all of one that bends, and a piece before it.

    Straight is what is off a line by no more than `ROOT`, relative to what it sweeps.
    """
    base, tip = curves[:, :, 1:2], curves[:, :, -1:]
    off = curves[:, :, 1:] - base - (tip - base) * np.linspace(0.0, 1.0, COLUMNS - 1)
    size = max(float(np.ptp(curves)), 1e-300)
    own = [1, COLUMNS - 1] if np.abs(off).max() <= ROOT * size else list(range(1, COLUMNS))
    before = np.abs(curves[:, :, 0] - curves[:, :, 1]).max() > ROOT * size
    return [0, *own] if before else own


PHASES = 12
"""Pictures of the arm in one period."""


def draw_arm(a: Analysis) -> Picture:
    """The arm at equal steps of a period, and its joints' motion and feedforward torques beside it."""
    caption, title = "Joint motion and feedforward of the rigid motion over one period.", "The arm along its motion"
    beside, half = draw_beside(a), (share_width(2),)
    if a.arm.near.points is None:
        return make_picture("arm", title, caption, resize(beside, 110.0, half))
    known = "bent by the steady response under the scene's loop"
    bent = known if a.response else "rigid, because there is no steady response"
    caption = (
        f"The arm at {PHASES} equal steps of a period, {bent}, to scale; later pictures are stronger. Grey: the rigid motion. "
        f"Red: the path of the tip. Beside it: {caption[0].lower()}{caption[1:]}"
    )
    views = draw_stroboscope(a)
    if len(views) == 1:
        panels = [*resize(views, 220.0, half), *resize(beside, 220.0, (share_width(4),))]
    else:
        panels = [*resize(views, 220.0, (share_width(3),)), *resize(beside, 110.0, half)]
    return make_picture("arm", title, caption, panels)


def draw_beside(a: Analysis) -> list[Panel]:
    """Joint angles in degrees, or displacements in m, and what the arm would need if its links were rigid: torque, force or voltage."""
    t, joints = a.t[:-1], range(a.arm.joints)  # at the last sample a turning joint begins anew
    q, units = a.plant.motion.sample(t)[0], [name_joint_unit(a, joint) for joint in joints]
    motion = np.where([unit == "rad" for unit in units], np.degrees(q), q)
    shown, names = ["°" if unit == "rad" else unit for unit in units], [name_joint(a, joint) for joint in joints]
    given = draw_groups(a, "feedforward", a.plant.driven, a.plant.inputs, a.plant.input_units, a.t, a.coefficients.tau)
    return [*draw_groups(a, "", joints, names, shown, t, motion), *given]


def draw_groups(
    a: Analysis, what: str, joints: Sequence[int], names: Sequence[str], units: Sequence[str], t: Array, curves: Array
) -> list[Panel]:
    """A panel for each unit with the curves (N, k) that have it; what is alone in one, in an arm of several joints, is named."""
    panels = []
    for unit in sorted(set(units)):
        chosen = [i for i, one in enumerate(units) if one == unit]
        title = f"{what} {names[chosen[0]]}".strip() if len(chosen) == 1 < a.arm.joints else what or "joints"
        panel = make_period_panel(a.plant.period, in_unit(title, unit))
        for i in chosen:
            colour, dash = style_part(joints[i])
            panel.line(t, curves[:, i], colour, dash=dash, label=names[i] if len(chosen) > 1 else "")
        panels.append(panel)
    return panels


def name_joint(a: Analysis, joint: int) -> str:
    """The name of a joint that follows the motion: q1, left q1."""
    moved = np.abs(np.array(a.arm.reference)[:, joint])
    named = [i for i in np.flatnonzero(moved) if a.arm.coordinates[i].kind == "joint"]
    return a.arm.names[named[0] if named else a.arm.drives[joint]]


def draw_stroboscope(a: Analysis) -> list[Panel]:
    """The arm at equal steps of a period, seen along each axis that it is not flat to."""
    states = a.response.states if a.response else np.zeros((len(a.t), 2 * a.plant.n))
    bent, _ = arm_positions(a.plant, a.t, states)
    picked = np.arange(PHASES) * (len(a.t) - 1) // PHASES
    still, moving = (
        [np.concatenate(links, axis=1) for links in trace_arm(a.plant, a.t[picked], x[picked])]
        for x in (np.zeros_like(states), states)
    )
    panels = []
    for across, up in choose_views(bent.shape[1]):
        title = "the arm" if bent.shape[1] == 2 else f"the arm along {'xyz'[3 - across - up]}"
        panel = Panel(title, x_label=in_unit("xyz"[across], "m"), y_label=in_unit("xyz"[up], "m"), equal=True)
        for curve in still:
            panel.line(curve[across], curve[up], "faint", width=0.8, opacity=0.5)
        for k, curve in enumerate(moving):
            panel.line(curve[across], curve[up], "blue", width=2.0, opacity=0.25 + 0.75 * (k + 1) / PHASES)
        panel.line(bent[:, across, -1], bent[:, up, -1], "rose", width=1.5)
        panels.append(panel.dots(bent[picked[-1], across, :-1], bent[picked[-1], up, :-1], "ink", size=3.5))
    return panels


SWING = 0.15
"""The largest displacement in a picture, against the arm's size."""


def draw_modes(a: Analysis) -> Picture | None:
    """A panel for each mode of the scene's own loop at t = 0, slowest oscillation first; modes that do not oscillate come last."""
    if a.arm.near.points is None:
        return None
    values, vectors = np.linalg.eig(a.closed.A(np.zeros(1))[0])
    order = order_modes(values)[:48]
    energy = np.sqrt(np.maximum(np.diagonal(a.coefficients.M[0]), 0.0))
    leading = [int(np.argmax(np.abs(vectors[: a.plant.n, i]) * energy)) for i in order]
    # when the leading coordinate is at the end of its swing
    turned = [np.real(vectors[: a.plant.n, i] / (vectors[k, i] or 1.0)) for i, k in zip(order, leading, strict=True)]
    rest, swings = bend_arm(a, [shape / (np.abs(shape).max() or 1.0) for shape in turned])
    modes = zip(values[order].tolist(), leading, swings, strict=True)
    panels = resize([draw_mode(a, value, k, rest, swing) for value, k, swing in modes], 130.0, (share_width(4),))
    caption = (
        "How the arm swings under the scene's loop if it is held still at t = 0 (coefficients frozen there): the shapes behind the "
        "frequencies above. Strong and faint: the two ends of the swing, magnified. Grey: the arm at rest. Below each: the coordinate that "
        "moves most, by its share of the kinetic energy, and how fast the mode decays. A mode without frequency creeps back, or grows."
    )
    shown, others = panels[:8], panels[8:]
    return make_picture("modes", "Mode shapes", caption, shown, (), others, f"The {len(others)} other modes")


def order_modes(values: Array) -> list[int]:
    """One of each pair by rising frequency, then those without by falling growth rate."""
    turning = [i for i in range(len(values)) if values[i].imag > ROOT * abs(values[i])]
    real = [i for i in range(len(values)) if abs(values[i].imag) <= ROOT * abs(values[i])]
    return [*sorted(turning, key=lambda i: values[i].imag), *sorted(real, key=lambda i: -values[i].real)]


def draw_mode(a: Analysis, value: complex, leading: int, rest: list[Array], swing: list[Array]) -> Panel:
    """One mode: both ends of its swing over the arm at rest."""
    frequency = with_unit(f"{value.imag / (2 * np.pi):.4g}", "Hz")
    panel = Panel(frequency if value.imag > ROOT * abs(value) else "no oscillation", equal=True, bare=True)
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
    if abs(value.real) <= ROOT * abs(value) or value.real == 0:
        return "undamped" if abs(value) else "drifts"
    return f"{'halves' if value.real < 0 else 'doubles'} in {format_duration(np.log(2) / abs(value.real))}"


def bend_arm(a: Analysis, shapes: list[Array]) -> tuple[list[Array], list[list[Array]]]:
    """Curves of the links at rest at t = 0, and their displacements along deflections (n,), scaled to be seen.

    They are those of the linear equations: magnified from deflections of `CUBE`, in rad or m.
    """
    states = CUBE * np.array([np.zeros(a.plant.n), *shapes])
    sight = -helmert(3)  # the directions across and up in space, seen from (1, 1, 1) with z upwards
    seen = [
        [curve if len(curve) == 2 else sight @ curve for curve in arm]
        for arm in trace_arm(a.closed, np.zeros(len(states)), states)
    ]
    rest, *bent = seen
    size = float(np.ptp(np.concatenate(rest, axis=1), axis=1).max()) or 1.0
    swings = []
    for curves in bent:
        moved = [(after - before) / CUBE for before, after in zip(rest, curves, strict=True)]
        largest = max(float(np.linalg.norm(part, axis=0).max()) for part in moved)
        factor = SWING * size / largest if np.isfinite(largest) and largest > 0 else 0.0
        swings.append([factor * part for part in moved])
    return rest, swings
