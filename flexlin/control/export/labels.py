"""Names and units of states and inputs, in the order in which every export writes them."""

from dataclasses import dataclass, replace

from flexlin.about.law import Controller
from flexlin.about.linearization import Linearization
from flexlin.errors import ArgumentError
from flexlin.scene.control import RATE


@dataclass(frozen=True)
class Labels:
    """Names and units of the states [y; y'] and of the inputs."""

    states: tuple[str, ...]
    state_units: tuple[str, ...]
    inputs: tuple[str, ...]
    input_units: tuple[str, ...]

    @classmethod
    def of(cls, lin: Linearization, controller: Controller | None = None) -> "Labels":
        """Those of an arm: q1, w11, ..., then q1_rate, ..., and of a controller, its loop's own where none is given.

        An input bears the name of the coordinate that it drives.
        """
        units = [coordinate.unit for coordinate in lin.coordinates]
        states = (*lin.names, *(name + RATE for name in lin.names))
        labels = cls(states, (*units, *(f"{unit}/s" for unit in units)), lin.inputs, lin.input_units)
        return labels.behind(lin.controller if controller is None else controller)

    def behind(self, controller: Controller | None) -> "Labels":
        """The same with a controller's states behind the arm's."""
        if controller is None:
            return self
        states, units = (*self.states, *controller.names), (*self.state_units, *controller.units)
        return replace(self, states=states, state_units=units)

    @classmethod
    def numbered(cls, states: int, inputs: int) -> "Labels":
        """x1, x2, ... and u1, u2, ... without units, for a system that came without names."""
        names = tuple(f"x{i + 1}" for i in range(states)), tuple(f"u{i + 1}" for i in range(inputs))
        return cls(names[0], ("",) * states, names[1], ("",) * inputs)

    @classmethod
    def fitting(
        cls, lin: Linearization | None, states: int, inputs: int, controller: Controller | None = None
    ) -> "Labels":
        """Those of the arm and of a design's controller, once they have been found to fit; without an arm, numbers."""
        labels = cls.numbered(states, inputs) if lin is None else cls.of(lin, controller)
        if (len(labels.states), len(labels.inputs)) != (states, inputs):
            got = f"{len(labels.states)} states and {len(labels.inputs)} inputs"
            raise ArgumentError("the arm does not fit what is exported", got=got, expected=f"{states} and {inputs}")
        return labels
