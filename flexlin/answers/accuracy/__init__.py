"""What accuracy costs in time: every stage of the work at many settings, and at the engine's own, against finer references."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache, partial, reduce
from itertools import chain, product
from time import perf_counter

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.about.linear import linearize
from flexlin.about.linearization import Linearization
from flexlin.answers.accuracy.result import (
    STAGE_SECONDS,
    CostResult,
    Row,
    Trial,
    compare_arrays,
    compare_exponents,
    measure_trials,
)
from flexlin.answers.accuracy.scipy_methods import (
    PLACES,
    derive_loop_rate,
    derive_response_rate,
    derive_riccati_rate,
    derive_transition_rate,
    forget_start,
    integrate_loop,
    multiply_up,
    respond_periodically,
    try_scipy,
)
from flexlin.answers.clock import time_limit
from flexlin.arguments import checked
from flexlin.checks import SAMPLES, Array, positive
from flexlin.errors import ArgumentError, FlexlinError, counted
from flexlin.mechanics import build_manipulator
from flexlin.mechanics.manipulator import Manipulator
from flexlin.motion import Motion
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.interpolation import FourierSeries
from flexlin.periodic.product import find_spectrum
from flexlin.periodic.quadratic.riccati import periodic_riccati
from flexlin.periodic.related import OfPlant
from flexlin.periodic.response.forced import forced_response
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.setting import Setting, choose_setting, factor_period
from flexlin.resources import part
from flexlin.scene.links import Link, Modes
from flexlin.scene.parameters import replace_value
from flexlin.scene.scene import Scene
from flexlin.series.explicit import taylor
from flexlin.simulation.run import simulate

TOLS = (1e-9, 1e-6, 1e-10, 1e-4, 1e-8)
"""The default first: it is measured even where there is time for one alone."""
FINE = 1e-11
REFERENCE = 24
"""Order of the references, on twice the segments that the engine would take for FINE."""
METHODS = {"gauss": range(4, 21, 4), "radau": (5, 9)}
RESOLUTIONS = tuple(2**k for k in range(1, 9))
"""Numbers of segments, or of harmonics."""
MOST_SEGMENTS = 4096
"""Segments of a trial of the engine at the most, and segments times order of one of collocation."""


__all__ = ["CostResult", "Row", "cost"]


def by_tol(method: str, run: Callable[[float], Array]) -> list[Trial]:
    """A stage that takes tol, at each of TOLS."""
    return [Trial(method, f"tol {tol:.0e}", partial(run, tol), f"{tol:.0e}") for tol in TOLS]


def measure_coefficients(closed: Linearization, seconds: float) -> list[Row]:
    """A(t) over the period from samples and their Fourier series, by the number of harmonics."""
    system, T = closed.periodic_system(), closed.period
    if system.breaks:
        return []
    t = T * (np.arange(64) + 0.3183) / 64
    exact = system.A(t)

    def trials() -> Iterator[Trial]:
        for h in RESOLUTIONS[:5]:
            at = T * np.arange(2 * h + 1) / (2 * h + 1)
            yield Trial("Fourier series", f"{h} harmonics", partial(interpolate_samples, system, at, t))

    return compare("coefficients", trials(), exact, seconds)


def compare(stage: str, trials: Iterable[Trial], exact: Array, seconds: float) -> list[Row]:
    """The rows of trials whose answers are arrays."""
    return measure_trials(stage, trials, partial(compare_arrays, exact=exact), seconds)


def interpolate_samples(system: PeriodicSystem, at: Array, t: Array) -> Array:
    """A at the times t by the Fourier series through its samples at equidistant times."""
    return FourierSeries.through(system.A(at), system.period)(t)


def try_outside(
    peers: bool, lin: Linearization, derive: Callable[[Linearization], ca.Function], run: Callable[..., Array]
) -> Iterable[Trial]:
    """SciPy's integrators at each of TOLS, the quick ones first."""
    return try_scipy(lin, derive, run, sorted(TOLS, reverse=True)) if peers else ()


def multiply_period(system: PeriodicSystem, setting: Setting) -> Array:
    """The transition matrix of one period."""
    with np.errstate(over="ignore", invalid="ignore"):  # a method that is far too coarse may leave the range
        return reduce(lambda P, F: F @ P, factor_period(system, setting)[1])


def measure_transition_matrices(closed: Linearization, exact: Array, peers: bool, seconds: float) -> list[Row]:
    """The setting that the engine starts from at each tol, and every method at every order."""
    system = closed.periodic_system()

    def trials() -> Iterator[Trial]:
        for tol in TOLS:
            setting = choose_setting(system, tol, "auto", None, None)
            if setting.segments <= MOST_SEGMENTS:
                yield try_setting(system, setting, f"{tol:.0e}")
        for method, orders in METHODS.items():
            for order, count in product(orders, RESOLUTIONS[1:]):
                if count * order <= MOST_SEGMENTS:
                    yield try_setting(system, Setting(method, order, count, ""))

    outside = try_outside(peers, closed, derive_transition_rate, multiply_up)
    return compare("transition matrices", chain(trials(), outside), exact, seconds)


def try_setting(system: PeriodicSystem, setting: Setting, chosen: str = "") -> Trial:
    """The transition matrix of one period by a method on so many segments."""
    name, run = counted(setting.segments, "segment"), partial(multiply_period, system, setting)
    return Trial(f"{setting.method} {setting.order}", name, run, chosen)


def choose_reference(system: PeriodicSystem, order: int = REFERENCE) -> Setting:
    """A setting that is finer than all that are tried."""
    count = 2 * choose_setting(system, FINE, "gauss", None, None).segments
    return Setting("gauss", order, int(np.clip(count, 64, 2048)), "")


def find_exact_exponents(system: PeriodicSystem) -> Array:
    """Exponents (n,) in 1/s of the reference's product of transition matrices, modulo 2 pi i / T."""
    return find_spectrum(factor_period(system, choose_reference(system))[1]).logs / system.period


def measure_exponents(closed: Linearization, exact: Array, seconds: float) -> list[Row]:
    """floquet at each tol as it chooses by itself, then with each method, and by Hill's Fourier matrix.

    Each run starts from a new system, so its time holds the resolution of the coefficients.
    """

    def run(tol: float, method: str) -> FloquetResult:
        return floquet(replace(closed).periodic_system(), tol, method=method, max_segments=MOST_SEGMENTS)

    def trials() -> Iterator[Trial]:
        for tol in TOLS:
            name, detail = f"tol {tol:.0e}", lambda found: name_setting(found.setting)
            yield Trial("floquet, auto", name, partial(run, tol, "auto"), f"{tol:.0e}", detail=detail)
        for tol in TOLS:
            for method in ("gauss", "hill"):
                yield Trial(f"floquet, {method}", f"tol {tol:.0e}", partial(run, tol, method))

    return measure_trials(
        "exponents", trials(), lambda found: compare_exponents(found.exponents, exact, closed.period), seconds
    )


def name_setting(setting: Setting) -> str:
    """A setting of the engine in a few words: eigenvalues, decoupling, or the method with its order and segments."""
    if setting.order == 0:
        return setting.method
    return f"{setting.method} {setting.order} on {setting.segments}"


def measure_riccati(plant: Linearization, peers: bool, seconds: float) -> list[Row]:
    """The periodic Riccati equation of the open loop with unit weights, X at 32 times."""
    if not plant.inputs:
        return []
    system, t = plant.periodic_system(), plant.period * np.arange(PLACES) / PLACES
    Q, R = np.eye(system.n), np.eye(system.m)
    exact = periodic_riccati(system, Q, R, tol=FINE).X(t)

    def run(tol: float) -> Array:
        return periodic_riccati(replace(plant).periodic_system(), Q, R, tol=tol).X(t)

    outside = try_outside(peers, plant, derive_riccati_rate, forget_start)
    return compare("periodic Riccati", chain(by_tol("periodic_riccati", run), outside), exact, seconds)


def measure_forced_response(closed: Linearization, peers: bool, seconds: float) -> list[Row]:
    """The periodic response to what the rigid motion leaves over, at 32 times."""
    t = closed.period * np.arange(PLACES) / PLACES

    def run(tol: float) -> Array:
        system = replace(closed).periodic_system()
        return forced_response(system, OfPlant(closed.forcing, system.n, system.n), tol)(t)

    exact, outside = run(FINE), try_outside(peers, closed, derive_response_rate, respond_periodically)
    return compare("forced response", chain(by_tol("forced_response", run), outside), exact, seconds)


def measure_simulation(closed: Linearization, peers: bool, seconds: float) -> list[Row]:
    """One period of the nonlinear loop from rest on the rigid motion.

    `simulate` has its own error, the linear answer, tips, torques and energy in its time; the others have the states alone.
    """

    def run(tol: float) -> Array:
        return simulate(closed, 1.0, tol=tol, points_per_period=SAMPLES).nonlinear

    exact, outside = run(FINE), try_outside(peers, closed, derive_loop_rate, integrate_loop)
    return compare("simulation", chain(by_tol("simulate", run), outside), exact, seconds)


def measure_modes(scene: Scene, seconds: float) -> list[Row]:
    """The leading exponent with 0, 1, 2 ... modes in each link that bends, against two modes more than the scene has."""
    if not scene.links or all(not any(counts_of(link)) for link in scene.links):
        return []
    most = max(count for link in scene.links for count in counts_of(link)) + 2

    def leading(count: int) -> complex:
        changed = scene
        for i, link in enumerate(scene.links):
            counts: dict[str, int] = {d: count for d, n in link.counts.by_direction().items() if n}
            if counts:
                modes = link.counts.model_copy(update=counts) if isinstance(link.modes, Modes) else count
                changed = replace_value(changed, f"links.{i}.modes", modes)
        loop = linearize(build_manipulator(changed), changed.motion, changed.control)
        first = floquet(loop.periodic_system(), 1e-8).exponents[0]
        return complex(first.real, abs(first.imag))

    exact = leading(most)
    trials = [Trial("assumed modes", f"{k} a link", partial(leading, k)) for k in range(most)]
    return measure_trials("number of modes", trials, lambda value: abs(value - exact) / max(1.0, abs(exact)), seconds)


def counts_of(link: Link) -> tuple[int, ...]:
    """The numbers of modes of a link, one a direction."""
    return tuple(link.counts.by_direction().values())


def measure_taylor_order(arm: Manipulator, motion: Motion, seconds: float) -> list[Row]:
    """Forces of the nonlinear equations at a displaced state by Taylor's polynomial in s, by its order."""
    q, q1, q2 = (arm.reference @ ca.DM(part[0]) for part in motion.sample(np.array([0.3 * motion.period])))
    known = ca.vertcat(arm.s_dot, arm.s_ddot, arm.parameters.symbols)
    values = ca.densify(ca.vertcat(q1, q2, ca.DM(arm.parameters.values)))
    force = ca.substitute(arm.residual, known, values)
    start = np.array(q).ravel()
    step = 0.05 * np.ones(arm.n)
    function = ca.Function("force", [arm.s], [ca.densify(force)])
    exact = symbolic.evaluate(function, (start + step)[None])[0][0]
    maps = {order: taylor(force, arm.s, start, order) for order in range(1, 5)}
    trials = [Trial("Taylor polynomial", f"order {k}", partial(polynomial, step)) for k, polynomial in maps.items()]
    return compare("Taylor order", trials, exact, seconds)


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
    system, floor = closed.periodic_system(), math.nan
    exact = cache(lambda order=REFERENCE: multiply_period(system, choose_reference(system, order)))

    def transition_matrices(seconds: float) -> list[Row]:
        nonlocal floor
        floor = max(compare_arrays(exact(20), exact()), 1e-15)
        return measure_transition_matrices(closed, exact(), peers, seconds)

    stages: dict[str, Callable[[float], list[Row]]] = {
        "exponents": lambda s: measure_exponents(closed, find_exact_exponents(system), s),
        "forced response": partial(measure_forced_response, closed, peers),
        "periodic Riccati": partial(measure_riccati, plant, peers),
        "simulation": partial(measure_simulation, closed, peers),
        "transition matrices": transition_matrices,
        "coefficients": partial(measure_coefficients, closed),
        "number of modes": partial(measure_modes, scene),
        "Taylor order": partial(measure_taylor_order, arm, closed.motion),
    }
    rows, notes = list[Row](), list[str]()
    if peers and closed.controller is not None:
        notes.append("SciPy has no rows: the loop has integrals or filters, and is no system of second order")
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
