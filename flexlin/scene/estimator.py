"""What a designed controller measures, and how noisy it is: the table `estimator` of a design."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, PlainValidator, WithJsonSchema, model_validator

from flexlin.scene.base import NonNegative, Positive, Table, Unit
from flexlin.scene.units import NUMBER_OR_TEXT, ONE_OR_MORE, Length, in_si, kept_quantities

Curvature = Annotated[
    Positive, BeforeValidator(lambda value: _in(value, "1/m")), WithJsonSchema(NUMBER_OR_TEXT), Unit("1/m")
]
Duration = Annotated[
    Positive, BeforeValidator(lambda value: _in(value, "s")), WithJsonSchema(NUMBER_OR_TEXT), Unit("s")
]
AnyAngle = Annotated[Any, PlainValidator(kept_quantities("rad", "m")), WithJsonSchema(ONE_OR_MORE)]
AnyTurn = Annotated[Any, PlainValidator(kept_quantities("rad/s", "m/s")), WithJsonSchema(ONE_OR_MORE)]
AnyNoise = Annotated[Any, PlainValidator(kept_quantities("N m", "N", "V")), WithJsonSchema(ONE_OR_MORE)]


def _in(value: Any, unit: str) -> Any:
    return in_si(value, unit) if isinstance(value, str) else value


class Gauge(Table):
    """A strain gauge: the curvature of a link at a place."""

    link: Annotated[int, Field(strict=True, ge=1)]
    """Number of the link, from 1."""
    at: Annotated[NonNegative, Field(le=1)] = 0.0
    """Place x / l on it, from 0 (joint) to 1 (tip)."""
    noise: Curvature
    """Standard deviation of a sample."""


class EstimatorTable(Table):
    """Sensors and their noise: the standard deviation of one sample each, taken every `sample_time`.

    V = sigma^2 sample_time for each measurement, W = B sigma^2 sample_time B' for the torques: the intensities of white noise.
    """

    encoders: Annotated[AnyAngle | None, Unit("rad or m")] = None
    """Noise of the motors' encoders, or a list of one each."""
    gyroscopes: Annotated[AnyTurn | None, Unit("rad/s or m/s")] = None
    """Noise of the joints' rates, or a list of one each."""
    strain: tuple[Gauge, ...] = ()
    """Strain gauges."""
    tip: Length | None = None
    """Noise of a camera that sees the tip, along each axis."""
    torque: Annotated[AnyNoise, Unit("N m, N or V")]
    """Noise of the torques, or a list of one each: what the model leaves out."""
    sample_time: Duration = 1e-3
    """Time between two samples of the noise."""

    @model_validator(mode="after")
    def _measures(self) -> "EstimatorTable":
        if self.encoders is None and self.gyroscopes is None and self.tip is None and not self.strain:
            raise ValueError("at least one sensor: encoders, gyroscopes, strain or tip")
        return self
