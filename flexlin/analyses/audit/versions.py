"""The versions of a scene that an audit tries, each effect off or on, a mode more or less, and the figures by which two are compared."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from timeit import repeat
from typing import Any

import casadi as ca
import numpy as np
from pydantic import BaseModel, ValidationError
from scipy.sparse.csgraph import connected_components

from flexlin.analyses.judging import find_response
from flexlin.checks import SAMPLES, SUM_ROUNDING, Array, try_to
from flexlin.control.drives import Demand, drive_load
from flexlin.control.tracking import tip_positions
from flexlin.errors import counted
from flexlin.linearization.free import loop_matrices
from flexlin.linearization.linear import linearize
from flexlin.linearization.linearization import Linearization
from flexlin.mechanics import build_manipulator
from flexlin.mechanics.effects import Effect, Scale
from flexlin.mechanics.link_shapes import make_shapes
from flexlin.motion import build_motion
from flexlin.periodic.coefficients import solve_mass
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.system import with_matrices
from flexlin.precision import SLIGHT
from flexlin.scene.base import Table
from flexlin.scene.control import Drives
from flexlin.scene.effects import known_effects
from flexlin.scene.library import registered_model
from flexlin.scene.links import Direction, Modes
from flexlin.scene.parameters import PARAMETERS, get_value, list_children, replace_value
from flexlin.scene.scene import Scene
from flexlin.summary import immutable

MOST_MODES = 12
"""No link is given more modes than these."""


@dataclass(frozen=True)
class Version:
    """A change of a scene, as `make` does it to any scene, and how to speak of it.

    on: whether the scene has what the change takes away, for an effect; whether there are fewer modes, for modes.
    """

    make: Callable[[Scene], Scene]
    change: str
    kind: str
    subject: str
    on: bool
    table: dict[str, Any]
    units: dict[str, str] = field(default_factory=dict)


def list_effect_versions(scene: Scene) -> Iterator[Version]:
    """Switch each effect off, or on with the figures that its own file proposes; an effect without a proposal is not tried."""
    on, scale = scene.effects.on(), read_scale(scene)
    for name, effect in known_effects().items():
        tried = effect.tried_with(scale) if name not in on and issubclass(effect, Effect) else None
        if shown := on.get(name, tried):
            change = f"without {name}" if name in on else f"with {name}"
            switch = partial(with_effect, name=name, table=tried)
            yield Version(switch, change, "effect", name, name in on, shown.model_dump(), effect.units())


def with_effect(scene: Scene, name: str, table: Effect | None) -> Scene:
    """The scene with another table of one effect, or without it."""
    return scene.model_copy(update={"effects": scene.effects.model_copy(update={name: table})})


def list_mode_versions(scene: Scene) -> Iterator[Version]:
    """Give each link that can bend, or that a model's table gives modes, a mode less and a mode more."""
    yield from (version for version in list_model_versions(scene) if version.kind == "modes")
    for i, link in enumerate(scene.links):
        if link.bending_stiffness is None or not link.mass_per_length:
            continue
        for direction, count in link.counts.by_direction().items():
            subject, words, path = f"links.{i}", f"link {i + 1} with {{}}", f"links.{i}.modes"
            if isinstance(link.modes, Modes):
                subject = path = f"{path}.{direction}"
                words += f" in {direction}"
            if count or (direction == "y" and subject != path):
                yield from step_modes(count, words, subject, path)


def step_modes(count: int, words: str, subject: str, path: str) -> Iterator[Version]:
    """The number of modes at a path one less and one more."""
    for step in (-1, 1):
        modes = count + step
        if 0 <= modes <= MOST_MODES:
            change, make = words.format(counted(modes, "mode")), partial(with_more, path=path, step=step)
            yield Version(make, change, "modes", subject, step < 0, {"modes": modes})


def with_more(scene: Scene, path: str, step: int) -> Scene:
    """The scene with a number of modes changed by a step; designs whose weights are a list for each state no longer fit, and go."""
    changed: Scene = replace_value(scene, path, get_value(scene, path) + step)
    return changed


BENDING: tuple[Direction, ...] = ("y", "z")


def read_scale(scene: Scene) -> Scale:
    """Read the sizes off a scene at rest, stretched out, or with closed loops as they are where the motion begins.

    A joint that follows from loops counts as the lightest that is driven.
    """
    arm = build_manipulator(scene)
    motion = build_motion(scene.motion, arm.joints, arm=arm)
    begun = arm.reference.full() @ motion.sample(np.zeros(1))[0][0] if scene.loops else np.zeros(arm.n)
    M = ca.Function("M", [arm.s], [ca.densify(arm.near.M)])(begun)
    slowest = [
        make_shapes(scene, i, d).beta[0] ** 2 * np.sqrt(link.stiffness_in(d) / (link.mass_per_length * link.length**4))
        for i, link in enumerate(scene.links)
        for d in BENDING
        if getattr(link.counts, d)
    ]
    joints = [float(M[i, i]) for i in range(arm.joints)]
    driven = [i for i, link in enumerate(scene.links) if link.driven]
    others = [min(joints) if link.passive else max(joints) for link in scene.links]
    return Scale(
        links=scene.links,
        inertias=tuple(joints[driven.index(i)] if i in driven else other for i, other in enumerate(others)),
        mass=sum(link.mass_per_length * link.length + (link.body.mass if link.body else 0.0) for link in scene.links),
        motion=2 * np.pi / motion.period,
        bending=float(min(slowest)) if slowest else None,
    )


def list_model_versions(scene: Scene) -> Iterator[Version]:
    """Set each number of the model's table to zero that may be zero, change each number of modes by one.

    What the model's schema refuses is not tried. A model says nothing of effects that it leaves out, so none is added.
    """
    if scene.model is None:
        return
    schema, versions = registered_model(scene.model).schema, list[Version]()
    for path, modes in find_modes(scene.parameters, PARAMETERS):  # the key means what it means in a scene
        where = path.removeprefix(f"{PARAMETERS}.").removesuffix(".modes")
        versions += step_modes(modes, f"{where} with {{}}", where, path)
    for version in (*list_switches(scene, schema), *versions):
        with suppress(ValidationError):
            schema.model_validate(version.make(scene).parameters)
            yield version


def list_switches(scene: Scene, schema: type[BaseModel]) -> Iterator[Version]:
    """Each number of the model's table taken away."""
    units = schema.units() if issubclass(schema, Table) else {}
    for name, entry in schema.model_fields.items():
        value = scene.parameters.get(name, entry.default)
        if isinstance(value, int | float) and not isinstance(value, bool) and value != 0:
            switch = partial(without_parameter, name=name)
            yield Version(switch, f"without {name}", "effect", name, True, {name: float(value)}, units)


def without_parameter(scene: Scene, name: str) -> Scene:
    """The scene with zero for a number of the model's table."""
    return scene.model_copy(update={"parameters": {**scene.parameters, name: 0.0}})


def find_modes(node: Any, path: str) -> Iterator[tuple[str, int]]:
    """Every whole number under a key `modes`, with its path."""
    for key, child in list_children(node).items():
        if key == "modes" and isinstance(child, int) and not isinstance(child, bool):
            yield f"{path}.{key}", child
        else:
            yield from find_modes(child, f"{path}.{key}")


MOST_SEGMENTS = 4000
"""A version that needs more segments than these for its margin is not judged."""


@immutable(eq=False)
class Part:
    """Coordinates and controller states that nothing couples to the others; `felt`: whether motors or motion reach any of them.

    margin, error: the largest growth rate in 1/s; frequencies: natural ones of the frozen loop, averaged over the period, in rad/s.
    """

    names: tuple[str, ...]
    felt: bool
    margin: float
    error: float
    verdict: str
    frequencies: Array


@immutable
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
    path : array, shape (N, 3), or None
        The tip in the periodic response, at equally spaced times, in m, zeros without points; None where it is not known.
    demands : tuple of Demand, or None
        What the drives have to do for it; None where it is not known.
    parts : tuple of Part
        The parts that nothing couples, each with its own margin.

    Examples
    --------
    >>> import flexlin as fl
    >>> from flexlin.analyses.audit import measure
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
    path: Array | None = None
    demands: tuple[Demand, ...] | None = None
    parts: tuple[Part, ...] = ()


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
        Margin, frequencies, tip path and drives, and the size of the equations.

    Raises
    ------
    InputError
        When the scene cannot be built at all.

    Examples
    --------
    >>> import flexlin as fl
    >>> from flexlin.analyses.audit import measure
    >>> figures = measure(fl.load_scene("single-link", {"links.0.modes": 1, "designs": []}))
    >>> figures.margin < -figures.margin_error
    True
    """
    lin = linearize(build_manipulator(scene), scene.motion, scene.control)
    problems: list[str] = []
    parts = tuple(judge_parts(lin, tol, problems))
    worst = join_parts(parts)
    path, away, demands = _follow(lin, scene.drives, problems)
    figures = worst.margin, worst.error, worst.verdict, worst.frequencies, away
    t = np.linspace(0, lin.period, SAMPLES + 1)
    microseconds = 1e6 * min(repeat(lambda: lin.sample(t), number=1)) / SAMPLES
    size = lin.n, lin.coefficients.n_instructions(), microseconds
    return Measure(*figures, *size, tuple(problems), path, demands, parts)


def join_parts(parts: tuple[Part, ...]) -> Part:
    """The verdict on parts together: that of the worst."""
    order = ("stable", "undecided", "unstable", "unknown")
    worst = max(parts, key=lambda part: (order.index(part.verdict), part.margin))
    return Part(
        tuple(name for part in parts for name in part.names),
        any(part.felt for part in parts),
        max(part.margin for part in parts),
        max(part.error for part in parts),
        worst.verdict,
        np.sort(np.concatenate([part.frequencies for part in parts])),
    )


def judge_parts(lin: Linearization, tol: float, problems: list[str]) -> Iterator[Part]:
    """Each part of the loop with its margin; all of it where it is one part."""
    labels, felt = part_coordinates(lin)
    names = (*lin.names, *(() if lin.controller is None else lin.controller.names))
    t = np.linspace(0, lin.period, 9, endpoint=False)
    coefficients = lin.sample(t)
    for label in np.unique(labels):
        places = np.flatnonzero(labels == label)
        y = places[places < lin.n]
        M, K = (matrix[:, y[:, None], y] for matrix in (coefficients.M, coefficients.K))
        found = _judge_margin(lin, places if len(places) < len(labels) else None, tol, problems)
        yield Part(tuple(names[i] for i in places), bool(felt[places].any()), *found, _average_frequencies(M, K, t))


def part_coordinates(lin: Linearization) -> tuple[Array, Array]:
    """Which part each of the n coordinates and k controller states belongs to, and whether motors or motion act on it, (n + k,) each.

    With M, D, K, h, B of coordinates of unit inertia; where nothing acts on anything, all counts as reached.
    """
    t = lin.period * np.arange(SAMPLES) / SAMPLES
    n, own, matrices = lin.n, lin.sample(t), lin.about.evaluate(loop_matrices(lin, None), t)
    unit = 1 / np.sqrt(np.einsum("tii->ti", matrices[0]).max(axis=0))
    coupled = np.zeros(matrices[0].shape[1:], dtype=bool)
    for matrix in matrices:
        size = np.abs(matrix * unit[:, None] * unit).max(axis=0)
        coupled |= size > SUM_ROUNDING * np.minimum(size.max(axis=1)[:, None], size.max(axis=1))
    force, felt = np.abs(own.h * unit[:n]).max(axis=0), np.zeros(len(unit), dtype=bool)
    felt[:n] = (force > SUM_ROUNDING * force.max()) | (np.abs(own.B) > 0).any(axis=(0, 2))
    labels = connected_components(coupled, directed=False)[1]
    return labels, felt if felt.any() else np.ones_like(felt)


def _judge_margin(
    lin: Linearization, places: Array | None, tol: float, problems: list[str]
) -> tuple[float, float, str]:
    """Floquet's margin of the coordinates and controller states at some places, or of all."""

    def solve() -> FloquetResult:
        system, n = lin.periodic_system(), lin.n
        if places is not None:
            states = np.concatenate([places[places < n], places[places < n] + n, places[places >= n] + n])
            system = with_matrices(system, lambda t: lin.A(t)[:, states[:, None], states], None)
        return floquet(system, tol, max_segments=MOST_SEGMENTS)

    result = try_to(solve)
    if isinstance(result, Exception):
        problems.append(f"stability: {result}")
        return float("nan"), float("nan"), "unknown"
    return float(result.exponents[0].real), float(result.errors[0]), result.verdict


def _average_frequencies(M: Array, K: Array, t: Array) -> Array:
    """sqrt |eigenvalues of M^-1 K|, each averaged over phases of the motion. Raises: SingularMassMatrix."""
    squares = np.linalg.eigvals(solve_mass(M, K, t))
    return np.asarray(np.sort(np.sqrt(np.abs(squares)), axis=1).mean(axis=0))


def _follow(
    lin: Linearization, drives: Drives | None, problems: list[str]
) -> tuple[Array | None, float, tuple[Demand, ...] | None]:
    """The tip's path, its largest distance from the rigid motion, and what the drives do; not known where there is no response."""
    t = lin.period * np.arange(SAMPLES) / SAMPLES
    found = try_to(lambda: find_response(lin, lin.periodic_system(), t, SLIGHT))
    if isinstance(found, Exception):
        problems.append(f"periodic response: {found}")
        return None, float("nan"), None
    states, law = found.states, found.law or lin.law
    demands = drive_load(lin, t, states, law, drives).demands if lin.about.m else ()
    if lin.arm.near.points is None:
        return np.zeros((len(t), 3)), float("nan"), demands
    path = tip_positions(lin, t, states)
    return np.pad(path, ((0, 0), (0, 3 - path.shape[1]))), float(found.tip_error.max()), demands
