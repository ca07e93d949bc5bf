"""Each elementary operation of CasADi as series operations: a function by the differential equation that it satisfies."""

from collections.abc import Callable, Sequence
from math import pi, sqrt
from typing import Any

import casadi as ca

from flexlin.errors import ArgumentError
from flexlin.program import Program
from flexlin.series.engine import Tape


def trigonometric(t: Tape, u: int, wanted: str, names: tuple[str, str], sign: float) -> int:
    """Return sin or cos (sign = -1), sinh or cosh (sign = 1): s' = c u', c' = sign s u'."""
    sine, cosine = names

    def cosine_of(s: int) -> int:
        return t.integral(cosine, u, lambda c: s if sign == 1 else t.scaled(-1.0, s))

    s = t.integral(sine, u, cosine_of)
    return s if wanted == sine else t.known[cosine, u, None]


def one_plus(t: Tape, a: int, sign: float = 1.0) -> int:
    """1 + sign a."""
    return t.sum(t.constant(1.0), a, 1.0, sign)


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
    ca.OP_NEG: lambda t, u: t.scaled(-1.0, u),
    ca.OP_TWICE: lambda t, u: t.scaled(2.0, u),
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
    ca.OP_TANH: lambda t, u: t.integral("tanh", u, lambda y: one_plus(t, square(t, y), -1.0)),
    ca.OP_ATAN: lambda t, u: t.integral("atan", u, lambda y: reciprocal(t, one_plus(t, square(t, u)))),
    ca.OP_ATANH: lambda t, u: t.integral("atanh", u, lambda y: reciprocal(t, one_plus(t, square(t, u), -1.0))),
    ca.OP_ASIN: lambda t, u: t.integral("asin", u, lambda y: reciprocal(t, t.root(one_plus(t, square(t, u), -1.0)))),
    ca.OP_ACOS: lambda t, u: t.integral(
        "acos", u, lambda y: t.quotient(t.constant(-1.0), t.root(one_plus(t, square(t, u), -1.0)))
    ),
    ca.OP_ASINH: lambda t, u: t.integral("asinh", u, lambda y: reciprocal(t, t.root(one_plus(t, square(t, u))))),
    ca.OP_ACOSH: lambda t, u: t.integral(
        "acosh", u, lambda y: reciprocal(t, t.root(t.sum(square(t, u), t.constant(1.0), 1.0, -1.0)))
    ),
    ca.OP_ERF: lambda t, u: t.integral("erf", u, lambda y: error_slope(t, u)),
    ca.OP_NOT: lambda t, u: t.switch("logic_not", u),
}

BINARY: dict[int, Callable[[Tape, int, int], int]] = {
    ca.OP_ADD: lambda t, a, b: t.sum(a, b),
    ca.OP_SUB: lambda t, a, b: t.sum(a, b, 1.0, -1.0),
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
