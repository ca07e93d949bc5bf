"""Systems on which straightforward Floquet code fails, each with exponents known from elsewhere.

`python -m tests.periodic.hard_cases` prints the table of docs/hard-cases.md.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce

import numpy as np
from scipy.special import mathieu_a

import flexlin as fl
from flexlin.periodic import place_edges
from tests.closed_arm import closed, control_loop
from tests.mechanics.test_features import scene as rubbing_link
from tests.periodic.chains import TWO_PI, Real
from tests.periodic.jumping_systems import reference_jump, reference_pulse
from tests.periodic.non_normal_systems import reference_non_normal
from tests.periodic.systems import colaneri, lyapunov_transformed, mathieu, mathieu_second_order, meissner, oscillator
from tests.periodic.truths import apart, integrated, panels_of

STEPS = 2000
"""Runge-Kutta steps a period of the naive code."""


def naive_exponents(system, steps=STEPS):
    """What is usually written: Runge-Kutta of order 4, the monodromy matrix multiplied out, its eigenvalues, their logs."""
    grid = place_edges(system.period, (), steps)
    h = np.diff(grid)[:, None, None]
    start, middle, end = (system.A(t) for t in (grid[:-1], grid[:-1] + h[:, 0, 0] / 2, grid[1:]))
    eye = np.eye(start.shape[-1])
    with np.errstate(all="ignore"):
        k1 = start
        k2 = middle @ (eye + h / 2 * k1)
        k3 = middle @ (eye + h / 2 * k2)
        k4 = end @ (eye + h * k3)
        factors = eye + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        monodromy = reduce(lambda before, step: step @ before, factors)
        if not np.isfinite(monodromy).all():
            return np.full(len(eye), np.inf)
        return np.log(np.linalg.eigvals(monodromy).astype(complex)) / system.period


def worst_miss(exponents, known, period):
    """The largest distance of a known exponent to the nearest one found, imaginary parts modulo 2 pi / T."""
    if not np.isfinite(exponents).all():
        return np.inf
    return float(apart(known, exponents, period).min(axis=1).max())


@dataclass(frozen=True)
class HardCase:
    """build: a system, and exponents that are known, some of them or all; how near flexlin must come, and the verdict it must give."""

    name: str
    source: str
    near: float
    verdict: str
    build: Callable[[], tuple[fl.PeriodicSystem, np.ndarray]]
    options: dict
    steps: int


CASES: list[HardCase] = []


def hard(name, source, near, verdict, steps=STEPS, **options):
    """Register what builds a case; its docstring says why it is hard."""

    def register(build):
        CASES.append(HardCase(name, source, near, verdict, build, options, steps))
        return build

    return register


def transformed(exponents, periods=1.0, seed=1):
    """Lyapunov's transformation of diag(exponents)."""
    A = lyapunov_transformed(np.diag(exponents), 1.0, 1, np.random.default_rng(seed))
    return fl.PeriodicSystem(A, 2 * np.pi * periods), np.array(exponents)


@hard("exponents far apart", "Colaneri's example, exact", 1e-8, "undecided")
def far_apart():
    """A decay by exp(-48 pi) is lost beside 1 in one monodromy matrix."""
    return fl.PeriodicSystem(colaneri, 2 * np.pi), np.array([0, -24.0])


@hard("exponents of both signs", "Lyapunov transformation of a constant system, exact", 1e-9, "unstable")
def both_signs():
    """Multipliers from exp(-1885) to exp(+1885) leave the range of floating-point numbers."""
    return transformed([60.0, 1.0, -2.0, -60.0], 5)


@hard("strongly unstable", "Lyapunov transformation, exact", 1e-8, "unstable")
def strongly_unstable():
    """The slow exponents drown in exp(200 T)."""
    return transformed([200.0, 5.0, -3.0])


@hard("damped too fast to resolve", "Lyapunov transformation, exact", 1e-6, "stable", tol=1e-6)
def damped_too_fast():
    """Exponent -1e7 with a turning direction: 1e7 segments, or an L-stable method and a bound."""
    system, exponents = transformed([-1e7, -0.2], seed=3)
    return system, exponents[1:]


@hard("jump in A(t)", "Meissner's equation, closed form", 1e-13, "unstable")
def jump():
    """A step across the jump has order 1."""
    return fl.PeriodicSystem(meissner, np.pi, breaks=(np.pi / 3,)), np.array([1, -1]) * 0.04137974466122074514 + 1j


@hard("tongue as narrow as rounding", "scipy.special.mathieu_a", 1e-7, "undecided")
def narrow_tongue():
    """The fifth Ince-Strutt tongue at q = 0.02 is 4e-14 wide."""
    return mathieu_second_order(float(mathieu_a(5, 0.02)), 0.02), np.array([1j, 1j])


@hard("double multiplier +1", "scipy.special.mathieu_a", 1e-6, "undecided")
def double_multiplier():
    """Rounding eps moves a defective double multiplier by sqrt(eps)."""
    return fl.PeriodicSystem(mathieu(float(mathieu_a(2, 0.8)), 0.8), np.pi), np.zeros(2)


@hard("double multiplier -1", "scipy.special.mathieu_a", 1e-6, "undecided", tol=1e-12)
def negative_double_multiplier():
    """The same at the principal resonance's boundary."""
    return fl.PeriodicSystem(mathieu(float(mathieu_a(1, 0.8)), 0.8), np.pi), np.array([1j, 1j])


def gyroscopic(stiffness, spin):
    """y'' + 2 spin J y' - stiffness y = 0: z^2 + (4 spin^2 - 2 stiffness) z + stiffness^2 = 0 for z = lambda^2."""
    J = np.array([[0, 1.0], [-1, 0]])
    z = np.roots([1, 4 * spin**2 - 2 * stiffness, stiffness**2]).astype(complex)
    system = fl.PeriodicSystem.from_second_order(np.eye(2), 2 * spin * J, -stiffness * np.eye(2), 1.7)
    return system, np.concatenate([np.sqrt(z), -np.sqrt(z)])


@hard("Krein collision", "gyroscopic stabilization, closed form", 1e-6, "undecided")
def krein_collision():
    """Two pairs of opposite signature meet on the axis."""
    return gyroscopic(2.0, np.sqrt(2.0))[0], np.array([1j, -1j]) * np.sqrt(2.0)


@hard("just past a Krein collision", "gyroscopic stabilization, closed form", 1e-6, "unstable")
def past_a_krein_collision():
    """Growth 1e-4 out of a double exponent."""
    return gyroscopic(2.0, np.sqrt(2.0) * (1 - 2.5e-9))


def link(changes):
    """The closed loop of the built-in single link, with changed numbers."""
    return closed(changes={"designs": [], **changes}).periodic_system()


def with_hill(system):
    """And its exponents by Hill's matrix."""
    return system, fl.floquet(system, tol=1e-7, method="hill").exponents


@hard("nearly rigid link (EI x 1e8)", "the rigid link, the limit of EI to infinity", 1e-7, "stable")
def nearly_rigid():
    """Bending modes a million times faster than the motion, damped as fast."""
    rigid = fl.floquet(link({"links.0.modes": 0}), tol=1e-11).exponents
    return link({"links.0.bending_stiffness": 3.7e8, "links.0.modes": 2}), rigid


FREQUENCIES = 1.0 * np.arange(1, 41) ** 2
"""In rad/s, spaced like a beam's bending frequencies."""
SHAPES = np.linalg.qr(np.random.default_rng(8).standard_normal((40, 40)))[0]


def modulated(stiffness):
    """Damped in proportion to the stiffness."""

    def waving(t):
        return (1 + 0.02 * np.cos(200 * t))[:, None, None] * stiffness

    return fl.PeriodicSystem.from_second_order(np.eye(len(stiffness)), 1e-3 * stiffness, waving, np.pi / 100)


@hard("40 modes", "each oscillator alone", 1e-8, "stable", steps=100, tol=1e-11)
def forty_modes():
    """Frequencies from 1 to 1600 rad/s, damped up to 2560 1/s, in mixed coordinates."""
    alone = [fl.floquet(modulated(w * w * np.eye(1)), tol=1e-11).exponents for w in FREQUENCIES]
    return modulated(SHAPES.T @ np.diag(FREQUENCIES**2) @ SHAPES), np.concatenate(alone)


@hard("payload of 1e-6 times the link", "Hill's matrix", 1e-6, "stable")
def small_payload():
    """Must pass smoothly to no payload."""
    return with_hill(link({"effects.payload.mass": 1.6e-7, "links.0.modes": 1}))


@hard("payload of 1e6 times the link", "12,000 segments of Gauss; exponents of 1e3", 1e-4, "unstable", tol=1e-9)
def large_payload():
    """The mass matrix has nearly rank 1."""
    system = link({"effects.payload.mass": 1.6e5, "links.0.modes": 1})
    return system, fl.floquet(system, method="gauss", order=12, segments=12_000).exponents


@hard("hub without inertia", "Hill's matrix", 1e-6, "stable")
def no_inertia():
    """The joint's inertia comes from the link alone."""
    return with_hill(link({"effects.hub.inertia": 0.0, "links.0.modes": 1}))


@hard("mass matrix near singular", "two quadratics", 1e-2, "stable", tol=1e-5)
def near_singular_mass():
    """A mass of 1e-10 in one direction: 1e5 rad/s beside 0.7 rad/s."""
    M = np.array([[1.0, 1 - 1e-10], [1 - 1e-10, 1.0]])
    masses = M[0, 0] + M[0, 1], M[0, 0] - M[0, 1]  # of the matrix as it is stored
    exponents = np.concatenate([np.roots([m, 1e-3 * m + 1e-8, 1.0]) for m in masses])
    return fl.PeriodicSystem.from_second_order(M, 1e-3 * M + 1e-8 * np.eye(2), np.eye(2), 2.0), exponents


def long_and_short(damping):
    """y'' + damping y' + (7 + cos 2t) y = 0 over 1200 periods, and the exponents over one."""

    def stiffness(t):
        return (7.0 + np.cos(2 * t))[:, None, None]

    periods = 1200 * np.pi, np.pi
    long, short = (fl.PeriodicSystem.from_second_order([[1.0]], [[damping]], stiffness, T) for T in periods)
    return long, fl.floquet(short, tol=1e-13).exponents


@hard("long period, damped", "the period divided by 1200", 1e-11, "stable")
def long_period():
    """There are 1e4 radians in a period."""
    return long_and_short(0.02)


@hard("long period, undamped", "the period divided by 1200", 1e-11, "undecided")
def long_undamped_period():
    """The symplectic form must survive 1200 periods."""
    return long_and_short(0.0)


@hard("zero motion", "eigenvalues of A", 1e-8, "stable")
def zero_motion():
    """The constant system must come out, not only nearly."""
    system = link({"motion.joints": [{"mean": 0.0, "amplitude": 0.0}], "links.0.modes": 1})
    return system, np.linalg.eigvals(system.A(np.zeros(1))[0])


@hard("narrow pulse", "integration with the pulse as an interval of its own", 1e-8, "unstable")
def narrow_pulse():
    """A pulse of 2e-4 of the period between the samples: all that grows is in it."""
    return reference_pulse().system(), reference_pulse().exponents


@hard("friction at a turn-around", "integration with the pulses as intervals of their own", 1e-7, "stable")
def turning_link():
    """Coulomb's tanh(q'/eps) is a pulse of 1e-4 of the period at each turn-around."""
    system = control_loop(rubbing_link(1.0, 0.0, 0.001)).periodic_system()
    panels = panels_of(1.0, 20.0, (), [(turn, 0.004, 300) for turn in (0.25, 0.75)])
    return system, integrated(turning_link_matrix, panels, 1.0)[0]


def turning_link_matrix(t):
    """J y'' + (kd + c / eps sech^2(q' / eps)) y' + kp y = 0 in extended precision, J = 1 / 60 kg m^2, q' = pi cos(2 pi t)."""
    J, kp, kd, c, eps = (Real(value) for value in ("0.05", "0.2", "0.001", "0.02", "0.001"))
    J = J / 3
    shape = np.cosh(np.minimum(np.abs(TWO_PI / 2 * np.cos(TWO_PI * t) / eps), Real(300))) ** -2
    return oscillator(np.broadcast_to(kp / J, t.shape), (kd + c / eps * shape) / J)


@hard("jump that nobody named", "product of two exponentials", 1e-9, "stable")
def forgotten_jump():
    """A jumps at 1.0002 of 2, where a comparison of resolutions sees nothing."""
    return reference_jump().system(), reference_jump().exponents


@hard("non-normal", "construction, exact in binary", 0.1, "undecided")
def non_normal():
    """Exact eigenvalues -1 to -4 under shears of 4000: rounding moves them by as much as they are."""
    return reference_non_normal().system(), np.array([-1.0, -2, -3, -4])


def table():
    """The rows of docs/hard-cases.md."""
    lines = [
        "| case | why it is hard | known from | naive code misses by | flexlin misses by | its own error | verdict | method |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for case in CASES:
        system, known = case.build()
        result = fl.floquet(system, **case.options)
        naive = worst_miss(naive_exponents(system, case.steps), known, system.period)
        miss, used = worst_miss(result.exponents, known, system.period), result.setting
        naive_text = f"{naive:.1e}" if np.isfinite(naive) else "overflow"
        method = f"{used.method} {used.order}, {used.segments} segments" if used.order else used.method
        lines.append(
            f"| {case.name} | {case.build.__doc__.rstrip('.')} | {case.source} | {naive_text} | {miss:.1e} "
            f"| {result.error:.1e} | {result.verdict} | {method} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    print(table())
