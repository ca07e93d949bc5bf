"""Filters of the feedback: low-pass and notch, on the torque that it asks for or on the rates that it measures."""

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema

from flexlin.scene.base import NonNegative, Positive, Table, Unit
from flexlin.scene.units import NUMBER_OR_TEXT, in_si

Frequency = Annotated[
    Positive,
    BeforeValidator(lambda value: in_si(value, "Hz") if isinstance(value, str) else value),
    WithJsonSchema(NUMBER_OR_TEXT),
    Unit("Hz"),
]


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
    cutoff: Frequency
    """Frequency at which half of the power passes."""
    order: Literal[1, 2] = 2
    """Order of the filter."""


class Notch(Filter):
    """(s^2 + 2 gain damping w s + w^2)/(s^2 + 2 damping w s + w^2), w = 2 pi frequency."""

    kind: Literal["notch"]
    """The kind of filter."""
    frequency: Frequency
    """What it takes out."""
    damping: Annotated[Positive, Unit("")] = 0.5
    """Damping ratio of its poles: the notch is about twice this times its frequency wide."""
    gain: Annotated[NonNegative, Field(lt=1), Unit("")] = 0.0
    """What passes at its frequency, from 0 (nothing) to below 1."""


AnyFilter = Annotated[LowPass | Notch, Field(discriminator="kind")]
