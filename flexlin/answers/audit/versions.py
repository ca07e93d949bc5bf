"""The versions of a scene that an audit tries: each effect switched on or off, each link a mode more or less."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from flexlin.mechanics.effects import Effect, Scale
from flexlin.scene.effects import known_effects
from flexlin.scene.links import Direction, Modes
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
    """Give each link that can bend a mode less and a mode more."""
    for i, link in enumerate(scene.links):
        if link.bending_stiffness is None or not link.mass_per_length:
            continue
        for direction, count in link.counts.by_direction().items():
            plain = not isinstance(link.modes, Modes)
            for step in (-1, 1) if count or (plain and direction == "y") else ():
                modes = count + step
                if 0 <= modes <= MOST_MODES:
                    which = "" if plain else f" in {direction}"
                    change = f"link {i + 1} with {modes} mode{'s' if modes != 1 else ''}{which}"
                    give = partial(with_modes, link=i, step=step, direction=direction)
                    subject = f"links.{i}" if plain else f"links.{i}.modes.{direction}"
                    yield Version(give, change, "modes", subject, step < 0, {"modes": modes})


def with_modes(scene: Scene, link: int, step: int, direction: Direction = "y") -> Scene:
    """The scene with some modes more in one link; designs whose weights are a list for each state no longer fit, and go."""
    old = scene.links[link]
    count = getattr(old.counts, direction) + step
    modes = old.counts.model_copy(update={direction: count}) if isinstance(old.modes, Modes) else count
    changed = old.model_copy(update={"modes": modes})
    return scene.model_copy(update={"links": (*scene.links[:link], changed, *scene.links[link + 1 :])})
