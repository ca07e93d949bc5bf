"""Work and precision of every stage for one scene."""

import math
from collections.abc import Callable, Iterator
from functools import cache, partial
from time import perf_counter

import casadi as ca
import numpy as np
from scipy.integrate import odeint, solve_ivp

from flexlin.about.linear import linearize
from flexlin.about.linearization import Linearization
from flexlin.answers.accuracy import own_stages as own
from flexlin.answers.accuracy import scipy_methods
from flexlin.answers.accuracy.own_stages import FINEST, TOLS
from flexlin.answers.accuracy.result import CostResult, Row
from flexlin.answers.accuracy.scipy_methods import LEAST, Rate, measure_scipy_methods, prepare_rate
from flexlin.answers.accuracy.trial import STAGE_SECONDS, Trial, compare_arrays, measure_trials
from flexlin.answers.limits import time_limit
from flexlin.arguments import checked, instance
from flexlin.checks import SAMPLES, Array, positive
from flexlin.errors import ArgumentError, FlexlinError
from flexlin.mechanics import build_manipulator
from flexlin.motion import SymbolicMotion
from flexlin.progress import part
from flexlin.scene.scene import Scene
from flexlin.simulation.equations import loop_expressions
from flexlin.simulation.run import simulate


def measure_simulation(closed: Linearization, peers: bool, seconds: float) -> list[Row]:
    """One period of the nonlinear loop from rest on the rigid motion, by `simulate` and by SciPy's integrators.

    `simulate` has its own error, the linear answer, tips, torques and energy in its time; the others have the states alone.
    """

    def run(tol: float) -> Array:
        return simulate(closed, 1.0, tol=tol, points_per_period=SAMPLES).nonlinear

    exact = run(FINEST)

    def trials() -> Iterator[Trial]:
        for tol in TOLS:
            yield Trial("simulate", f"tol {tol:.0e}", partial(run, tol), f"{tol:.0e}")
        if peers and can_be_written(closed):
            rate = prepare_rate(derive_loop_rate(closed), closed.arm.parameters.values)
            for method, tols in scipy_methods.TOLS.items():
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
    t, start = np.linspace(0.0, 1.0, SAMPLES + 1), np.zeros(states)
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


@checked
def cost(scene: Scene, *, peers: bool = True, seconds: float | None = None) -> CostResult:
    """Measure what accuracy costs in time, stage by stage, for the scene's own loop.

        error = max |result - reference| / max |reference|,   of exponents max |difference| / max(1, |exponent|)

    Parameters
    ----------
    scene : Scene
        A scene with a periodic motion.
    peers : bool
        Measure SciPy's integrators on the transition matrices and the simulation too.
    seconds : float, optional
        Wall time that all of it may take; by default the scene's limit.

    Returns
    -------
    CostResult
        `recommendations()` names the cheapest setting for each accuracy; rows with `chosen` are the engine's choices.

    Raises
    ------
    ArgumentError
        For a one-way motion.

    Notes
    -----
    Stages: sampling the coefficients, transition matrices by every method and order, exponents, periodic Riccati equation, forced
    response, number of modes, order of Taylor's polynomial. References come from a finer resolution; how well two of them agree is
    the result's `floor`. Times are CPU times of one thread, the least of several where a run is short; building the model is left out.
    A stage tries settings for 5 s, less where time is short, the engine's own first and in turns; what that does not hold is left out
    with a note.

    Examples
    --------
    A run takes some seconds, so this one is not among the tests of docstrings:

    >>> import flexlin as fl
    >>> result = fl.cost(fl.load_scene("single-link"), peers=False)  # doctest: +SKIP
    >>> result.cheapest("exponents", 1e-8).setting  # doctest: +SKIP
    'tol 1e-08, gauss 20 on 40'
    """
    instance("scene", scene, Scene, "load one: fl.load_scene(name or path)")
    end = perf_counter() + (scene.accuracy.seconds if seconds is None else positive("seconds", seconds))
    arm = build_manipulator(scene)
    closed, plant = linearize(arm, scene.motion, scene.control), linearize(arm, scene.motion)
    if not closed.motion.periodic:
        raise ArgumentError("a one-way motion has no period, so there is nothing to measure", got=scene.motion.kind)
    system, floor = closed.periodic_system(), math.nan
    exact = cache(lambda order=own.REFERENCE: own.multiply_period(system, own.choose_reference(system, order)))

    def transition_matrices(seconds: float) -> list[Row]:
        nonlocal floor
        floor = max(compare_arrays(exact(20), exact()), 1e-15)
        return own.measure_transition_matrices(system, exact(), seconds)

    stages: dict[str, Callable[[float], list[Row]]] = {
        "exponents": lambda s: own.measure_exponents(closed, own.find_exact_exponents(system), s),
        "forced response": partial(own.measure_forced_response, closed),
        "periodic Riccati": partial(own.measure_riccati, plant),
        "simulation": partial(measure_simulation, closed, peers),
        "transition matrices": transition_matrices,
        "coefficients": partial(own.measure_coefficients, closed),
        "number of modes": partial(own.measure_modes, scene),
        "Taylor order": partial(own.measure_taylor_order, arm, closed.motion),
    }
    rows, notes = list[Row](), list[str]()
    if peers and closed.controller is not None:
        notes.append("SciPy has no rows: the loop has integrals or filters, and is no system of second order")
    elif peers and isinstance(closed.motion, SymbolicMotion):
        stages["SciPy"] = lambda s: measure_scipy_methods(scene, exact(), s)
    for done, (name, stage) in enumerate(stages.items()):
        with part(done / len(stages), (done + 1) / len(stages)):
            found, note = measure_stage(name, stage, (end - perf_counter()) / (len(stages) - done))
        rows, notes = [*rows, *found], [*notes, *note]
    return CostResult(scene.title, tuple(rows), floor, tuple(notes)).marked()


def measure_stage(name: str, stage: Callable[[float], list[Row]], most: float) -> tuple[list[Row], list[str]]:
    """The rows of a stage that may take some s and begins with its references; a note where it has none, or not all."""
    begin, seconds = perf_counter(), max(min(STAGE_SECONDS, most), 1e-3)
    try:
        with time_limit(name, max(min(2 * seconds, most), 1e-3)):
            rows = stage(seconds)
    except FlexlinError as error:
        return [], [f"{name} left out: {error.what}"]
    over = f"{name}: the slowest settings are left out, which {seconds:.2g} s do not hold"
    return rows, [over] if perf_counter() - begin > seconds else []
