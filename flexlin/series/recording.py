"""A CasADi function read, instruction by instruction, into a tape of series operations."""

from collections.abc import Sequence
from typing import Any

import casadi as ca

from flexlin.errors import ArgumentError
from flexlin.program import Program
from flexlin.series.elementary import apply
from flexlin.series.tape import Tape


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
