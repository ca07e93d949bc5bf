"""The compiled core: a library of C functions built with the package, and the one checked door to them.

The library is here in a variant for each instruction set; which one is loaded is chosen once, when this module is imported: the best
that the processor runs, or the one that the environment variable FLEXLIN_CORE names. A function is declared once, by its prototype in
C, beside the code that calls it:

    scale_rows = declare("void scale_rows(int n, int m, const double *by, double *X)", lambda n, m, *_: (n, (n, m)))

after which `scale_rows(n, m, by, X)` raises where an array is not what C takes it for. `tests/test_core.py` compares the prototypes with
the C sources.
"""

import ctypes
import os
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flexlin.checks import Array

BUILT = Path(__file__).with_name("built")
VARIANTS = {4: "v4", 3: "v3"}
"""Variants for levels of x86-64; `baseline` runs on every processor of the platform."""
LANES = 8
"""Segments or values that go through an operation together, on the widest processors."""
SCALARS = {"int": ctypes.c_int, "long": ctypes.c_long, "double": ctypes.c_double, "void": None}
DTYPES: dict[str, np.dtype] = {
    "int": np.dtype(np.intc),
    "long": np.dtype(np.int_),
    "double": np.dtype(float),
    "char": np.dtype(np.int8),
}
DTYPES |= {"complex": np.dtype(complex), "Step": np.dtype(np.intc)}
"""What the types of C are here; a step of a tape is four whole numbers."""
DECLARED: dict[str, "Function"] = {}
"""The functions that are declared so far, by their prototypes."""


@dataclass(frozen=True, slots=True)
class Numbers:
    """Contiguous numbers of one type that C reads, or writes as well."""

    dtype: np.dtype
    written: bool = False

    def fits(self, array: Array) -> bool:
        """Whether C can take these numbers, however many they are."""
        flags = array.flags
        return array.dtype == self.dtype and flags.c_contiguous and (flags.writeable or not self.written)

    def describe_misfit(self, array: Array, shape: Any = None) -> str:
        """What is wrong with an array, in words."""
        wanted = f"{'writable ' if self.written else ''}{self.dtype} in C order" + (f", {shape}" if shape else "")
        rights = "writable" if array.flags.writeable else "not writable"
        return f"the compiled core takes {wanted}; got {array.dtype}, {array.shape}, strides {array.strides}, {rights}"


class Function:
    """A function of the core: checks the arrays that it is called with, and hands on where they stand."""

    def __init__(self, prototype: str, shapes: Callable[..., Any] | None, optional: tuple[str, ...]) -> None:
        found = re.fullmatch(r"(\w+) (\w+)\((.*)\)", prototype)
        if found is None:
            raise ValueError(f"not a prototype: {prototype}")
        returns, self.name, takes = found.groups()
        self.names, kinds = zip(*map(read_argument, takes.split(", ")), strict=True)
        self.shapes, self.optional = shapes, {self.names.index(name) for name in optional}
        self.arrays = [(place, kind) for place, kind in enumerate(kinds) if isinstance(kind, Numbers)]
        self.call = getattr(LIBRARY, self.name)
        self.call.restype = SCALARS[returns]
        self.call.argtypes = [ctypes.c_void_p if isinstance(kind, Numbers) else kind for kind in kinds]

    def __call__(self, *arguments: Any) -> Any:
        """Call it. Raises: TypeError where an array is of another type or shape, not contiguous, or to be written and may not be;
        MemoryError where C returns -1."""
        passed = list(arguments)
        expected = self.shapes(*arguments) if self.shapes else (None,) * len(self.arrays)
        for (place, kind), shape in zip(self.arrays, expected, strict=True):
            array = arguments[place]
            if array is None and place in self.optional:
                continue
            has = array.size if type(shape) is int else array.shape
            if not kind.fits(array) or (shape is not None and shape != has):
                raise TypeError(f"{self.name}, {self.names[place]}: {kind.describe_misfit(array, shape)}")
            passed[place] = locate(array)
        if (found := self.call(*passed)) == -1:
            raise MemoryError(f"the arrays of {self.name}")
        return found


REALS = Numbers(DTYPES["double"]), Numbers(DTYPES["double"], written=True)
"""Real numbers that C reads, and such as it writes."""
NO_BYTES = ctypes.c_char * 0


def read_argument(text: str) -> tuple[str, Any]:
    """Name and kind of an argument as C writes it; a pointer to pointers, or to void, is an address."""
    read = re.fullmatch(r"(const )?(double complex|\w+) (?:(\*const \*|\*\*|\*)(?:restrict )?)?(\w+)", text)
    if read is None:
        raise ValueError(f"not an argument: {text}")
    constant, kind, pointer, name = read.groups()
    if pointer is None:
        return name, SCALARS[kind]
    if pointer != "*" or kind == "void":
        return name, ctypes.c_void_p
    return name, Numbers(DTYPES[kind.removeprefix("double ")], constant is None)


def declare(prototype: str, shapes: Callable[..., Any] | None = None, optional: tuple[str, ...] = ()) -> Function:
    """Declare a function of the core by its prototype in C.

    Parameters: shapes: of all arguments, gives for each array in turn its shape, or how many numbers it holds where its shape does not
    matter, or None where C does not mind; optional: arrays that may be None.
    Raises: AttributeError where the library has no such function.
    """
    DECLARED[prototype] = Function(prototype, shapes, optional)
    return DECLARED[prototype]


def declare_sized(prototype: str, sizes: Iterable[tuple[int, int]]) -> dict[tuple[int, int], Function]:
    """Declare a function that the library has for each size, by its prototype `kind SIZED(name)(arguments)` in C.

    Parameters: sizes: states and rows, as CMakeLists.txt lists them.
    """
    name = re.search(r"SIZED\((\w+)\)", prototype)
    if name is None:
        raise ValueError(f"not a prototype of several sizes: {prototype}")
    found = {size: Function(prototype.replace(name[0], f"{name[1]}_{size[0]}_{size[1]}"), None, ()) for size in sizes}
    DECLARED[prototype] = next(iter(found.values()))
    return found


def locate(array: Any) -> Any:
    """Where the numbers of a contiguous array stand, as ctypes passes it on: a fourth of the time of array.ctypes.data."""
    try:
        return NO_BYTES.from_buffer(array)
    except (TypeError, ValueError):  # it may not be written
        return array.ctypes.data


def address(array: Array) -> int:
    """The same as a number."""
    found = locate(array)
    return found if type(found) is int else ctypes.addressof(found)


def addresses(arrays: list[Array], written: bool = False) -> ctypes.Array:
    """A table of where arrays of real numbers stand. Raises: TypeError where one is not contiguous, or of another type."""
    kind = REALS[written]
    for array in arrays:
        if not kind.fits(array):
            raise TypeError(kind.describe_misfit(array))
    return (ctypes.c_void_p * len(arrays))(*map(address, arrays))


def load() -> tuple[str, ctypes.CDLL]:
    """The variant of the library for this processor, and its name. Raises: ImportError where the library has not been built."""
    try:
        if asked := os.environ.get("FLEXLIN_CORE"):
            return asked, ctypes.CDLL(str(BUILT / f"{asked}.so"))
        baseline = ctypes.CDLL(str(BUILT / "baseline.so"))
        variant = VARIANTS.get(baseline.find_level(), "baseline")
        if not (BUILT / f"{variant}.so").is_file():
            return "baseline", baseline
        return variant, ctypes.CDLL(str(BUILT / f"{variant}.so"))
    except OSError as error:
        todo = "in a checkout, `make core` builds it; else install flexlin anew"
        raise ImportError(f"the compiled core of flexlin cannot be loaded ({error}): {todo}") from None


VARIANT, LIBRARY = load()
