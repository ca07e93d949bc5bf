"""How far a scene's numbers are from the values at which its own loop changes its verdict."""

from contextlib import suppress
from dataclasses import dataclass, replace
from math import inf

from flexlin.about.linearization import Linearization
from flexlin.answers.critical_values import CriticalValue, check_limits, search_family
from flexlin.answers.loops import need_numbers
from flexlin.answers.spectra import make_family
from flexlin.errors import ArgumentError
from flexlin.periodic.boundary.spectra import Effort
from flexlin.scene.parameters import get_value
from flexlin.scene.scene import Scene
from flexlin.summary import represent

UNASKED = 2.0
"""Seconds of work for all numbers that nobody asked for."""
TOL = 1e-6
"""Wanted error of a critical value, as a share of its range."""
FINE = 1e-9
"""Wanted error of the exponents beside a critical value, in 1/s: it moves the value by less than is printed."""
FACTORS = (0.25, 8.0)
"""Least and largest values of the usual ranges, in the scene's own value."""


@dataclass(frozen=True)
class Margin:
    """The critical values of one number between low and high, and the scene's own value; values: how many were tried; gap: the widest part
    of the range in which a change may hide since the search had to end, 0 where it did not; searched: ends of the part about its own value
    in which none can."""

    path: str
    low: float
    high: float
    own: float
    values: int
    critical: tuple[CriticalValue, ...]
    gap: float = 0.0
    searched: tuple[float, float] = (-inf, inf)

    __repr__ = represent

    @property
    def nearest(self) -> CriticalValue | None:
        """The critical value nearest to the scene's own, those of closed tongues left out."""
        open_ = [one for one in self.critical if not one.touching]
        return min(open_, key=lambda one: abs(one.distance), default=None)


def find_margin(
    scene: Scene, path: str, limits: tuple[float, float], seconds: float = inf, known: Linearization | None = None
) -> Margin:
    """The critical values of one number of a scene's own loop, or as much of them as so many seconds of work bring.

    Parameters: known: the loop; where its equations keep the number free they are not derived again.
    Raises: what `make_family` raises; ArgumentError for what is no real number of the scene (`need_numbers`).
    """
    need_numbers(scene, (path,))
    own = float(get_value(scene, path))
    (low, high), effort = check_limits(path, limits), Effort(seconds, own)
    kept = known if known is not None and path in known.arm.parameters.paths else None
    family = replace(make_family(scene, {path: (low, high)}, "own", kept), finest=FINE)
    found = search_family(family, path, low, high, TOL * (high - low), effort=effort)
    searched = max(low, effort.searched[0]), min(high, effort.searched[1])
    return Margin(path, low, high, own, effort.values, tuple(found), effort.gap, searched)


def choose_margins(scene: Scene) -> dict[str, tuple[float, float]]:
    """The numbers that engineers ask for first, speed and payload, with ranges about the scene's own values."""
    paths = (
        "motion.frequency",
        "motion.move_time",
        "motion.joints.0.rate",
        last_number(scene, "effects.payload.mass"),
        "parameters.payload_mass",
    )
    known = {path: read_number(scene, path) for path in paths}
    ends = {path: sorted(factor * own for factor in FACTORS) for path, own in known.items() if own}
    return {path: (low, high) for path, (low, high) in ends.items()}


def last_number(scene: Scene, path: str) -> str:
    """The path of a list's last number, here that of the load at the tip; the path itself where it leads to one number."""
    with suppress(ArgumentError):
        value = get_value(scene, path)
        return path if isinstance(value, float) else f"{path}.{len(value) - 1}"
    return path


def read_number(scene: Scene, path: str) -> float:
    """The number at a path, 0 where there is none."""
    try:
        value = get_value(scene, path)
    except ArgumentError:
        return 0.0
    return value if isinstance(value, float) else 0.0
