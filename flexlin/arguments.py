"""The kinds of the arguments of public functions, refused by name where they are other ones than their annotations state."""

import inspect
import numbers
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, wraps
from operator import index
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from flexlin.errors import ArgumentError, counted

SEVERAL = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
Function = TypeVar("Function", bound=Callable[..., Any])


SYSTEM, MAKER = "PeriodicSystem", "periodic_system"
ANY_SYSTEM = f"a {SYSTEM}, or what has one"
"""Where a system is meant, a linearization serves that makes one."""
HINTS = {
    "a Scene": "load one: fl.load_scene(name or path)",
    "a Scene or a PeriodicFamily": "load one: fl.load_scene(name or path)",
    "a Linearization": "make one: fl.linearize(arm, motion, control)",
    "a PeriodicMotion": "give what periodic_motion hands back",
    "a FloquetModes": "give what floquet_modes hands back",
    ANY_SYSTEM: f"make one of A(t) and its period: fl.{SYSTEM}(A, period)",
}
"""What to do where a scene or a system is missing, which most often means that its name, or A(t) itself, was given."""


@dataclass(frozen=True)
class Kind:
    """What an argument must be, in words and as a test, and what is made of it; as a mark it stands in `Annotated[Any, Kind(...)]`."""

    words: str
    fits: Callable[[Any], bool]
    take: Callable[[Any], Any] = lambda value: value


def instance(name: str, value: object, kind: type | tuple[type, ...], todo: str | None = None) -> None:
    """Refuse a value that is not of the kind a public function works on."""
    if not isinstance(value, kind):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        expected = " or ".join(name_kind(k) for k in kinds)
        raise ArgumentError(f"{name} is of another kind", got=shown(value), expected=expected, todo=todo)


def name_kind(kind: type) -> str:
    """A class in a message, with its article."""
    return f"{'an' if kind.__name__[0] in 'AEIO' or kind.__name__ in ('SX', 'MX') else 'a'} {kind.__name__}"


def checked(function: Function) -> Function:
    """Refuse arguments of another kind than the annotations state, before the function begins; a system is made of what has one.

    Values are the function's own matter: this looks at kinds alone, and at what is annotated in a way that says something.
    Raises: ArgumentError naming the argument.
    """
    signature = inspect.signature(function)

    @cache
    def kinds() -> dict[str, Kind]:
        single = {name: one for name, one in signature.parameters.items() if one.kind not in SEVERAL}
        found = {name: kind_of(one.annotation) for name, one in single.items()}
        return {name: kind for name, kind in found.items() if kind is not None}

    @wraps(function)
    def begin(*given: Any, **named: Any) -> Any:
        try:
            bound = signature.bind_partial(*given, **named)
        except TypeError:  # too many or unknown arguments: Python says it best
            return function(*given, **named)
        for name, kind in kinds().items():
            if name in bound.arguments:
                value = bound.arguments[name]
                if not kind.fits(value):
                    got, todo = shown(value), HINTS.get(kind.words)
                    raise ArgumentError(f"{name} is of another kind", got=got, expected=kind.words, todo=todo)
                bound.arguments[name] = kind.take(value)
        return function(*bound.args, **bound.kwargs)

    return begin  # type: ignore[return-value]


def shown(value: Any) -> str:
    """A value in a message, on one line."""
    try:
        return " ".join(repr(value).split())[:80]
    except Exception:
        return name_kind(type(value))


def kind_of(annotation: Any) -> Kind | None:
    """What an annotation asks for; None where it lets everything through."""
    origin, inside = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        marks = [mark for mark in inside[1:] if isinstance(mark, Kind)]
        return marks[0] if marks else kind_of(inside[0])
    if origin is Literal:
        return Kind(" or ".join(map(repr, inside)), lambda value: isinstance(value, str) and value in inside)
    if origin in (Union, types.UnionType):
        return kind_of_union(inside)
    if is_of_numpy(annotation):
        return NUMBERS
    if annotation in SIMPLE:
        return SIMPLE[annotation]
    if is_callable(annotation):
        return FUNCTION
    if origin is tuple and inside and inside[-1] is not Ellipsis:
        return fixed_tuple([kind_of(one) for one in inside])
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return Kind("a mapping", lambda value: isinstance(value, Mapping))
    if isinstance(origin, type) and issubclass(origin, Iterable):
        return list_of(kind_of(inside[0]) if inside else None)
    if not isinstance(annotation, type) or annotation in (object, Any, inspect.Parameter.empty):
        return None
    if annotation.__name__ == SYSTEM:
        return Kind(
            ANY_SYSTEM,
            lambda v: isinstance(v, annotation) or (not isinstance(v, type) and callable(getattr(v, MAKER, None))),
            lambda v: v if isinstance(v, annotation) else getattr(v, MAKER)(),
        )
    return Kind(name_kind(annotation), lambda value: isinstance(value, annotation))


def kind_of_union(inside: Sequence[Any]) -> Kind | None:
    """What a union asks for: with arrays in it, an array of numbers, and a function or None where these are in it."""
    if any(is_of_numpy(one) for one in inside):
        functions, none = any(is_callable(one) for one in inside), type(None) in inside
        return either([NUMBERS, *[FUNCTION] * functions, *[NONE] * none])
    kinds = [kind_of(one) for one in inside]
    return None if None in kinds else either([kind for kind in kinds if kind is not None])


def is_of_numpy(annotation: Any) -> bool:
    """Whether an annotation asks for an array, or for what NumPy makes one of."""
    module = getattr(get_origin(annotation) or annotation, "__module__", "")
    return module.startswith("numpy") and "dtype" not in repr(get_origin(annotation) or annotation)


def is_callable(annotation: Any) -> bool:
    """Whether an annotation asks for a function."""
    return Callable in (annotation, get_origin(annotation))


def either(kinds: Sequence[Kind]) -> Kind:
    """One of several kinds."""
    return Kind(" or ".join(kind.words for kind in kinds), lambda value: any(kind.fits(value) for kind in kinds))


def list_of(kind: Kind | None) -> Kind:
    """A list, a tuple, an array or an iterator that is not used up by the look at it."""

    def fits(value: Any) -> bool:
        if isinstance(value, (str, bytes, Mapping)) or not isinstance(value, Iterable):
            return False
        return kind is None or not hasattr(value, "__len__") or all(map(kind.fits, value))

    return Kind("a list" if kind is None else f"a list, each {kind.words}", fits)


def fixed_tuple(kinds: Sequence[Kind | None]) -> Kind:
    """So many things of these kinds."""

    def fits(value: Any) -> bool:
        fitting = LIST.fits(value) and hasattr(value, "__len__") and len(value) == len(kinds)
        return fitting and all(kind is None or kind.fits(one) for kind, one in zip(kinds, value, strict=True))

    words = {kind.words for kind in kinds if kind is not None}
    return Kind(counted(len(kinds), "entry") + (f", each {words.pop()}" if len(words) == 1 else ""), fits)


def is_number(value: Any) -> bool:
    """Whether it is one real number; True is none."""
    if isinstance(value, bool):
        return False
    return isinstance(value, numbers.Real) or (getattr(value, "shape", None) == () and value.dtype.kind in "iuf")


def is_whole(value: Any) -> bool:
    """Whether it is a whole number; True and 2.0 are none."""
    try:
        return not isinstance(value, bool) and index(value) is not None
    except TypeError:
        return False


def is_truth(value: Any) -> bool:
    """Whether it is True or False, of Python's or NumPy's."""
    return isinstance(value, bool) or (type(value).__module__ == "numpy" and type(value).__name__ in ("bool", "bool_"))


def are_numbers(value: Any) -> bool:
    """Whether NumPy makes an array of numbers of it."""
    import numpy as np  # what takes no arrays needs none

    try:
        return np.asarray(value).dtype.kind in "biufc"
    except Exception:
        return False


NONE = Kind("None", lambda value: value is None)
NUMBERS = Kind("an array of numbers", are_numbers)
FUNCTION = Kind("a function", callable)
SIMPLE: dict[Any, Kind] = {
    float: Kind("a number", is_number),
    int: Kind("a whole number", is_whole),
    str: Kind("a text", lambda value: isinstance(value, str)),
    bool: Kind("True or False", is_truth),
    Path: Kind("a path", lambda value: isinstance(value, PathLike)),
    type(None): NONE,
}
LIST = list_of(None)
