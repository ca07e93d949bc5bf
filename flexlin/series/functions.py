"""The elementary functions of series by name, on NumPy numbers (real or complex) and on CasADi scalars."""

from collections.abc import Callable

import casadi as ca
import numpy as np

from flexlin.checks import Array


def atan2(y: Array, x: Array) -> Array:
    """Return the angle of (x, y), also for complex y and x."""
    if np.iscomplexobj(y) or np.iscomplexobj(x):
        return -1j * np.log((x + 1j * y) / np.sqrt(x * x + y * y))
    return np.arctan2(y, x)


def erf(x: Array) -> Array:
    """Return the error function, also of complex x."""
    from scipy import special

    return np.asarray(special.erf(x))


def less(a: Array, b: Array) -> Array:
    """Return 1 where a < b and 0 where a > b; nan at equality, where a choice between them is not analytic."""
    return np.where(np.real(a) == np.real(b), np.nan, np.less(np.real(a), np.real(b)))


def both(a: Array, b: Array) -> Array:
    """Return a and b, of truth values 0 and 1."""
    return a * b


def either(a: Array, b: Array) -> Array:
    """Return a or b, of truth values 0 and 1."""
    return a + b - a * b


def opposite(a: Array) -> Array:
    """Return not a, of truth values 0 and 1."""
    return 1 - a


NUMPY: dict[str, Callable] = {
    "exp": np.exp,
    "log": np.log,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "sinh": np.sinh,
    "cosh": np.cosh,
    "tanh": np.tanh,
    "asinh": np.arcsinh,
    "acosh": np.arccosh,
    "atanh": np.arctanh,
    "erf": erf,
    "log1p": np.log1p,
    "expm1": np.expm1,
    "sqrt": np.sqrt,
    "atan2": atan2,
    "power": np.power,
    "lt": less,
    "le": less,
    "logic_and": both,
    "logic_or": either,
    "logic_not": opposite,
}
CASADI: dict[str, Callable] = {name: getattr(ca, name) for name in NUMPY}
