"""What accuracy costs in time: every stage of the work at many settings, and at the engine's own, against finer references."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial, reduce
from itertools import chain, product
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.analyses.accuracy import scipy_methods
from flexlin.analyses.accuracy.result import (
    CostResult,
    Row,
    Trial,
    Trials,
    compare_arrays,
    compare_exponents,
    measure_stage,
)
from flexlin.arguments import checked
from flexlin.checks import SAMPLES, Array, positive
from flexlin.errors import ArgumentError, counted
from flexlin.linearization.linear import linearize
from flexlin.linearization.linearization import Linearization
from flexlin.mechanics import build_manipulator
from flexlin.mechanics.manipulator import Manipulator
from flexlin.motion import Motion
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.interpolation import FourierSeries
from flexlin.periodic.product import find_spectrum
from flexlin.periodic.response.forced import forced_response
from flexlin.periodic.riccati.riccati import periodic_riccati
from flexlin.periodic.system import PeriodicSystem, of_plant
from flexlin.periodic.transition.choose_segments import Setting, choose_setting, factor_period
from flexlin.resources import part
from flexlin.scene.links import Modes
from flexlin.scene.parameters import replace_value
from flexlin.scene.scene import Scene
from flexlin.series.explicit import taylor
from flexlin.simulation.run import simulate

MEASURED_TOLS = (1e-9, 1e-6, 1e-10, 1e-4, 1e-8)
"""The default first: it is measured even where there is time for one alone."""
REFERENCE_TOL = 1e-11
"""What references are asked for."""
MOST_SEGMENTS = 4096
"""Segments of a trial of the engine at the most, and segments times order of one of collocation."""

__all__ = ["CostResult", "Row", "cost"]


def against(exact: Array, *trials: Iterable[Trial]) -> Trials:
    """Trials whose answers are arrays."""
    return chain(*trials), partial(compare_arrays, exact=exact)


def at_each_tol(method: str, run: Callable[[float], Any], detail: Callable[[Any], str] | None = None) -> list[Trial]:
    """What flexlin does when it is asked for each of MEASURED_TOLS."""
    return [Trial(method, f"tol {tol:.0e}", partial(run, tol), f"{tol:.0e}", detail=detail) for tol in MEASURED_TOLS]


def try_coefficients(closed: Linearization) -> Trials:
    """A(t) over the period from samples and their Fourier series, by the number of harmonics."""
    system, T = closed.periodic_system(), closed.period
    t = T * (np.arange(64) + 0.3183) / 64

    def interpolate(harmonics: int) -> Array:
        at = T * np.arange(2 * harmonics + 1) / (2 * harmonics + 1)
        return FourierSeries.through(system.A(at), T)(t)

    counts = () if system.breaks else (2, 4, 8, 16, 32)
    trials = (Trial("Fourier series", f"{count} harmonics", partial(interpolate, count)) for count in counts)
    return against(system.A(t), trials)


def multiply_period(system: PeriodicSystem, setting: Setting) -> Array:
    """The transition matrix of one period."""
    with np.errstate(over="ignore", invalid="ignore"):  # a method that is far too coarse may leave the range
        return reduce(lambda P, F: F @ P, factor_period(system, setting))


def try_transition_matrices(system: PeriodicSystem) -> Iterator[Trial]:
    """The setting that the engine starts from at each tol, and every method at every order."""
    for tol in MEASURED_TOLS:
        setting = choose_setting(system, tol)
        if setting.segments <= MOST_SEGMENTS:
            yield try_setting(system, setting, f"{tol:.0e}")
    for method, orders in {"gauss": (4, 8, 12, 16, 20), "radau": (5, 9)}.items():
        for order, count in product(orders, (4, 8, 16, 32, 64, 128, 256)):
            if count * order <= MOST_SEGMENTS:
                yield try_setting(system, Setting(method, order, count, ""))


def try_setting(system: PeriodicSystem, setting: Setting, chosen: str = "") -> Trial:
    """The transition matrix of one period by a method on so many segments."""
    name, run = counted(setting.segments, "segment"), partial(multiply_period, system, setting)
    return Trial(f"{setting.method} {setting.order}", name, run, chosen)


def choose_reference(system: PeriodicSystem, order: int = 24) -> Setting:
    """A setting that is finer than all that are tried, on twice the segments that the engine would take for REFERENCE_TOL."""
    count = 2 * choose_setting(system, REFERENCE_TOL).segments
    return Setting("gauss", order, int(np.clip(count, 64, 2048)), "")


def try_exponents(closed: Linearization) -> Trials:
    """floquet at each tol as it chooses by itself, then with each method, and by Hill's Fourier matrix.

    Each run starts from a new system, so its time holds the resolution of the coefficients.
    """
    system = closed.periodic_system()
    exact = find_spectrum(factor_period(system, choose_reference(system))).logs / system.period

    def run(tol: float, method: str = "auto") -> FloquetResult:
        return floquet(replace(closed).periodic_system(), tol, method=method, max_segments=MOST_SEGMENTS)

    trials = at_each_tol("floquet, auto", run, lambda found: name_setting(found.setting))
    for tol, method in product(MEASURED_TOLS, ("gauss", "hill")):
        trials.append(Trial(f"floquet, {method}", f"tol {tol:.0e}", partial(run, tol, method)))
    return trials, lambda found: compare_exponents(found.exponents, exact, closed.period)


def name_setting(setting: Setting) -> str:
    """A setting of the engine in a few words: eigenvalues, decoupling, or the method with its order and segments."""
    if setting.order == 0:
        return setting.method
    return f"{setting.method} {setting.order} on {setting.segments}"


def try_riccati(plant: Linearization, tols: Sequence[float]) -> Trials:
    """The periodic Riccati equation of the open loop with unit weights, X at 32 times."""
    t, Q, R = plant.period * scipy_methods.PHASES, np.eye(2 * plant.n), np.eye(plant.about.m)

    def run(tol: float) -> Array:
        return periodic_riccati(replace(plant).periodic_system(), Q, R, tol=tol).X(t)

    return against(run(REFERENCE_TOL), at_each_tol("periodic_riccati", run), scipy_methods.riccati(plant, tols))


def try_forced_response(closed: Linearization, tols: Sequence[float]) -> Trials:
    """The periodic response to what the rigid motion leaves over, at 32 times."""
    t = closed.period * scipy_methods.PHASES

    def run(tol: float) -> Array:
        system = replace(closed).periodic_system()
        return forced_response(system, of_plant(closed.forcing, system.n, system.n), tol)(t)

    return against(run(REFERENCE_TOL), at_each_tol("forced_response", run), scipy_methods.responses(closed, tols))


def try_simulation(closed: Linearization, tols: Sequence[float]) -> Trials:
    """One period of the nonlinear loop from rest on the rigid motion.

    `simulate` has its own error, the linear answer, tips, torques and energy in its time; the others have the states alone.
    """

    def run(tol: float) -> Array:
        return simulate(closed, 1.0, tol=tol, points_per_period=SAMPLES).nonlinear

    return against(run(REFERENCE_TOL), at_each_tol("simulate", run), scipy_methods.simulations(closed, tols))


def try_modes(scene: Scene) -> Trials:
    """The leading exponent with 0, 1, 2 ... modes in each link that bends, against two modes more than the scene has."""
    bending = {
        f"links.{i}.modes" + (f".{direction}" if isinstance(link.modes, Modes) else ""): count
        for i, link in enumerate(scene.links)
        for direction, count in link.counts.by_direction().items()
        if count
    }
    most = max(bending.values(), default=-2) + 2

    def leading(count: int) -> complex:
        changed = scene
        for path in bending:
            changed = replace_value(changed, path, count)
        loop = linearize(build_manipulator(changed), changed.motion, changed.control)
        first = floquet(loop.periodic_system(), 1e-8).exponents[0]
        return complex(first.real, abs(first.imag))

    exact = leading(most) if most else 0.0
    trials = [Trial("assumed modes", f"{k} a link", partial(leading, k)) for k in range(most)]
    return trials, lambda value: abs(value - exact) / max(1.0, abs(exact))


def try_taylor_orders(arm: Manipulator, motion: Motion) -> Trials:
    """Forces of the nonlinear equations at a displaced state by Taylor's polynomial in s, by its order."""
    q, q1, q2 = (arm.reference @ ca.DM(part[0]) for part in motion.sample(np.array([0.3 * motion.period])))
    known = ca.vertcat(arm.s_dot, arm.s_ddot, arm.parameters.symbols)
    values = ca.densify(ca.vertcat(q1, q2, ca.DM(arm.parameters.values)))
    force = ca.substitute(arm.residual, known, values)
    start = np.array(q).ravel()
    step = 0.05 * np.ones(arm.n)
    function = ca.Function("force", [arm.s], [ca.densify(force)])
    maps = [taylor(force, arm.s, start, order) for order in (1, 2, 3, 4)]
    trials = [Trial("Taylor polynomial", f"order {k}", partial(one, step)) for k, one in enumerate(maps, 1)]
    return against(symbolic.evaluate(function, (start + step)[None])[0][0], trials)


@checked
def cost(scene: Scene, *, peers: bool = True, seconds: float | None = None) -> CostResult:
    """Measure what accuracy costs in time, stage by stage, for the scene's own loop.

        error = max |result - reference| / max |reference|,   of exponents max |difference| / max(1, |exponent|)

    Parameters
    ----------
    scene : Scene
        A scene with a periodic motion.
    peers : bool
        Measure SciPy's integrators too: on transition matrices, forced response, Riccati equation and simulation.
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
    A stage tries settings for 5 s, less where time is short, the engine's own first; what that does not hold is left out
    with a note.

    Examples
    --------
    A run takes some seconds, so this one is not among the tests of docstrings:

    >>> import flexlin as fl
    >>> result = fl.cost(fl.load_scene("single-link"), peers=False)  # doctest: +SKIP
    >>> result.cheapest("exponents", 1e-8).setting  # doctest: +SKIP
    'tol 1e-08, gauss 20 on 40'
    """
    end = perf_counter() + (scene.accuracy.seconds if seconds is None else positive("seconds", seconds))
    arm = build_manipulator(scene)
    closed, plant = linearize(arm, scene.motion, scene.control), linearize(arm, scene.motion)
    if not closed.motion.periodic:
        raise ArgumentError("a one-way motion has no period, so there is nothing to measure", got=scene.motion.kind)
    system, floor, tols = closed.periodic_system(), math.nan, sorted(MEASURED_TOLS, reverse=True) if peers else []

    def transition_matrices() -> Trials:
        nonlocal floor
        rough, exact = (multiply_period(system, choose_reference(system, order)) for order in (20, 24))
        floor = max(compare_arrays(rough, exact), 1e-15)
        return against(exact, try_transition_matrices(system), scipy_methods.transitions(closed, tols))

    stages: dict[str, Callable[[], Trials]] = {
        "exponents": partial(try_exponents, closed),
        "forced response": partial(try_forced_response, closed, tols),
        "periodic Riccati": partial(try_riccati, plant, tols),
        "simulation": partial(try_simulation, closed, tols),
        "transition matrices": transition_matrices,
        "coefficients": partial(try_coefficients, closed),
        "number of modes": partial(try_modes, scene),
        "Taylor order": partial(try_taylor_orders, arm, closed.motion),
    }
    if not plant.inputs:
        del stages["periodic Riccati"]
    rows, notes = list[Row](), list[str]()
    if peers and closed.controller is not None:
        notes.append("SciPy has no rows: the loop has integrals or filters, and is no system of second order")
    for done, (name, stage) in enumerate(stages.items()):
        with part(done / len(stages), (done + 1) / len(stages)):
            found, note = measure_stage(name, stage, (end - perf_counter()) / (len(stages) - done))
        rows, notes = [*rows, *found], [*notes, *note]
    return CostResult(scene.title, tuple(rows), floor, tuple(notes))
