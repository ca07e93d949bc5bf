"""The versions of a scene that an audit tries: each effect switched on or off, each link a mode more or less."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from flexlin.mechanics.effects import Effect, Scale
from flexlin.scene.effects import known_effects
from flexlin.scene.scene import Scene


@dataclass(frozen=True)
class Version:
    """A changed scene, and how to speak of the change."""

    scene: Scene
    change: str
    kind: str
    subject: str
    on: bool
    table: dict[str, Any]
    units: dict[str, str] = field(default_factory=dict)


def list_effect_versions(scene: Scene, scale: Scale) -> Iterator[Version]:
    """Switch each effect off, or on with the figures that its own file proposes; an effect without a proposal is not tried."""
    on = scene.effects.on()
    for name, effect in known_effects().items():
        shown = on.get(name)
        other = None
        if shown is None and issubclass(effect, Effect):
            shown = other = effect.tried_with(scale)
        if shown is None:
            continue
        effects = scene.effects.model_copy(update={name: other})
        change = f"without {name}" if name in on else f"with {name}"
        version = scene.model_copy(update={"effects": effects})
        yield Version(version, change, "effect", name, name in on, shown.model_dump(), effect.units())


def list_mode_versions(scene: Scene) -> Iterator[Version]:
    """Give each link that can bend a mode less and a mode more."""
    for i, link in enumerate(scene.links):
        if link.bending_stiffness is None or not link.mass_per_length:
            continue
        for modes in (link.modes - 1, link.modes + 1):
            if modes >= 0:
                links = (*scene.links[:i], link.model_copy(update={"modes": modes}), *scene.links[i + 1 :])
                change = f"link {i + 1} with {modes} mode{'s' if modes != 1 else ''}"
                version = scene.model_copy(update={"links": links})
                yield Version(version, change, "modes", f"links.{i}", modes < link.modes, {"modes": modes})
