"""Work and precision of every stage for one scene."""

import math
from collections.abc import Callable
from functools import cache, partial
from time import perf_counter

from flexlin.about.linear import linearize
from flexlin.answers.accuracy import own_stages as own
from flexlin.answers.accuracy.result import STAGE_SECONDS, CostResult, Row, compare_arrays
from flexlin.answers.accuracy.scipy_methods import measure_scipy_methods
from flexlin.answers.limits import time_limit
from flexlin.arguments import checked, instance
from flexlin.checks import positive
from flexlin.errors import ArgumentError, FlexlinError
from flexlin.mechanics import build_manipulator
from flexlin.motion import SymbolicMotion
from flexlin.progress import part
from flexlin.scene.scene import Scene


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
        "forced response": partial(own.measure_forced_response, closed, peers),
        "periodic Riccati": partial(own.measure_riccati, plant, peers),
        "simulation": partial(own.measure_simulation, closed, peers),
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
