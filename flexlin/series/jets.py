"""Truncated power series as numbers: CasADi's operations on them, over which a program is carried out as over any other numbers.

A function is computed from the differential equation that it satisfies, one degree after the other. A series holds only the variables that
it depends on. Its coefficients are real or complex numbers, at many points at once, or CasADi scalars.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import comb, pi, sqrt
from typing import Any

import casadi as ca
import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.precision import EPS
from flexlin.program import CONST, INPUT, OUTPUT, Program, name_of
from flexlin.series.indices import LISTED_PRODUCTS, Indices, kept_indices, sum_products


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


NUMPY: dict[str, Callable] = {
    **{name: getattr(np, name) for name in ("exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh")},
    **{
        name: getattr(np, f"arc{name.removeprefix('a')}")
        for name in ("asin", "acos", "atan", "asinh", "acosh", "atanh")
    },
    **{name: getattr(np, name) for name in ("log1p", "expm1", "sqrt", "power")},
    "erf": erf,
    "atan2": atan2,
    "lt": less,
    "le": less,
    "logic_and": lambda a, b: a * b,
    "logic_or": lambda a, b: a + b - a * b,
    "logic_not": lambda a: 1 - a,
}


@dataclass(frozen=True)
class Space:
    """Series in n variables up to an order, with numbers as coefficients, at one point or at many (trailing axes)."""

    n: int
    order: int
    batch: tuple[int, ...] = ()
    dtype: Any = float

    @property
    def all(self) -> tuple[int, ...]:
        """All variables."""
        return tuple(range(self.n))

    def indices(self, variables: tuple[int, ...]) -> Indices:
        """The multi-indices of some of the variables."""
        return kept_indices(len(variables), self.order)

    def zeros(self, variables: tuple[int, ...]) -> Array:
        """The coefficients of 0."""
        return np.zeros((self.indices(variables).size, *self.batch), dtype=self.dtype)

    def number(self, value: float) -> "Jet":
        """A constant."""
        return Jet(self, (), np.full((1, *self.batch), value), float(value))

    def variable(self, i: int, value: Any) -> "Jet":
        """The variable i about a value."""
        return self.polynomial((i,), [value, 1])

    def polynomial(self, variables: tuple[int, ...], known: Sequence[Any]) -> "Jet":
        """The series that begins with these coefficients, as many as its order has room for."""
        c = self.zeros(variables)
        for place, value in enumerate(known[: len(c)]):
            c[place] = value
        return Jet(self, variables, c)

    def fit(self, c: Array) -> "Jet":
        """Coefficients in all variables, of another order, as a series of this one."""
        fitted = self.zeros(self.all)
        fitted[: len(c)] = c[: len(fitted)]
        return Jet(self, self.all, fitted)

    def apply(self, name: str, *values: Array) -> Array:
        """An elementary function of coefficients of degree 0."""
        return NUMPY[name](*values)

    def scale(self, factor: Any, c: Array) -> Array:
        """Coefficients times a number."""
        return factor * c

    def choose(self, switch: Array, c: Array) -> Array:
        """Coefficients where the switch (of length 1) is on, else 0, whatever they hold; nan where it is undecided."""
        return np.where(switch == 0, 0.0, switch * c)

    def clean(self, part: Array) -> Array:
        """A part as it is kept."""
        return part

    def solve(self, V: Array, right: Array) -> Array:
        """x of V x = right; V (m, m, ...), right (m, size, ...)."""
        inside = np.linalg.solve(np.moveaxis(V, (0, 1), (-2, -1)), np.moveaxis(right, (0, 1), (-2, -1)))
        return np.moveaxis(inside, (-2, -1), (0, 1))


@dataclass(frozen=True, eq=False)
class Symbolic(Space):
    """Series in one variable with CasADi scalars as coefficients; what CasADi finds to be zero costs no instruction."""

    dtype: Any = object

    def apply(self, name: str, *values: Array) -> Array:
        return of_scalars(getattr(ca, name)(*(ca.SX(value[0]) for value in values)))

    def scale(self, factor: Any, c: Array) -> Array:
        return of_scalars(*(factor * value for value in c))

    def choose(self, switch: Array, c: Array) -> Array:
        return of_scalars(*(0 if is_zero(value) else ca.if_else(switch[0], value, 0) for value in c))

    def clean(self, part: Array) -> Array:
        """With zeros that are numbers."""
        return of_scalars(*(0 if is_zero(value) else value for value in part))

    def solve(self, V: Array, right: Array) -> Array:
        """V (m, m), right (m, size)."""
        x = ca.solve(ca.blockcat(V.tolist()), ca.blockcat(right.tolist()))
        return of_scalars(*ca.vertsplit(ca.vec(x.T))).reshape(right.shape)


def is_zero(value: Any) -> bool:
    """Whether a number or a CasADi scalar is known to be 0."""
    return bool(value.is_zero() if isinstance(value, ca.SX) else value == 0)


def of_scalars(*values: Any) -> Array:
    """An array of CasADi scalars, which NumPy would else take apart."""
    return np.array([*values, None], dtype=object)[:-1]


@dataclass(frozen=True, eq=False)
class Jet:
    """A series in some of the variables of a space; `known`: its value where it is a number; `kept`: what was made of it already."""

    space: Space
    variables: tuple[int, ...]
    c: Array
    known: float | None = None
    kept: dict[Any, Any] = field(default_factory=dict)

    def __add__(self, other: "Jet | float") -> "Jet":
        work = Work.on(self, as_jet(self, other))
        return work.jet(work.space.clean(work.c[0] + work.c[1]))

    def __sub__(self, other: "Jet | float") -> "Jet":
        work = Work.on(self, as_jet(self, other))
        return work.jet(work.space.clean(work.c[0] - work.c[1]))

    def __rsub__(self, other: float) -> "Jet":
        return as_jet(self, other) - self

    def __neg__(self) -> "Jet":
        return replace(self, c=-self.c, known=None, kept={})

    def __mul__(self, other: "Jet | float") -> "Jet":
        one, other = (self, as_jet(self, other)) if self.known is None else (as_jet(self, other), self)
        if other.known is not None:
            return replace(one, c=one.space.scale(other.known, one.c), known=None, kept={})
        work = Work.on(one, other)
        a, b = work.c
        return work.grow(lambda y, k: work.convolve(a, b, k))

    def __truediv__(self, other: "Jet | float") -> "Jet":
        """y_k = (a_k - sum_(j < k) y_j b_(k-j)) / b_0."""
        other = as_jet(self, other)
        if other.known is not None:
            return replace(self, c=self.space.clean(self.c / other.known), known=None, kept={})
        work = Work.on(self, other)
        a, b = work.c
        return work.grow(lambda y, k: (a[work.degree(k)] - work.convolve(y, b, k)) / b[:1])

    def __rtruediv__(self, other: float) -> "Jet":
        return as_jet(self, other) / self

    def spread(self, variables: tuple[int, ...]) -> Array:
        """The coefficients in more variables."""
        if self.variables == variables:
            return self.c
        wide = self.space.zeros(variables)
        among = tuple(variables.index(i) for i in self.variables)
        wide[self.space.indices(variables).places_of(self.space.indices(self.variables), among)] = self.c
        return wide

    @property
    def whole(self) -> Array:
        """The coefficients in all variables."""
        return self.spread(self.space.all)


def as_jet(beside: Jet, value: Jet | float) -> Jet:
    """A number as a series of the same space."""
    return value if isinstance(value, Jet) else beside.space.number(value)


@dataclass(frozen=True, eq=False)
class Work:
    """Series in the variables of all of them together, from which another one is made degree by degree."""

    space: Space
    variables: tuple[int, ...]
    indices: Indices
    c: list[Array]

    @classmethod
    def on(cls, *jets: Jet) -> "Work":
        """The coefficients of all in common variables."""
        variables = tuple(sorted({i for one in jets for i in one.variables}))
        space = jets[0].space
        return cls(space, variables, space.indices(variables), [one.spread(variables) for one in jets])

    def degree(self, k: int) -> slice:
        return self.indices.degree(k)

    def convolve(self, a: Array, b: Array, k: int) -> Array:
        """The part of degree k of a product; parts that are not yet computed are zero."""
        if self.indices.tabulated or self.space.batch:
            left, right, start = self.indices.pairs(k)
            return np.add.reduceat(a[left] * b[right], start, axis=0)
        return sum_products(self.indices, a, b, k, np.ones(k + 1))

    def integrate(self, u: Array, g: Array, k: int) -> Array:
        """The part of degree k of y with y' = g u', by the Euler derivative: k y_k = sum_j j u_j g_(k-j)."""
        if self.indices.tabulated or self.space.batch:
            return self.convolve(self.indices.degrees.reshape(-1, *[1] * len(self.space.batch)) * u, g, k) / k
        return sum_products(self.indices, u, g, k, np.arange(k + 1) / k)

    def jet(self, c: Array) -> Jet:
        """The result."""
        return Jet(self.space, self.variables, c)

    def grow(self, part: Callable[[Array, int], Array], first: Array | None = None) -> Jet:
        """The series whose part of degree k follows from those below it, in the array that is handed over."""
        y = self.space.zeros(self.variables)
        for k in range(self.space.order + 1 if self.variables else 1):
            y[self.degree(k)] = self.space.clean(part(y, k) if k or first is None else first)
        return self.jet(y)


def root(a: Jet) -> Jet:
    """sqrt(a):  y_k = (a_k - sum_(0 < j < k) y_j y_(k-j)) / (2 y_0)."""
    work = Work.on(a)
    first = work.space.apply("sqrt", a.c[:1])
    return work.grow(lambda y, k: (a.c[work.degree(k)] - work.convolve(y, y, k)) / (2 * y[:1]), first)


def integral(name: str, u: Jet, slope: Jet | Callable[[Work, Array, Array, int], Array], *more: float) -> Jet:
    """phi(u) by its differential equation y' = g u':  y_k = 1/k sum_(j=1..k) j u_j g_(k-j).

    slope: g, or its part of degree k from y and g, which are known that far. more: further arguments of phi, as in u^p.
    """
    first = u.space.apply(name, u.c[:1], *(0 * u.c[:1] + p for p in more))
    if isinstance(slope, Jet):
        work = Work.on(u, slope)
        x, ready = work.c
        return work.grow(lambda y, k: work.integrate(x, ready, k), first)
    work, g, below = Work.on(u), u.space.zeros(u.variables), slope

    def part(y: Array, k: int) -> Array:
        g[work.degree(k - 1)] = work.space.clean(below(work, y, g, k - 1))
        return work.integrate(u.c, g, k)

    return work.grow(part, first)


def pair(u: Jet, names: tuple[str, str], sign: int) -> tuple[Jet, Jet]:
    """sin and cos (sign = -1), or sinh and cosh (sign = 1), made together: s' = c u', c' = sign s u'."""
    if names not in u.kept:
        work, c = Work.on(u), u.space.zeros(u.variables)
        c[:1] = u.space.apply(names[1], u.c[:1])

        def part(s: Array, k: int) -> Array:
            c[work.degree(k)] = u.space.clean(sign * work.integrate(u.c, s, k))
            return work.integrate(u.c, c, k)

        sine = work.grow(part, u.space.apply(names[0], u.c[:1]))
        u.kept[names] = sine, work.jet(c)
    found: tuple[Jet, Jet] = u.kept[names]
    return found


def angle(a: Jet, b: Jet) -> Jet:
    """atan2(a, b):  y' = p a' - q b',  p = b/(a^2 + b^2),  q = a/(a^2 + b^2)."""
    square = a * a + b * b
    work = Work.on(a, b, b / square, a / square)
    x, z, p, q = work.c
    first = a.space.apply("atan2", a.c[:1], b.c[:1])
    return work.grow(lambda y, k: work.integrate(x, p, k) - work.integrate(z, q, k), first)


def power(u: Jet, b: Jet) -> Jet:
    """u^b: by products for whole b, which are analytic at 0 too; by y' = b (y/u) u' for a constant one, else exp(b log u)."""
    p = b.known
    if p is None:
        return unary[ca.OP_EXP](b * unary[ca.OP_LOG](u))
    if p == int(p) and 0 < p < 1 / EPS:
        if p == 1:
            return u
        half = power(u, u.space.number(p // 2))
        return half * half * u if p % 2 else half * half
    return integral("power", u, lambda w, y, g, k: (p * y[w.degree(k)] - w.convolve(g, u.c, k)) / u.c[:1], p)


def switch(name: str, *read: Jet) -> Jet:
    """A truth value: locally constant."""
    return Jet(read[0].space, (), read[0].space.apply(name, *(one.c[:1] for one in read)))


def choice(on: Jet, a: Jet) -> Jet:
    """a where a truth value is on, else 0."""
    return replace(a, c=a.space.choose(on.c[:1], a.c), known=None, kept={})


def of_itself(slope: Callable[[int, Array], Any], squared: bool = False) -> Any:
    """The slope of a function that is given by the function's own value, or its square."""
    return lambda w, y, g, k: slope(int(k == 0), w.convolve(y, y, k) if squared else y[w.degree(k)])


CIRCULAR, HYPERBOLIC = ("sin", "cos"), ("sinh", "cosh")
unary: dict[int, Callable[[Jet], Jet]] = {
    ca.OP_ASSIGN: lambda u: u,
    ca.OP_NEG: lambda u: -u,
    ca.OP_TWICE: lambda u: u * 2.0,
    ca.OP_SQ: lambda u: u * u,
    ca.OP_INV: lambda u: 1 / u,
    ca.OP_SQRT: root,
    ca.OP_EXP: lambda u: integral("exp", u, of_itself(lambda one, y: y)),
    ca.OP_EXPM1: lambda u: integral("expm1", u, of_itself(lambda one, y: one + y)),
    ca.OP_LOG: lambda u: integral("log", u, 1 / u),
    ca.OP_LOG1P: lambda u: integral("log1p", u, 1 / (u + 1)),
    ca.OP_SIN: lambda u: pair(u, CIRCULAR, -1)[0],
    ca.OP_COS: lambda u: pair(u, CIRCULAR, -1)[1],
    ca.OP_SINH: lambda u: pair(u, HYPERBOLIC, 1)[0],
    ca.OP_COSH: lambda u: pair(u, HYPERBOLIC, 1)[1],
    ca.OP_TAN: lambda u: integral("tan", u, of_itself(lambda one, square: one + square, squared=True)),
    ca.OP_TANH: lambda u: integral("tanh", u, of_itself(lambda one, square: one - square, squared=True)),
    ca.OP_ATAN: lambda u: integral("atan", u, 1 / (u * u + 1)),
    ca.OP_ATANH: lambda u: integral("atanh", u, 1 / (1 - u * u)),
    ca.OP_ASIN: lambda u: integral("asin", u, 1 / root(1 - u * u)),
    ca.OP_ACOS: lambda u: integral("acos", u, -1 / root(1 - u * u)),
    ca.OP_ASINH: lambda u: integral("asinh", u, 1 / root(u * u + 1)),
    ca.OP_ACOSH: lambda u: integral("acosh", u, 1 / root(u * u - 1)),
    ca.OP_ERF: lambda u: integral("erf", u, unary[ca.OP_EXP](-(u * u)) * (2 / sqrt(pi))),
    ca.OP_NOT: lambda u: switch("logic_not", u),
}
binary: dict[int, Callable[[Jet, Jet], Jet]] = {
    ca.OP_ADD: lambda a, b: a + b,
    ca.OP_SUB: lambda a, b: a - b,
    ca.OP_MUL: lambda a, b: a * b,
    ca.OP_DIV: lambda a, b: a / b,
    ca.OP_ATAN2: angle,
    ca.OP_HYPOT: lambda a, b: root(a * a + b * b),
    ca.OP_POW: power,
    ca.OP_CONSTPOW: power,
    ca.OP_LT: lambda a, b: switch("lt", a, b),
    ca.OP_LE: lambda a, b: switch("le", a, b),
    ca.OP_AND: lambda a, b: switch("logic_and", a, b),
    ca.OP_OR: lambda a, b: switch("logic_or", a, b),
    ca.OP_IF_ELSE_ZERO: choice,
}
CONSTANT = (ca.OP_LT, ca.OP_LE, ca.OP_AND, ca.OP_OR, ca.OP_NOT)
"""Operations whose results do not move with what they read."""
PAIRED = (ca.OP_SIN, ca.OP_COS, ca.OP_SINH, ca.OP_COSH)


def apply(code: int, a: Jet, b: Jet) -> Jet:
    """One of CasADi's operations.

    Raises: ArgumentError naming the operation when it has no power series (fabs, floor, fmod ...). Choices by < are series on either side.
    """
    if code in unary:
        return unary[code](a)
    if code in binary:
        return binary[code](a, b)
    raise ArgumentError(
        "an operation has no power series",
        got=name_of(code).removeprefix("OP_").lower(),
        expected="analytic operations",
        todo="smooth it",
    )


@np.errstate(all="ignore")
def carry_out(program: Program, *inputs: Sequence[Jet]) -> list[list[Jet]]:
    """The outputs of a program for series; nan or infinite where they do not exist."""
    space = next(one.space for jets in inputs for one in jets)
    return program.carry_out([list(jets) for jets in inputs], space.number, apply)


def bytes_of(program: Program, n: int, inputs: Sequence[Sequence[tuple[int, ...]]], order: int) -> int:
    """The memory of the series that a program holds at once, of its outputs and of one product; inputs: the variables of each."""
    variables, sizes, ends, live, most = dict[int, set[int]](), dict[int, int](), program.find_ends(), 0, 0
    for i, (code, k, a, b) in enumerate(program.steps.tolist()):
        if code != OUTPUT:
            fixed = code in (CONST, *CONSTANT)
            variables[k] = set() if fixed else set(inputs[a][b]) if code == INPUT else variables[a] | variables[b]
            sizes[k] = comb(len(variables[k]) + order, order) * (2 if code in PAIRED else 1)
            live += sizes[k]
            most = max(most, live)
        live -= sum(sizes[value] for value in ends[i])
    return 8 * (most + (2 * int(program.sizes.sum()) + 4) * comb(n + order, order) + LISTED_PRODUCTS)


def scalar_function(name: str, expressions: Sequence[Any], symbols: Sequence[Any]) -> ca.Function:
    """A function of scalar operations of CasADi expressions (SX or MX) of the given columns of symbols.

    Raises: ArgumentError where an expression has free symbols.
    """
    try:
        function = ca.Function(name, list(symbols), [ca.densify(e) for e in expressions])
    except RuntimeError as error:
        if "free" not in str(error):
            raise
        raise ArgumentError(
            "an expression has free symbols", got=str(error)[-200:], expected="only the variables"
        ) from None
    return function if function.is_a("SXFunction") else function.expand()
