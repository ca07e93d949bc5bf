"""The gain, phase and delay margins of the loops on an arm, as a report compares them."""

from functools import partial

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.answers.clock import Clock
from flexlin.periodic.margins import Margins, margins
from flexlin.periodic.related import extend_system


def find_loop_margins(a: Analysis, clock: Clock) -> dict[str, Margins]:
    """What each stable loop with a feedback endures, broken where the torque enters the arm, by the loop's name."""
    found: dict[str, Margins] = {}
    plant = a.plant.periodic_system() if a.plant.motion.periodic and a.plant.about.m else None
    for loop in (a.own, *a.designs):
        law = a.closed.law if loop.design is None else loop.design.law
        known = loop.floquet is not None and loop.verdict == "stable"
        if plant is None or not known or not np.any(law.gain(np.zeros(1))):
            continue
        broken = plant if law.controller is None else extend_system(plant, law.controller.rates)
        name = f"margins: {loop.name}"
        one = clock.attempt(a.problems, name, name, a.scene.accuracy, partial(margins, broken, law.gain))
        if one is not None and one.reason:
            a.problems[name] = f"some of the {name}: {one.reason}"
        found |= {} if one is None else {loop.name: one}
    return found
