"""What a verdict is worth: the words behind it where the linear model does not hold, or where no arm would show the decay."""

from flexlin.answers.judging import Loop
from flexlin.answers.validity import ModelEvidence, ModelValidity
from flexlin.report.wording import caution, format_quantity

BROKEN = "but the linear model does not hold here"
UNDECIDED = "and the linear model does not hold here"


def doubt(loop: Loop, period: float, model: ModelValidity) -> str:
    """What goes behind a verdict that is not to be believed as it stands; nothing behind one that is, nor behind an unstable one."""
    if model.verdict == "invalid" and loop.verdict in ("stable", "undecided"):
        return BROKEN if loop.verdict == "stable" else UNDECIDED
    return caution(loop, period)


def colour(loop: Loop, period: float, model: ModelValidity) -> str:
    """The class of a loop's verdict: that of doubt where there is one."""
    return "undecided" if doubt(loop, period, model) else loop.verdict


def reason(validity: ModelValidity) -> str:
    """The figure that speaks against the linear model, in words; nothing where none does."""
    return "" if validity.reason is None else describe_evidence(validity.reason)


def describe_evidence(found: ModelEvidence) -> str:
    """One figure in words."""
    size = format_quantity(found.value, found.unit).rstrip()
    of_arm = f"{size}, {100 * found.share:.3g} % of the arm's length"
    if found.what == "bending":
        return f"by the linear answer its links bend by {of_arm}, and the equations are those of small bending"
    if found.what == "tip":
        return f"by the linear answer its tip is {of_arm}, away from its rigid path, and deflections must be small"
    if found.what == "difference":
        return (
            f"the linear answer misses the nonlinear one by {size}, {100 * found.share:.3g} % of the largest deviation"
        )
    return f"the nonlinear equations lose their meaning after {format_quantity(found.bound, 's')}"
