"""The name of a step that is one of several: a progress display makes a percentage and the time left of it."""


class Counted(str):
    """A step's name with its place: `Counted("exponents", 3, 20)` reads "exponents (3 of 20)"; 3 of them are done."""

    done: int
    total: int

    def __new__(cls, name: str, done: int, total: int) -> "Counted":
        """Make the text once, so that whatever takes a name takes this one."""
        made = super().__new__(cls, f"{name} ({done} of {total})")
        made.done, made.total = done, total
        return made
