"""The figures by which two versions of a scene are compared."""

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from flexlin.about.linear import Linearization, linearize
from flexlin.checks import Array
from flexlin.control.tracking import tip_positions
from flexlin.errors import FlexlinError
from flexlin.mechanics import build_manipulator
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.fourier import fourier_differentiation
from flexlin.scene.scene import Scene
from flexlin.summary import represent

PHASES, POINTS, REPEATS = 9, 257, 3
SEGMENTS = 4000
"""A version that needs more segments than these for its margin is not judged."""
HARMONICS = (24, 48)
"""Of the periodic response; the difference between the two must be below RESPONSE of it."""
RESPONSE = 0.01


@dataclass(frozen=True)
class Measure:
    """A scene's own loop in figures. A figure that is not known is not a number, and `problems` says why.

    Attributes
    ----------
    margin : float
        Largest real part of the Floquet exponents, in 1/s; negative is stable.
    margin_error : float
        Its error, in 1/s.
    verdict : str
        "stable", "unstable", "undecided" or "unknown".
    frequencies : array, shape (k,)
        Natural frequencies of the frozen loop, averaged over the period, ascending, in rad/s.
    tip_error : float
        Largest distance between the tip and its rigid motion in the periodic response, in m; not a number without points.
    coordinates : int
        Number of coordinates.
    instructions : int
        Instructions of all coefficients.
    microseconds : float
        Time to evaluate them at one time.
    problems : tuple of str
        Why figures are missing.

    Examples
    --------
    >>> import flexlin as fl
    >>> from flexlin.answers.audit import measure
    >>> figures = measure(fl.load_scene("single-link", {"links.0.modes": 1, "designs": []}))
    >>> figures.verdict, figures.coordinates, figures.problems
    ('stable', 2, ())
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

    __repr__ = represent


def measure(scene: Scene, tol: float = 1e-4) -> Measure:
    """Build, linearize and judge a scene's own loop.

    Parameters
    ----------
    scene : Scene
        The scene.
    tol : float
        Wanted error of the margin, in 1/s.

    Returns
    -------
    Measure
        Margin, frequencies, tip error, and the size of the equations.

    Raises
    ------
    InputError
        When the scene cannot be built at all.

    Examples
    --------
    >>> import flexlin as fl
    >>> from flexlin.answers.audit import measure
    >>> figures = measure(fl.load_scene("single-link", {"links.0.modes": 1, "designs": []}))
    >>> figures.margin < -figures.margin_error
    True
    """
    lin = linearize(build_manipulator(scene), scene.motion, scene.control)
    problems: list[str] = []
    margin, error, verdict = _judge_margin(lin, tol, problems)
    return Measure(
        margin,
        error,
        verdict,
        _average_frequencies(lin),
        _measure_tip_error(lin, problems),
        lin.n,
        lin.coefficients.n_instructions(),
        _time_evaluation(lin),
        tuple(problems),
    )


def _judge_margin(lin: Linearization, tol: float, problems: list[str]) -> tuple[float, float, str]:
    try:
        result = floquet(lin.periodic_system(), tol, max_segments=SEGMENTS)
    except FlexlinError as error:
        problems.append(f"stability: {error}")
        return float("nan"), float("nan"), "unknown"
    return float(result.exponents[0].real), float(result.errors[0]), result.verdict


def _average_frequencies(lin: Linearization) -> Array:
    """sqrt |eigenvalues of M^-1 K|, each averaged over phases of the motion."""
    c = lin.sample(np.linspace(0, lin.period, PHASES, endpoint=False))
    squares = np.linalg.eigvals(np.linalg.solve(c.M, c.K))
    return np.sort(np.sqrt(np.abs(squares)), axis=1).mean(axis=0)


def _measure_tip_error(lin: Linearization, problems: list[str]) -> float:
    """The largest distance of the tip from its rigid motion, with few harmonics and with more."""
    if not lin.motion.periodic:
        problems.append("periodic response: a one-way motion has none")
        return float("nan")
    if lin.arm.points is None:
        return float("nan")
    coarse, fine = (_measure_tip_distance(lin, harmonics) for harmonics in HARMONICS)
    if not abs(fine - coarse) <= RESPONSE * fine + 1e-12:
        problems.append(
            f"periodic response: {HARMONICS[1]} harmonics do not resolve it, {coarse:.3g} m became {fine:.3g} m"
        )
    return fine


def _measure_tip_distance(lin: Linearization, harmonics: int) -> float:
    """Solve M y'' + D y' + K y = h on 2 harmonics + 1 times by Fourier collocation: fast modes that nothing excites do not matter."""
    count, n = 2 * harmonics + 1, lin.n
    t = lin.period * np.arange(count) / count
    slope = fourier_differentiation(count, lin.period)
    M, D, K, h = second_order_with_states(lin, t)
    operator = np.einsum("tab,ts->tasb", M, slope @ slope) + np.einsum("tab,ts->tasb", D, slope)
    operator[np.arange(count), :, np.arange(count), :] += K
    try:
        y = np.linalg.solve(operator.reshape(h.size, h.size), h.ravel()).reshape(count, -1)[:, :n]
    except np.linalg.LinAlgError:
        return float("nan")
    states = np.hstack([y, slope @ y])
    away = tip_positions(lin, t, states) - tip_positions(lin, t, np.zeros_like(states))
    return float(np.linalg.norm(away, axis=1).max())


def second_order_with_states(lin: Linearization, t: Array) -> tuple[Array, Array, Array, Array]:
    """M, D, K (N, n + k, n + k) and h (N, n + k) of [y; z]; the controller's rows, z' - rates [y; y'; z] = 0, have no mass."""
    c, n, controller = lin.sample(t), lin.n, lin.controller
    if controller is None:
        return c.M, c.D, c.K, c.h
    k, rates = controller.states, controller.rates
    M, D, K = (np.zeros((len(t), n + k, n + k)) for _ in range(3))
    M[:, :n, :n], D[:, :n, :n], K[:, :n, :n] = c.M, c.D, c.K
    K[:, :n, n:] = c.B @ lin.closed_by.gain(t)[:, :, 2 * n :]
    D[:, n:, :n], D[:, n:, n:] = -rates[:, n : 2 * n], np.eye(k)
    K[:, n:, :n], K[:, n:, n:] = -rates[:, :n], -rates[:, 2 * n :]
    return M, D, K, np.concatenate([c.h, np.zeros((len(t), k))], axis=1)


def _time_evaluation(lin: Linearization) -> float:
    t = np.linspace(0, lin.period, POINTS)
    lin.sample(t)
    times = []
    for _ in range(REPEATS):
        start = perf_counter()
        lin.sample(t)
        times.append(perf_counter() - start)
    return 1e6 * min(times) / POINTS
