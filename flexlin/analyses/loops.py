"""Which loop on the arm is asked about while scene numbers vary: the scene's own, the open arm, or one that is designed."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError, ModelError, SceneError
from flexlin.lazy import lazy
from flexlin.linearization.free import KeptGain, ParametricLoop, parametric_loop
from flexlin.linearization.linear import linearize
from flexlin.linearization.linearization import Linearization
from flexlin.mechanics.chain import build_manipulator
from flexlin.mechanics.manipulator import Manipulator
from flexlin.periodic.system import PeriodicSystem
from flexlin.scene.control import DesignTable
from flexlin.scene.loading import revise_scene
from flexlin.scene.parameters import PARAMETERS, get_value, need_numbers, path_in
from flexlin.scene.scene import Scene
from flexlin.summary import immutable

REDONE = ", redone"
"""What is written behind a design's name to have it made anew at each value."""


OUTSIDE = ("accuracy", "designs", "drives", "uncertainty")
"""Tables of a scene whose numbers stand in the equations of no loop."""
SAMPLED = ("table", "tip-path")
"""Kinds of motions that are no expressions of their numbers."""
TIMES = ("motion.move_time", "motion.dwell_time")
"""Numbers that move the breaks of a motion."""


@immutable(eq=False)
class RedesignedLoop:
    """A loop whose controller is designed anew, to `tol`, at each point of the free scene numbers."""

    plant: "ParametricLoop | RebuiltLoop"
    table: DesignTable
    tol: float

    @property
    def states(self) -> int:
        """The number of states."""
        return self.plant.states

    def system_at(self, point: Array) -> PeriodicSystem:
        """The closed loop at one point (P,)."""
        from flexlin.control.catalogue import design

        return design(self.plant.at(point), self.table, self.tol).closed_loop


@immutable(eq=False)
class RebuiltLoop:
    """A loop whose equations are derived anew at each point, for models whose code, or motions that, take numbers and no symbols."""

    scene: Scene
    paths: tuple[str, ...]
    closed: bool
    kept: KeptGain | None = None

    @lazy
    def arm(self) -> Manipulator:
        """The arm with the scene's own numbers."""
        return build_manipulator(self.scene)

    @lazy
    def states(self) -> int:
        """The number of states."""
        return self.follow(self.arm, self.scene).states + (0 if self.kept is None else self.kept.memory)

    def system_at(self, point: Array) -> PeriodicSystem:
        """The loop at one point (P,); with a kept gain the plant is closed by it."""
        system = self.at(point).periodic_system()
        return system if self.kept is None else self.kept.close(system)

    def at(self, point: Array) -> Linearization:
        """The linearization at one point (P,), without a kept gain."""
        scene = revise_scene(self.scene, dict(zip(self.paths, map(float, point), strict=True)))
        same = scene.model is None and all(path.startswith("motion.") for path in self.paths)
        return self.follow(self.arm if same else build_manipulator(scene), scene)

    def follow(self, arm: Manipulator, scene: Scene) -> Linearization:
        """The linearization of an arm along a scene's motion."""
        return linearize(arm, scene.motion, scene.control if self.closed else None)


AnyLoop = ParametricLoop | RedesignedLoop | RebuiltLoop


def choose_loop(scene: Scene, paths: Iterable[str], loop: str = "own", tol: float = 1e-9) -> AnyLoop:
    """The loop that a word names, with the numbers at the dotted paths left free.

        "own": the scene's; "open": no feedback; a design's name: its gain as designed with the scene's own numbers, kept while they
        vary, as a function of the phase; the name followed by ", redone": designed anew at each value

    Parameters: tol: relative error of designed gains.
    Raises: ArgumentError for an unknown loop, or a free number of a controller that is not in it; what `design` raises.
    """
    paths = tuple(path_in(scene, path) for path in paths)
    outside = [path for path in paths if path.split(".")[0] in OUTSIDE]
    if outside:
        what = "this number does not stand in the equations of the loop"
        expected = "a number of the links, effects, motion, control or parameters"
        raise ArgumentError(what, got=outside[0], expected=expected)
    if loop == "own":
        return leave_free(scene, paths, closed=True)
    table = None if loop == "open" else find_design(scene, loop)
    strangers = [path for path in paths if path.startswith("control.")]
    if strangers:
        todo = "ask for loop = own"
        raise ArgumentError("the scene's controller has no part in this loop", got=f"{strangers[0]}, {loop}", todo=todo)
    plant = leave_free(scene, paths, closed=False)
    if table is None:
        return plant
    if loop == table.name + REDONE:
        return RedesignedLoop(plant, table, tol)
    from flexlin.control.catalogue import design

    made = design(linearize(build_manipulator(scene), scene.motion), table, tol)
    period = made.closed_loop.period
    rates = None if made.controller is None else made.controller.rates
    return replace(plant, kept=KeptGain(made.K, period, tuple(t / period for t in made.closed_loop.breaks), rates))


def leave_free(scene: Scene, paths: tuple[str, ...], closed: bool) -> ParametricLoop | RebuiltLoop:
    """The scene's own loop or the open arm with free numbers: as symbols, or derived anew at each point where that cannot be."""
    sampled = scene.motion.kind in SAMPLED or any(path in TIMES for path in paths)
    if not sampled and not any(path.startswith(f"{PARAMETERS}.") for path in paths):
        return parametric_loop(scene, paths, closed=closed)
    rebuilt = RebuiltLoop(scene, paths, closed)
    if sampled:
        need_numbers(scene, paths)
        return rebuilt
    try:
        loop = parametric_loop(scene, paths, closed=closed)
    except (ArgumentError, ModelError):  # the model's code takes numbers only
        for path in paths:
            get_value(scene, path)
        return rebuilt
    return loop if is_same_model(loop, rebuilt) else rebuilt


def is_same_model(loop: ParametricLoop, rebuilt: RebuiltLoop) -> bool:
    """Whether a model written in Python means the same with symbols as with numbers, at the scene's own point and beside it.

    Its code may take decisions, or read its own tables of numbers, that no symbol shows.
    """
    phases = np.linspace(0.0, 1.0, 17, endpoint=False)
    for factor in (1.0, 1.03):
        point = loop.nominal * factor
        try:
            exact = rebuilt.system_at(point)
        except SceneError:
            continue
        A, again = loop.system_at(point).A(phases * exact.period), exact.A(phases * exact.period)
        if not np.allclose(A, again, rtol=1e-9, atol=1e-9 * np.abs(again).max()):
            return False
    return True


def need_continuous(table: DesignTable) -> None:
    """Raise ArgumentError for a sampled design, which is judged at the scene's own numbers alone."""
    if table.sample_time is not None:
        got = f"{table.name}, sampled every {table.sample_time:g} s"
        todo = "ask for a report, with --set for other numbers, or leave sample_time out"
        raise ArgumentError("this answer is known of continuous designs alone", got=got, todo=todo)


def find_design(scene: Scene, loop: str) -> DesignTable:
    """The design that a word names. Raises: ArgumentError with the words that there are."""
    for table in scene.designs:
        if loop in (table.name, table.name + REDONE):
            need_continuous(table)
            return table
    words = ["own", "open", *(word for table in scene.designs for word in (table.name, table.name + REDONE))]
    raise ArgumentError("there is no such loop", got=repr(loop), expected=" | ".join(words))
