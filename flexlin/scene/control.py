"""The tables of control: the scene's own loop, and the designs to be compared with it."""

from typing import Annotated, Literal

from pydantic import Field

from flexlin.scene.base import NonNegative, Positive, Table


class Pd(Table):
    """u = -kp (q - q_R) - kd (q' - q_R'), one gain a torque-driven joint."""

    kind: Literal["pd"]
    kp: tuple[NonNegative, ...]
    kd: tuple[NonNegative, ...]


class Control(Table):
    """The loop that runs on the arm: feedforward along the basic motion, and feedback about it."""

    feedforward: Literal["rigid", "none"] = "rigid"
    feedback: Pd | None = None


class Design(Table):
    """A controller to be designed; weights are the diagonals of Q (state [y; y']) and R."""

    name: Annotated[str, Field(min_length=1)]
    kind: Literal["periodic-lqr", "frozen-lqr", "averaged-lqr"]
    state_weight: tuple[NonNegative, ...]
    input_weight: tuple[Positive, ...]
    phases: Annotated[int, Field(strict=True, ge=1, le=4096)] = 16
