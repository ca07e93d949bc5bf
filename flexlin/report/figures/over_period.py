"""Over a period: the arm along its motion, the coefficients and gains that matter most, steady motion, nonlinear beside linear."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import cycle

import numpy as np

from flexlin.analyses.analysis import Analysis
from flexlin.checks import SUM_ROUNDING, Array
from flexlin.control.tracking import arm_positions
from flexlin.linearization.linearization import Linearization
from flexlin.mechanics.links import COLUMNS
from flexlin.plots.panel import Mark, Panel
from flexlin.precision import ROOT_EPS, SLIGHT
from flexlin.report.advice import agreement, sentence
from flexlin.report.figures import DASHES, Picture, choose_colour, make_period_panel, make_picture, resize, style_part
from flexlin.report.wording import format_decimal, format_power, format_quantity, in_unit, page_unit, scale_values


def trace_arm(lin: Linearization, t: Array, states: Array) -> list[list[Array]]:
    """The axis of each link at each time, (2, k) or (3, k), for deviations (N, n) or (N, 2n) from the rigid motion.

    Each link begins where the one before it ends. Links of a model that does not say how they bend are straight, from joint to joint.
    """
    if lin.arm.near.axes is None:
        points, _ = arm_positions(lin, t, states)
        return [[at[:, i : i + 2] for i in range(at.shape[1] - 1)] for at in points]
    axes = lin.about.of_arm("axes", t, states[:, : lin.n])
    links = np.split(axes, axes.shape[2] // COLUMNS, axis=2)
    return [[curves[k] for curves in links] for k in range(len(t))]


ARM_PICTURES = 12
"""Pictures of the arm in one period."""


def draw_arm(a: Analysis) -> Picture:
    """The arm at equal steps of a period, and its joints' motion and feedforward torques beside it."""
    known, unknown = "bent by the steady response under the scene's loop", "rigid, because there is no steady response"
    other = "joint motion" + " and feedforward of the rigid motion" * bool(a.plant.inputs)
    caption = (
        f"The arm at {ARM_PICTURES} equal steps of a period, {known if a.response else unknown}, to scale; later pictures are stronger. "
        f"Grey: the rigid motion. Red: the path of the tip. Other panels: {other} over one period."
    )
    views = [] if a.plant.arm.near.points is None else draw_stroboscope(a)
    resize(views, 220.0, max(2, len(views)))
    beside = resize(draw_beside(a), *((220.0, 4) if len(views) == 1 else (110.0, 2)))
    if not views:
        caption = f"{other.capitalize()} over one period."
    return make_picture("arm", "The arm along its motion", caption, [*views, *beside])


def draw_beside(a: Analysis) -> list[Panel]:
    """Joint angles in degrees, or displacements in m, and what the arm would need if its links were rigid: torque, force or voltage."""
    t, joints = a.t[:-1], range(a.plant.arm.joints)  # at the last sample a turning joint begins anew
    units = [a.plant.arm.coordinates[a.plant.arm.drives[joint]].unit for joint in joints]
    q = a.plant.motion.sample(t)[0]
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
        title = f"{what} {names[chosen[0]]}".strip() if len(chosen) == 1 < a.plant.arm.joints else what or "joints"
        panel = make_period_panel(a.plant.period, title, unit)
        for i in chosen:
            colour, dash = style_part(joints[i])
            panel.line(t, curves[:, i], colour, dash=dash, label=names[i] if len(chosen) > 1 else "")
        panels.append(panel)
    return panels


def name_joint(a: Analysis, joint: int) -> str:
    """The name of a joint that follows the motion: q1, left q1."""
    moved = np.abs(np.array(a.plant.arm.reference)[:, joint])
    named = [i for i in np.flatnonzero(moved) if a.plant.arm.coordinates[i].kind == "joint"]
    return a.plant.arm.names[named[0] if named else a.plant.arm.drives[joint]]


def choose_views(dimension: int) -> tuple[tuple[int, int], ...]:
    """World axes across and up of the pictures of a path: one is enough for an arm in its plane."""
    return ((0, 1), (0, 2), (1, 2)) if dimension == 3 else ((0, 1),)


def draw_stroboscope(a: Analysis) -> list[Panel]:
    """The arm at equal steps of a period, seen along each axis that it is not flat to."""
    states = a.response.states if a.response else np.zeros((len(a.t), 2 * a.plant.n))
    bent, _ = arm_positions(a.plant, a.t, states)
    picked = np.arange(ARM_PICTURES) * (len(a.t) - 1) // ARM_PICTURES
    traced = (trace_arm(a.plant, a.t[picked], x[picked]) for x in (np.zeros_like(states), states))
    still, moving = ([np.concatenate(links, axis=1) for links in arms] for arms in traced)
    panels = []
    for across, up in choose_views(bent.shape[1]):
        title = "the arm" if bent.shape[1] == 2 else f"the arm along {'xyz'[3 - across - up]}"
        panel = Panel(title, x_label=in_unit("xyz"[across], "m"), y_label=in_unit("xyz"[up], "m"), equal=True)
        for curve in still:
            panel.line(curve[across], curve[up], "faint", width=0.8, opacity=0.5)
        for k, curve in enumerate(moving):
            panel.line(curve[across], curve[up], "blue", width=2.0, opacity=0.25 + 0.75 * (k + 1) / ARM_PICTURES)
        panel.line(bent[:, across, -1], bent[:, up, -1], "rose", width=1.5)
        panels.append(panel.dots(bent[picked[-1], across, :-1], bent[picked[-1], up, :-1], "ink", size=3.5))
    return panels


UNITS = {"M": ("kg", "kg m", "kg m²"), "D": ("N s/m", "N s", "N m s"), "K": ("N/m", "N", "N m")}
"""Of entries of a matrix, by how many of row and column are rotations."""


def name_entry(a: Analysis, matrix: str, i: int, j: int | None = None) -> str:
    """An entry by its coordinates: K(q1, w11), h(q1)."""
    return f"{matrix}({', '.join(a.plant.names[k] for k in (i, j) if k is not None)})"


def shift_from_mean(title: str, values: Array) -> tuple[str, Array]:
    """A title, and values whose axis can be read: from the mean where they are nearly flat."""
    mean = float(f"{np.mean(values):.5g}")
    if not 0 < np.ptp(values) < SLIGHT * np.abs(values).max():
        return title, values
    return f"{title} {'−' if mean > 0 else '+'} {format_decimal(abs(mean), 5)}", values - mean


MOST_PANELS = 12
"""Panels shown."""
FOLDED_STRIDE = 4
"""Every so many times are drawn of what is folded."""
COLOURS = {"M": "teal", "D": "wine", "K": "indigo", "h": "rose"}


def choose_shown(
    weights: Array, groups: Sequence[Sequence[int]], room: int = MOST_PANELS
) -> tuple[list[int], list[int]]:
    """Which panels are shown, and which are folded, each in their own order.

    Shown are the heaviest of each group (one a joint, say), then the heaviest of all; folded are the heaviest of the others.
    """
    heaviest = [max(group, key=lambda i: weights[i]) for group in groups if len(group)]
    order = list(dict.fromkeys([*heaviest, *np.argsort(-weights, kind="stable").tolist()]))
    most = max(room, len(set(heaviest)))
    return sorted(order[:most]), sorted(order[most : most + 240])


@dataclass(frozen=True)
class Entry:
    """One entry over a period: its matrix, row and column, values (N,), unit, how much its variation matters, and what counts as none."""

    matrix: str
    row: int
    column: int | None
    values: Array
    unit: str
    weight: float
    noise: float

    @property
    def varies(self) -> bool:
        """Whether it does."""
        return float(np.ptp(self.values)) > self.noise


def draw_coefficients(a: Analysis) -> Picture:
    """A panel for each entry of M, D, K and h that varies; each joint has one at the least."""
    varying = [entry for entry in list_entries(a) if entry.varies]
    joints = [[k for k, entry in enumerate(varying) if entry.row == i] for i in list_joints(a)]
    shown, folded = choose_shown(np.array([entry.weight for entry in varying]), joints)
    panels = [draw_entry(a, varying[k]) for k in shown]
    under = [draw_entry(a, varying[k], FOLDED_STRIDE) for k in folded]
    caption, rest = describe_shown(len(varying), len(shown), len(folded)), ("other entries that vary", under)
    return make_picture("coefficients", "The coefficients over a period", caption, panels, (), rest)


def list_joints(a: Analysis) -> list[int]:
    """Which coordinates of the linear equations are joints."""
    return [i for i, coordinate in enumerate(a.plant.coordinates) if coordinate.kind == "joint"]


def draw_entry(a: Analysis, entry: Entry, every: int = 1) -> Panel:
    """One entry over the period, at every so many times."""
    name = name_entry(a, entry.matrix, entry.row, entry.column)
    title, values = shift_from_mean(name, entry.values)
    panel = make_period_panel(a.plant.period, title, entry.unit)
    return panel.line(a.t[::every], values[::every], COLOURS[entry.matrix])


def describe_shown(varying: int, shown: int, folded: int) -> str:
    """How many entries are shown, and where the others are."""
    if not varying:
        return (
            "Every entry of M, D, K and h is constant along this motion: the linear system has constant coefficients."
        )
    left = varying - shown - folded
    alone = f", {left} stand in coefficients.nc of flexlin linearize alone" if left else ""
    most = "whose variation moves frequencies and the response most, one of each joint at the least"
    rest = f" Shown are those {most}; the others are folded below{alone}." if folded else ""
    return (
        "Entries of M y″ + D y′ + K y = h that vary along the rigid motion, open loop; y collects the deviations of joints (q), "
        f"elastic coordinates and motors.{rest} Constant entries stand in the table below."
    )


def list_entries(a: Analysis) -> Iterator[Entry]:
    """All entries of M, D and K, of a pair that is equal at all times the upper one, and of h."""
    scales = weigh_entries(a)
    for name in ("M", "D", "K"):
        matrix = getattr(a.coefficients, name)
        noise = ROOT_EPS * (np.abs(matrix).max() or 1.0)
        for i, j in np.ndindex(a.plant.n, a.plant.n):
            values, mirror = matrix[:, i, j], matrix[:, j, i]
            if not (j < i and np.all(np.abs(values - mirror) <= noise)):
                weight = float(np.ptp(values) * scales[name][i, j])
                turns = sum(a.plant.coordinates[k].unit == "rad" for k in (i, j))
                yield Entry(name, i, j, values, page_unit(UNITS[name][turns]), weight, noise)
    noise = ROOT_EPS * (np.abs(a.coefficients.h).max() or 1.0)
    for i, values in enumerate(a.coefficients.h.T):
        unit = "N" if a.plant.coordinates[i].unit == "m" else "N m"
        yield Entry("h", i, None, values, unit, float(np.ptp(values) * scales["h"][i, 0]), noise)


def weigh_entries(a: Analysis) -> dict[str, Array]:
    """By what each entry's variation is multiplied to see what it does, in numbers without unit.

        M_ij / (m_i m_j),   D_ij / (m_i m_j sqrt(w_i w_j)),   K_ij / (m_i m_j w_i w_j),   h_i / (m_i w_i) against the largest

    with m_i = sqrt(M_ii), w_i^2 = |K_ii| / M_ii, not below the motion's frequency: the share by which w_i^2 would move.
    """
    M, K = (np.abs(np.einsum("tii->ti", getattr(a.coefficients, name))).mean(axis=0) for name in ("M", "K"))
    mass = np.sqrt(np.maximum(M, 1e-12 * M.max(initial=0.0)))
    mass[mass == 0] = 1.0
    rate = np.maximum(np.sqrt(K) / mass, 2 * np.pi / a.plant.period)
    both = np.outer(mass, mass)
    force = 1 / (mass * rate)
    largest = float((np.ptp(a.coefficients.h, axis=0) * force).max(initial=0.0)) or 1.0
    geometric = np.sqrt(np.outer(rate, rate))
    return {"M": 1 / both, "D": 1 / (both * geometric), "K": 1 / (both * geometric**2), "h": force[:, None] / largest}


def share_legend(panels: Sequence[Panel]) -> list[Mark]:
    """The legend of panels that show the same, taken from each of them."""
    legend = panels[0].legend if panels else []
    for panel in panels:
        panel.marks = [replace(mark, label="") for mark in panel.marks]
    return legend


def draw_gains(a: Analysis) -> Picture | None:
    """A panel for each entry of the gain; each input has one at the least."""
    if not any(loop.design is not None for loop in a.loops):
        return None
    states = 2 * a.plant.n
    gains = [(loop, loop.design.K(a.t)) for loop in a.loops if loop.design is not None]
    own = a.closed.law.gain(a.t)
    gains += [(a.own, own)] if np.any(own) else []
    remembers = any(gain.shape[2] > states for _, gain in gains)
    gains = [(loop, gain[:, :, :states]) for loop, gain in gains]
    # what each input gives to deflections of equal energy, against its largest: |gain_ij| / (m_j w_j), or / m_j for rates
    scales, size = weigh_entries(a), np.max([np.abs(gain).max(axis=0) for _, gain in gains], axis=0)
    weights = size * np.sqrt([*np.diagonal(scales["K"]), *np.diagonal(scales["M"])])
    weights /= np.maximum(weights.max(axis=1, keepdims=True), 1e-300)
    groups = [range(i * states, (i + 1) * states) for i in range(len(a.plant.inputs))]
    shown, folded = choose_shown(weights.ravel(), groups)
    panels = {k: make_period_panel(a.plant.period, name_gain(a, *divmod(k, states))) for k in (*shown, *folded)}
    for (loop, gain), dash in zip(gains, cycle(DASHES), strict=False):
        for k, panel in panels.items():  # gains that coincide are seen, each through the next
            (i, j), every = divmod(k, states), 1 if k in shown else FOLDED_STRIDE
            panel.line(a.t[::every], gain[::every, i, j], choose_colour(a, loop), dash=dash, label=loop.name)
    legend = share_legend(list(panels.values()))
    above, under = [panels[k] for k in shown], [panels[k] for k in folded]
    caption = "Entries of the feedback gain in u = −gain(t) [y; y′]: gain(input, state)."
    if remembers:
        caption += " What a controller's integrals and filters add is not drawn."
    if under:
        caption += " Shown are those that act most on deflections of equal energy, one of each input at the least; others are folded below."
    return make_picture("gains", "Gains over a period", caption, above, legend, ("other entries", under))


def name_gain(a: Analysis, i: int, j: int) -> str:
    """The title of an entry, what input i gets from state j of x = [y; y']; a torque for a displacement is a force."""
    k, rate = j % a.plant.n, j >= a.plant.n
    force, unit, time = a.plant.input_units[i], a.plant.coordinates[k].unit, " s" * rate
    per = f"N{time}" if (force, unit) == ("N m", "m") else f"{force}{time}/{unit}"
    return in_unit(f"gain({a.plant.inputs[i]}, {a.plant.names[k]}{'′' * rate})", per)


def draw_response(a: Analysis) -> Picture | None:
    """A panel for each deviation and each input: all joints and inputs, and the coordinates that hold most energy."""
    if a.response is None:
        return None
    joints, inputs = list_joints(a), range(len(a.plant.inputs))
    energy = np.abs(a.response.states[:, : a.plant.n]).max(axis=0) / np.sqrt(np.diagonal(weigh_entries(a)["K"]))
    shown, rest = choose_shown(energy, [[i] for i in joints], MOST_PANELS - len(inputs))
    moves = energy > SUM_ROUNDING * energy.max(initial=0.0)
    shown, rest = ([i for i in part if moves[i]] for part in (shown, rest))
    still = ", ".join(name for name, one in zip(a.plant.names, moves, strict=True) if not one)
    torques = [draw_torque(a, k) for k in inputs]
    legend = share_legend(torques)
    panels = [*(draw_deviation(a, i) for i in shown), *torques]
    caption = (
        "Steady deviations from the rigid motion under the scene's loop: q of joints, w of bending, phi of twist, theta of motors; and "
        "what each joint is given." + " Further coordinates are folded below." * bool(rest)
    )
    caption += f" Zero to rounding, and not drawn: {still}." if still else ""
    folded = "other coordinates", [draw_deviation(a, i) for i in rest]
    return make_picture("response", "Forced periodic response", caption, panels, legend, folded)


def draw_deviation(a: Analysis, i: int) -> Panel:
    """One coordinate over the period."""
    assert a.response is not None
    values, unit = scale_values(a.response.states[:, i], a.plant.coordinates[i].unit)
    panel = make_period_panel(a.plant.period, a.plant.names[i], unit).zero()
    return panel.line(a.t, values, choose_colour(a, a.own))


def draw_torque(a: Analysis, k: int) -> Panel:
    """What one input gives: feedforward alone, and with feedback in the periodic response."""
    assert a.response is not None
    torque = a.closed.law.torque(a.t, a.response.states)
    panel = make_period_panel(a.plant.period, f"input {a.plant.inputs[k]}", a.plant.input_units[k])
    panel.line(a.t, torque[:, k], choose_colour(a, a.own), label=a.own.name)
    return panel.line(a.t, a.coefficients.tau[:, k], "ink", width=1.1, dash="4 3", label="feedforward alone")


def draw_tip(a: Analysis) -> Picture | None:
    """The components over the period on the left, the path of the error on the right; in space its three views below."""
    if a.response is None or not np.all(np.isfinite(a.response.tip)):
        return None
    xyz, unit = scale_values(a.response.tip, "m")
    left = make_period_panel(a.plant.period, "tip minus rigid tip", unit).zero()
    left.line(a.t, np.linalg.norm(xyz, axis=1), "ink", width=2.0, label="distance")
    for k, values in enumerate(xyz.T):
        colour, _ = style_part(k)
        left.line(a.t, values, colour, label="xyz"[k], dash=("", "6 2", "2 2")[k])
    paths = []
    for across, up in choose_views(xyz.shape[1]):
        x_label, y_label = (in_unit("xyz"[axis], unit) for axis in (across, up))
        path = Panel("its path", equal=True, x_label=x_label, y_label=y_label)
        path.line(xyz[:, across], xyz[:, up], "ink", label="tip")
        paths.append(path.dots([0], [0], "ink", "cross", 6, label="rigid tip"))
    distance = a.response.tip_error
    largest, rms = float(distance.max()), float(np.sqrt(np.mean(distance[:-1] ** 2)))
    caption = (
        f"Largest {format_quantity(largest, 'm')}, root mean square {format_quantity(rms, 'm')}, by the linear model; "
        f"the states behind it are known to {format_power(a.response.error)}."
    )
    panels = resize([left, *paths], 150.0, *((1.5, 3) if len(paths) == 1 else (2,)))
    return make_picture("tip", "Tip error in steady motion", caption, panels)


def draw_comparison(a: Analysis) -> Picture | None:
    """Both answers, and their difference: of the tip along the axis of its largest error, or of the first coordinate without a tip."""
    s = a.simulation
    if s is None:
        return None
    if np.all(np.isfinite(s.tip)):
        axis, unit = int(np.abs(s.tip - s.tip_rigid).max(axis=0).argmax()), "m"
        name, gap = f"tip error along {'xyz'[axis]}", np.linalg.norm(s.tip - s.tip_linear, axis=1)
        nonlinear, linear = ((tip - s.tip_rigid)[:, axis] for tip in (s.tip, s.tip_linear))
    else:
        name, unit = a.plant.names[0], a.plant.coordinates[0].unit
        nonlinear, linear = s.nonlinear[:, 0], s.linear[:, 0]
        gap = nonlinear - linear
    (both, both_unit), (apart, apart_unit) = scale_values(np.array([nonlinear, linear]), unit), scale_values(gap, unit)
    end, colour = float(s.t[-1]), choose_colour(a, a.own)
    upper = make_period_panel(end, name, both_unit).zero()
    upper.line(s.t, both[0], colour, width=4.5, opacity=0.5, label="nonlinear")
    upper.line(s.t, both[1], "ink", width=1.4, dash="5 3", label="linear")
    lower = make_period_panel(end, "difference", apart_unit).zero().line(s.t, apart, colour)
    spans = "periods" if a.plant.motion.periodic else "durations"
    caption = (
        f"The full nonlinear equations over {s.t[-1] / a.plant.period:g} {spans} under the scene's loop, started on the rigid motion, "
        f"beside the linear prediction from the same start. {sentence(agreement(a, s))}"
    )
    return make_picture("comparison", "Nonlinear against linear", caption, resize([upper, lower], 110.0, 1))
