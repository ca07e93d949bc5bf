"""What all tables of a scene share: frozen, no unknown keys, finite numbers, SI units and radians."""

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from flexlin.text import steers


class Table(BaseModel):
    """One table of a scene file."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @classmethod
    def units(cls) -> dict[str, str]:
        """The unit of each key that states one."""
        stated = {
            key: [mark.name for mark in field.metadata if isinstance(mark, Unit)]
            for key, field in cls.model_fields.items()
        }
        return {key: names[0] for key, names in stated.items() if names}


@dataclass(frozen=True)
class Unit:
    """The unit of a key, stated beside its type: `mass: Annotated[NonNegative, Unit("kg")]`; empty for a ratio."""

    name: str

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        """The key's JSON schema, with the unit in it."""
        return {**handler(core), "unit": self.name}


LARGEST = 1e30
"""No number of an arm is larger; squares and cubes of it stay far from overflow."""

SMALLEST = 1e-30
"""A figure of an arm that is smaller must be zero; quotients and powers then stay numbers."""


def _not_tiny(value: float) -> float:
    if 0 < abs(value) < SMALLEST:
        raise ValueError(f"a number of at least {SMALLEST:g}, or 0 where that is allowed")
    return value


def _shown_as_it_stands(text: str) -> str:
    if any(steers(character) for character in text):
        raise ValueError("a text without control characters")
    return text


Number = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(strict=True, gt=0, le=LARGEST), AfterValidator(_not_tiny)]
NonNegative = Annotated[float, Field(strict=True, ge=0, le=LARGEST), AfterValidator(_not_tiny)]
Text = Annotated[str, AfterValidator(_shown_as_it_stands)]
"""One line that is printed as it stands, so nothing in it may steer a terminal."""
MOST = 200
"""Links, or designs, of one scene."""


def _not_endless(value: object) -> object:
    if isinstance(value, (list, tuple)) and len(value) > MOST:
        raise ValueError(f"a list of {MOST} at most")
    return value


NotEndless = BeforeValidator(_not_endless)
"""Refuses a list that is too long before any of its items is looked at."""

PerLink = NonNegative | tuple[NonNegative, ...]
"""A number for all links or joints that an effect acts on, or a list of one each."""
AllPositive = Positive | Annotated[tuple[Positive, ...], Field(min_length=1)]
"""As `PerLink`, none of them zero."""
