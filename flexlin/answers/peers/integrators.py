"""Transition matrices of one period by the integrators of SciPy and by CasADi's cvodes."""

from collections.abc import Callable
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import odeint, solve_ivp
from scipy.sparse import csc_array

from flexlin import symbolic
from flexlin.about.free import ParametricLoop
from flexlin.answers.peers.right_hand_sides import Rate, compile_product, derive_state_matrix, prepare_rate
from flexlin.checks import Array

Transition = Callable[[], Array]
"""-> the transition matrix of one period (n, n), with the set-up behind it."""
LEAST = 3e-14
"""The smallest relative tolerance that SciPy takes."""


def prepare_scipy(
    loop: ParametricLoop, method: str, tol: float, p: Array | None = None, rate: Rate | None = None
) -> Transition:
    """SciPy on all columns at once: DOP853 or Radau by solve_ivp, LSODA by odeint, whose loop over the steps is compiled.

    The columns stand one after another, so the Jacobian is block diagonal: banded for LSODA, sparse for Radau.
    Parameters: p: values of the free numbers, the scene's own by default; rate: the right-hand side, the compiled one by default.
    """
    values = loop.nominal if p is None else p
    n = loop.states
    f = prepare_rate(loop, values) if rate is None else rate
    start = np.eye(n).ravel()
    if method == "LSODA":
        return partial(integrate_by_odeint, f, start, tol)
    jac = (
        partial(arrange_jacobian, symbolic.Pointwise(derive_state_matrix(loop)), values) if method == "Radau" else None
    )
    extra: dict[str, Any] = {} if jac is None else {"jac": jac}

    def transition() -> Array:
        found = solve_ivp(f, (0.0, 1.0), start, method, rtol=max(tol, LEAST), atol=tol, t_eval=(1.0,), **extra)
        if not found.success:
            raise RuntimeError(found.message)
        return np.asarray(found.y[:, -1].reshape(n, n).T)

    return transition


def integrate_by_odeint(rate: Rate, start: Array, tol: float) -> Array:
    """LSODA over one period."""
    n = round(np.sqrt(len(start)))
    options = {"rtol": max(tol, LEAST), "atol": tol, "ml": n - 1, "mu": n - 1, "mxstep": 10**7, "full_output": True}
    found, info = odeint(rate, start, (0.0, 1.0), tfirst=True, **options)
    if info["message"] != "Integration successful.":
        raise RuntimeError(info["message"])
    return np.asarray(found[-1].reshape(n, n).T)


def arrange_jacobian(A: symbolic.Pointwise, p: Array, phase: float, x: Array) -> csc_array:
    """T A once for each column of X, as one sparse matrix."""
    block = A(np.array([phase]), p)[0].T
    n = len(block)
    rows = (np.arange(n) + n * np.arange(n)[:, None]).repeat(n, axis=0).ravel()
    return csc_array((np.tile(block.ravel(), n), rows, n * np.arange(n * n + 1)), shape=(n * n, n * n))


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
