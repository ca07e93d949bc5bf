"""A loop with its verdict and steady motion, whether the linear model holds there, and how links bend with the joints held."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from flexlin.checks import SAMPLES, SUM_ROUNDING, Array
from flexlin.control.designed_loop import Design
from flexlin.control.tracking import scene_feedforward, tip_positions
from flexlin.errors import InputError, NumericalError, ResonantForcing, TimeLimit
from flexlin.linearization.law import Law
from flexlin.linearization.linear import linearize
from flexlin.linearization.linearization import Linearization
from flexlin.mechanics import build_manipulator
from flexlin.mechanics.links import COLUMNS
from flexlin.motion import Motion, SampledMotion
from flexlin.periodic.certificate import Certificate
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.response.forced import forced_response
from flexlin.periodic.system import PeriodicSystem, of_plant
from flexlin.scene.scene import Scene

LEAST_TOL = 1e-8
"""The smallest error that is asked for of sampled loops, whose time may never fit the period, and of disturbances, of which plots show
three digits."""


@dataclass(frozen=True)
class Response:
    """The periodic response of a loop: states [y; y'; z] (N, 2n + k), and how far the tip is from its rigid motion, (N, 2) in m.

    `tip_by_bending` is the part of it that is left when only the elastic coordinates deviate; `error`, `amplification` and `status` are
    those of a forced response. Where a feedforward leads along an elastic motion, which any stable loop keeps, `law` commands the torque
    and the amplification is not a number. `at_rest`: the largest tip error in m that stays however slow the motion is, if it is known.
    """

    error: float
    amplification: float
    status: str
    states: Array
    tip: Array
    tip_by_bending: Array
    law: Law | None = None
    at_rest: float = float("nan")

    @property
    def relative_error(self) -> float:
        """The error of the states, relative to the largest, absolute below 1."""
        return self.error / max(1.0, float(np.abs(self.states).max()))

    @property
    def tip_error(self) -> Array:
        """The distance of the tip from its rigid motion, (N,) in m; not a number where the model has no points."""
        return np.linalg.norm(self.tip, axis=1)

    @property
    def sizes(self) -> tuple[float, float]:
        """The largest tip error by bending alone, and the largest of all, in m."""
        return float(np.linalg.norm(self.tip_by_bending, axis=1).max()), float(self.tip_error.max())


def find_response(closed: Linearization, loop: PeriodicSystem, t: Array, tol: float, rest: bool = False) -> Response:
    """The periodic response to what the rigid motion leaves over, and what it does to the tip; `rest`: also to one at rest."""
    forward = scene_feedforward(closed, tol)
    if forward is None:
        solution = forced_response(loop, of_plant(closed.forcing, 2 * closed.n, loop.n), tol)
        states, known = solution(t), (solution.error, solution.amplification, solution.status)
    else:
        reference = forward.law.reference(t)
        states = np.concatenate([reference, np.zeros((len(t), loop.n - 2 * closed.n))], axis=1)
        known = forward.error * float(np.abs(states).max()), float("nan"), forward.status
    bent = states[:, : 2 * closed.n] * [coordinate.kind == "elastic" for coordinate in closed.coordinates * 2]
    rigid = tip_positions(closed, t, np.zeros_like(states))
    tip, by_bending = (tip_positions(closed, t, x) - rigid for x in (states, bent))
    law, at_rest = None if forward is None else forward.law, find_tip_error_at_rest(closed, t[::4]) if rest else np.nan
    return Response(*known, states, tip, by_bending, law, at_rest)


def stand_still(motion: Motion) -> SampledMotion:
    """The postures of a motion, at each of which the joints rest."""

    def still(t: Array) -> tuple[Array, Array, Array]:
        q = motion.sample(t)[0]
        return q, np.zeros_like(q), np.zeros_like(q)

    return SampledMotion(motion.joints, motion.period, motion.prescribed, motion.breaks, motion.periodic, sampler=still)


def deflect(lin: Linearization, t: Array) -> Array:
    """The deviations (N, n) that balance the loads at each time, K y = h; not numbers where K is singular."""
    c = lin.sample(t)
    try:
        return np.asarray(np.linalg.solve(c.K, c.h[..., None])[..., 0])
    except np.linalg.LinAlgError:
        return np.full(c.h.shape, np.nan)


def find_tip_error_at_rest(closed: Linearization, t: Array) -> float:
    """The largest tip error of a loop that rests in each posture, in m; not a number where a joint is free, or the arm has no points."""
    resting = linearize(closed.arm, stand_still(closed.motion), closed.control)
    y = deflect(resting, t)
    moved, rigid = (tip_positions(resting, t, one) for one in (y, 0 * y))
    return float(np.linalg.norm(moved - rigid, axis=1).max())


def arm_length(plant: Linearization) -> float:
    """The length of the arm from the base over its joints to the tip, in m, as the motion begins; not a number where it has no points."""
    if plant.arm.near.points is None:
        return float("nan")
    points = plant.about.near.of_arm("points", np.zeros(1), np.zeros((1, plant.n)))[0]
    return float(np.linalg.norm(np.diff(points, axis=1), axis=0).sum())


SMALL_SHARE = 0.2
"""The share of the arm's length beyond which a deflection is not small, and of the largest deviation by which the linear answer may miss
the nonlinear one."""
REPEATABILITY = 1e-5
"""A share of the arm's length of the order in which good arms repeat a motion (some 0.01 mm for 1 m, ISO 9283): nothing is gained
below it."""
COVERED_SHARE = 0.5
"""A simulation speaks for a steady deviation of which it has reached this share."""

What = Literal["bending", "tip", "difference", "stopped"]


@dataclass(frozen=True)
class ModelEvidence:
    """One figure against its bound, in `unit`; `share` is its part of `whole` (the arm's length, or the largest deviation).

    what: the bending or the whole tip error of the steady motion, the difference between the linear and the nonlinear answer, or
    the time at which the nonlinear equations ended.
    """

    what: What
    value: float
    bound: float
    unit: str
    whole: float = float("nan")

    @property
    def against(self) -> bool:
        """Whether it speaks against the linear model."""
        return not self.value <= self.bound

    @property
    def share(self) -> float:
        """The value as a part of the whole."""
        return self.value / self.whole if self.whole > 0 else float("nan")


@dataclass(frozen=True)
class ModelValidity:
    """Whether the linear model holds along the motion: valid, invalid, or unknown where nothing compares it with the nonlinear one."""

    verdict: Literal["valid", "invalid", "unknown"]
    evidence: tuple[ModelEvidence, ...] = ()

    @property
    def reason(self) -> ModelEvidence | None:
        """The figure that speaks against the linear model, of several the one that says most to a reader."""
        against = {found.what: found for found in self.evidence if found.against}
        return next((against[what] for what in ("tip", "bending", "difference", "stopped") if what in against), None)


def judge_model(
    length: float,
    steady: tuple[float, float] | None = None,
    simulated: tuple[float, float, float, str] | None = None,
    stopped: tuple[float, float] | None = None,
    curved: bool = False,
) -> ModelValidity:
    """Judge the linear model by what is known of a loop's motion.

    The steady motion's tip error may not exceed SMALL_SHARE of the arm, unless a simulation that came as far agrees; nor may its bending,
    where only links that bend as curves (`curved`) make the simulation a judge of it. The linear answer may miss the nonlinear one by
    SMALL_SHARE of the largest deviation, or of the bending, which a feedforward may leave while it leads the tip; or by what no arm
    repeats. A simulation that ended outside the equations' range is against it.

    Parameters: length: of the arm in m, not a number where it has no points; steady: bending and tip error in m of a steady motion that
    the loop keeps; simulated: how far the answers are apart, the largest deviation, the error of the first, the unit; stopped: when
    the simulation left the range of the equations, and when it was to end, in s.
    """
    found: list[ModelEvidence] = []
    if simulated is not None:
        apart, largest, error, unit = simulated
        if steady is not None and unit == "m" and np.isfinite(steady[0]):
            largest = max(largest, steady[0])
        floor = REPEATABILITY * length if unit == "m" and np.isfinite(length) else REPEATABILITY
        found.append(ModelEvidence("difference", apart, max(SMALL_SHARE * largest, error, floor), unit, largest))
    if stopped is not None:
        found.append(ModelEvidence("stopped", stopped[1], stopped[0], "s", stopped[1]))
    if steady is not None and np.all(np.isfinite([*steady, length])):
        bending, tip = steady
        confirmed = simulated is not None and not found[0].against and simulated[1] >= COVERED_SHARE * tip
        far = confirmed and curved
        found.append(ModelEvidence("bending", bending, np.inf if far else SMALL_SHARE * length, "m", length))
        found.append(ModelEvidence("tip", tip, np.inf if confirmed else SMALL_SHARE * length, "m", length))
    if any(figure.against for figure in found):
        return ModelValidity("invalid", tuple(found))
    return ModelValidity("unknown" if simulated is None else "valid", tuple(found))


@dataclass(frozen=True)
class Loop:
    """One loop on the arm and Floquet's verdict on it; `problem` says why there is none, `design` is the designed controller, if any,
    `response` the loop's periodic response, if that is known and kept: an unstable loop leaves it,
    `certificate` the proof that it is stable; `ends`: its motion is one-way, and has no exponents."""

    name: str
    kind: str
    floquet: FloquetResult | None
    problem: str = ""
    design: Design | None = None
    response: Response | None = None
    certificate: Certificate | None = None
    ends: bool = False

    @property
    def verdict(self) -> str:
        """stable, unstable, undecided, one-way, or failed where there is no answer."""
        if self.ends and self.floquet is None:
            return "one-way"
        return "failed" if self.floquet is None else self.floquet.verdict

    @property
    def steady(self) -> tuple[float, float] | None:
        """The bending and the tip error of the steady motion that the loop keeps, in m, where there is one."""
        return None if self.response is None or self.verdict in ("unstable", "failed") else self.response.sizes

    @property
    def growth(self) -> tuple[float, float]:
        """The largest growth rate and its error, in 1/s."""
        if self.floquet is None:
            return float("nan"), float("nan")
        return float(self.floquet.exponents[0].real), float(self.floquet.errors[0])


@dataclass(frozen=True)
class Bending:
    """The largest deflections of the links' tips, (links,) in m: at rest in each posture, and along the motion; `lengths` of the links."""

    lengths: Array
    at_rest: Array
    moving: Array

    @property
    def largest(self) -> Array:
        """The larger of both against the links' lengths, (links,)."""
        return np.maximum(self.at_rest, self.moving) / np.where(self.lengths > 0, self.lengths, np.inf)


@dataclass(frozen=True)
class AtRest:
    """Natural frequencies in Hz with the joints held as the motion begins, rising; `gives_way`: in a posture it buckles or flutters."""

    frequencies: Array
    gives_way: bool
    bending: Bending | None


def examine(plant: Linearization, lengths: Array) -> AtRest | None:
    """Natural frequencies with the motors held, and the links' deflections: K y = h at rest in each posture, and in motion.

    Returns: None for an arm of which nothing moves then.
    """
    arm, motion = plant.arm, plant.motion
    held = replace(motion, prescribed=(True,) * motion.joints)
    try:
        loads = [linearize(arm, one) for one in (stand_still(held), held)]
    except InputError:
        return None
    c = loads[0].sample(motion.period * np.arange(SAMPLES) / SAMPLES)
    squares = find_squares(c.M, c.K)
    if squares is None:
        return AtRest(np.zeros(0), True, None)
    known = (
        None
        if arm.axes is None
        else Bending(lengths, bend(loads[0], lengths), bend(loads[1], lengths, find_deviations))
    )
    return AtRest(np.sqrt(squares[0]) / (2 * np.pi), False, known)


def find_squares(M: Array, K: Array) -> Array | None:
    """The squared natural frequencies (N, n) of M y'' + K y = 0, rising; none where one at any time is not positive, or not real.

    Rounding is a share of the largest eigenvalue: of M^-1 K, which gives the high ones, and of K^-1 M, which gives the low ones.
    """
    try:
        stiff, soft = (np.linalg.eigvals(np.linalg.solve(*pair)) for pair in ((M, K), (K, M)))
    except np.linalg.LinAlgError:
        return None
    for found in (stiff, soft):
        rounding = SUM_ROUNDING * np.abs(found).max()
        if not max(-found.real.min(), np.abs(found.imag).max()) <= rounding:
            return None
    low, high = np.sort(1 / np.maximum(soft.real, np.finfo(float).tiny)), np.sort(stiff.real)
    softest = (np.diagonal(K, axis1=1, axis2=2) / np.diagonal(M, axis1=1, axis2=2)).min(axis=1)
    if (low[:, 0] <= SUM_ROUNDING * softest).any():
        return None
    return np.asarray(np.where(high**2 < low[:, :1] * high[:, -1:], low, high))


def find_bending(scene: Scene) -> float:
    """By which share of its length a link of a scene bends at most along the motion; 0 where none does, inf where the arm gives way."""
    if not any(any(link.counts.by_direction().values()) for link in scene.links):
        return 0.0
    plant = linearize(build_manipulator(scene), scene.motion)
    found = examine(plant, np.array([link.length for link in scene.links]))
    if found is None or (found.bending is None and not found.gives_way):
        return 0.0
    return np.inf if found.bending is None else float(found.bending.largest.max())


def find_deviations(lin: Linearization, t: Array) -> Array:
    """The deviations (N, n) of the periodic motion, which near a resonance are larger than the loads' and beyond it smaller; those that
    balance the loads where none is found."""
    try:
        return forced_response(lin.periodic_system(), lin.forcing, LEAST_TOL)(t)[:, : lin.n]
    except TimeLimit:
        raise
    except (InputError, NumericalError) as error:
        return deflect(lin, t) * (np.nan if isinstance(error, ResonantForcing) else 1.0)


def bend(lin: Linearization, lengths: Array, deviations: Callable[[Linearization, Array], Array] = deflect) -> Array:
    """The largest deflection of each link's tip (links,) against its own base; infinite where K is singular, 0 where it is rounding of
    the arm's length."""
    t = lin.period * np.arange(SAMPLES) / SAMPLES
    y = deviations(lin, t)
    if np.isnan(y).any():
        return np.full(len(lengths), np.inf)
    straight = lin.about.near.of_arm("axes", t, np.zeros_like(y))
    found = np.zeros(len(lengths))
    for i in range(len(lengths)):
        own = [one.kind == "elastic" and one.link == i and one.mode is not None for one in lin.coordinates]
        bent, end = lin.about.near.of_arm("axes", t, y * own) if any(own) else straight, COLUMNS * (i + 1) - 1
        found[i] = np.linalg.norm(bent[:, :, end] - straight[:, :, end], axis=1).max()
    return np.where(found > SUM_ROUNDING * lengths.sum(), found, 0.0)
