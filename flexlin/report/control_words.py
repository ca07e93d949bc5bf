"""What the scene's controller holds beside its gains, in words."""

from flexlin.report.wording import format_quantity
from flexlin.scene.control import AnyFilter, Control, LowPass, Pid

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
