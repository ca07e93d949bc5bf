"""report.html: one self-contained page, which asks no other file or host for anything."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined, Template, select_autoescape

import flexlin
from flexlin.answers.analysis import Analysis, Loop
from flexlin.answers.clock import Step
from flexlin.report.advice import next_steps, under
from flexlin.report.figures.coefficients import NOISE, matrix_unit
from flexlin.report.figures.style import Picture
from flexlin.report.wording import caution, decimal, duration, largest_multiplier, modulus, pace, power, quantity, rate
from flexlin.scene.accuracy import Accuracy


def page(analysis: Analysis, data: dict[str, Any], pictures: list[Picture], command: str) -> str:
    """Fill the page's template: verdict first, then what to do, figures, and everything that went in."""
    return template("page").render(
        analysis=analysis,
        own=analysis.own,
        under=under(analysis.own),
        caution=caution(analysis.own, analysis.plant.period),
        pace=pace(analysis.own, analysis.plant.period),
        facts=facts(analysis),
        steps=next_steps(analysis),
        loops=[loop_row(loop, analysis.plant.period) for loop in analysis.loops],
        exponents=[exponent_rows(loop) for loop in analysis.loops if loop.floquet is not None],
        pictures=pictures,
        constants=constants(analysis),
        parameters=went_in(data["scene"], data["effects"]["units"]),
        effects=data["effects"],
        versions=data["versions"],
        command=command,
        asked=asked_for(analysis.scene.accuracy),
        took=[step_row(step) for step in (*analysis.steps, together(analysis.steps))],
    )


def picture_page(title: str, picture: Picture, command: str) -> str:
    """A page of one picture."""
    return template("picture").render(title=title, picture=picture, command=command, version=flexlin.__version__)


def template(name: str) -> Template:
    """A template of the report; a name in it that has no value is an error."""
    environment = Environment(
        loader=PackageLoader("flexlin.report"),
        autoescape=select_autoescape(("html.j2",)),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(f"{name}.html.j2")


def facts(a: Analysis) -> list[tuple[str, str]]:
    """The figures of merit, as name and value."""
    growth, error = a.own.growth
    said = [
        ("growth rate", rate(growth, error)),
        ("largest multiplier", f"|µ| = {largest_multiplier(a.own)}"),
        ("period", quantity(a.plant.period, "s", 5)),
    ]
    if a.response is not None and np.all(np.isfinite(a.response.tip)):
        said.append(("largest tip error", quantity(float(a.response.tip_error.max()), "m")))
    if a.simulation is not None and np.isfinite(a.simulation.difference):
        said.append(("linear against nonlinear", quantity(a.simulation.difference, "m")))
    return said


def loop_row(loop: Loop, period: float) -> dict[str, str]:
    """One row of the comparison of loops."""
    growth, error = loop.growth
    settled = "–"
    if loop.verdict == "stable":
        settled = duration(np.log(50) / -growth)
    return {
        "name": loop.name,
        "verdict": loop.verdict,
        "colour": "undecided" if caution(loop, period) else loop.verdict,
        "rate": rate(growth, error) if loop.floquet is not None else "–",
        "multiplier": largest_multiplier(loop),
        "settled": settled,
        "status": loop.problem or (loop.floquet.status if loop.floquet else ""),
        "design": loop.design.status if loop.design is not None else "",
    }


def exponent_rows(loop: Loop) -> dict[str, Any]:
    """The exponents of a loop: growth rate, error, frequency, modulus of the multiplier."""
    assert loop.floquet is not None
    result = loop.floquet
    rows = [
        (
            decimal(value.real, 6),
            power(error),
            f"{abs(value.imag) / (2 * np.pi):.4g}",
            modulus(float(log.real)),
        )
        for value, error, log in zip(result.exponents, result.errors, result.log_multipliers, strict=True)
        if value.imag >= -error
    ]
    return {"name": loop.name, "rows": rows}


def asked_for(accuracy: Accuracy) -> dict[str, str]:
    """What the scene asks of every stage."""
    memory = quantity(accuracy.memory, "B") if accuracy.memory < 1e9 else f"{accuracy.memory / 1e9:.3g} GB"
    return {"tol": power(accuracy.tol), "seconds": quantity(accuracy.seconds, "s"), "memory": memory}


def step_row(step: Step) -> dict[str, Any]:
    """One stage: what was asked, what was reached, what it took."""
    return {
        "name": step.name,
        "asked": "" if step.asked is None else power(step.asked),
        "reached": "" if step.asked is None else "–" if step.reached is None else power(step.reached),
        "missed": step.missed,
        "seconds": f"{step.seconds:.3f}",
        "cpu": f"{step.cpu_seconds:.3f}",
        "problem": step.problem,
    }


def together(steps: Sequence[Step]) -> Step:
    """What all stages took."""
    return Step("together", sum(step.seconds for step in steps), sum(step.cpu_seconds for step in steps))


def constants(a: Analysis) -> list[tuple[str, str, str]]:
    """Entries of M, D, K that do not vary and are not zero, one of a symmetric pair: name, value, unit."""
    found = []
    for name in ("M", "D", "K"):
        matrix = getattr(a.coefficients, name)
        size = np.abs(matrix).max() or 1.0
        for i, j in np.ndindex(a.plant.n, a.plant.n):
            values = matrix[:, i, j]
            if j < i and np.all(np.abs(values - matrix[:, j, i]) <= NOISE * size):
                continue
            if np.ptp(values) <= NOISE * size and np.abs(values).max() > NOISE * size:
                found.append(
                    (
                        f"{name}({a.plant.names[i]}, {a.plant.names[j]})",
                        decimal(values.mean(), 6),
                        matrix_unit(a, name, i, j),
                    )
                )
    return found


def went_in(scene: dict[str, Any], units: dict[str, dict[str, str]]) -> list[tuple[str, str, str]]:
    """Every value of the scene by its dotted path, with the unit where an effect states one."""
    stated = {f"effects.{name}.{key}": unit for name, keys in units.items() for key, unit in keys.items()}
    found = leaves({key: value for key, value in scene.items() if key not in ("title", "source")})
    return [(path, value, stated.get(path, "")) for path, value in found]


def leaves(node: Any, path: str = "") -> list[tuple[str, str]]:
    """Every value below a table by its dotted path; a list of numbers is one value."""
    if node in ([], {}):
        return []
    if isinstance(node, dict):
        children = list(node.items())
    elif isinstance(node, list) and any(isinstance(child, dict) for child in node):
        children = list(enumerate(node))
    else:
        return [(path, ", ".join(map(str, node)) if isinstance(node, list) else str(node))]
    return [leaf for name, child in children for leaf in leaves(child, f"{path}.{name}" if path else str(name))]
