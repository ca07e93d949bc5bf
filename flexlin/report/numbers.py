"""report.json: the truth of a report, versioned by its `schema`; complex numbers as [re, im], SI units and radians."""

import sys
from collections.abc import Sequence
from platform import libc_ver, machine, python_version, release, system
from typing import TYPE_CHECKING, Any

import numpy as np
import pydantic_core

import flexlin
from flexlin.analyses.analysis import Analysis
from flexlin.analyses.boundary import Margin
from flexlin.analyses.clock import Step
from flexlin.analyses.judging import Loop
from flexlin.checks import Array
from flexlin.periodic.margins import Margins
from flexlin.report.wording import describe_controller, reason
from flexlin.scene.effects import known_effects
from flexlin.scene.scene import Scene

if TYPE_CHECKING:
    import xarray

    from flexlin.analyses.audit import Audit
    from flexlin.analyses.nearest import NearestInstability

PACKAGES = ("casadi", "control", "numpy", "pydantic", "scipy")


def record(a: Analysis) -> dict[str, Any]:
    """Everything that the report says, as data that `to_json` writes; of what was not asked for nothing."""
    whole = {
        **record_scene(a.scene, a.steps),
        "coordinates": a.plant.names,
        "inputs": a.plant.inputs,
        "period": a.plant.period,
        "validity": record_validity(a, a.own),
        "floquet": record_loop(a.own) | record_load(a, a.own) | record_controller(a),
        "open_loop": record_judged(a, a.open_loop),
        "resonances": None if "resonances" in a.problems else [str(resonance) for resonance in a.resonances],
        "designs": {loop.name: record_judged(a, loop) for loop in a.designs},
        "t": a.t,
        "coefficients": record_fields(a.coefficients, "M D K h B tau"),
        "forced_response": record_response(a),
        "simulation": record_simulation(a),
        "linear_range": record_linear_range(a),
        "zeros": a.zeros
        and {"verdict": a.zeros.verdict, "real_parts": a.zeros.exponents.real, "errors": a.zeros.errors},
        "margins": [record_margin(margin) for margin in a.margins],
    }
    asked = {
        "elastic_motion": a.elastic and record_loop(a.elastic),
        "estimated": {loop.name: record_loop(loop) for loop in a.estimated},
        "sampled": {loop.name: record_loop(loop) for loop in a.sampled},
        "loop_margins": {name: record_endured(one) for name, one in a.endured.items()},
        "nearest_instability": a.nearest and record_nearest(a.nearest),
        "effects_audit": a.audit and audit_block(a.audit),
        "sensitivity": None if a.sensitivity is None else record_sensitivity(a.sensitivity),
    }
    return whole | {name: block for name, block in asked.items() if block}


def record_scene(scene: Scene, steps: Sequence[Step]) -> dict[str, Any]:
    """What was asked, and what each stage of the work took."""
    on = scene.effects.on()
    effects = {
        "on": list(on),
        "off": [name for name in known_effects() if name not in on],
        "meaning": {name: effect.summary() for name, effect in on.items()},
        "units": {name: effect.units() for name, effect in on.items()},
    }
    return {
        "schema": 1,
        "title": scene.title,
        "scene": record_tables(scene),
        "effects": effects,
        "versions": list_versions(),
        "accuracy": scene.accuracy.model_dump(mode="json"),
        "steps": [step_block(step) for step in steps],
    }


def record_tables(scene: Scene) -> dict[str, Any]:
    """What a scene states, as in its file."""
    return scene.model_dump(mode="json", by_alias=True, exclude_none=True)


def step_block(step: Step) -> dict[str, Any]:
    """What one stage took; the error that was asked and the one that was reached, what libraries warned of, why it has no answer."""
    took = {"name": step.name, "seconds": round(step.seconds, 4), "cpu_seconds": round(step.cpu_seconds, 4)}
    errors = {} if step.asked is None else record_fields(step, "asked reached")
    return took | errors | {name: said for name, said in record_fields(step, "notes problem").items() if said}


def to_json(data: dict[str, Any]) -> str:
    """The text of report.json: a line for each of its first keys, since indentation would take longer than all else of a long one.

    By Pydantic's own writer, which prints numbers, with every digit, ten times as fast as Python. A number that is not finite (a multiplier
    beyond 1e308, say) becomes null; its logarithm stands in `log_multipliers`.
    """
    lines = (f" {write_json(key)}: {write_json(value)}" for key, value in data.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def write_json(value: Any) -> str:
    """One value in a line."""
    return pydantic_core.to_json(value, inf_nan_mode="null", fallback=list_numbers).decode()


def list_numbers(array: Array) -> Any:
    """An array as nested lists, complex numbers as [re, im]."""
    return (np.stack([array.real, array.imag], axis=-1) if np.iscomplexobj(array) else array).tolist()


def record_loop(loop: Loop) -> dict[str, Any]:
    """What is known of one loop."""
    block: dict[str, Any] = {"name": loop.name, "kind": loop.kind, "verdict": loop.verdict}
    if loop.design is not None:
        block |= {"design_error": loop.design.error, "design_status": loop.design.status}
    if loop.floquet is None:
        return block | {"status": loop.problem}
    result, setting = loop.floquet, loop.floquet.setting
    growth, growth_error = loop.growth
    return block | {
        "growth_rate": growth,
        "growth_rate_error": growth_error,
        **record_fields(result, "status exponents errors error log_multipliers multipliers"),
        "setting": record_fields(setting, "method order segments reason"),
        "certificate": None if loop.certificate is None else loop.certificate.record(),
    }


def record_judged(a: Analysis, loop: Loop) -> dict[str, Any]:
    """What is known of one loop, of the linear model under it, and of what it asks of the drives."""
    return record_loop(loop) | {"validity": record_validity(a, loop)} | record_load(a, loop)


def record_controller(a: Analysis) -> dict[str, Any]:
    """What the scene's own loop remembers, and what it holds beside its gains; nothing where there is nothing."""
    controller, said = a.closed.controller, describe_controller(a.scene.control)
    block: dict[str, Any] = {} if controller is None else {"controller_states": controller.names}
    return block | ({"controller": said} if said else {})


def record_validity(a: Analysis, loop: Loop) -> dict[str, Any]:
    """Whether the linear model holds along the motion under a loop, and the figures that say so: each with its bound, both in `unit`."""
    found = a.validity(loop)
    figures = [record_fields(figure, "what value bound unit share against") for figure in found.evidence]
    return {"verdict": found.verdict, "reason": reason(found), "figures": figures}


def record_response(analysis: Analysis) -> dict[str, Any]:
    """The periodic response of the scene's own loop at the times `t`."""
    response = analysis.response
    if response is None:
        return {"problem": analysis.problems["response"]}
    return {
        "states": response.states,
        "tip_error_xy": response.tip,
        "largest_tip_error": response.tip_error.max(),
        "rms_tip_error": np.sqrt(np.mean(response.tip_error[:-1] ** 2)),
        **record_fields(response, "error amplification status"),
    }


def record_simulation(analysis: Analysis) -> dict[str, Any]:
    """The nonlinear equations beside the linear prediction."""
    simulation = analysis.simulation
    if simulation is None:
        return {"problem": analysis.problems["simulation"]}
    return {
        **record_fields(simulation, "t nonlinear linear torque tip tip_linear tip_rigid error linear_error status"),
        "largest_tip_difference": simulation.difference,
        "largest_tip_error": simulation.tip_error,
        "largest_tip_difference_error": simulation.difference_error,
        **({"events": simulation.events} if simulation.events else {}),
    }


def record_load(a: Analysis, loop: Loop) -> dict[str, Any]:
    """The drives' figures of a loop as data; empty where there are none."""
    load = a.load(loop)
    if load is None:
        return {}
    rows = [record_fields(demand, "what joint value limit unit exceeds") for demand in load.demands]
    return {"drives": {"demands": rows, "exceeds": bool(load.exceeded)}}


def record_margin(margin: Margin) -> dict[str, Any]:
    """One number's critical values as data that JSON can hold."""
    critical = [record_fields(one, "value error kind resonance distance slope touching") for one in margin.critical]
    return record_fields(margin, "path low high own values gap searched") | {"critical": critical}


def record_endured(found: Margins) -> dict[str, Any]:
    """The margins of one loop; not finite where there is no limit, or `reason` says why it is not known. Phase in rad, delay in s."""
    return record_fields(found, "gain errors phase delay reason" if found.reason else "gain errors phase delay")


def record_nearest(found: "NearestInstability") -> dict[str, Any]:
    """The nearest place of instability; not finite where none was found."""
    numbers = zip(found.paths, found.own, found.values, strict=True)
    return {
        "numbers": {path: {"own": own, "value": value} for path, own, value in numbers},
        **record_fields(found, "scale confirmed furthest tried growth status"),
        "error": found.error if np.isfinite(found.scale) else None,
    }


def record_linear_range(analysis: Analysis) -> dict[str, Any]:
    """Amplitudes, in rad or m, at which second-order terms count along the slowest modes of the scene's own loop."""
    found = analysis.linear_range
    if found is None:
        return {"status": analysis.problems["linear range"]}
    return record_fields(found, "status share directions amplitudes errors")


def audit_block(audit: "Audit") -> dict[str, Any]:
    """Which effects and modes the scene needs; a significance that is not finite means another verdict."""
    found, minimal = audit.minimal, None
    if found is not None:
        minimal = record_fields(found, "dropped added coordinates error") | {"scene": record_tables(found.scene)}
    problem = {"problem": audit.problem} if audit.problem else {}
    rows = {"rows": (*audit.effects, *audit.modes), "pairs": audit.pairs, "minimal": minimal}
    return record_fields(audit, "tolerance needed droppable missing") | rows | problem


def record_sensitivity(data: "xarray.Dataset") -> dict[str, Any]:
    """What one percent more of each number does to each growth rate, in 1/s, beside the number and the exponents."""
    numbers = {name: data[name].values for name in ("exponents", "condition", "percent")}
    return {"parameters": data["parameter"].values, "values": data["value"].values, **numbers}


def list_versions() -> dict[str, str]:
    """Versions of flexlin, Python and the packages that made the numbers: of those that may, the ones that are loaded."""
    packages = {package: str(sys.modules[package].__version__) for package in PACKAGES if package in sys.modules}
    place = "-".join(filter(None, (system(), release(), machine(), "".join(libc_ver()))))  # platform() starts a program
    return {"flexlin": flexlin.__version__, "python": python_version(), "platform": place, **packages}


def record_fields(thing: Any, names: str) -> dict[str, Any]:
    """Some attributes by their names."""
    return {name: getattr(thing, name) for name in names.split()}
