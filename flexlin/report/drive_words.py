"""What a loop asks of the drives, in words and as data."""

from typing import Any

from flexlin.answers.analysis import Analysis
from flexlin.answers.judging import Loop
from flexlin.control.drives import Demand, DriveLoad
from flexlin.report.wording import format_quantity


def largest(load: DriveLoad, what: str) -> str:
    """The largest figure of all joints, such as the peak torque."""
    found = [demand for demand in load.demands if demand.what == what]
    units = {demand.unit for demand in found}
    return " and ".join(sorted(format_quantity(max(d.value for d in found if d.unit == unit), unit) for unit in units))


def drive_cells(a: Analysis, loop: Loop) -> dict[str, str]:
    """The cells of a loop in the comparison."""
    load = a.load(loop)
    if load is None:
        return {"torque": "–", "rms": "–", "power": "–", "over": ""}
    over = "; ".join(f"above the drive: {describe_demand(demand)}" for demand in load.exceeded)
    cells = {"torque": "peak torque", "rms": "RMS torque", "power": "peak power"}
    return {key: largest(load, what) for key, what in cells.items()} | {"over": over}


def describe_demand(demand: Demand) -> str:
    """One demand above its limit: peak torque of q1 1.28 N m, limit 0.4 N m."""
    value = format_quantity(demand.value, demand.unit)
    limit = "" if demand.limit is None else f", limit {format_quantity(demand.limit, demand.unit)}"
    return f"{demand.what} of {demand.joint} {value}{limit}"


def drive_line(a: Analysis, loop: Loop) -> str:
    """What a loop asks beyond its drives, in one line; nothing where it does not."""
    load = a.load(loop)
    return "" if load is None or not load.exceeded else f"above the drive: {describe_demand(load.exceeded[0])}"


def comment_on_drives(a: Analysis) -> list[str]:
    """Which loops ask more than the drives give, and how much room the others leave."""
    if a.scene.drives is None:
        return []
    said = []
    for loop in a.loops:
        load = a.load(loop)
        if load is not None and load.exceeded:
            worst = load.exceeded[0]
            more = f" ({len(load.exceeded)} limits in all)" if len(load.exceeded) > 1 else ""
            said.append(
                f"In steady motion {name_of(loop)} asks more than the drives give: {describe_demand(worst)}{more}. "
                "Slow down, lower the payload, or take a stronger drive."
            )
    return said


def comment_on_gains(a: Analysis, loop: Loop) -> str:
    """What a faster design takes of the drives, as far as limits are known."""
    load = a.load(loop)
    if load is None:
        return "compare its gains with what the drive allows"
    torque = f"in steady motion it asks for {largest(load, 'peak torque')} at most"
    if a.scene.drives is None:
        return f"{torque}; give [drives] limits to have it held against them"
    return f"{torque}, {'more than' if load.exceeded else 'within what'} the drives give"


def name_of(loop: Loop) -> str:
    """A loop within a sentence."""
    return "the arm without feedback" if loop.kind == "open" else f"the {loop.name}"


def record_load(a: Analysis, loop: Loop) -> dict[str, Any]:
    """The drives' figures of a loop as data; empty where there are none."""
    load = a.load(loop)
    if load is None:
        return {}
    rows = [
        {"what": d.what, "joint": d.joint, "value": d.value, "limit": d.limit, "unit": d.unit, "exceeds": d.exceeds}
        for d in load.demands
    ]
    return {"drives": {"demands": rows, "exceeds": bool(load.exceeded)}}
