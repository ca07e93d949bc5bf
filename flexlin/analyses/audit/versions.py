"""The versions of a scene that an audit tries: each effect switched on or off, each link a mode more or less, a model's own parameters."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
from pydantic import BaseModel, ValidationError

from flexlin.errors import counted
from flexlin.mechanics import build_manipulator
from flexlin.mechanics.effects import Effect, Scale
from flexlin.mechanics.link_shapes import make_shapes
from flexlin.motion import build_motion
from flexlin.scene.base import Table
from flexlin.scene.effects import known_effects
from flexlin.scene.library import registered_model
from flexlin.scene.links import Direction, Modes
from flexlin.scene.parameters import PARAMETERS, get_value, list_children, replace_value
from flexlin.scene.scene import Scene

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


def list_effect_versions(scene: Scene, scale: Scale | None) -> Iterator[Version]:
    """Switch each effect off, or on with the figures that its own file proposes; an effect without a proposal is not tried."""
    on = scene.effects.on()
    for name, effect in known_effects().items():
        shown, other = on.get(name), None
        if shown is None and scale is not None and issubclass(effect, Effect):
            shown = other = effect.tried_with(scale)
        if shown is None:
            continue
        change = f"without {name}" if name in on else f"with {name}"
        switch = partial(with_effect, name=name, table=other)
        yield Version(switch, change, "effect", name, name in on, shown.model_dump(), effect.units())


def with_effect(scene: Scene, name: str, table: Effect | None) -> Scene:
    """The scene with another table of one effect, or without it."""
    return scene.model_copy(update={"effects": scene.effects.model_copy(update={name: table})})


def list_mode_versions(scene: Scene) -> Iterator[Version]:
    """Give each link that can bend, or that a model's table gives modes, a mode less and a mode more."""
    if scene.model is not None:
        yield from (version for version in list_model_versions(scene) if version.kind == "modes")
    for i, link in enumerate(scene.links):
        if link.bending_stiffness is None or not link.mass_per_length:
            continue
        for direction, count in link.counts.by_direction().items():
            plain = not isinstance(link.modes, Modes)
            if count or (plain and direction == "y"):
                words = f"link {i + 1} with {{}}" + ("" if plain else f" in {direction}")
                subject = f"links.{i}" if plain else f"links.{i}.modes.{direction}"
                yield from step_modes(count, words, subject, partial(with_modes, link=i, direction=direction))


def step_modes(count: int, words: str, subject: str, give: Callable[..., Scene]) -> Iterator[Version]:
    """A number of modes one less and one more."""
    for step in (-1, 1):
        modes = count + step
        if 0 <= modes <= MOST_MODES:
            change, make = words.format(counted(modes, "mode")), partial(give, step=step)
            yield Version(make, change, "modes", subject, step < 0, {"modes": modes})


def with_modes(scene: Scene, link: int, step: int, direction: Direction = "y") -> Scene:
    """The scene with some modes more in one link; designs whose weights are a list for each state no longer fit, and go."""
    old = scene.links[link]
    count = getattr(old.counts, direction) + step
    modes = old.counts.model_copy(update={direction: count}) if isinstance(old.modes, Modes) else count
    changed = old.model_copy(update={"modes": modes})
    return scene.model_copy(update={"links": (*scene.links[:link], changed, *scene.links[link + 1 :])})


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
        versions += step_modes(modes, f"{where} with {{}}", where, partial(with_more, path=path))
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


def with_more(scene: Scene, path: str, step: int) -> Scene:
    """The scene with a number of the model's table changed by a step."""
    changed: Scene = replace_value(scene, path, get_value(scene, path) + step)
    return changed
