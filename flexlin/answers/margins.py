"""How far a scene's numbers are from the values at which its own loop changes its verdict."""

from contextlib import suppress
from dataclasses import dataclass, replace

from flexlin.about.linearization import Linearization
from flexlin.answers.critical_values import CriticalValue, critical_values, search_family
from flexlin.answers.loops import SAMPLED
from flexlin.answers.spectra import Family, OneOfSeveral, SceneFamily, make_family
from flexlin.errors import ArgumentError, InputError, TimeLimit
from flexlin.periodic.floquet.decoupled import estimate_decoupling_work
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.resolved.companion import ResolvedCompanion
from flexlin.periodic.transition.choice import estimate_segment_work
from flexlin.scene.parameters import get_value
from flexlin.scene.scene import Scene
from flexlin.summary import represent

COARSE, COARSEST, THOROUGH = 17, 9, 1025
"""Values of the scan: where nobody asked, the same for loops whose scan would take long, and where a range was chosen."""
SHORT, LONG = 3e5, 3.1e5
"""Microseconds of collocation or decoupling beyond which a scan that nobody asked for has fewer values, or is left out."""
TOL = 1e-6
"""Wanted error of a critical value, as a share of its range."""
FINE = 1e-9
"""Wanted error of the exponents beside a critical value that nobody asked for, in 1/s: it moves the value by less than is printed."""
RESOLVED = 2.0
"""A value that segments serve takes so much more, since its coefficients are resolved first."""
FACTORS = (0.25, 8.0)
"""Least and largest values of the usual ranges, in the scene's own value."""


@dataclass(frozen=True)
class Margin:
    """The critical values of one number between low and high, and the scene's own value; samples: values of the scan."""

    path: str
    low: float
    high: float
    own: float
    samples: int
    critical: tuple[CriticalValue, ...]

    __repr__ = represent

    @property
    def nearest(self) -> CriticalValue | None:
        """The critical value nearest to the scene's own, those of closed tongues left out."""
        open_ = [one for one in self.critical if not one.touching]
        return min(open_, key=lambda one: abs(one.distance), default=None)


@dataclass
class Shared:
    """One derivation of a scene's own loop for all numbers whose usual margins are asked for: `known`, if it keeps them free."""

    scene: Scene
    ranges: dict[str, tuple[float, float]]
    known: Linearization | None = None
    made: SceneFamily | None = None
    tried: bool = False

    def family(self, path: str) -> Family:
        """The systems by one of the numbers. Raises: what `make_family` raises."""
        known = self.known if self.known is not None and self.known.arm.parameters.paths == tuple(self.ranges) else None
        if not self.tried and (known is not None or len(self.ranges) > 1):
            self.tried = True
            with suppress(InputError):
                made = make_family(self.scene, self.ranges, "own", known)
                self.made = replace(made, finest=FINE) if isinstance(made, SceneFamily) else None
        if self.made is None:
            return replace(make_family(self.scene, {path: self.ranges[path]}, "own"), finest=FINE)
        return OneOfSeveral.of(self.made, list(self.ranges).index(path)) if len(self.ranges) > 1 else self.made


def find_margin(scene: Scene, path: str, limits: tuple[float, float], samples: int = THOROUGH) -> Margin:
    """The critical values of one number of a scene's own loop."""
    own = get_value(scene, path)
    if not isinstance(own, float):
        raise ArgumentError("this is no real number of the scene", got=path, expected="such as motion.frequency")
    tol = TOL * (limits[1] - limits[0])
    found = critical_values(scene, path, limits, tol, samples=samples, narrow=samples == THOROUGH)
    return Margin(path, *limits, own, samples, tuple(found))


def find_usual_margin(
    scene: Scene,
    path: str,
    limits: tuple[float, float],
    own: FloquetResult | None = None,
    shared: Shared | None = None,
) -> Margin | None:
    """As `find_margin`, by a coarse scan; none where the number cannot be free, or each value needs equations of its own.

    Raises: TimeLimit where the work on the own loop says that the scan would take long.
    """
    if scene.motion.kind in SAMPLED:
        return None
    each = 0.0 if own is None else predict_work(own)
    samples = COARSE if COARSE * each <= SHORT else COARSEST
    if own is not None and samples * each > LONG:
        raise TimeLimit(
            f"critical values of {path}: left out, since nobody asked for them and they would take long",
            got=f"{len(own.exponents)} states",
            todo=f"ask for them by --margins {path}={limits[0]:g}:{limits[1]:g}",
        )
    shared = shared or Shared(scene, {path: limits})
    try:
        found = search_family(shared.family(path), path, *limits, TOL * (limits[1] - limits[0]), samples, narrow=False)
    except InputError:
        return None
    return Margin(path, *limits, read_number(scene, path), samples, tuple(found))


def predict_work(own: FloquetResult) -> float:
    """Microseconds that the exponents of a loop take, about."""
    n = len(own.exponents)
    if own.setting.method != "decoupling":
        return RESOLVED * estimate_segment_work(n, isinstance(own.resolved, ResolvedCompanion), own.setting)
    return estimate_decoupling_work(n, 1 if own.resolved is None else len(own.resolved.breaks) + 1)


def choose_margins(scene: Scene) -> dict[str, tuple[float, float]]:
    """The numbers that engineers ask for first, speed and payload, with ranges about the scene's own values."""
    paths = ("motion.frequency", "motion.joints.0.rate", "effects.payload.mass", "parameters.payload_mass")
    known = {path: read_number(scene, path) for path in paths}
    ends = {path: sorted(factor * own for factor in FACTORS) for path, own in known.items() if own}
    return {path: (low, high) for path, (low, high) in ends.items()}


def read_number(scene: Scene, path: str) -> float:
    """The number at a path, 0 where there is none."""
    try:
        value = get_value(scene, path)
    except ArgumentError:
        return 0.0
    return value if isinstance(value, float) else 0.0
