"""report.html: one self-contained page, which asks no other file or host for anything."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

import flexlin
from flexlin.analyses.analysis import Analysis
from flexlin.analyses.clock import Step
from flexlin.analyses.judging import Loop
from flexlin.errors import ArgumentError
from flexlin.report import wording
from flexlin.report.advice import advise, drive_cells, name_condition
from flexlin.report.figures import Picture
from flexlin.report.figures.exponents import draw_exponents, draw_modes, draw_multipliers
from flexlin.report.figures.over_period import (
    draw_arm,
    draw_coefficients,
    draw_comparison,
    draw_gains,
    draw_response,
    draw_tip,
    list_entries,
    name_entry,
)
from flexlin.scene.names import name_unit
from flexlin.scene.scene import Scene

TEMPLATES = Environment(
    loader=PackageLoader("flexlin.report"),
    autoescape=select_autoescape(("html.j2",)),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    finalize=wording.typeset,
)
TEMPLATES.filters |= {"power": wording.format_power, "prefixed": wording.format_with_prefix}
"""Those of reports; a name in one that has no value is an error."""


FIGURES: tuple[Callable[[Analysis], Picture | None], ...] = (
    draw_multipliers,
    draw_arm,
    draw_tip,
    draw_response,
    draw_comparison,
    draw_exponents,
    draw_modes,
    draw_coefficients,
    draw_gains,
)


def draw_pictures(analysis: Analysis) -> Iterator[Picture]:
    """All figures that this analysis has numbers for, in the order of the page."""
    with wording.units_of(analysis):
        yield from (picture for draw in FIGURES if (picture := draw(analysis)) is not None)
        if analysis.sensitivity is not None:
            from flexlin.report.audit import draw_sensitivity

            yield draw_sensitivity(analysis.sensitivity)
        if analysis.audit is not None:
            from flexlin.report.audit import draw_effects

            yield draw_effects(analysis.audit)


def render_page(analysis: Analysis, data: dict[str, Any], pictures: list[Picture], command: str) -> str:
    """Fill the page's template: verdict first, then what to do, figures, and everything that went in."""
    with wording.units_of(analysis):
        model = analysis.validity(analysis.own)
        return TEMPLATES.get_template("page.html.j2").render(
            analysis=analysis,
            own=analysis.own,
            under=name_condition(analysis.own),
            doubt=wording.doubt(analysis.own, analysis.plant.period, model),
            reason=wording.reason(model),
            pace=wording.describe_pace(analysis.own, analysis.plant.period),
            facts=list_facts(analysis),
            margins=wording.describe_margins(analysis.scene, analysis.margins, analysis.problems),
            nearest=wording.describe_nearest(analysis.scene, analysis.nearest),
            steps=advise(analysis),
            loops=[describe_loop(analysis, loop) for loop in analysis.loops],
            endured=bool(analysis.endured),
            exponents=[list_exponents(loop) for loop in analysis.loops if loop.floquet is not None],
            pictures=pictures,
            dimensionless=wording.is_dimensionless(),
            constants=list_constants(analysis),
            inputs=list_inputs(analysis.scene, data["scene"]),
            effects=data["effects"],
            versions=data["versions"],
            command=command,
            took=[*analysis.steps, Step("together", *wording.took(analysis.steps))],
        )


def picture_page(
    title: str, picture: Picture, command: str, more: Sequence[Picture] = (), said: Sequence[str] = ()
) -> str:
    """A page of one picture, with what is to be said before it, and of other pictures below it."""
    page = {"title": title, "picture": picture, "more": more, "said": said}
    return TEMPLATES.get_template("picture.html.j2").render(command=command, version=flexlin.__version__, **page)


def list_facts(a: Analysis) -> list[tuple[str, str]]:
    """The figures of merit, as name and value."""
    said = []
    if a.own.floquet is not None:
        said.append(("growth rate", wording.format_rate(*a.own.growth)))
        said.append(("largest multiplier", f"|µ| = {wording.format_largest_multiplier(a.own)}"))
    said.append(("period" if a.plant.motion.periodic else "duration", wording.format_quantity(a.plant.period, "s", 5)))
    if a.response is not None and np.all(np.isfinite(a.response.tip)):
        said.append(("largest tip error", wording.format_quantity(float(a.response.tip_error.max()), "m")))
    if a.simulation is not None and not a.simulation.is_unresolved and np.isfinite(a.simulation.difference):
        said.append(("linear against nonlinear", wording.format_quantity(a.simulation.difference, "m")))
    return said


def describe_loop(a: Analysis, loop: Loop) -> dict[str, str]:
    """One row of the comparison of loops."""
    (growth, error), period, model = loop.growth, a.plant.period, a.validity(loop)
    return {
        "name": loop.name,
        "verdict": loop.verdict,
        "colour": wording.colour(loop, period, model),
        "doubt": wording.doubt(loop, period, model),
        "tip": steady_tip(a, loop),
        "rate": wording.format_rate(growth, error) if loop.floquet is not None else "–",
        "multiplier": wording.format_largest_multiplier(loop),
        "settled": wording.format_duration(np.log(50) / -growth) if loop.verdict == "stable" else "–",
        "status": wording.without_units(loop.problem or (loop.floquet.status if loop.floquet else "")),
        "design": loop.design.status if loop.design is not None else "",
        "controller": wording.describe_controller(a.scene.control) if loop is a.own and loop.kind != "open" else "",
        "endured": wording.describe_endured(a.endured.get(loop.name)),
        **drive_cells(a, loop),
    }


def steady_tip(a: Analysis, loop: Loop) -> str:
    """How far the tip stays from its rigid path in the steady motion that the loop keeps, if that is known."""
    response = a.response if loop is a.own else loop.response
    if response is None or loop.verdict == "unstable" or not np.all(np.isfinite(response.tip)):
        return "–"
    return wording.format_quantity(response.sizes[1], "m")


def list_exponents(loop: Loop) -> dict[str, Any]:
    """The exponents of a loop: growth rate, error, frequency, modulus of the multiplier; of modes that are only bounded no error."""
    assert loop.floquet is not None
    result = loop.floquet
    rows = [
        (
            wording.format_decimal(value.real, 6),
            wording.format_power(error) if np.isfinite(error) else "–",
            f"{abs(value.imag) / (2 * np.pi):.4g}",
            wording.format_modulus(float(log.real)),
        )
        for value, error, log in zip(result.exponents, result.errors, result.log_multipliers, strict=True)
        if value.imag >= -error
    ]
    return {"name": loop.name, "rows": rows}


def list_constants(a: Analysis) -> list[tuple[str, str, str]]:
    """Entries of M, D, K that do not vary and are not zero, one of a symmetric pair: name, value, unit."""
    return [
        (name_entry(a, one.matrix, one.row, one.column), wording.format_decimal(one.values.mean(), 6), one.unit)
        for one in list_entries(a)
        if one.matrix != "h" and not one.varies and np.abs(one.values).max() > one.noise
    ]


def list_inputs(scene: Scene, data: dict[str, Any]) -> list[tuple[str, list[tuple[str, str]]]]:
    """Each table of the scene by its dotted path, with its keys and values, and the unit where the table states one."""
    tables = dict[str, list[tuple[str, str]]]()
    for path, value in flatten_table({key: value for key, value in data.items() if key not in ("title", "source")}):
        (table, _, key), unit = path.rpartition("."), ""
        if table and not isinstance(value, str):
            with suppress(ArgumentError):  # a key may be a path itself, as in [uncertainty]
                unit = name_unit(scene, path)
        said = ", ".join(map(format_input, value if isinstance(value, list) else [value]))
        tables.setdefault(table or "scene", []).append((key, f"{said} {unit}".strip()))
    return list(tables.items())


def flatten_table(node: Any, path: str = "") -> list[tuple[str, Any]]:
    """Every value below a table by its dotted path; a list of numbers is one value."""
    if node in ([], {}, ""):
        return []
    if isinstance(node, dict):
        children = list(node.items())
    elif isinstance(node, list) and any(isinstance(child, dict) for child in node):
        children = list(enumerate(node))
    else:
        return [(path, node)]
    return [leaf for name, child in children for leaf in flatten_table(child, f"{path}.{name}" if path else str(name))]


def format_input(value: object) -> str:
    """One value as TOML has it, but without what rounding left of a number."""
    return (
        f"{value:.12g}" if isinstance(value, float) else str(value).lower() if isinstance(value, bool) else str(value)
    )
