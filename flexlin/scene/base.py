"""What all tables of a scene share: frozen, no unknown keys, finite numbers, SI units and radians."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


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


LARGEST = 1e30
"""No number of an arm is larger; squares and cubes of it stay far from overflow."""

Number = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(strict=True, gt=0, le=LARGEST)]
NonNegative = Annotated[float, Field(strict=True, ge=0, le=LARGEST)]
Count = Annotated[int, Field(strict=True, ge=0)]

PerLink = NonNegative | tuple[NonNegative, ...]
"""A number for all links or joints that an effect acts on, or a list of one each."""
AllPositive = Positive | Annotated[tuple[Positive, ...], Field(min_length=1)]
"""As `PerLink`, none of them zero."""
