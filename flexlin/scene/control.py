"""The tables of control: loop, weights, filters, estimators, drives, and the designs to be compared with the scene's own loop."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, Field, model_validator

from flexlin.scene.base import Kept, NonNegative, NotEndless, Positive, Table, Text, Unit

RATE = "_rate"
"""What stands behind a coordinate's name for its rate."""


class Weights(Table):
    """The largest acceptable deviations (Bryson's rule): Q and R hold the inverses of their squares.

        Q(t) = sum_i (y_i / d_i)^2 + |C_tip(t) [y; y']|^2 / d_tip^2,   R = diag(1 / d_u^2)

    tip: distance of the tip from its path; joints, rates: each angle of joints and of motors behind flexible joints, and its rate (a
    list: one a joint); deflection, deflection_rates: each elastic coordinate; input: each torque (a list: one each).
    integrals: the integral of each torque-driven joint's error, a state more (LQI).
    A coordinate's own name, such as w11 or q1_rate, takes the place of what the others say about it. What is not named costs nothing.
    """

    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False)
    __pydantic_extra__: dict[str, Annotated[Any, Kept("rad, m, rad/s or m/s")]]

    tip: Annotated[Positive | None, Unit("m")] = None
    """Acceptable distance of the tip from its path."""
    joints: Annotated[Any | None, Kept("rad or m")] = None
    """Acceptable deviation of joints, or a list of one each."""
    rates: Annotated[Any | None, Kept("rad/s or m/s")] = None
    """Acceptable deviation of the joints' rates, or a list of one each."""
    deflection: Annotated[Positive | None, Unit("m")] = None
    """Acceptable deviation of elastic coordinates."""
    deflection_rates: Annotated[Positive | None, Unit("m/s")] = None
    """Acceptable rate of elastic coordinates."""
    integrals: Annotated[Any | None, Kept("rad s or m s")] = None
    """Acceptable integral of the error of each torque-driven joint, or a list of one each: the design has integral action."""
    input: Annotated[Any, Kept("N m, N or V")]
    """Acceptable torque, or a list of one each."""

    @property
    def coordinates(self) -> dict[str, Any]:
        """What is said of single coordinates and rates, by their names."""
        return dict(self.__pydantic_extra__ or {})


class Filter(Table):
    """What all filters share: what they act on, and at which joints."""

    on: Literal["torque", "rates"] = "torque"
    """torque: the feedback's torque, the feedforward is added behind it; rates: the measured rates of the joints."""
    joints: Annotated[tuple[Annotated[int, Field(strict=True, ge=1)], ...] | None, Field(min_length=1)] = None
    """Numbers of the torque-driven joints that have this filter, from 1; all of them by default."""


class LowPass(Filter):
    """w/(s + w), or w^2/(s^2 + sqrt(2) w s + w^2) of second order (Butterworth), w = 2 pi cutoff."""

    kind: Literal["low-pass"]
    """The kind of filter."""
    cutoff: Annotated[Positive, Unit("Hz")]
    """Frequency at which half of the power passes."""
    order: Literal[1, 2] = 2
    """Order of the filter."""


class Notch(Filter):
    """(s^2 + 2 gain damping w s + w^2)/(s^2 + 2 damping w s + w^2), w = 2 pi frequency."""

    kind: Literal["notch"]
    """The kind of filter."""
    frequency: Annotated[Positive, Unit("Hz")]
    """What it takes out."""
    damping: Annotated[Positive, Unit("")] = 0.5
    """Damping ratio of its poles: the notch is about twice this times its frequency wide."""
    gain: Annotated[NonNegative, Field(lt=1), Unit("")] = 0.0
    """What passes at its frequency, from 0 (nothing) to below 1."""


AnyFilter = Annotated[LowPass | Notch, Field(discriminator="kind")]


class Gauge(Table):
    """A strain gauge: the curvature of a link at a place."""

    link: Annotated[int, Field(strict=True, ge=1)]
    """Number of the link, from 1."""
    at: Annotated[NonNegative, Field(le=1)] = 0.0
    """Place x / l on it, from 0 (joint) to 1 (tip)."""
    noise: Annotated[Positive, Unit("1/m")]
    """Standard deviation of a sample."""


class EstimatorTable(Table):
    """Sensors and their noise: the standard deviation of one sample each, taken every `sample_time`.

    V = sigma^2 sample_time for each measurement, W = B sigma^2 sample_time B' for the torques: the intensities of white noise.
    """

    encoders: Annotated[Any | None, Kept("rad or m")] = None
    """Noise of the motors' encoders, or a list of one each."""
    gyroscopes: Annotated[Any | None, Kept("rad/s or m/s")] = None
    """Noise of the joints' rates, or a list of one each."""
    strain: tuple[Gauge, ...] = ()
    """Strain gauges."""
    tip: Annotated[Positive | None, Unit("m")] = None
    """Noise of a camera that sees the tip, along each axis."""
    torque: Annotated[Any, Kept("N m, N or V")]
    """Noise of the torques, or a list of one each: what the model leaves out."""
    sample_time: Annotated[Positive, Unit("s")] = 1e-3
    """Time between two samples of the noise."""

    @model_validator(mode="after")
    def _measures(self) -> "EstimatorTable":
        if self.encoders is None and self.gyroscopes is None and self.tip is None and not self.strain:
            raise ValueError("at least one sensor: encoders, gyroscopes, strain or tip")
        return self


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
    tracking_time: Annotated[Positive | None, Unit("s")] = None
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
    encoders: Annotated[tuple[Positive, ...] | None, Unit("rad or m")] = None
    """Steps to which the encoders' readings are rounded; in the nonlinear simulation."""
    torque: Annotated[tuple[Positive, ...] | None, Unit("N m or N")] = None
    """Steps to which the torques are rounded; in the nonlinear simulation."""

    @model_validator(mode="after")
    def _acts_within_the_sample(self) -> "Sampling":
        if self.delay > self.period:
            raise ValueError(f"a delay of 0 to the period, {self.period:g} s")
        return self


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
    sample_time: Annotated[Positive | None, Unit("s")] = None
    """Time between samples that fill whole periods: the gains are those of a periodic-lqr whose torque is held from sample to sample."""

    @model_validator(mode="after")
    def _weighs_once_and_samples_what_is_known(self) -> "DesignTable":
        bare = (self.state_weight is None, self.input_weight is None)
        if bare != ((True, True) if self.weights is not None else (False, False)):
            raise ValueError(
                'either weights = { joints = "0.5 deg", ..., input = "3 N m" }, or state_weight and input_weight'
            )
        remembers = self.estimator is not None or (self.weights is not None and self.weights.integrals is not None)
        if self.sample_time is not None and (self.kind != "periodic-lqr" or remembers):
            raise ValueError('sample_time beside kind = "periodic-lqr", without an estimator or integrals')
        return self


class TorqueLimits(Table):
    """Limits of a joint's torque, or of its force where it slides."""

    peak: Annotated[Any | None, Kept("N m or N")] = None
    """Largest torque at any time, N m (N)."""
    continuous: Annotated[Any | None, Kept("N m or N")] = None
    """Largest root mean square of the torque over a period, N m (N)."""


class CurrentLimits(Table):
    """Limits of a motor's current."""

    peak: Annotated[Any | None, Kept("A")] = None
    """Largest current at any time, A."""
    continuous: Annotated[Any | None, Kept("A")] = None
    """Largest root mean square of the current over a period, A."""


class Drives(Table):
    """Limits at the joints, behind the gears: torque, speed, power, and the motors' current.

    Each limit is a quantity for all torque-driven joints, or a list of one each.
    """

    torque: TorqueLimits = TorqueLimits()
    """Limits of the torque."""
    speed: Annotated[Any | None, Kept("rad/s or m/s")] = None
    """Largest speed of the joint, rad/s (m/s)."""
    power: Annotated[Any | None, Kept("W")] = None
    """Largest power at the joint, W."""
    current: CurrentLimits = CurrentLimits()
    """Limits of the motors' current."""
    torque_constant: Annotated[Any | None, Kept("N m/A or N/A")] = None
    """Torque at the joint for an ampere, N m/A (N/A); where [effects.motor] is on it is known already."""
