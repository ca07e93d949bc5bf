"""The tables of control: the scene's own loop, and the designs to be compared with it."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from flexlin.scene.base import NonNegative, NotEndless, Positive, Table, Text, Unit
from flexlin.scene.estimator import Duration, EstimatorTable
from flexlin.scene.filters import AnyFilter
from flexlin.scene.weights import Weights


class Pd(Table):
    """u = -kp (q - q_R) - kd (q' - q_R'), one gain a torque-driven joint."""

    kind: Literal["pd"]
    """The kind of feedback."""
    kp: Annotated[tuple[NonNegative, ...], Unit("N m/rad or N/m")]
    """Stiffness of each torque-driven joint's loop."""
    kd: Annotated[tuple[NonNegative, ...], Unit("N m s/rad or N s/m")]
    """Damping of each torque-driven joint's loop."""


class Pid(Table):
    """u = -kp e - kd e' - ki int e dt with e = q - q_R, one gain a torque-driven joint."""

    kind: Literal["pid"]
    """The kind of feedback."""
    kp: Annotated[tuple[NonNegative, ...], Unit("N m/rad or N/m")]
    """Stiffness of each torque-driven joint's loop."""
    kd: Annotated[tuple[NonNegative, ...], Unit("N m s/rad or N s/m")]
    """Damping of each torque-driven joint's loop."""
    ki: Annotated[tuple[NonNegative, ...], Unit("N m/(rad s) or N/(m s)")]
    """Gain on the integral of each torque-driven joint's error; a joint with 0 has no integral."""
    tracking_time: Duration | None = None
    """Time in which a drive at its limit empties the integral: (int e)' = e + (asked - given) / (ki tracking_time)."""


def _none_at_all(value: Any) -> Any:
    """No feedback, said in words: { kind = "none" }."""
    if isinstance(value, dict) and value.get("kind") == "none":
        if len(value) > 1:
            raise ValueError('kind = "none" alone, kind = "pd" with kp and kd, or kind = "pid" with ki too')
        return None
    return value


AnyFeedback = Annotated[Pd | Pid, Field(discriminator="kind")]


class Saturation(Table):
    """The motors give no more than this torque, in N m, one number a torque-driven joint."""

    torque: Annotated[tuple[Positive, ...], Unit("N m or N")]
    """Largest torque of each torque-driven joint."""
    rate: Annotated[tuple[Positive, ...] | None, Unit("N m/s or N/s")] = None
    """Largest rate at which the torque of each torque-driven joint changes."""


class Sampling(Table):
    """The torque is computed once every `period` (s), held in between, and takes effect `delay` (s) after the measurement."""

    period: Annotated[Positive, Unit("s")]
    """Time between two samples."""
    delay: Annotated[NonNegative, Unit("s")] = 0.0
    """Time from the measurement to the torque."""


class Control(Table):
    """The loop that runs on the arm: feedforward along the basic motion, and feedback about it.

    Integrals and filters are states of the controller, in the linear equations as in the nonlinear simulation. `saturation` and
    `sampling` are on when their tables are present; the linear equations leave both out, the nonlinear simulation
    does not. `about = "elastic"` judges the loop about the periodic motion of the elastic arm too, beside the rigid one.
    """

    feedforward: Literal["rigid", "joint-exact", "tip-exact", "none"] = "rigid"
    """rigid: the torque of the rigid motion; joint-exact, tip-exact: of the elastic motion that keeps joints or tip on their path."""
    feedback: Annotated[AnyFeedback | None, BeforeValidator(_none_at_all)] = None
    """The feedback about the basic motion; kind = "none", or no table: none."""
    filters: Annotated[tuple[AnyFilter, ...], NotEndless] = ()
    """Filters of the feedback, one behind the other in this order."""
    saturation: Saturation | None = None
    """What the motors give at most; in the nonlinear simulation."""
    sampling: Sampling | None = None
    """How the controller samples; in the nonlinear simulation."""
    about: Literal["rigid", "elastic"] = "rigid"
    """elastic: judge the loop about the elastic arm's own motion too."""


class DesignTable(Table):
    """A controller to be designed; weights in physical sizes, or the bare diagonals of Q (state [y; y']) and R."""

    name: Annotated[Text, Field(min_length=1, max_length=400)]
    """Name in reports."""
    kind: Literal["periodic-lqr", "frozen-lqr", "averaged-lqr", "finite-horizon-lqr"]
    """The kind of design."""
    weights: Weights | None = None
    """Acceptable deviations, in physical sizes."""
    state_weight: tuple[NonNegative, ...] | None = None
    """Diagonal of Q for the state [y; y']."""
    input_weight: tuple[Positive, ...] | None = None
    """Diagonal of R for the inputs."""
    estimator: EstimatorTable | None = None
    """Sensors and their noise: the design is judged with its states estimated, too."""
    phases: Annotated[int, Field(strict=True, ge=1, le=4096)] = 16
    """Places of a period at which a frozen-lqr is designed."""

    @model_validator(mode="after")
    def _weighs_once(self) -> "DesignTable":
        bare = (self.state_weight is None, self.input_weight is None)
        if bare != ((True, True) if self.weights is not None else (False, False)):
            raise ValueError(
                'either weights = { joints = "0.5 deg", ..., input = "3 N m" }, or state_weight and input_weight'
            )
        return self
