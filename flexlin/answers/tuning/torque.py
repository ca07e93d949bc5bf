"""The largest torque of a loop's steady motion, and the limit that it has."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from flexlin.about.linear import linearize
from flexlin.answers.spectra import Source
from flexlin.answers.steady import find_response
from flexlin.checks import positive
from flexlin.control.drives import drive_load
from flexlin.mechanics import build_manipulator
from flexlin.scene.revised import revise_scene
from flexlin.scene.scene import Scene
from flexlin.scene.units import in_si

TIMES = 256
RESPONSE_TOL = 1e-6


def torque_limit(source: Source, limits: Mapping[str, Any]) -> float | None:
    """The limit given, else that of the scene's drives or saturation: the least of all joints."""
    if "torque" in limits:
        return positive("the limit of the torque", limits["torque"])
    if not isinstance(source, Scene):
        return None
    drives, saturation = getattr(source, "drives", None), source.control.saturation
    known = [] if saturation is None else list(saturation.torque)
    if drives is not None and drives.torque.peak is not None:
        several = drives.torque.peak if isinstance(drives.torque.peak, list | tuple) else [drives.torque.peak]
        known += [min(torque_in_si(item) for item in several)]
    return float(min(known)) if known else None


def torque_in_si(item: Any) -> float:
    """A torque or a force in SI units."""
    for unit in ("N m", "N"):
        try:
            return float(in_si(item, unit))
        except ValueError:
            continue
    return float("inf")


def peak_torque(scene: Scene, numbers: Mapping[str, float]) -> float:
    """The largest torque of the scene's steady motion with other numbers, in N m."""
    revised = revise_scene(scene, numbers)
    lin = linearize(build_manipulator(revised), revised.motion, revised.control)
    t = lin.period * np.arange(TIMES) / TIMES
    states = find_response(lin, lin.periodic_system(), t, RESPONSE_TOL).states
    return float(np.abs(drive_load(lin, t, states, lin.law).torque).max())
