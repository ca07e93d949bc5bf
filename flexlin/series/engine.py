"""Truncated power series of explicit and implicit functions, one order after the other."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flexlin.checks import Array
from flexlin.series.nodes import (
    Angle,
    Choice,
    Increments,
    Integral,
    Node,
    Product,
    Quotient,
    Root,
    Series,
    Space,
    Sum,
    Switch,
)


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


def seeded(space: Space, values: Array, seeds: Array) -> list[Array]:
    """Return the series of u = u0 + S xi, one for each entry of u.

    Parameters: values u0 (nu, ...); seeds S (nu, n), or (nu, n, ...) with a direction for each point.
    """
    series = [space.zero() for _ in range(len(values))]
    for one, value, seed in zip(series, values, seeds, strict=True):
        one[0] = value
        if space.indices.order > 0:
            one[space.indices.degree(1)] = seed
    return series


def start(tape: Tape, space: Space, inputs: Sequence[Sequence[Array]]) -> Series:
    """Return the nodes' coefficients with inputs, constants and all parts of degree 0 in place."""
    c: Series = [space.zero() for _ in range(tape.size)]
    for nodes, series in zip(tape.inputs, inputs, strict=True):
        for node, one in zip(nodes, series, strict=True):
            c[node] = one
    for node, value in tape.constants.items():
        c[node][0] = value if value != 0 else 0
    for node, operation in tape.operations:
        c[node][:1] = space.clean(operation.value(space, c))
    return c


def advance(tape: Tape, space: Space, c: Series, k: int) -> None:
    """Compute all parts of degree k from those of lower degree and the inputs' parts of degree k."""
    where = space.indices.degree(k)
    for node, operation in tape.operations:
        c[node][where] = space.clean(operation.part(space, c, k))


def increments(tape: Tape, space: Space, c: Series, moved: Increments) -> dict[int, Array]:
    """Return how all parts of one degree move when those of some nodes do."""
    delta = dict(moved)
    for node, operation in tape.operations:
        if any(i in delta for i in operation.operands):
            delta[node] = space.clean(operation.increment(c, delta))
    return delta


@np.errstate(all="ignore")
def expand(tape: Tape, space: Space, inputs: Sequence[Sequence[Array]]) -> list[list[Array]]:
    """Return the series of all outputs of a tape, given those of its inputs; nan or infinite where they do not exist."""
    c = start(tape, space, inputs)
    for k in range(1, space.indices.order + 1):
        advance(tape, space, c, k)
    return [[c[node] for node in nodes] for nodes in tape.outputs]


def jacobian(tape: Tape, space: Space, c: Series, which: int) -> Array:
    """Return D f (m, n, ...) by one input at the point of evaluation: the movement of f under unit movements of the input."""
    identity: Array = np.eye(len(tape.inputs[which]), dtype=int).astype(space.dtype)
    moved = {}
    for node, row in zip(tape.inputs[which], identity, strict=True):
        moved[node] = row.reshape(-1, *[1] * (c[node].ndim - 1))
    delta = increments(tape, space, c, moved)
    shape = (len(identity), *c[tape.inputs[which][0]].shape[1:])
    return np.array([np.broadcast_to(delta.get(node, np.zeros(shape, dtype=int)), shape) for node in tape.outputs[0]])


@np.errstate(all="ignore")
def expand_implicit(tape: Tape, space: Space, u: Sequence[Array], v0: Array) -> list[Array]:
    """Return the series of v(u) with f(u, v) = 0, given those of u and v's value.

        V_0 v_k = -[f(u, v_0 + ... + v_(k-1))]_k,   k = 1, 2 ...

    After each order the parts of all nodes move with v_k by their linearization.

    Assumes f(u0, v0) = 0 and V = D_v f regular there.
    Parameters: tape of f(u, v); u: series of u's entries; v0 (nv, ...).
    Returns: the series of v's entries.
    Source: the equations of de Jong et al. (14)-(25), order by order instead of by Kronecker products.
    """
    v = seeded(space, v0, np.zeros((len(v0), space.indices.n, *[1] * (v0.ndim - 1)), dtype=int))
    c = start(tape, space, [u, v])
    V = jacobian(tape, space, c, 1)
    for k in range(1, space.indices.order + 1):
        where = space.indices.degree(k)
        advance(tape, space, c, k)
        residual = np.array([c[node][where] for node in tape.outputs[0]])
        step = space.solve(V, -residual)
        if k == space.indices.order:
            for one, part in zip(v, step, strict=True):
                one[where] = part
            break
        moved = dict(zip(tape.inputs[1], step, strict=True))
        for node, part in increments(tape, space, c, moved).items():
            c[node][where] = c[node][where] + part
    return v
