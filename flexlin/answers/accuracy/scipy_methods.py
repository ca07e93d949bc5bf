"""Transition matrices, motion from rest, periodic response and Riccati equation by SciPy's integrators on one CasADi expression each."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import odeint, solve_ivp
from scipy.sparse import csc_array

from flexlin import symbolic
from flexlin.about.free import ParametricLoop, parametric_loop
from flexlin.about.linearization import Linearization
from flexlin.answers.accuracy.result import Row, Trial, compare_arrays, measure_trials
from flexlin.checks import SAMPLES, Array
from flexlin.motion import SymbolicMotion
from flexlin.scene.scene import Scene
from flexlin.simulation.equations import loop_expressions

PLACES = 32
"""Times in a period at which periodic answers are compared."""
PERIODS, FORGOTTEN = 100, 10.0
"""Periods after which X must have become periodic: its change over one is so many times tol at the most."""
TOLS = {
    "DOP853": (1e-5, 1e-7, 1e-9, 1e-11),
    "LSODA": tuple(10.0**-k for k in range(4, 13)),
    "Radau": (1e-4, 1e-6, 1e-8),
}
"""Of each method of SciPy."""
LEAST = 3e-14
"""The smallest relative tolerance that SciPy takes."""
Rate = Callable[[float, Array], Array]
"""(phase, columns of X one after another (n n,)) -> the columns of T A X."""
Transition = Callable[[], Array]
"""-> the transition matrix of one period (n, n), with the set-up behind it."""


def try_scipy(
    lin: Linearization, derive: Callable[[Linearization], ca.Function], run: Callable[[Rate, int, str, float], Array]
) -> Iterator[Trial]:
    """Every method at each of its tolerances, where the right-hand side is one expression: a symbolic motion, a law without states."""
    if isinstance(lin.motion, SymbolicMotion) and lin.controller is None:
        rate = prepare_rate(derive(lin), lin.arm.parameters.values)
        for method, tols in TOLS.items():
            for tol in tols:
                yield Trial(
                    f"SciPy {method}", f"tol {tol:.0e}", partial(run, rate, 2 * lin.n, method, tol), outside=True
                )


def derive_loop_rate(lin: Linearization) -> ca.Function:
    """(phase, [y; y'], p) -> T [y'; y''] of the nonlinear loop under the scene's law."""
    about, law = lin.about, lin.law
    inputs, _, F, _, _ = loop_expressions(about)
    y, v, w, torque = inputs.values()
    assert isinstance(about.motion, SymbolicMotion)
    phase, p = about.motion.phase, about.arm.parameters.symbols
    rigid = dict(zip(lin.of_arm.name_out(), lin.of_arm.call([phase, p]), strict=True))["tau"]
    given = rigid if law.feedforward == "rigid" else ca.SX.zeros(about.m)
    given = given - ca.DM(law.gain(np.zeros(1))[0]) @ ca.vertcat(y, v)
    M, left = ca.substitute([ca.jacobian(F, w), F], [torque, w], [given, ca.SX.zeros(about.n)])
    acceleration = -ca.ldl_solve(left, *ca.ldl(ca.sparsify(M)))
    rate = ca.densify(lin.period * ca.vertcat(v, acceleration))
    return ca.Function("loop_rate", [phase, ca.vertcat(y, v), p], [rate], ["phase", "x", "p"], ["rate"])


def integrate_loop(rate: Rate, states: int, method: str, tol: float) -> Array:
    """States (N, 2n) over a period from rest."""
    return integrate(rate, np.zeros(states), np.linspace(0.0, 1.0, SAMPLES + 1), method, tol)


def derive_linear(lin: Linearization) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]:
    """phase, p, T A, T b and T B of x' = A x + b + B u, the linear loop."""
    phase, p = lin.coefficients.sx_in()
    M, D, K, h, B, _ = lin.coefficients(phase, p)
    lower = ca.ldl_solve(ca.sparsify(ca.horzcat(-K, -D, h, B)), *ca.ldl(ca.sparsify(M)))
    n, upper = lin.n, ca.SX(lin.n, lower.size2())
    upper[:, n : 2 * n] = ca.SX.eye(n)
    rows = lin.period * ca.vertcat(upper, lower)
    return phase, p, rows[:, : 2 * n], rows[:, 2 * n], rows[:, 2 * n + 1 :]


def derive_response_rate(lin: Linearization) -> ca.Function:
    """(phase, columns of [X, x], p) -> those of T [A X, A x + b]: the transition matrix, and a motion."""
    phase, p, A, b, _ = derive_linear(lin)
    X = ca.SX.sym("X", 2 * lin.n, 2 * lin.n + 1)
    rate = A @ X
    rate[:, -1] += b
    return ca.Function("response_rate", [phase, ca.vec(X), p], [ca.densify(ca.vec(rate))])


def respond_periodically(rate: Rate, states: int, method: str, tol: float) -> Array:
    """The periodic response (32, 2n) from the transition matrix and the motion from rest."""
    start, t = np.eye(states + 1, states).ravel(), np.arange(PLACES + 1) / PLACES
    columns = integrate(rate, start, t, method, tol, states - 1).reshape(PLACES + 1, states + 1, states)
    X, x = columns[:, :-1].swapaxes(1, 2), columns[:, -1]
    return (X @ np.linalg.solve(np.eye(states) - X[-1], x[-1]) + x)[:-1]


def derive_riccati_rate(lin: Linearization) -> ca.Function:
    """(s, X, p) -> T (A' X + X A - X B B' X + I) at the phase -s: the Riccati equation with unit weights, backward in time."""
    phase, p, A, _, B = derive_linear(lin)
    X = ca.SX.sym("X", 2 * lin.n, 2 * lin.n)
    pushed = X @ B
    rate = A.T @ X + X @ A - pushed @ pushed.T / lin.period + lin.period * ca.SX.eye(2 * lin.n)
    return ca.Function("riccati_rate", [phase, ca.vec(X), p], [ca.substitute(ca.densify(ca.vec(rate)), phase, -phase)])


def forget_start(rate: Rate, states: int, method: str, tol: float) -> Array:
    """The periodic X (32, 2n, 2n): backward from 0, period after period, until it repeats itself."""
    start = np.zeros(states**2)
    for _ in range(PERIODS):
        found = integrate(rate, start, np.arange(PLACES + 1) / PLACES, method, tol)
        if np.abs(found[-1] - start).max() <= FORGOTTEN * tol * np.abs(start).max():
            return found[:0:-1].reshape(PLACES, states, states)
        start = found[-1]
    raise RuntimeError(f"X is not periodic after {PERIODS} periods")


def measure_scipy_methods(scene: Scene, exact: Array, seconds: float) -> list[Row]:
    """DOP853, LSODA and Radau at several tolerances, set-up left out, for a loop that is a system of second order."""
    loop = parametric_loop(scene, ())
    rate = prepare_rate(derive_product(loop), loop.nominal)

    def trials() -> Iterator[Trial]:
        for method, tols in TOLS.items():
            for tol in tols:
                run = prepare_scipy(loop, method, tol, rate=rate)
                yield Trial(f"SciPy {method}", f"tol {tol:.0e}", run, outside=True)

    return measure_trials("transition matrices", trials(), lambda P: compare_arrays(P, exact), seconds)


def prepare_scipy(
    loop: ParametricLoop, method: str, tol: float, p: Array | None = None, rate: Rate | None = None
) -> Transition:
    """SciPy on all columns at once: DOP853 or Radau by solve_ivp, LSODA by odeint, whose loop over the steps is compiled.

    The columns stand one after another, so the Jacobian is block diagonal: banded for LSODA, sparse for Radau.
    Parameters: p: values of the free numbers, the scene's own by default; rate: the right-hand side, CasADi's own by default.
    """
    values = loop.nominal if p is None else p
    n = loop.states
    f = prepare_rate(derive_product(loop), values) if rate is None else rate
    start = np.eye(n).ravel()
    extra: dict[str, Any] = {}
    if method == "Radau":
        extra["jac"] = partial(arrange_jacobian, symbolic.Pointwise(derive_state_matrix(loop)), values)

    def transition() -> Array:
        return integrate(f, start, np.array([0.0, 1.0]), method, tol, n - 1, **extra)[-1].reshape(n, n).T

    return transition


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


def arrange_jacobian(A: symbolic.Pointwise, p: Array, phase: float, x: Array) -> csc_array:
    """T A once for each column of X, as one sparse matrix."""
    block = A(np.array([phase]), p)[0].T
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


def prepare_rate(product: ca.Function, p: Array) -> Rate:
    """A product (phase, X, p) -> T A X for integrators that call Python."""
    return FastRate(product, p)


class FastRate:
    """(t, x, p) -> x' at fixed p through buffers that are laid out once.

    Each call returns an array of its own: integrators keep the last one.
    """

    def __init__(self, function: ca.Function, p: Array):
        self._function = function  # which must live as long as its buffers
        self._t, self._x, self._parameters = np.zeros(1), np.zeros(function.numel_in(1)), np.array(p, dtype=float)
        self._out = np.zeros(function.numel_out(0))
        self._buffer, self._trigger = self._function.buffer()
        for i, array in enumerate((self._t, self._x, self._parameters)):
            if array.size:
                self._buffer.set_arg(i, array.data)
        self._buffer.set_res(0, self._out.data)

    def __call__(self, t: float, x: Array) -> Array:
        self._t[0] = t
        self._x[:] = x
        self._trigger()
        return self._out.copy()
