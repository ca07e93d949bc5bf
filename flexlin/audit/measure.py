"""The figures by which two versions of a scene are compared."""

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from flexlin.checks import Array
from flexlin.errors import FlexlinError
from flexlin.linearization import Linearization, linearize
from flexlin.mechanics import build_manipulator
from flexlin.periodic import floquet, forced_response
from flexlin.scene.scene import Scene
from flexlin.simulation import tip_positions

PHASES, POINTS, REPEATS = 9, 257, 3
TOLERANCE = 1e-6
"""Of exponents and responses: far below any change that an audit calls a change."""


@dataclass(frozen=True)
class Measure:
    """A scene's own loop in figures.

    margin: largest real part of the Floquet exponents, with its error, in 1/s (negative is stable); frequencies (k,): natural
    frequencies of the frozen loop, averaged over the period, ascending, in rad/s; tip_error: largest distance in m between the tip and
    its rigid motion in the periodic response; coordinates; instructions of all coefficients; microseconds to evaluate them at one time.
    A figure that could not be had is not a number, and `problems` says why.
    """

    margin: float
    margin_error: float
    verdict: str
    frequencies: Array
    tip_error: float
    coordinates: int
    instructions: int
    microseconds: float
    problems: tuple[str, ...] = ()


def measure(scene: Scene) -> Measure:
    """Build, linearize and judge a scene's own loop.

    Returns: a `Measure`. Raises: InputError when the scene cannot be built at all.
    """
    lin = linearize(build_manipulator(scene), scene.motion, scene.control)
    problems: list[str] = []
    margin, error, verdict = _margin(lin, problems)
    return Measure(
        margin,
        error,
        verdict,
        _frequencies(lin),
        _tip_error(lin, problems),
        lin.n,
        lin.coefficients.n_instructions(),
        _microseconds(lin),
        tuple(problems),
    )


def _margin(lin: Linearization, problems: list[str]) -> tuple[float, float, str]:
    try:
        result = floquet(lin.periodic_system(), TOLERANCE)
    except FlexlinError as error:
        problems.append(f"stability: {error}")
        return float("nan"), float("nan"), "unknown"
    return float(result.exponents[0].real), float(result.errors[0]), result.verdict


def _frequencies(lin: Linearization) -> Array:
    """sqrt |eigenvalues of M^-1 K|, each averaged over phases of the motion."""
    c = lin.sample(np.linspace(0, lin.period, PHASES, endpoint=False))
    squares = np.linalg.eigvals(np.linalg.solve(c.M, c.K))
    return np.sort(np.sqrt(np.abs(squares)), axis=1).mean(axis=0)


def _tip_error(lin: Linearization, problems: list[str]) -> float:
    t = np.linspace(0, lin.period, POINTS)
    try:
        states = forced_response(lin.periodic_system(), lin.forcing, TOLERANCE)(t)
    except FlexlinError as error:
        problems.append(f"periodic response: {error}")
        return float("nan")
    away = tip_positions(lin, t, states) - tip_positions(lin, t, np.zeros_like(states))
    return float(np.linalg.norm(away, axis=1).max())


def _microseconds(lin: Linearization) -> float:
    t = np.linspace(0, lin.period, POINTS)
    lin.sample(t)
    times = []
    for _ in range(REPEATS):
        start = perf_counter()
        lin.sample(t)
        times.append(perf_counter() - start)
    return 1e6 * min(times) / POINTS
