"""Work and precision of every stage for one scene."""

from collections.abc import Callable
from time import perf_counter

from flexlin.about.linear import linearize
from flexlin.answers.accuracy import own_stages as own
from flexlin.answers.accuracy.result import CostResult, Row
from flexlin.answers.accuracy.scipy_methods import measure_scipy_methods
from flexlin.answers.accuracy.trial import STAGE_SECONDS, compare_arrays
from flexlin.answers.limits import time_limit
from flexlin.arguments import checked, instance
from flexlin.errors import ArgumentError, FlexlinError
from flexlin.mechanics import build_manipulator
from flexlin.motion import SymbolicMotion
from flexlin.progress import part
from flexlin.scene.scene import Scene

SHARE = 0.6
"""Of the scene's limit of time: after it no stage is begun, so that with the last one at its limit all of it ends in time."""


@checked
def cost(scene: Scene, *, peers: bool = True) -> CostResult:
    """Measure what accuracy costs in time, stage by stage, for the scene's own loop.

        error = max |result - reference| / max |reference|,   of exponents max |difference| / max(1, |exponent|)

    Parameters
    ----------
    scene : Scene
        A scene with a periodic motion.
    peers : bool
        Measure SciPy's integrators on the transition matrices too.

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
    A stage tries settings for 5 s, the engine's own first and in turns; what that does not hold is left out with a note.

    Examples
    --------
    A run takes some seconds, so this one is not among the tests of docstrings:

    >>> import flexlin as fl
    >>> result = fl.cost(fl.load_scene("single-link"), peers=False)  # doctest: +SKIP
    >>> result.cheapest("exponents", 1e-8).setting  # doctest: +SKIP
    'tol 1e-08, gauss 20 on 40'
    """
    instance("scene", scene, Scene, "load one: fl.load_scene(name or path)")
    start, total = perf_counter(), SHARE * scene.accuracy.seconds
    arm = build_manipulator(scene)
    closed, plant = linearize(arm, scene.motion, scene.control), linearize(arm, scene.motion)
    if not closed.motion.periodic:
        raise ArgumentError("a one-way motion has no period, so there is nothing to measure", got=scene.motion.kind)
    system = closed.periodic_system()
    exact, check = (own.multiply_period(system, own.choose_reference(system, order)) for order in (own.REFERENCE, 20))
    stages: dict[str, Callable[[], list[Row]]] = {
        "exponents": lambda: own.measure_exponents(closed, own.find_exact_exponents(system)),
        "forced response": lambda: own.measure_forced_response(closed),
        "periodic Riccati": lambda: own.measure_riccati(plant),
        "transition matrices": lambda: own.measure_transition_matrices(system, exact),
        "coefficients": lambda: own.measure_coefficients(closed),
        "number of modes": lambda: own.measure_modes(scene),
        "Taylor order": lambda: own.measure_taylor_order(arm, closed.motion),
    }
    rows, notes, last = [], [], len(stages) + peers
    for done, (name, stage) in enumerate(stages.items()):
        begin = perf_counter()
        left = start + total - begin
        if left <= 0:
            notes.append(f"{name} left out: the others took {total:g} s; allow more time (--limit-seconds)")
            continue
        try:
            with time_limit(name, min(2 * STAGE_SECONDS, left)), part(done / last, (done + 1) / last):
                rows += stage()
        except FlexlinError as error:
            notes.append(f"{name} left out: {error.what}")
        else:
            if perf_counter() - begin > STAGE_SECONDS:
                notes.append(f"{name}: the slowest settings are left out, which {STAGE_SECONDS:g} s do not hold")
    left = start + total - perf_counter()
    if peers and isinstance(closed.motion, SymbolicMotion) and left > 0:
        try:
            with time_limit("SciPy", left + 2 * STAGE_SECONDS), part(1 - 1 / last, 1.0):
                found, missing = measure_scipy_methods(scene, exact)
            rows, notes = rows + found, notes + missing
        except FlexlinError as error:
            notes.append(f"SciPy left out: {error.what}")
    return CostResult(scene.title, tuple(rows), max(compare_arrays(check, exact), 1e-15), tuple(notes)).marked()
