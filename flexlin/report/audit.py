"""What matters: effects and modes that a scene needs, as a picture, a table and the smallest scene; numbers that move its growth rate."""

from typing import TYPE_CHECKING

import numpy as np

from flexlin.analyses.audit import Audit, Measure, Minimal, Row
from flexlin.errors import SceneError, counted
from flexlin.plots.panel import LINE_HEIGHT, Panel
from flexlin.plots.scales import Linear, Logarithmic, Named
from flexlin.report.figures import WIDTH, Picture, make_picture
from flexlin.report.wording import format_figures, format_quantity, format_rate, in_unit
from flexlin.scene.json_schema import write_toml
from flexlin.scene.loading import parse_scene
from flexlin.scene.scene import Scene

if TYPE_CHECKING:
    import xarray


def draw_effects(audit: Audit) -> Picture:
    """Bars of significance, the largest on top, with the tolerance as a line."""
    rows = [*audit.effects, *audit.modes]
    rows.sort(key=clip_significance)
    bars = {row.change: (row.significance, colour_need(row, audit.tolerance)) for row in rows}
    axis = Logarithmic(1e-6, 2.0)  # less counts as none; a change of the verdict reaches the other end
    panel = draw_bars(axis, "largest relative change", bars, 1e-6)
    panel.line([audit.tolerance] * 2, [-0.5, len(rows) - 0.5], "ink", width=1.2, dash="4 3")
    return make_picture("effects", "Which effects this scene needs", describe_findings(audit), [panel] if rows else [])


def draw_bars(x: Linear, x_label: str, bars: dict[str, tuple[float, str]], begin: float = 0.0) -> Panel:
    """A bar for each name, of a length and a colour, from the lowest row up; none for what is no number."""
    names = Named(-0.5, len(bars) - 0.5, tuple(bars))
    panel = Panel("", x, names, x_label, width=WIDTH, height=LINE_HEIGHT * len(bars))
    for i, (size, colour) in enumerate(bars.values()):
        if not np.isnan(size):
            end = float(np.clip(size, *x.ends))
            panel.area([begin, end, end, begin], [i - 0.3, i - 0.3, i + 0.3, i + 0.3], colour)
    return panel


def clip_significance(row: Row) -> float:
    """What a row is sorted by; a version that could not be judged comes last."""
    return -1.0 if np.isnan(row.significance) else row.significance


def colour_need(row: Row, tolerance: float) -> str:
    """Blue where the scene's choice is needed, orange where it leaves out what matters, grey below the tolerance."""
    if row.significance <= tolerance:
        return "grid"
    return "blue" if row.on else "orange"


def describe_findings(audit: Audit) -> str:
    """How to read the bars, and the advice."""
    nothing = "not known" if audit.problem else "none"
    findings = [
        f"needed: {', '.join(audit.needed) or nothing}",
        f"may be dropped: {', '.join(audit.droppable) or nothing}",
        f"left out although it would be noticed with the figures tried: {', '.join(audit.missing) or nothing}",
    ]
    return (
        "Each effect switched on or off in turn, each link given a mode more or less: the largest relative change of margin, "
        f"frequencies, tip path and torques. Blue: the scene has it and needs it. Orange: the scene lacks it. Dashed: the tolerance "
        f"{audit.tolerance:g}. At that tolerance {'; '.join(findings)}.{audit.problem and f' {audit.problem}.'}"
    )


PERCENT = (
    "What one percent more of each number does to the largest growth rate of the scene's own loop, by exact derivatives. Green: it settles "
    "faster. Red: slower. Numbers that are zero are left out."
)


def draw_sensitivity(data: "xarray.Dataset") -> Picture:
    """Bars to both sides, the strongest on top."""
    slowest = int(np.argmax(data["exponents"].values.real))
    change = data["percent"].values[:, slowest]
    order = np.argsort(np.abs(change))[-16:]
    names = [f"{data['parameter'].values[i]} = {data['value'].values[i]:.4g}" for i in order]
    reach = 1.08 * float(np.abs(change).max()) or 1.0
    colours = ["stable" if change[i] < 0 else "unstable" for i in order]
    bars = dict(zip(names, zip(change[order], colours, strict=True), strict=True))
    panel = draw_bars(Linear(-reach, reach), in_unit("change of the growth rate for 1 % more", "1/s"), bars)
    panel.line([0, 0], [-0.5, len(order) - 0.5], "ink", width=1.0)
    rest = len(change) - len(order)
    left_out = f" The {rest} that move it least are not shown." if rest else ""
    return make_picture("sensitivity", "Which numbers move the growth rate", PERCENT + left_out, [panel])


def audit_lines(audit: Audit) -> list[str]:
    """The audit as a table, the most significant change first; the figures of the effects; pairs; the smallest scene that is enough."""
    head = f"{'change':<30} {'significance':>12} {'margin 1/s':>11} {'frequency':>10} {'tip path':>9} {'torque':>9} {'instr.':>7}  advice"
    rows = sorted((*audit.effects, *audit.modes), key=clip_significance, reverse=True)
    figures: list[str] = []
    named = {True: "effects of the scene, with its figures", False: "effects that are off were tried with"}
    for on, words in named.items():
        tried = [row for row in rows if row.kind == "effect" and row.on is on]
        figures += [words] if tried else []
        figures += [f"  {row.subject}: {format_figures(row.table, row.units)}" for row in tried]
    pairs = [f"  {row.subject}: {row.advice}, {format_size(row)}" for row in audit.pairs]
    pairs = ["two effects at once", *pairs] if pairs else []
    return [head, *map(format_audit_row, rows), describe_base(audit.base), *figures, *pairs, *minimal_lines(audit)]


def describe_base(base: Measure) -> str:
    """The scene's own figures."""
    frequencies = ", ".join(f"{value / (2 * np.pi):.3g}" for value in base.frequencies[:4])
    tip = "" if np.isnan(base.tip_error) else f", tip error {format_quantity(base.tip_error, 'm')}"
    return f"the scene: {base.verdict}, {format_rate(base.margin, base.margin_error)}; natural frequencies {frequencies} Hz{tip}"


def minimal_lines(audit: Audit) -> list[str]:
    """The smallest scene that was found to be enough."""
    if audit.minimal is None:
        return [audit.problem] if audit.problem else []
    found = audit.minimal
    changes = [*(f"drop: {text}" for text in found.dropped), *(f"add: {text}" for text in found.added)]
    size = f"{counted(found.coordinates, 'coordinate')} in the place of {audit.base.coordinates}"
    head = f"minimal scene, {size}, error {describe_error(found.error)}"
    return [head, *(f"  {text}" for text in changes or ["nothing to drop"])]


def format_size(row: Row) -> str:
    """The significance of two changes, or what is another one, where no number says how much."""
    if row.significance < float("inf"):
        return f"{row.significance:.2g} together"
    return f"other marks of the drives: {', '.join(row.marks)}" if row.marks else "another verdict"


def known(share: float, form: str = ".2g") -> str:
    """A share, or a dash where there is none: an unstable loop keeps no steady path."""
    return "-" if np.isnan(share) else format(share, form)


def format_audit_row(row: Row) -> str:
    """One change in one line."""
    if row.problem and row.verdict == "unknown":
        return f"{row.change:<30} {row.problem}"
    size = f"{row.significance:.2g}" if row.significance < float("inf") else "drive marks" if row.marks else "verdict"
    shares = f"{known(row.frequency):>10} {known(row.path):>9} {known(row.torque):>9}"
    return f"{row.change:<30} {size:>12} {known(row.margin, '+.2g'):>11} {shares} {row.instructions:>+7d}  {row.advice}"


def minimal_text(audit: Audit, minimal: Minimal, command: str = "") -> str:
    """The scene as TOML below comments that say what it lacks, what that changes, and what the audit would add."""
    scene, left = fitting(minimal.scene)
    found = minimal.error
    said = [
        f"{command or 'flexlin effects'}: the smallest scene that was found to be enough at a tolerance of {audit.tolerance:g}.",
        f"Dropped: {', '.join(minimal.dropped) or 'nothing'}.",
        f"Added: {', '.join(minimal.added) or 'nothing'}.",
        f"Its error, against the scene{' with these modes' if minimal.added else ''}: {describe_error(found)}.",
        *left,
    ]
    for row in audit.effects:
        if not row.on and row.significance > audit.tolerance:
            figures = f"{row.subject} ({format_figures(row.table, row.units)})"
            said.append(f"Left out as in the scene, but it would be noticed with these figures: {figures}.")
    data = scene.model_dump(mode="json", by_alias=True, exclude_unset=True)
    return "".join(f"# {line}\n" for line in said) + "\n" + write_toml(data)


def describe_error(row: Row) -> str:
    """What the minimal scene changes, in one line."""
    if row.verdict == "unknown":
        return f"not known: {row.problem}"
    changes = {"slower frequencies": row.frequency, "tip path": row.path, "torques": row.torque}
    shares = ", ".join(f"{name} {known(100 * share)} %" for name, share in changes.items())
    return f"{known(100 * row.significance)} % (growth rate {known(row.margin, '+.2g')} 1/s, {shares})"


def fitting(scene: Scene) -> tuple[Scene, list[str]]:
    """The scene without designs whose weights are a list for a number of states that it no longer has; and what is said of them."""
    kept = []
    for design in scene.designs:
        alone = scene.model_copy(update={"designs": (design,)})
        try:
            parse_scene(alone.model_dump(mode="json", by_alias=True, exclude_unset=True))
        except SceneError:
            continue
        kept.append(design)
    gone = [design.name for design in scene.designs if design not in kept]
    said = f"Designs whose lists of weights do not fit its coordinates were left out: {', '.join(gone)}."
    return scene.model_copy(update={"designs": tuple(kept)}), [said] if gone else []
