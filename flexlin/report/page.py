"""report.html: one self-contained page, which asks no other file or host for anything."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

import flexlin
from flexlin.analyses.analysis import Analysis
from flexlin.analyses.clock import Step
from flexlin.errors import ArgumentError
from flexlin.report import advice, wording
from flexlin.report.audit import draw_effects, draw_sensitivity
from flexlin.report.figures import Picture, exponents, over_period
from flexlin.scene.names import name_unit
from flexlin.scene.parameters import list_children
from flexlin.scene.scene import Scene

TEMPLATES = Environment(
    loader=PackageLoader("flexlin.report"),
    autoescape=select_autoescape(("html.j2",)),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    finalize=wording.typeset,
)
TEMPLATES.globals |= {"wording": wording, "advice": advice, "math": math, "zip": zip}
"""Those of reports; a name in one that has no value is an error."""


FIGURES: tuple[Callable[[Analysis], Picture | None], ...] = (
    exponents.draw_multipliers,
    over_period.draw_arm,
    over_period.draw_tip,
    over_period.draw_response,
    over_period.draw_comparison,
    exponents.draw_exponents,
    exponents.draw_modes,
    over_period.draw_coefficients,
    over_period.draw_gains,
    lambda a: None if a.sensitivity is None else draw_sensitivity(a.sensitivity),
    lambda a: None if a.audit is None else draw_effects(a.audit),
)


def draw_pictures(analysis: Analysis) -> Iterator[Picture]:
    """All figures that this analysis has numbers for, in the order of the page."""
    with wording.units_of(analysis):
        yield from (picture for draw in FIGURES if (picture := draw(analysis)) is not None)


def render_page(analysis: Analysis, data: dict[str, Any], pictures: list[Picture], command: str) -> str:
    """Fill the page's template: verdict first, then what to do, figures, and everything that went in."""
    with wording.units_of(analysis):
        constants, inputs = list_constants(analysis), list_inputs(analysis.scene, data["scene"])
        took = [*analysis.steps, Step("together", *wording.took(analysis.steps))]
        given = {"analysis": analysis, "data": data, "pictures": pictures, "command": command}
        page = TEMPLATES.get_template("page.html.j2")
        return page.render(given, constants=constants, inputs=inputs, took=took)


def picture_page(
    title: str, picture: Picture, command: str, more: Sequence[Picture] = (), said: Sequence[str] = ()
) -> str:
    """A page of one picture, with what is to be said before it, and of other pictures below it."""
    page = {"title": title, "picture": picture, "more": more, "said": said}
    return TEMPLATES.get_template("picture.html.j2").render(command=command, version=flexlin.__version__, **page)


def list_constants(a: Analysis) -> list[tuple[str, str, str]]:
    """Entries of M, D, K that do not vary and are not zero, one of a symmetric pair: name, value, unit."""
    return [
        (
            over_period.name_entry(a, one.matrix, one.row, one.column),
            wording.format_decimal(one.values.mean(), 6),
            one.unit,
        )
        for one in over_period.list_entries(a)
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
    if not (isinstance(node, dict) or (isinstance(node, list) and any(isinstance(child, dict) for child in node))):
        return [(path, node)]
    inside = list_children(node).items()
    return [leaf for name, child in inside for leaf in flatten_table(child, f"{path}.{name}" if path else name)]


def format_input(value: object) -> str:
    """One value as TOML has it, but without what rounding left of a number."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.12g}" if isinstance(value, float) else str(value)
