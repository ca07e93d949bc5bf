"""The operations of a series computation. Each knows three things about its result y:

    value        the coefficient of degree 0,
    part         the homogeneous part of degree k >= 1, from parts of lower degree and its operands' parts of degree k,
    increment    how that part moves when the operands' parts of degree k move: linear, by values of degree 0.

A function is computed from the differential equation that it satisfies.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from flexlin.checks import Array
from flexlin.series.space import Numeric, Symbolic, choose

Space = Numeric | Symbolic
Series = list[Array]
"""The coefficients of each node, by the node's number."""


class Readable(Protocol):
    """The coefficients of each node as one node reads them; a list of them is one."""

    def __getitem__(self, i: int, /) -> Any:
        """Return the series of a node."""
        ...


Increments = Mapping[int, Array]
"""Movements of parts of one degree, by the node's number; a node not in it does not move."""


class Node(Protocol):
    """One operation."""

    @property
    def operands(self) -> tuple[int, ...]:
        """The nodes whose parts of equal degree it reads."""
        ...

    def value(self, space: Space, c: Readable) -> Array:
        """Return the part of degree 0, of length 1."""
        ...

    def part(self, space: Space, c: Readable, k: int) -> Array:
        """Return the part of degree k."""
        ...

    def increment(self, c: Series, delta: Increments) -> Array:
        """Return the movement of the part of degree k."""
        ...


@dataclass(frozen=True)
class Sum:
    """y = p a + q b with numbers p, q."""

    operands: tuple[int, int]
    factors: tuple[float, float]

    def value(self, space: Space, c: Readable) -> Array:
        return self.part(space, c, 0)

    def part(self, space: Space, c: Readable, k: int) -> Array:
        a, b = (c[i][space.indices.degree(k)] for i in self.operands)
        return times(self.factors[0], a) + times(self.factors[1], b)

    def increment(self, c: Series, delta: Increments) -> Array:
        terms = [times(f, delta[i]) for f, i in zip(self.factors, self.operands, strict=True) if i in delta]
        return terms[0] if len(terms) == 1 else terms[0] + terms[1]


@dataclass(frozen=True)
class Product:
    """y = a b."""

    operands: tuple[int, int]

    def value(self, space: Space, c: Readable) -> Array:
        a, b = self.operands
        return c[a][:1] * c[b][:1]

    def part(self, space: Space, c: Readable, k: int) -> Array:
        a, b = self.operands
        return space.convolve(c[a], c[b], k)

    def increment(self, c: Series, delta: Increments) -> Array:
        a, b = self.operands
        return c[a][:1] * delta.get(b, 0) + c[b][:1] * delta.get(a, 0)


@dataclass(frozen=True)
class Quotient:
    """y = a / b:  y_k = (a_k - sum_(j < k) y_j b_(k-j)) / b_0."""

    operands: tuple[int, int]
    result: int

    def value(self, space: Space, c: Readable) -> Array:
        a, b = self.operands
        return c[a][:1] / c[b][:1]

    def part(self, space: Space, c: Readable, k: int) -> Array:
        a, b = self.operands
        return (c[a][space.indices.degree(k)] - space.convolve(c[self.result], c[b], k)) / c[b][:1]

    def increment(self, c: Series, delta: Increments) -> Array:
        a, b = self.operands
        return (delta.get(a, 0) - c[self.result][:1] * delta.get(b, 0)) / c[b][:1]


@dataclass(frozen=True)
class Root:
    """y = sqrt(a):  y_k = (a_k - sum_(0 < j < k) y_j y_(k-j)) / (2 y_0)."""

    operands: tuple[int]
    result: int

    def value(self, space: Space, c: Readable) -> Array:
        return space.apply("sqrt", c[self.operands[0]][:1])

    def part(self, space: Space, c: Readable, k: int) -> Array:
        y = c[self.result]
        return (c[self.operands[0]][space.indices.degree(k)] - space.convolve(y, y, k)) / (2 * y[:1])

    def increment(self, c: Series, delta: Increments) -> Array:
        return delta[self.operands[0]] / (2 * c[self.result][:1])


@dataclass
class Integral:
    """y = phi(u) by its differential equation y' = g u':  y_k = 1/k sum_(j=1..k) j u_j g_(k-j).

    `slope` (the node of g) may depend on y: it is only read below degree k. `parameter`: a second argument of phi, as in u^p.
    """

    operands: tuple[int]
    function: str
    parameter: float | None = None
    slope: int = -1

    def value(self, space: Space, c: Readable) -> Array:
        u = c[self.operands[0]][:1]
        return space.apply(self.function, u, *([0 * u + self.parameter] if self.parameter is not None else []))

    def part(self, space: Space, c: Readable, k: int) -> Array:
        return space.integrate(c[self.operands[0]], c[self.slope], k)

    def increment(self, c: Series, delta: Increments) -> Array:
        return c[self.slope][:1] * delta[self.operands[0]]


@dataclass(frozen=True)
class Angle:
    """y = atan2(a, b) with y' = p a' - q b', p = b/(a^2 + b^2), q = a/(a^2 + b^2)."""

    operands: tuple[int, int]
    slopes: tuple[int, int]

    def value(self, space: Space, c: Readable) -> Array:
        a, b = self.operands
        return space.apply("atan2", c[a][:1], c[b][:1])

    def part(self, space: Space, c: Readable, k: int) -> Array:
        (a, b), (p, q) = self.operands, self.slopes
        return space.integrate(c[a], c[p], k) - space.integrate(c[b], c[q], k)

    def increment(self, c: Series, delta: Increments) -> Array:
        (a, b), (p, q) = self.operands, self.slopes
        return c[p][:1] * delta.get(a, 0) - c[q][:1] * delta.get(b, 0)


@dataclass(frozen=True)
class Switch:
    """A truth value such as a < b: locally constant, so it has no operands to move with."""

    function: str
    read: tuple[int, ...]
    operands: tuple[int, ...] = ()

    def value(self, space: Space, c: Readable) -> Array:
        return space.apply(self.function, *[c[i][:1] for i in self.read])

    def part(self, space: Space, c: Readable, k: int) -> Array:
        return space.zero()[space.indices.degree(k)]

    def increment(self, c: Series, delta: Increments) -> Array:
        return 0 * next(iter(delta.values()))


@dataclass(frozen=True)
class Choice:
    """y = a where a switch is on, else 0."""

    switch: int
    operands: tuple[int]

    def value(self, space: Space, c: Readable) -> Array:
        return choose(c[self.switch][:1], c[self.operands[0]][:1])

    def part(self, space: Space, c: Readable, k: int) -> Array:
        return choose(c[self.switch][:1], c[self.operands[0]][space.indices.degree(k)])

    def increment(self, c: Series, delta: Increments) -> Array:
        return choose(c[self.switch][:1], delta[self.operands[0]])


def times(factor: float, part: Array) -> Array:
    """Multiply by a number, leaving 1 and -1 without a multiplication."""
    if factor == 1:
        return part
    return -part if factor == -1 else factor * part
