"""Transition matrices of one period by CasADi's cvodes."""

from typing import Any

import casadi as ca
import numpy as np

from flexlin.checks import Array
from flexlin.linearization.free import ParametricLoop
from outside.compiled import compile_product
from outside.scipy_ode import Transition


def prepare_cvodes(loop: ParametricLoop, tol: float, p: Array | None = None, stiff: bool = False) -> Transition:
    """CasADi's interface to SUNDIALS cvodes, all columns at once, compiled: Adams' formulas, or BDF for `stiff`."""
    values = loop.nominal if p is None else p
    n = loop.states
    product = compile_product(loop)
    phase, x, symbols = product.mx_in()
    options: dict[str, Any] = {"reltol": tol, "abstol": tol, "max_num_steps": 1_000_000}
    if not stiff:
        options |= {"linear_multistep_method": "adams", "nonlinear_solver_iteration": "functional"}
    equations = {"x": x, "t": phase, "p": symbols, "ode": product(phase, x, symbols)}
    integrator = ca.integrator("flow", "cvodes", equations, 0.0, 1.0, options)
    start = np.eye(n).ravel()
    return lambda: np.array(integrator(x0=start, p=values)["xf"]).reshape(n, n).T
