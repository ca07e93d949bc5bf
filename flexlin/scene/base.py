"""What all tables of a scene share: frozen, no unknown keys, finite numbers, SI units and radians."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, get_args

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, model_validator
from pydantic_core import core_schema

from flexlin.bounds import LARGEST_NUMBER, MOST_ITEMS, SMALLEST_NUMBER, steers
from flexlin.scene.units import in_unit, keep_quantity, split_units


def _say_units(schema: dict[str, Any], table: Any) -> None:
    """Let the descriptions in a JSON schema end with the unit, which editors show."""
    for key, unit in table.units().items():
        stated = schema["properties"].get(key, {})
        if unit and "description" in stated:
            stated["description"] += f" [{unit}]"


class Table(BaseModel):
    """One table of a scene file."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, ser_json_inf_nan="constants", use_attribute_docstrings=True,
        json_schema_extra=_say_units,
    )  # fmt: skip
    read_before: ClassVar[tuple[str, ...]] = ()
    """Keys that stand for others, and are replaced before the table is checked."""

    @classmethod
    def units(cls) -> dict[str, str]:
        """The unit of each key that states one."""
        marks = [(key, mark) for key, field in cls.model_fields.items() for mark in field.metadata]
        return {key: mark.name for key, mark in marks if isinstance(mark, Unit)}

    @model_validator(mode="before")
    @classmethod
    def _in_si(cls, raw: Any, info: ValidationInfo) -> Any:
        """Numbers with a unit behind them, "1000 mm", in the unit of their key; the data itself holds numbers from then on."""
        if isinstance(raw, dict):
            sliding = info.context["sliding"] if info.context else None
            for key, unit in cls.units().items():
                marks = cls.model_fields[key].metadata
                if isinstance(raw.get(key), (str, list, tuple)) and not any(isinstance(mark, Kept) for mark in marks):
                    raw[key] = in_unit(raw[key], unit, sliding)
        return raw


@dataclass(frozen=True)
class Unit:
    """The unit of a key, stated beside its type: `mass: Annotated[NonNegative, Unit("kg")]`; empty for a ratio."""

    name: str

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        """The key's JSON schema, with the unit in it; a number may be a text with a unit behind it."""
        made = handler(core)
        return {**(with_text(made) if self.name else made), "unit": self.name}


@dataclass(frozen=True)
class Kept(Unit):
    """The units of a quantity, or a list of such, that is kept as it was written: in which of them it is, is the arm's to say."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        units = split_units(self.name)
        kept = core_schema.no_info_plain_validator_function(lambda value: keep_quantity(value, units))
        return core_schema.nullable_schema(kept) if type(None) in get_args(source) else kept

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        one: list[dict[str, Any]] = [{"type": "number", "exclusiveMinimum": 0}, {"type": "string"}]
        none = [{"type": "null"}] if core["type"] == "nullable" else []
        return {"anyOf": [*one, {"type": "array", "items": {"anyOf": one}}, *none], "unit": self.name}


def with_text(schema: dict[str, Any]) -> dict[str, Any]:
    """A JSON schema that takes a text, such as "2 mm", where it takes a number."""
    if schema.get("type") == "number":
        return {"anyOf": [schema, {"type": "string", "pattern": r"^\s*[+-]?[0-9.]"}]}
    if "anyOf" in schema:
        return {**schema, "anyOf": [with_text(one) for one in schema["anyOf"]]}
    return {**schema, "items": with_text(schema["items"])} if "items" in schema else schema


def _not_tiny(value: float) -> float:
    if 0 < abs(value) < SMALLEST_NUMBER:
        raise ValueError(f"a number of at least {SMALLEST_NUMBER:g}, or 0 where that is allowed")
    return value


def _shown_as_it_stands(text: str) -> str:
    if any(steers(character) for character in text):
        raise ValueError("a text without control characters")
    return text


Number = Annotated[float, Field(strict=True, ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
Positive = Annotated[float, Field(strict=True, gt=0, le=LARGEST_NUMBER), AfterValidator(_not_tiny)]
NonNegative = Annotated[float, Field(strict=True, ge=0, le=LARGEST_NUMBER), AfterValidator(_not_tiny)]
Text = Annotated[str, AfterValidator(_shown_as_it_stands)]
"""One line that is printed as it stands, so nothing in it may steer a terminal."""


def _not_endless(value: object) -> object:
    if isinstance(value, (list, tuple)) and len(value) > MOST_ITEMS:
        raise ValueError(f"a list of {MOST_ITEMS} at most")
    return value


NotEndless = BeforeValidator(_not_endless)
"""Refuses a list that is too long before any of its items is looked at."""

PerLink = NonNegative | tuple[NonNegative, ...]
"""A number for all links or joints that an effect acts on, or a list of one each."""
AllPositive = Positive | Annotated[tuple[Positive, ...], Field(min_length=1)]
"""As `PerLink`, none of them zero."""
