"""Transition matrix, motion from rest, periodic response and Riccati equation by SciPy's integrators on one CasADi expression each."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import product

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from flexlin.analyses.accuracy.result import Trial
from flexlin.checks import SAMPLES, Array
from flexlin.linearization.deviation import loop_expressions
from flexlin.linearization.linearization import Linearization
from flexlin.motion import SymbolicMotion

COMPARED_TIMES = 32
PHASES = np.arange(COMPARED_TIMES) / COMPARED_TIMES
"""Of the times in a period at which periodic answers are compared."""
METHODS = ("DOP853", "Radau")
Rate = Callable[[float, Array], Array]
"""(phase, columns of X one after another (n n,)) -> the columns of T A X."""


def derive_loop_rate(lin: Linearization) -> ca.Function:
    """(phase, [y; y'], p) -> T [y'; y''] of the nonlinear loop under the scene's law."""
    about, law = lin.about, lin.law
    inputs, _, F, _ = loop_expressions(about)
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


def derive_transition_rate(lin: Linearization, forced: bool = False) -> ca.Function:
    """(phase, columns of X, p) -> those of T A X, zeros of A left out of the product; `forced`: of [X, x] those of T [A X, A x + b]."""
    phase, p, A, b, _ = derive_linear(lin)
    X = ca.SX.sym("X", 2 * lin.n, 2 * lin.n + forced)
    rate = ca.sparsify(A) @ X
    if forced:
        rate[:, -1] += b
    return ca.Function("transition_rate", [phase, ca.vec(X), p], [ca.densify(ca.vec(rate))])


def multiply_up(rate: Rate, states: int, method: str, tol: float) -> Array:
    """The transition matrix of one period (2n, 2n)."""
    return integrate(rate, np.eye(states).ravel(), np.array([0.0, 1.0]), method, tol)[-1].reshape(states, states).T


derive_response_rate = partial(derive_transition_rate, forced=True)


def respond_periodically(rate: Rate, states: int, method: str, tol: float) -> Array:
    """The periodic response (32, 2n) from the transition matrix and the motion from rest."""
    start, t = np.eye(states + 1, states).ravel(), np.arange(COMPARED_TIMES + 1) / COMPARED_TIMES
    columns = integrate(rate, start, t, method, tol).reshape(COMPARED_TIMES + 1, states + 1, states)
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
    """The periodic X (32, 2n, 2n): backward from 0, period after period, until it repeats itself to ten times tol."""
    start, change = np.zeros(states**2), np.inf
    while not change <= 10 * tol * np.abs(start).max():
        found = integrate(rate, start, np.arange(COMPARED_TIMES + 1) / COMPARED_TIMES, method, tol)
        start, change = found[-1], float(np.abs(found[-1] - start).max())
    return found[:0:-1].reshape(COMPARED_TIMES, states, states)


def integrate(rate: Rate, start: Array, t: Array, method: str, tol: float) -> Array:
    """The unknowns (N, ...) at times t. Raises: RuntimeError."""
    with np.errstate(over="ignore", invalid="ignore"):  # a step that is far too long may leave the range
        run = solve_ivp(rate, (t[0], t[-1]), start, method, rtol=tol, atol=tol, t_eval=t)
    if not run.success:
        raise RuntimeError(run.message)
    return np.asarray(run.y.T)


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


Run = Callable[[Rate, int, str, float], Array]
"""(rate, number of states, method, tol) -> what is compared."""


def try_scipy(
    lin: Linearization, tols: Sequence[float], derive: Callable[[Linearization], ca.Function], run: Run
) -> Iterator[Trial]:
    """Every method at each tolerance, where the right-hand side is one expression: a symbolic motion, a law without states."""
    if isinstance(lin.motion, SymbolicMotion) and lin.controller is None:
        rate = FastRate(derive(lin), lin.arm.parameters.values)
        for method, tol in product(METHODS, tols):
            work = partial(run, rate, 2 * lin.n, method, tol)
            yield Trial(f"SciPy {method}", f"tol {tol:.0e}", work, outside=True)


transitions = partial(try_scipy, derive=derive_transition_rate, run=multiply_up)
simulations = partial(try_scipy, derive=derive_loop_rate, run=integrate_loop)
responses = partial(try_scipy, derive=derive_response_rate, run=respond_periodically)
riccati = partial(try_scipy, derive=derive_riccati_rate, run=forget_start)
"""What SciPy needs for each of the answers that are compared."""
