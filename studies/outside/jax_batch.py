"""Transition matrices of one period for many parameters at once by jax."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from flexlin.checks import Array
from flexlin.linearization.free import ParametricLoop
from flexlin.program import Program
from outside.scipy_ode import derive_state_matrix


def prepare_jax(loop: ParametricLoop, steps: int) -> Callable[[Array], Array]:
    """X' = T A(phase, p) X over one period by fixed steps of DOP853, jitted, vmapped over the points (V, P), in double precision."""
    import jax
    import jax.numpy as jnp
    from scipy.integrate._ivp import dop853_coefficients as dop

    jax.config.update("jax_enable_x64", True)
    function, n = derive_state_matrix(loop), loop.states
    stages = 12

    def state_matrix(phase: Any, p: Any) -> Any:
        return jnp.stack(evaluate_in_jax(jnp, function, [[phase], p])).reshape(n, n).T

    def flow(p: Any) -> Any:
        h = 1.0 / steps

        def step(X: Any, k: Any) -> tuple[Any, None]:
            slopes: list[Any] = []
            for i in range(stages):
                Y = X + h * sum(float(dop.A[i, j]) * slopes[j] for j in range(i) if dop.A[i, j] != 0)
                slopes.append(state_matrix((k + float(dop.C[i])) * h, p) @ Y)
            return X + h * sum(float(dop.B[i]) * slopes[i] for i in range(stages) if dop.B[i] != 0), None

        return jax.lax.scan(step, jnp.eye(n), jnp.arange(steps))[0]

    compiled = jax.jit(jax.vmap(flow))
    return lambda points: np.asarray(compiled(points))


def evaluate_in_jax(jnp: Any, function: ca.Function, inputs: list[Any]) -> list[Any]:
    """The first output of a CasADi function of scalars, as jax numbers."""
    operations: dict[int, Callable[..., Any]] = {
        ca.OP_ASSIGN: lambda a, _: a, ca.OP_NEG: lambda a, _: -a, ca.OP_SIN: lambda a, _: jnp.sin(a), ca.OP_COS: lambda a, _: jnp.cos(a),
        ca.OP_SQ: lambda a, _: a * a, ca.OP_SQRT: lambda a, _: jnp.sqrt(a), ca.OP_TWICE: lambda a, _: 2.0 * a,
        ca.OP_INV: lambda a, _: 1.0 / a, ca.OP_ADD: lambda a, b: a + b, ca.OP_SUB: lambda a, b: a - b, ca.OP_MUL: lambda a, b: a * b,
        ca.OP_DIV: lambda a, b: a / b,
    }  # fmt: skip
    outputs = Program.read(function).carry_out(inputs, float, lambda code, a, b: operations[code](a, b))[0]
    return [jnp.asarray(output, dtype=float) for output in outputs]
