"""Transition matrices, and motions, by SciPy's integrators at their best: DOP853 and Radau by solve_ivp, LSODA by odeint."""

from collections.abc import Callable
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import odeint, solve_ivp
from scipy.sparse import csc_array

from flexlin import symbolic
from flexlin.analyses.accuracy.scipy_methods import FastRate, Rate
from flexlin.checks import SAMPLES, Array
from flexlin.linearization.free import ParametricLoop

LEAST = 3e-14
"""The smallest relative tolerance that SciPy takes."""
Transition = Callable[[], Array]
"""-> the transition matrix of one period (n, n), with the set-up behind it."""


def prepare_scipy(
    loop: ParametricLoop, method: str, tol: float, p: Array | None = None, rate: Rate | None = None
) -> Transition:
    """SciPy on all columns at once.

    The columns stand one after another, so the Jacobian is block diagonal: banded for LSODA, sparse for Radau.
    Parameters: p: values of the free numbers, the scene's own by default; rate: the right-hand side, CasADi's own by default.
    """
    values = loop.nominal if p is None else p
    n = loop.states
    f = FastRate(derive_product(loop), values) if rate is None else rate
    start = np.eye(n).ravel()
    extra: dict[str, Any] = {}
    if method == "Radau":
        extra["jac"] = partial(arrange_jacobian, derive_state_matrix(loop), values)

    def transition() -> Array:
        return integrate(f, start, np.array([0.0, 1.0]), method, tol, n - 1, **extra)[-1].reshape(n, n).T

    return transition


def integrate_loop(rate: Rate, states: int, method: str, tol: float) -> Array:
    """States (N, 2n) over a period from rest."""
    return integrate(rate, np.zeros(states), np.linspace(0.0, 1.0, SAMPLES + 1), method, tol)


def integrate(
    rate: Rate, start: Array, t: Array, method: str, tol: float, band: int | None = None, **extra: Any
) -> Array:
    """The unknowns (N, ...) at times t: LSODA by odeint, whose loop over the steps is compiled, others by solve_ivp.

    Parameters: band: how far from the diagonal the Jacobian has entries, for LSODA; extra: of solve_ivp. Raises: RuntimeError.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # a step that is far too long may leave the range
        if method == "LSODA":
            found, info = odeint(
                *(rate, start, t),
                **{"tfirst": True, "rtol": max(tol, LEAST), "atol": tol, "mxstep": 10**7, "full_output": True},
                **({} if band is None else {"ml": band, "mu": band}),
            )
            good, message = info["message"] == "Integration successful.", info["message"]
        else:
            run = solve_ivp(rate, (t[0], t[-1]), start, method, rtol=max(tol, LEAST), atol=tol, t_eval=t, **extra)
            found, good, message = run.y.T, run.success, run.message
    if not good:
        raise RuntimeError(message)
    return np.asarray(found)


def arrange_jacobian(A: ca.Function, p: Array, phase: float, x: Array) -> csc_array:
    """T A once for each column of X, as one sparse matrix."""
    block = symbolic.call_at(A, np.array([phase]), p)[0].T
    n = len(block)
    rows = (np.arange(n) + n * np.arange(n)[:, None]).repeat(n, axis=0).ravel()
    return csc_array((np.tile(block.ravel(), n), rows, n * np.arange(n * n + 1)), shape=(n * n, n * n))


def derive_state_matrix(loop: ParametricLoop) -> ca.Function:
    """(phase, p) -> T A = T [0 I 0; -M^-1 [K, D]] as one expression, ignorable coordinates left out, time in units of the period."""
    phase, p = loop.matrices.sx_in()
    M, D, K = loop.matrices(phase, p)
    n = loop.coordinates - loop.memory
    lower = ca.ldl_solve(ca.horzcat(K[:, :n], D), *ca.ldl(ca.sparsify(M)))
    A = ca.vertcat(ca.horzcat(ca.SX.zeros(n, n), ca.SX.eye(n), ca.SX.zeros(n, loop.memory)), -lower)
    return ca.Function("state_matrix", [phase, p], [ca.densify(loop.duration(p) * A)], ["phase", "p"], ["A"])


def derive_product(loop: ParametricLoop) -> ca.Function:
    """(phase, columns of X, p) -> the columns of T A X, zeros of A left out of the product."""
    A = derive_state_matrix(loop)
    phase, p = A.sx_in()
    X = ca.SX.sym("X", A.size1_out(0), A.size1_out(0))
    product = ca.densify(ca.vec(ca.sparsify(A(phase, p)) @ X))
    return ca.Function("product", [phase, ca.vec(X), p], [product], ["phase", "X", "p"], ["rate"])
