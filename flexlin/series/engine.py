"""Truncated power series of explicit and implicit functions, one order after the other: CasADi's operations as those of series."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import pi, sqrt
from typing import Any

import casadi as ca
import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.program import Program
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

    def difference(self, a: int, b: int) -> int:
        """a - b."""
        return self.sum(a, b, 1.0, -1.0)

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


def trigonometric(t: Tape, u: int, wanted: str, names: tuple[str, str], sign: float) -> int:
    """Return sin or cos (sign = -1), sinh or cosh (sign = 1): s' = c u', c' = sign s u'."""
    sine, cosine = names

    def cosine_of(s: int) -> int:
        return t.integral(cosine, u, lambda c: s if sign == 1 else t.scaled(-1.0, s))

    s = t.integral(sine, u, cosine_of)
    return s if wanted == sine else t.known[cosine, u, None]


def one_plus(t: Tape, a: int) -> int:
    """1 + a."""
    return t.sum(t.constant(1.0), a)


def one_minus(t: Tape, a: int) -> int:
    """1 - a."""
    return t.difference(t.constant(1.0), a)


def negative(t: Tape, a: int) -> int:
    """-a."""
    return t.scaled(-1.0, a)


def reciprocal(t: Tape, a: int) -> int:
    """1 / a."""
    return t.quotient(t.constant(1.0), a)


def square(t: Tape, a: int) -> int:
    """a^2."""
    return t.product(a, a)


def error_slope(t: Tape, u: int) -> int:
    """2/sqrt(pi) exp(-u^2)."""
    return t.scaled(2 / sqrt(pi), UNARY[ca.OP_EXP](t, t.scaled(-1.0, square(t, u))))


CIRCULAR, HYPERBOLIC = ("sin", "cos"), ("sinh", "cosh")

UNARY: dict[int, Callable[[Tape, int], int]] = {
    ca.OP_ASSIGN: lambda t, u: u,
    ca.OP_NEG: lambda t, u: negative(t, u),
    ca.OP_TWICE: lambda t, u: t.sum(u, u),
    ca.OP_SQ: square,
    ca.OP_INV: reciprocal,
    ca.OP_SQRT: lambda t, u: t.root(u),
    ca.OP_EXP: lambda t, u: t.integral("exp", u, lambda y: y),
    ca.OP_EXPM1: lambda t, u: t.integral("expm1", u, lambda y: one_plus(t, y)),
    ca.OP_LOG: lambda t, u: t.integral("log", u, lambda y: reciprocal(t, u)),
    ca.OP_LOG1P: lambda t, u: t.integral("log1p", u, lambda y: reciprocal(t, one_plus(t, u))),
    ca.OP_SIN: lambda t, u: trigonometric(t, u, "sin", CIRCULAR, -1.0),
    ca.OP_COS: lambda t, u: trigonometric(t, u, "cos", CIRCULAR, -1.0),
    ca.OP_SINH: lambda t, u: trigonometric(t, u, "sinh", HYPERBOLIC, 1.0),
    ca.OP_COSH: lambda t, u: trigonometric(t, u, "cosh", HYPERBOLIC, 1.0),
    ca.OP_TAN: lambda t, u: t.integral("tan", u, lambda y: one_plus(t, square(t, y))),
    ca.OP_TANH: lambda t, u: t.integral("tanh", u, lambda y: one_minus(t, square(t, y))),
    ca.OP_ATAN: lambda t, u: t.integral("atan", u, lambda y: reciprocal(t, one_plus(t, square(t, u)))),
    ca.OP_ATANH: lambda t, u: t.integral("atanh", u, lambda y: reciprocal(t, one_minus(t, square(t, u)))),
    ca.OP_ASIN: lambda t, u: t.integral("asin", u, lambda y: reciprocal(t, t.root(one_minus(t, square(t, u))))),
    ca.OP_ACOS: lambda t, u: t.integral(
        "acos", u, lambda y: negative(t, reciprocal(t, t.root(one_minus(t, square(t, u)))))
    ),
    ca.OP_ASINH: lambda t, u: t.integral("asinh", u, lambda y: reciprocal(t, t.root(one_plus(t, square(t, u))))),
    ca.OP_ACOSH: lambda t, u: t.integral(
        "acosh", u, lambda y: reciprocal(t, t.root(negative(t, one_minus(t, square(t, u)))))
    ),
    ca.OP_ERF: lambda t, u: t.integral("erf", u, lambda y: error_slope(t, u)),
    ca.OP_NOT: lambda t, u: t.switch("logic_not", u),
}

BINARY: dict[int, Callable[[Tape, int, int], int]] = {
    ca.OP_ADD: lambda t, a, b: t.sum(a, b),
    ca.OP_SUB: lambda t, a, b: t.difference(a, b),
    ca.OP_MUL: lambda t, a, b: t.product(a, b),
    ca.OP_DIV: lambda t, a, b: t.quotient(a, b),
    ca.OP_ATAN2: lambda t, a, b: t.angle(a, b),
    ca.OP_HYPOT: lambda t, a, b: t.root(t.sum(square(t, a), square(t, b))),
    ca.OP_POW: lambda t, a, b: power(t, a, b),
    ca.OP_CONSTPOW: lambda t, a, b: power(t, a, b),
    ca.OP_LT: lambda t, a, b: t.switch("lt", a, b),
    ca.OP_LE: lambda t, a, b: t.switch("le", a, b),
    ca.OP_AND: lambda t, a, b: t.switch("logic_and", a, b),
    ca.OP_OR: lambda t, a, b: t.switch("logic_or", a, b),
    ca.OP_IF_ELSE_ZERO: lambda t, a, b: t.choice(a, b),
}


def power(t: Tape, a: int, b: int) -> int:
    """a^b, with a constant or a varying exponent."""
    if b in t.constants:
        return t.power(a, t.constants[b])
    return UNARY[ca.OP_EXP](t, t.product(b, UNARY[ca.OP_LOG](t, a)))


def apply(t: Tape, code: int, operands: Sequence[int]) -> int:
    """Put one CasADi operation on the tape.

    Raises: ArgumentError naming the operation when it has no power series (fabs, floor, fmod ...). Choices by < are series on either side.
    """
    if code in UNARY:
        return UNARY[code](t, operands[0])
    if code in BINARY:
        return BINARY[code](t, operands[0], operands[1])
    names = {getattr(ca, name): name[3:].lower() for name in dir(ca) if name.startswith("OP_")}
    raise ArgumentError(
        "an operation has no power series", got=names.get(code, code), expected="analytic operations", todo="smooth it"
    )


def record(function: ca.Function) -> Tape:
    """Read a CasADi function of scalar operations into a tape.

    Parameters: function: of SX kind, dense outputs.
    Returns: the tape.
    Raises: ArgumentError when the function holds a free symbol or an operation that is not analytic.
    """
    program, tape = Program.read(function), Tape()
    tape.inputs = [[tape.number() for _ in range(size)] for size in program.rows]
    tape.outputs = program.carry_out(tape.inputs, tape.constant, lambda code, a, b: apply(tape, code, (a, b)))
    return tape


def record_expressions(name: str, expressions: Sequence[Any], symbols: Sequence[Any]) -> Tape:
    """Read CasADi expressions (SX or MX) of the given columns of symbols into a tape."""
    try:
        function = ca.Function(name, list(symbols), [ca.densify(e) for e in expressions])
    except RuntimeError as error:
        if "free" not in str(error):
            raise
        raise ArgumentError(
            "an expression has free symbols", got=str(error)[-200:], expected="only the variables"
        ) from None
    return record(function if function.is_a("SXFunction") else function.expand())
