"""The nonlinear loop simulated over a period: here, and by SciPy's integrators on the same equations."""

from collections.abc import Iterator
from functools import partial

import casadi as ca
import numpy as np
from scipy.integrate import odeint, solve_ivp

from flexlin.about.linearization import Linearization
from flexlin.answers.accuracy.own_stages import FINEST, TOLS
from flexlin.answers.accuracy.result import Row
from flexlin.answers.accuracy.scipy_methods import LEAST, Rate, prepare_rate
from flexlin.answers.accuracy.trial import Trial, compare_arrays, measure_trials
from flexlin.checks import Array
from flexlin.motion import SymbolicMotion
from flexlin.simulation.equations import loop_expressions
from flexlin.simulation.run import simulate

POINTS = 128
"""Times of the period at which states are compared."""
OUTSIDE_TOLS = {
    "LSODA": tuple(10.0**-k for k in range(4, 13)),
    "DOP853": (1e-5, 1e-7, 1e-9, 1e-11),
    "Radau": (1e-4, 1e-6, 1e-8),
}


def measure_simulation(closed: Linearization, peers: bool, seconds: float) -> list[Row]:
    """One period of the nonlinear loop from rest on the rigid motion, by `simulate` and by SciPy's integrators.

    `simulate` has its own error, the linear answer, tips, torques and energy in its time; the others have the states alone.
    """

    def run(tol: float) -> Array:
        return simulate(closed, 1.0, tol=tol, points_per_period=POINTS).nonlinear

    exact = run(FINEST)

    def trials() -> Iterator[Trial]:
        for tol in TOLS:
            yield Trial("simulate", f"tol {tol:.0e}", partial(run, tol), f"{tol:.0e}")
        if peers and can_be_written(closed):
            rate = prepare_rate(derive_loop_rate(closed), closed.arm.parameters.values)
            for method, tols in OUTSIDE_TOLS.items():
                for tol in tols:
                    outside = partial(integrate_loop, rate, 2 * closed.n, method, tol)
                    yield Trial(f"SciPy {method}", f"tol {tol:.0e}", outside, outside=True)

    return measure_trials("simulation", trials(), lambda x: compare_arrays(x, exact), seconds)


def can_be_written(lin: Linearization) -> bool:
    """Whether the whole right-hand side is one expression of phase and state: a symbolic motion, a law without states or tables."""
    return isinstance(lin.motion, SymbolicMotion) and lin.controller is None


def derive_loop_rate(lin: Linearization) -> ca.Function:
    """(phase, [y; y'], p) -> T [y'; y''] of the nonlinear loop under the scene's law, with time in units of the period."""
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
    """States (N, 2n) over a period from rest: LSODA by odeint, whose loop over the steps is compiled, others by solve_ivp."""
    t, start = np.linspace(0.0, 1.0, POINTS + 1), np.zeros(states)
    if method == "LSODA":
        options = {"rtol": max(tol, LEAST), "atol": tol, "mxstep": 10**7, "full_output": True}
        found, info = odeint(rate, start, t, tfirst=True, **options)
        if info["message"] != "Integration successful.":
            raise RuntimeError(info["message"])
        return np.asarray(found)
    solved = solve_ivp(rate, (0.0, 1.0), start, method, rtol=max(tol, LEAST), atol=tol, t_eval=t)
    if not solved.success:
        raise RuntimeError(solved.message)
    return np.asarray(solved.y.T)
