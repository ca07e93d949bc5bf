"""What the raw table of control demands of itself and of the joints that are driven."""

from collections.abc import Iterator
from typing import Any

from flexlin.errors import Problem

COUNTED = (("feedback", "kp"), ("feedback", "kd"), ("feedback", "ki"), ("saturation", "torque"), ("saturation", "rate"))
"""Keys that hold one number for each torque-driven joint."""


def control_contradictions(control: dict[str, Any], powered: int) -> Iterator[Problem]:
    """List what does not fit in the raw table of control of an arm with so many torque-driven joints."""
    tables = {key: value if isinstance(value, dict) else {} for key, value in control.items()}
    for table, key in COUNTED:
        values = tables.get(table, {}).get(key)
        if isinstance(values, list) and len(values) != powered:
            yield Problem(
                f"control.{table}.{key}", f"{len(values)} numbers", f"{powered}, one for each torque-driven joint"
            )
    feedback, filters = tables.get("feedback", {}), control.get("filters")
    if feedback.get("tracking_time") is not None and not tables.get("saturation"):
        yield Problem(
            "control.feedback.tracking_time", "a time without a limit", "[control.saturation], at which it acts"
        )
    if isinstance(filters, list) and filters and feedback.get("kind", "none") == "none":
        yield Problem("control.filters", "filters without a feedback", "[control.feedback], which they filter")
    if tables.get("saturation", {}).get("rate") is not None and tables.get("sampling"):
        yield Problem(
            "control.saturation.rate",
            "a rate beside [control.sampling]",
            "one of them: a torque that is held changes in steps",
        )
    for i, table in enumerate(filters if isinstance(filters, list) else ()):
        joints = table.get("joints") if isinstance(table, dict) else None
        for joint in joints if isinstance(joints, list) else ():
            if isinstance(joint, int) and joint > powered:
                yield Problem(f"control.filters.{i}.joints", f"joint {joint}", f"numbers from 1 to {powered}")
