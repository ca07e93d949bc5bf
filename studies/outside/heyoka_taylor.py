"""heyoka's variational Taylor integrator on the equations of a loop."""

from importlib import import_module
from typing import Any

import casadi as ca
import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.linearization.free import ParametricLoop
from flexlin.program import Program, name_of
from outside.scipy_ode import derive_state_matrix


class HeyokaTransitions:
    """heyoka's Taylor integrator on X' = T A X, compiled for this loop; `batch` systems in one SIMD sweep (1: scalar).

    Parameters: compact: heyoka's compact mode, which compiles sooner and runs slower.
    Raises: ArgumentError when heyoka is not installed.
    """

    def __init__(self, loop: ParametricLoop, tol: float, batch: int = 1, compact: bool = False):
        hy = import_heyoka()
        self.n, self.batch = loop.states, batch
        system, start, parameters = write_equations(hy, loop), np.zeros(self.n**2), np.zeros(len(loop.paths))
        if batch == 1:
            self.integrator = hy.taylor_adaptive(system, start, pars=parameters, tol=tol, compact_mode=compact)
        else:
            starts, pars = (np.repeat(a[:, None], batch, axis=1) for a in (start, parameters))
            self.integrator = hy.taylor_adaptive_batch(system, starts, pars=pars, tol=tol, compact_mode=compact)

    def __call__(self, points: Array) -> Array:
        """Transition matrices: (P,) -> (n, n), or for a batch (batch, P) -> (batch, n, n)."""
        n, flow = self.n, self.integrator
        if self.batch == 1:
            flow.time = 0.0
            flow.state[:], flow.pars[:] = np.eye(n).ravel(), points
            flow.propagate_until(1.0)
            return np.array(flow.state.reshape(n, n))
        flow.set_time(0.0)
        flow.state[:], flow.pars[:] = np.eye(n).reshape(-1, 1), points.T
        flow.propagate_until(1.0)
        return np.moveaxis(flow.state.reshape(n, n, -1), -1, 0).copy()


def import_heyoka(name: str = "heyoka") -> Any:
    """The module heyoka."""
    try:
        return import_module(name)
    except ImportError:
        raise ArgumentError(
            "heyoka is not installed", expected="the optional extra", todo="pip install 'flexlin[peers]'"
        ) from None


def write_equations(hy: Any, loop: ParametricLoop) -> list[Any]:
    """X' = T A(phase, p) X, row by row, as heyoka expressions, from the instructions of CasADi's function.

    For these linear equations it compiles and runs faster than the variational equations that heyoka makes of x' = T A x.
    """
    A = np.array(translate(hy, derive_state_matrix(loop), [[hy.time], [hy.par[i] for i in range(len(loop.paths))]]))
    n = loop.states
    X = np.array(hy.make_vars(*[f"x{i}_{j}" for i in range(n) for j in range(n)])).reshape(n, n)
    rows = A.reshape(n, n).T  # CasADi stores columns one after another
    return [(X[i, j], hy.sum([rows[i, k] * X[k, j] for k in range(n)])) for i in range(n) for j in range(n)]


def translate(hy: Any, function: ca.Function, inputs: list[list[Any]]) -> list[Any]:
    """The first output of a CasADi function of scalars, as heyoka expressions.

    Raises: ArgumentError for an operation that has no counterpart.
    """
    unary = {ca.OP_NEG: lambda a: -a, ca.OP_SIN: hy.sin, ca.OP_COS: hy.cos, ca.OP_SQ: lambda a: a * a, ca.OP_SQRT: hy.sqrt,
             ca.OP_TWICE: lambda a: 2.0 * a, ca.OP_INV: lambda a: 1.0 / a, ca.OP_EXP: hy.exp, ca.OP_TANH: hy.tanh,
             ca.OP_ASSIGN: lambda a: a}  # fmt: skip
    binary = {ca.OP_ADD: lambda a, b: a + b, ca.OP_SUB: lambda a, b: a - b, ca.OP_MUL: lambda a, b: a * b,
              ca.OP_DIV: lambda a, b: a / b}  # fmt: skip

    def apply(code: int, a: Any, b: Any) -> Any:
        if code not in unary and code not in binary:
            raise ArgumentError("heyoka has no counterpart of an operation of this scene", got=name_of(code))
        return unary[code](a) if code in unary else binary[code](a, b)

    return Program.read(function).carry_out(inputs, hy.expression, apply)[0]
