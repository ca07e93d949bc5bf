"""A list of series operations; equal operations become one."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from flexlin.series.nodes import Angle, Choice, Integral, Node, Product, Quotient, Root, Sum, Switch


@dataclass
class Tape:
    """The operations of outputs = f(inputs) in an order in which they can be done.

    Nodes are numbered; `inputs[i][j]` is the node of entry j of input i, `outputs[i][j]` likewise.
    """

    inputs: list[list[int]] = field(default_factory=list)
    outputs: list[list[int]] = field(default_factory=list)
    constants: dict[int, float] = field(default_factory=dict)
    operations: list[tuple[int, Node]] = field(default_factory=list)
    size: int = 0
    known: dict[Any, int] = field(default_factory=dict)

    def number(self) -> int:
        """Return the number of a new node."""
        self.size += 1
        return self.size - 1

    def once(self, key: Any, make: Callable[[int], Node]) -> int:
        """Return the node of an operation, made when it is asked for the first time."""
        if key not in self.known:
            self.known[key] = number = self.number()
            self.operations.append((number, make(number)))
        return self.known[key]

    def constant(self, value: float) -> int:
        """Return the node of a number."""
        if ("constant", value) not in self.known:
            self.known["constant", value] = number = self.number()
            self.constants[number] = value
        return self.known["constant", value]

    def sum(self, a: int, b: int, p: float = 1.0, q: float = 1.0) -> int:
        """p a + q b."""
        return self.once(("sum", a, b, p, q), lambda _: Sum((a, b), (p, q)))

    def scaled(self, p: float, a: int) -> int:
        """p a."""
        return self.sum(a, self.constant(0.0), p, 1.0)

    def product(self, a: int, b: int) -> int:
        """a b."""
        a, b = sorted((a, b))
        return self.once(("product", a, b), lambda _: Product((a, b)))

    def quotient(self, a: int, b: int) -> int:
        """a / b."""
        return self.once(("quotient", a, b), lambda y: Quotient((a, b), y))

    def root(self, a: int) -> int:
        """sqrt(a)."""
        return self.once(("root", a), lambda y: Root((a,), y))

    def angle(self, a: int, b: int) -> int:
        """atan2(a, b)."""
        square = self.sum(self.product(a, a), self.product(b, b))
        slopes = self.quotient(b, square), self.quotient(a, square)
        return self.once(("angle", a, b), lambda _: Angle((a, b), slopes))

    def switch(self, name: str, *read: int) -> int:
        """A truth value of other nodes."""
        return self.once((name, read), lambda _: Switch(name, read))

    def choice(self, switch: int, a: int) -> int:
        """a where the switch is on, else 0."""
        return self.once(("choice", switch, a), lambda _: Choice(switch, (a,)))

    def integral(self, name: str, u: int, slope: Callable[[int], int], parameter: float | None = None) -> int:
        """phi(u), given the node of phi'(u) as a function of the node of phi(u)."""
        key = (name, u, parameter)
        if key not in self.known:
            node = Integral((u,), name, parameter)
            y = self.once(key, lambda _: node)
            node.slope = slope(y)
        return self.known[key]

    def power(self, u: int, p: float) -> int:
        """u^p: by products for small whole p, which are analytic at 0 too, else by y' = p (y/u) u'."""
        if p == 0:
            return self.constant(1.0)
        if p < 0 and p == int(p):
            return self.quotient(self.constant(1.0), self.power(u, -p))
        if p == int(p) and p <= 64:
            half = self.power(u, p // 2) if p > 1 else None
            square = u if half is None else self.product(half, half)
            return self.product(square, u) if p % 2 and p > 1 else square
        return self.integral("power", u, lambda y: self.scaled(p, self.quotient(y, u)), p)
