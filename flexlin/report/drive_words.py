"""What a controller holds beside its gains and what a loop asks of the drives, in words and as data."""

from flexlin.answers.analysis import Analysis
from flexlin.answers.judging import Loop
from flexlin.control.drives import Demand, DriveLoad
from flexlin.report.wording import format_quantity
from flexlin.scene.control import AnyFilter, Control, LowPass, Pid


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
                f"In steady motion {name_loop(loop)} asks more than the drives give: {describe_demand(worst)}{more}. "
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


def name_loop(loop: Loop) -> str:
    """A loop within a sentence."""
    return "the arm without feedback" if loop.kind == "open" else f"the {loop.name}"


PLACES = {"torque": "on the torque", "rates": "on the measured rates"}


def describe_controller(control: Control) -> str:
    """Integral action and filters of the scene's own loop, and what of its drive the linear verdict leaves out."""
    parts = []
    if isinstance(control.feedback, Pid) and any(control.feedback.ki):
        time = control.feedback.tracking_time
        parts.append("integral action" + (f", unwound within {format_quantity(time, 's')}" if time is not None else ""))
    parts += [describe_filter(one) for one in control.filters]
    said = ["with " + ", ".join(parts)] if parts else []
    left_out = [name for name, table in limits_of(control) if table is not None]
    said += [f"{' and '.join(left_out)} act in the simulation only"] if left_out else []
    return "; ".join(said)


def limits_of(control: Control) -> list[tuple[str, object]]:
    """What limits the drive, and its numbers."""
    limits = control.saturation
    return [("torque limits", limits), ("limits of the torque's rate", None if limits is None else limits.rate)]


def describe_filter(one: AnyFilter) -> str:
    """One filter: low-pass of order 2 at 200 Hz on the torque of joint 1."""
    if isinstance(one, LowPass):
        what = f"low-pass of order {one.order} at {format_quantity(one.cutoff, 'Hz')}"
    else:
        what = f"notch at {format_quantity(one.frequency, 'Hz')}"
    of = "" if one.joints is None else f" of joint {', '.join(map(str, one.joints))}"
    return f"{what} {PLACES[one.on]}{of}"
