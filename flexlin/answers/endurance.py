"""The gain, phase and delay margins of the loops on an arm, as a report compares them."""

from functools import partial

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.answers.clock import Clock
from flexlin.periodic.margins import Margins, margins


def find_loop_margins(a: Analysis, clock: Clock) -> dict[str, Margins]:
    """What each stable loop with a feedback of the arm's own states endures, by the loop's name."""
    found: dict[str, Margins] = {}
    plant = a.plant.periodic_system() if a.plant.motion.periodic and a.plant.about.m else None
    for loop in (a.own, *a.designs):
        gain = a.closed.law.gain if loop.design is None else loop.design.K
        known = loop.floquet is not None and loop.verdict == "stable" and len(loop.floquet.exponents) == 2 * a.plant.n
        if plant is None or not known or not np.any(gain(np.zeros(1))):
            continue
        name = f"margins: {loop.name}"
        one = clock.attempt(a.problems, name, name, a.scene.accuracy, partial(margins, plant, gain))
        found |= {} if one is None else {loop.name: one}
    return found
