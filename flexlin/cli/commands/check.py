"""`flexlin check`: read a scene, derive its equations, and say what its links are and how they bend."""

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

from flexlin.cli.options import LIMITS, SCENE
from flexlin.cli.shared import DONE, loaded

if TYPE_CHECKING:
    from flexlin.answers.at_rest import AtRest
    from flexlin.scene.links import Link

PURPOSE = "read a scene and derive its equations"
TAKES = (*SCENE, *LIMITS)
SHOWN = 5
"""Natural frequencies that are printed."""
BEYOND = ": further than linear equations hold; stiffen the link, or trust the simulation with effects.geometric_stiffening only"


def run(options: argparse.Namespace) -> int:
    scene = loaded(options)
    import numpy as np

    from flexlin.about.linear import linearize
    from flexlin.answers.at_rest import examine
    from flexlin.answers.clock import Budget, Clock
    from flexlin.mechanics import build_manipulator
    from flexlin.report.numbers import effects
    from flexlin.report.wording import units_of_scene

    clock, asked = Clock(budget=Budget(options.watch)), scene.accuracy
    arm = clock.stage("equations of motion", asked, lambda: build_manipulator(scene))
    plant = clock.stage("linearization", asked, lambda: linearize(arm, scene.motion, scene.control))
    lengths = np.array([link.length for link in scene.links])
    rest = clock.stage("arm at rest", asked, lambda: examine(plant, lengths))
    print(f"{scene.title}: usable")
    print(f"  coordinates  {', '.join(plant.names)}")
    print(f"  torques on   {', '.join(plant.inputs) or 'no joint'}")
    print(f"  effects on   {', '.join(effects(scene)['on']) or 'none'}")
    print(f"  period       {plant.period:.6g} s")
    with units_of_scene(scene):
        for i, link in enumerate(scene.links):
            if any(link.counts.by_direction().values()):
                print(f"  link {i + 1:<8}{', '.join(describe_link(link))}")
        for name, words in () if rest is None else describe_rest(rest):
            print(f"  {name:<13}{words}")
    return DONE


def describe_link(link: "Link") -> Iterator[str]:
    """The figures of a link that deflects."""
    from flexlin.scene.links import DIRECTIONS

    yield say(link.mass_per_length, "kg/m")
    for direction, name in zip(DIRECTIONS, ("EI in y", "EI in z", "GJ"), strict=True):
        if link.stiffness_in(direction) is not None:
            yield f"{name} {say(link.stiffness_in(direction), 'N m^2')}"
    if link.polar_inertia is not None:
        yield f"rho I_p {say(link.polar_inertia, 'kg m')}"


def describe_rest(rest: "AtRest") -> Iterator[tuple[str, str]]:
    """What the arm does with its joints held."""
    from flexlin.answers.validity import SMALL

    if rest.gives_way:
        yield "at rest", "gives way under its loads even with its joints held: stiffen its links, or lessen the loads"
        return
    known = ", ".join(f"{frequency:.4g}" for frequency in rest.frequencies[:SHOWN])
    yield "at rest", f"{say(known, 'Hz')}, its joints held where the motion begins"
    bending = rest.bending
    if bending is None:
        return
    for i, share in enumerate(bending.largest):
        sides = ((bending.at_rest[i], "under gravity"), (bending.moving[i], "along the motion"))
        said = " and ".join(f"{say(f'{size:.3g}', 'm')} {where}" for size, where in sides if size > 0)
        if said:
            yield (
                f"link {i + 1}",
                f"bends by {said}, {100 * share:.2g} % of its length{BEYOND if share > SMALL else ''}",
            )


def say(value: float | str, unit: str) -> str:
    """A value with its unit, which a scene without dimensions has not."""
    from flexlin.report.wording import is_dimensionless

    text = value if isinstance(value, str) else f"{value:.4g}"
    return text if is_dimensionless() else f"{text} {unit}"
