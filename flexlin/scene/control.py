"""The tables of control: the scene's own loop, and the designs to be compared with it."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from flexlin.scene.base import NonNegative, Positive, Table, Text
from flexlin.scene.weights import Weights


class Pd(Table):
    """u = -kp (q - q_R) - kd (q' - q_R'), one gain a torque-driven joint."""

    kind: Literal["pd"]
    kp: tuple[NonNegative, ...]
    kd: tuple[NonNegative, ...]


class Saturation(Table):
    """The motors give no more than this torque, in N m, one number a torque-driven joint."""

    torque: tuple[Positive, ...]


class Sampling(Table):
    """The torque is computed once every `period` (s), held in between, and takes effect `delay` (s) after the measurement."""

    period: Positive
    delay: NonNegative = 0.0


class Control(Table):
    """The loop that runs on the arm: feedforward along the basic motion, and feedback about it.

    `saturation` and `sampling` are on when their tables are present; the linear equations leave both out, the nonlinear simulation
    does not. `about = "elastic"` judges the loop about the periodic motion of the elastic arm too, beside the rigid one.
    """

    feedforward: Literal["rigid", "none"] = "rigid"
    feedback: Pd | None = None
    saturation: Saturation | None = None
    sampling: Sampling | None = None
    about: Literal["rigid", "elastic"] = "rigid"


class DesignTable(Table):
    """A controller to be designed; weights in physical sizes, or the bare diagonals of Q (state [y; y']) and R."""

    name: Annotated[Text, Field(min_length=1, max_length=400)]
    kind: Literal["periodic-lqr", "frozen-lqr", "averaged-lqr", "finite-horizon-lqr"]
    weights: Weights | None = None
    state_weight: tuple[NonNegative, ...] | None = None
    input_weight: tuple[Positive, ...] | None = None
    phases: Annotated[int, Field(strict=True, ge=1, le=4096)] = 16

    @model_validator(mode="after")
    def _weighs_once(self) -> "DesignTable":
        bare = (self.state_weight is None, self.input_weight is None)
        if bare != ((True, True) if self.weights is not None else (False, False)):
            raise ValueError(
                'either weights = { joints = "0.5 deg", ..., input = "3 N m" }, or state_weight and input_weight'
            )
        return self
