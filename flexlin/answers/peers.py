"""What others use for the same question: transition matrices of one period by SciPy, CasADi's cvodes and heyoka."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from flexlin import symbolic
from flexlin.about.free import ParametricLoop
from flexlin.checks import Array
from flexlin.errors import ArgumentError

Transition = Callable[[Array], Array]
"""Values of the free parameters (P,) -> transition matrix of one period (n, n)."""


def derive_state_matrix(loop: ParametricLoop) -> ca.Function:
    """(phase, p) -> T A = T [[0, I], [-M^-1 K, -M^-1 D]] as one expression, time in units of the period."""
    phase, p = loop.matrices.sx_in()
    M, D, K = loop.matrices(phase, p)
    n = M.shape[0]
    lower = ca.ldl_solve(ca.horzcat(K, D), *ca.ldl(ca.sparsify(M)))
    A = ca.vertcat(ca.horzcat(ca.SX.zeros(n, n), ca.SX.eye(n)), -lower)
    return ca.Function("state_matrix", [phase, p], [ca.densify(loop.duration(p) * A)], ["phase", "p"], ["A"])


def prepare_scipy(loop: ParametricLoop, method: str, tol: float) -> Transition:
    """SciPy's solve_ivp on all columns at once, A evaluated through CasADi's buffers."""
    A = symbolic.Pointwise(derive_state_matrix(loop))
    n = 2 * loop.linearization.n

    def transition(p: Array) -> Array:
        def rate(phase: float, x: Array) -> Array:
            return (A(np.array([phase]), p)[0] @ x.reshape(n, n)).ravel()

        jac = (lambda phase, x: np.kron(A(np.array([phase]), p)[0], np.eye(n))) if method in ("Radau", "BDF") else None
        extra: dict[str, Any] = {} if jac is None else {"jac": jac}
        found = solve_ivp(rate, (0.0, 1.0), np.eye(n).ravel(), method, rtol=max(tol, 3e-14), atol=tol, **extra)
        return np.asarray(found.y[:, -1].reshape(n, n))

    return transition


def prepare_cvodes(loop: ParametricLoop, tol: float) -> Transition:
    """CasADi's interface to SUNDIALS cvodes (BDF), all columns at once."""
    n = 2 * loop.linearization.n
    phase, p = derive_state_matrix(loop).sx_in()
    X = ca.SX.sym("X", n, n)
    equations = {"x": ca.vec(X), "t": phase, "p": p, "ode": ca.vec(derive_state_matrix(loop)(phase, p) @ X)}
    options = {"reltol": tol, "abstol": tol, "max_num_steps": 1_000_000}
    integrator = ca.integrator("flow", "cvodes", equations, 0.0, 1.0, options)
    start = np.eye(n).ravel()
    return lambda values: np.array(integrator(x0=start, p=values)["xf"]).reshape(n, n).T


class HeyokaTransitions:
    """heyoka's variational Taylor integrator, compiled for this loop; `batch` systems in one SIMD sweep (1: scalar).

    Raises: ArgumentError when heyoka is not installed.
    """

    def __init__(self, loop: ParametricLoop, tol: float, batch: int = 1):
        hy = import_heyoka()
        self.n, self.batch = 2 * loop.linearization.n, batch
        system = hy.var_ode_sys(write_equations(hy, loop), hy.var_args.vars)
        start = np.zeros(self.n)
        parameters = np.zeros(len(loop.paths))
        if batch == 1:
            self.integrator = hy.taylor_adaptive(system, start, pars=parameters, tol=tol)
        else:
            starts, pars = (np.repeat(a[:, None], batch, axis=1) for a in (start, parameters))
            self.integrator = hy.taylor_adaptive_batch(system, starts, pars=pars, tol=tol)

    def __call__(self, points: Array) -> Array:
        """Transition matrices: (P,) -> (n, n), or for a batch (batch, P) -> (batch, n, n)."""
        n, flow = self.n, self.integrator
        if self.batch == 1:
            flow.time = 0.0
            flow.state[:n], flow.state[n:], flow.pars[:] = 0.0, np.eye(n).ravel(), points
            flow.propagate_until(1.0)
            return np.array(flow.state[n:].reshape(n, n))
        flow.set_time(0.0)
        flow.state[:n], flow.state[n:], flow.pars[:] = 0.0, np.eye(n).reshape(-1, 1), points.T
        flow.propagate_until(1.0)
        return np.moveaxis(flow.state[n:].reshape(n, n, -1), -1, 0).copy()


def import_heyoka(name: str = "heyoka") -> Any:
    """The module heyoka."""
    try:
        return import_module(name)
    except ImportError:
        raise ArgumentError(
            "heyoka is not installed", expected="the optional extra", todo="pip install 'flexlin[peers]'"
        ) from None


def write_equations(hy: Any, loop: ParametricLoop) -> list[Any]:
    """x' = T A(phase, p) x as heyoka expressions, from the instructions of CasADi's function."""
    A = np.array(translate(hy, derive_state_matrix(loop), [[hy.time], [hy.par[i] for i in range(len(loop.paths))]]))
    n = 2 * loop.linearization.n
    x = hy.make_vars(*[f"x{i}" for i in range(n)])
    rows = A.reshape(n, n).T  # CasADi stores columns one after another
    return [(x[i], hy.sum([rows[i, j] * x[j] for j in range(n)])) for i in range(n)]


def translate(hy: Any, function: ca.Function, inputs: list[list[Any]]) -> list[Any]:
    """The first output of a CasADi function of scalars, as heyoka expressions.

    Raises: ArgumentError for an operation that has no counterpart.
    """
    unary = {ca.OP_NEG: lambda a: -a, ca.OP_SIN: hy.sin, ca.OP_COS: hy.cos, ca.OP_SQ: lambda a: a * a, ca.OP_SQRT: hy.sqrt,
             ca.OP_TWICE: lambda a: 2.0 * a, ca.OP_INV: lambda a: 1.0 / a, ca.OP_EXP: hy.exp, ca.OP_TANH: hy.tanh,
             ca.OP_ASSIGN: lambda a: a}  # fmt: skip
    binary = {ca.OP_ADD: lambda a, b: a + b, ca.OP_SUB: lambda a, b: a - b, ca.OP_MUL: lambda a, b: a * b,
              ca.OP_DIV: lambda a, b: a / b}  # fmt: skip
    work: dict[int, Any] = {}
    outputs: list[Any] = [hy.expression(0.0)] * function.numel_out(0)
    for k in range(function.n_instructions()):
        code, source, target = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_CONST:
            work[target[0]] = hy.expression(function.instruction_constant(k))
        elif code == ca.OP_INPUT:
            work[target[0]] = inputs[source[0]][source[1]]
        elif code == ca.OP_OUTPUT:
            outputs[target[1]] = work[source[0]]
        elif code in unary:
            work[target[0]] = unary[code](work[source[0]])
        elif code in binary:
            work[target[0]] = binary[code](work[source[0]], work[source[1]])
        else:
            raise ArgumentError("heyoka has no counterpart of an operation of this scene", got=f"operation {code}")
    return outputs
