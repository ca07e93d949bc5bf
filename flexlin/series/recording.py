"""A CasADi function read, instruction by instruction, into a tape of series operations."""

from collections.abc import Sequence
from typing import Any

import casadi as ca

from flexlin.errors import ArgumentError
from flexlin.series.elementary import apply
from flexlin.series.tape import Tape


def record(function: ca.Function) -> Tape:
    """Read a CasADi function of scalar operations into a tape.

    Parameters: function: of SX kind, dense outputs.
    Returns: the tape.
    Raises: ArgumentError when the function holds a free symbol or an operation that is not analytic.
    """
    if function.has_free():
        raise ArgumentError("an expression has free symbols", got=function.get_free(), expected="only the variables")
    tape = Tape()
    tape.inputs = [[tape.number() for _ in range(function.nnz_in(i))] for i in range(function.n_in())]
    tape.outputs = [[-1] * function.nnz_out(i) for i in range(function.n_out())]
    work: dict[int, int] = {}
    for k in range(function.n_instructions()):
        code, source, target = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_CONST:
            work[target[0]] = tape.constant(function.instruction_constant(k))
        elif code == ca.OP_INPUT:
            work[target[0]] = tape.inputs[source[0]][source[1]]
        elif code == ca.OP_OUTPUT:
            tape.outputs[target[0]][target[1]] = work[source[0]]
        else:
            work[target[0]] = apply(tape, code, [work[i] for i in source])
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
