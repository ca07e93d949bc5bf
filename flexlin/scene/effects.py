"""The effects' tables: an effect is on when its table is present, off when it is not.

Which effects there are is not said here. Each is one file of `flexlin.mechanics.effects`, which registers itself when that package is
imported; the scene asks this registry, and has the package imported when it first needs to know.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, SerializeAsAny, WrapValidator, create_model

from flexlin.errors import Problem, counted
from flexlin.scene.base import Table

SHIPPED = "flexlin.mechanics.effects"
"""Importing this registers the shipped effects."""
RawTable = dict[str, Any]


@dataclass(frozen=True)
class RawArm:
    """The raw tables of the links, and of the motion of each link's joint (empty for a fixed one)."""

    links: Sequence[RawTable]
    joints: Sequence[RawTable]


class EffectTable(Table):
    """The table of an effect, and what a scene must know of the effect beside its keys."""

    lists: ClassVar[Literal["each", "first"] | None] = None
    """What a list in the table holds: one number for each link, one for each of the first links, or something else."""
    vectors: ClassVar[tuple[str, ...]] = ()
    """Keys whose list is a vector, not one number a link."""
    frees_motors: ClassVar[bool] = False
    """Whether each motor has a coordinate of its own."""
    frees_bearings: ClassVar[bool] = False
    """Whether each bearing gives across its joint's direction, by two coordinates."""
    inertia_keys: ClassVar[tuple[str, ...]] = ()
    """Keys any of which, unless it is zero, gives inertia to a link that has none itself."""

    @classmethod
    def summary(cls) -> str:
        """What the effect is, in one line."""
        return (cls.__doc__ or cls.__name__).strip().partition("\n")[0]

    @classmethod
    def gives_inertia(cls, raw: RawTable) -> bool:
        """Whether a raw table gives inertia to a link that has none itself; unknown counts as yes."""
        return any(raw.get(key) not in (None, 0) for key in cls.inertia_keys)

    @classmethod
    def contradictions(cls, raw: RawTable, arm: RawArm) -> Iterator[Problem]:
        """List where a raw table does not fit the links or the motion; keys as in the file."""
        yield from ()


def count_soft(raw: RawTable, moving: Sequence[int]) -> int:
    """How many of these joints a raw table does not hold by a 0 in its list of stiffnesses."""
    given = raw.get("stiffness")
    return sum(not isinstance(given, list) or i >= len(given) or given[i] != 0 for i in moving)


class Effects(Table):
    """The effects that a scene calls for: an optional table each; `effects_table` holds those that are registered."""

    def on(self) -> dict[str, EffectTable]:
        """The effects that are on, by name."""
        tables = {name: getattr(self, name) for name in type(self).model_fields}
        return {name: table for name, table in tables.items() if table is not None}

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the tables: the class that holds them is made anew of the effects that are registered there."""
        return restore_effects, (self.on(), set(self.model_fields_set))


_REGISTRY: dict[str, type[EffectTable]] = {}


def add_effect(name: str, effect: type[EffectTable]) -> None:
    """Let scenes hold a table [effects.name]."""
    _REGISTRY[name] = effect


def known_effects() -> dict[str, type[EffectTable]]:
    """Every effect that a scene may call for, by the name of its table, in the order of reports."""
    import_module(SHIPPED)
    return dict(_REGISTRY)


def effects_table() -> type[Effects]:
    """The table [effects], with a key for every known effect."""
    return _table_of(tuple(known_effects().items()))


@cache
def _table_of(effects: tuple[tuple[str, type[EffectTable]], ...]) -> type[Effects]:
    fields: dict[str, Any] = {
        name: (effect | None, Field(None, description=effect.summary())) for name, effect in effects
    }
    return create_model("Effects", __base__=Effects, **fields)


def restore_effects(tables: dict[str, EffectTable], given: set[str]) -> Effects:
    """The table [effects] with checked tables in it."""
    return effects_table().model_construct(_fields_set=given, **tables)


def _of_known_effects(value: Any, handler: Callable[[Any], Effects]) -> Effects:
    return value if isinstance(value, Effects) else effects_table().model_validate(value)


AnyEffects = Annotated[
    SerializeAsAny[Effects], WrapValidator(_of_known_effects), Field(default_factory=lambda: effects_table()())
]
"""A field for the effects of a scene: none is on unless its table is there."""


def effect_contradictions(effects: Mapping[str, Any], arm: RawArm) -> Iterator[Problem]:
    """List what does not fit in the raw tables of the effects."""
    links = len(arm.links)
    for name, effect in tables_on(effects):
        for key, value in effects[name].items():
            count = len(value) if isinstance(value, list) and key not in effect.vectors else None
            if effect.lists == "first" and count is not None and count > links:
                yield Problem(f"effects.{name}.{key}", counted(count, "number"), f"at most {links}, one for each link")
            if effect.lists == "each" and count not in (None, links):
                expected = f"{links}, one for each link, or a single number"
                yield Problem(f"effects.{name}.{key}", counted(len(value), "number"), expected)
        yield from effect.contradictions(effects[name], arm)


def tables_on(effects: Mapping[str, Any]) -> Iterator[tuple[str, type[EffectTable]]]:
    """The known effects of a raw scene that have a table."""
    for name, effect in known_effects().items():
        if isinstance(effects.get(name), dict):
            yield name, effect
