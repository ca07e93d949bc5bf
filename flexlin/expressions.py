"""Pickling of objects that hold CasADi expressions: all in one serialisation, so that they go on sharing their symbols."""

from collections import deque
from dataclasses import fields
from typing import Any

import casadi as ca


class Expressions:
    """A frozen dataclass whose fields hold CasADi expressions, alone or inside other such objects and tuples.

    What is derived from the fields and kept beside them is not pickled; it is derived again. Symbols are shared inside one object: two
    objects that are pickled side by side each have symbols of their own afterwards.
    """

    def __getstate__(self) -> dict[str, Any]:
        serializer = ca.StringSerializer()
        state = flattened({f.name: getattr(self, f.name) for f in fields(self)}, serializer)  # type: ignore[arg-type]
        return {"expressions": serializer.encode(), "fields": state}

    def __setstate__(self, state: dict[str, Any]) -> None:
        rebuild(self, restored(state["fields"], ca.StringDeserializer(state["expressions"])))


class Expression:
    """Stands for the next expression of the serialisation."""


class Part:
    """Stands for another object with expressions: its class and its fields."""

    def __init__(self, kind: type, state: Any):
        self.kind, self.state = kind, state


def flattened(value: Any, serializer: "ca.StringSerializer | Row") -> Any:
    """The value with its expressions moved into the serialisation, in the order in which they are met."""
    if isinstance(value, ca.SX):
        serializer.pack(value)
        return Expression()
    if isinstance(value, Expressions):
        state = {f.name: getattr(value, f.name) for f in fields(value)}  # type: ignore[arg-type]
        return Part(type(value), flattened(state, serializer))
    if isinstance(value, dict):
        return {key: flattened(item, serializer) for key, item in value.items()}
    if type(value) is tuple:
        return tuple(flattened(item, serializer) for item in value)
    return value


def restored(value: Any, expressions: "ca.StringDeserializer | Row") -> Any:
    """The value with its expressions back in place."""
    if isinstance(value, Expression):
        return expressions.unpack()
    if isinstance(value, Part):
        made: Any = object.__new__(value.kind)
        rebuild(made, restored(value.state, expressions))
        return made
    if isinstance(value, dict):
        return {key: restored(item, expressions) for key, item in value.items()}
    if type(value) is tuple:
        return tuple(restored(item, expressions) for item in value)
    return value


class Row(deque[Any]):
    """Expressions one after the other, in the place of a serialisation."""

    pack, unpack = deque.append, deque.popleft


def substituted(made: Any, old: ca.SX, new: ca.SX) -> Any:
    """The same object with other expressions in the place of symbols, in all that it holds."""
    row = Row()
    state = flattened(made, row)
    return restored(state, Row(ca.substitute(list(row), [old], [new])))


def rebuild(made: Any, state: dict[str, Any]) -> None:
    """Set the fields of a frozen object."""
    for name, item in state.items():
        object.__setattr__(made, name, item)
