"""Harmonic, rotating and Fourier motions, and waypoints: expressions of the phase."""

from collections.abc import Callable
from fractions import Fraction
from functools import reduce
from math import comb, gcd, lcm, pi

import casadi as ca

from flexlin.errors import MotionError
from flexlin.mechanics.coordinates import Parameters
from flexlin.scene.motion import AnyMotion, Fourier, Harmonic, PointToPoint, Rotation

LARGEST_RATIO = 1000
"""Rates of rotating joints must be ratios of integers up to this one, or the common period would be unusably long."""


Expression = tuple[ca.SX, ca.SX, tuple[float, ...]]
"""Angles (joints, 1) of the phase, duration in s, and the breaks as phases."""


def make_harmonic(table: Harmonic, phase: ca.SX, parameters: Parameters) -> Expression:
    """q = mean + amplitude sin(2 pi t/T + phase), T = 1/frequency."""
    angles = [joint.mean + joint.amplitude * ca.sin(2 * pi * phase + joint.phase) for joint in table.joints]
    return ca.vertcat(*angles), ca.SX(1) / table.frequency, ()


def make_fourier(table: Fourier, phase: ca.SX, parameters: Parameters) -> Expression:
    """q = mean + sum_k cos_k cos(2 pi k t/T) + sin_k sin(2 pi k t/T)."""
    angles = []
    for joint in table.joints:
        angle = ca.SX(joint.mean)
        for k, amplitude in enumerate(joint.cos, start=1):
            angle += amplitude * ca.cos(2 * pi * k * phase)
        for k, amplitude in enumerate(joint.sin, start=1):
            angle += amplitude * ca.sin(2 * pi * k * phase)
        angles.append(angle)
    return ca.vertcat(*angles), ca.SX(table.period), ()


def highest_harmonic(table: AnyMotion) -> int:
    """The highest harmonic of the angles; 1 for polynomials between the breaks."""
    if not isinstance(table, Fourier):
        return 1
    return max(len(row) for joint in table.joints for row in (joint.cos, joint.sin, (0.0,)))


def make_rotation(table: Rotation, phase: ca.SX, parameters: Parameters) -> Expression:
    """q = start + rate t: the angle grows, but sin q and cos q, and so the coefficients, are periodic.

    Raises: MotionError when no joint turns, or the rates have no common period.
    """
    nominal = [read_nominal(joint.rate, parameters) for joint in table.joints]
    leader = next((i for i, rate in enumerate(nominal) if rate != 0), None)
    if leader is None:
        raise MotionError(
            "no joint turns, so the motion has no period",
            got=f"rates {nominal}",
            expected="a rate that is not 0",
            todo="use kind = 'harmonic' with amplitude 0 for an arm at rest",
        )
    turns, rate = _count_turns(nominal, leader), ca.SX(table.joints[leader].rate)
    way = ca.sign(rate * nominal[leader])  # a free rate may turn round
    angles = [joint.start + 2 * pi * turn * way * phase for joint, turn in zip(table.joints, turns, strict=True)]
    return ca.vertcat(*angles), 2 * pi * turns[leader] * way / rate, ()


def _count_turns(rates: list[float], leader: int) -> list[int]:
    """Whole turns of each joint in the shortest common period."""
    ratios = [Fraction(rate / rates[leader]).limit_denominator(LARGEST_RATIO) for rate in rates]
    for rate, ratio in zip(rates, ratios, strict=True):
        if abs(float(ratio) * rates[leader] - rate) > 1e-12 * abs(rates[leader]):
            raise MotionError(
                "the joints' rates have no common period",
                got=f"rates {rates}",
                expected=f"ratios of integers up to {LARGEST_RATIO}",
            )
    common = lcm(*(ratio.denominator for ratio in ratios))
    turns = [int(ratio * common) for ratio in ratios]
    shared = gcd(*turns)
    sign = 1 if rates[leader] > 0 else -1
    return [sign * turn // shared for turn in turns]


def read_nominal(value: object, parameters: Parameters) -> float:
    """The number behind a value that may be a free symbol."""
    if not isinstance(value, ca.SX):
        return float(value)  # type: ignore[arg-type]
    return float(ca.evalf(ca.substitute(value, parameters.symbols, ca.DM(parameters.values))))


PROFILES = {"quintic": 2, "septic": 3}
"""Derivatives of a step from 0 to 1 that vanish at both ends: rate, acceleration and jerk. Source: Biagiotti, Melchiorri (2008), 2.1."""


def make_point_to_point(table: PointToPoint, phase: ca.SX, parameters: Parameters) -> Expression:
    """q = q_i + (q_(i+1) - q_i) step((t - t_i)/move_time), then rest for dwell_time, from waypoint to waypoint.

    Raises: MotionError when joints have unequal numbers of waypoints.
    """
    counts = [len(joint.waypoints) for joint in table.joints]
    if len(set(counts)) != 1:
        raise MotionError(
            "the joints have unequal numbers of waypoints", got=counts, expected="one angle for each waypoint and joint"
        )
    visits = list(range(counts[0]))
    if table.course == "there-and-back":
        visits += visits[-2::-1]
    moves = len(visits) - 1
    stage = table.move_time + table.dwell_time
    share = table.move_time / stage
    steps = [make_step(table.profile, ca.fmin(ca.fmax((phase * moves - i) / share, 0), 1)) for i in range(moves)]
    angles = []
    for joint in table.joints:
        stops = [joint.waypoints[visit] for visit in visits]
        angles.append(stops[0] + sum((b - a) * rise for a, b, rise in zip(stops, stops[1:], steps, strict=False)))
    breaks = sorted({edge for i in range(moves) for edge in (i / moves, (i + share) / moves) if edge < 1})
    return ca.vertcat(*angles), ca.SX(moves * stage), tuple(breaks)


def make_step(profile: str, x: ca.SX) -> ca.SX:
    """The polynomial step of a profile at x in [0, 1], x^(n+1) sum_k binom(n+k, k) binom(2n+1, n-k) (-x)^k, by Horner's rule."""
    n = PROFILES[profile]
    factors = [0] * (n + 1) + [comb(n + k, k) * comb(2 * n + 1, n - k) * (-1) ** k for k in range(n + 1)]
    return reduce(lambda value, factor: value * x + factor, reversed(factors), ca.SX(0))


MAKERS: dict[type, Callable[..., Expression]] = {
    Harmonic: make_harmonic,
    Rotation: make_rotation,
    Fourier: make_fourier,
    PointToPoint: make_point_to_point,
}
