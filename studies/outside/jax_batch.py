"""Transition matrices of one period for many parameters at once by jax."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from flexlin.about.free import ParametricLoop
from flexlin.answers.accuracy.scipy_methods import derive_state_matrix
from flexlin.checks import Array


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
        ca.OP_ASSIGN: lambda a: a, ca.OP_NEG: lambda a: -a, ca.OP_SIN: jnp.sin, ca.OP_COS: jnp.cos, ca.OP_SQ: lambda a: a * a,
        ca.OP_SQRT: jnp.sqrt, ca.OP_TWICE: lambda a: 2.0 * a, ca.OP_INV: lambda a: 1.0 / a, ca.OP_ADD: lambda a, b: a + b,
        ca.OP_SUB: lambda a, b: a - b, ca.OP_MUL: lambda a, b: a * b, ca.OP_DIV: lambda a, b: a / b,
    }  # fmt: skip
    work: dict[int, Any] = {}
    outputs: list[Any] = [jnp.zeros(())] * function.numel_out(0)
    for k in range(function.n_instructions()):
        code, source, target = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_CONST:
            work[target[0]] = function.instruction_constant(k)
        elif code == ca.OP_INPUT:
            work[target[0]] = inputs[source[0]][source[1]]
        elif code == ca.OP_OUTPUT:
            outputs[target[1]] = jnp.asarray(work[source[0]], dtype=float)
        else:
            work[target[0]] = operations[code](*[work[i] for i in source])
    return outputs
