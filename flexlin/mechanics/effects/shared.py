"""Numbers of an effect that its table gives once for all joints or links, or in a list."""

from typing import Any


def per_joint(value: Any, joint: int, *, single: str) -> Any:
    """Read a table's value for one joint: a tuple by index; a single number stands for the `"first"` joint or for `"every"` one."""
    if isinstance(value, tuple):
        return value[joint] if joint < len(value) else 0.0
    return value if single == "every" or joint == 0 else 0.0


def at_tip(value: Any, link: int, links: int) -> Any:
    """Read a table's value for the tip of one link: a tuple by index; a single number stands for the last link."""
    if isinstance(value, tuple):
        return value[link] if link < len(value) else 0.0
    return value if link == links - 1 else 0.0
