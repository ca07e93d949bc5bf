"""Series computations written out as straight-line code: casadi.Function and C."""

import casadi as ca
import numpy as np

from flexlin.checks import Array, check_size
from flexlin.errors import ArgumentError
from flexlin.series.engine import Tape, expand_implicit, seeded
from flexlin.series.indices import Indices
from flexlin.series.polynomial import symbolic_monomials, weighted_sums
from flexlin.series.space import Symbolic

BYTES_PER_INSTRUCTION = 300
"""Memory that one scalar operation of an expression takes while it is built."""


def unrolled(tape: Tape, indices: Indices, V: Array) -> ca.Function:
    """Return (u0, v0, du) -> v, the Taylor polynomial about any solution (u0, v0), without loops, branches or linear solvers.

    Assumes that the pivots chosen for this V serve near by: elimination is not pivoted again.
    Raises: TooLarge when the expression would take an unreasonable number of bytes.
    """
    from scipy.linalg import lu  # takes longer to load than most maps to compute

    products = sum(len(indices.pairs(k).left) for k in range(indices.order + 1))
    size = 2 * BYTES_PER_INSTRUCTION * products * len(tape.operations)
    check_size("the unrolled function", size, "lower the order, or use the map in numbers")
    sizes = [len(tape.inputs[0]), len(tape.inputs[1]), len(tape.inputs[0])]
    u0, v0, du = (ca.SX.sym(name, size) for name, size in zip(("u0", "v0", "du"), sizes, strict=True))
    space = Symbolic(indices, lu(V)[0].argmax(axis=0))
    seeds = np.eye(len(tape.inputs[0]), dtype=int).astype(object)
    series = expand_implicit(tape, space, seeded(space, scalars(u0), seeds), scalars(v0))
    v = weighted_sums(np.array(series), symbolic_monomials(indices, du))
    return ca.Function("taylor", [u0, v0, du], [v], ["u0", "v0", "du"], ["v"])


def scalars(column: ca.SX) -> Array:
    """Return a CasADi column as an array of scalars."""
    array = np.empty(column.numel(), dtype=object)
    for i in range(column.numel()):
        array[i] = column[i]
    return array


def c_code(function: ca.Function) -> str:
    """Return self-contained C source of a CasADi function.

    Parameters
    ----------
    function : casadi.Function
        Such as `TaylorMap.function()` or `ImplicitMap.moving`.

    Returns
    -------
    str
        C99 source.

    Raises
    ------
    ArgumentError
        When a C compiler could not use it, because the function calls external code.

    Examples
    --------
    >>> import casadi as ca
    >>> import flexlin as fl
    >>> from flexlin.series import c_code
    >>> x = ca.SX.sym("x")
    >>> source = c_code(fl.taylor(ca.sin(x), x, [0.0], 3).function())
    >>> "taylor" in source
    True
    """
    try:
        generator = ca.CodeGenerator(f"{function.name()}.c")
        generator.add(function)
        return generator.dump()
    except RuntimeError as error:
        raise ArgumentError("no C code for this function", got=str(error)[-200:]) from None
