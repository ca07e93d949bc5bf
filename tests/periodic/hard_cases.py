"""Systems on which straightforward Floquet code fails, each with exponents known from elsewhere.

`python -m tests.periodic.hard_cases` prints the table of docs/hard-cases.md.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.special import mathieu_a

import flexlin as fl
from tests.periodic.hard_systems import (
    forty_modes,
    forty_modes_one_by_one,
    gyroscopic,
    gyroscopic_exponents,
    hill_exponents,
    link,
    long_oscillator,
    near_singular_mass,
    near_singular_mass_exponents,
    short_oscillator_exponents,
    transformed,
    turning_link,
    turning_link_exponents,
)
from tests.periodic.jumping_systems import reference_jump, reference_pulse
from tests.periodic.naive import STEPS, naive_exponents, worst_miss
from tests.periodic.non_normal_systems import reference_non_normal
from tests.periodic.systems import colaneri, mathieu, mathieu_second_order, meissner


@dataclass(frozen=True)
class HardCase:
    """A system, the exponents that are known (some of them or all), how near flexlin must come, and the verdict it must give."""

    name: str
    why: str
    build: Callable[[], fl.PeriodicSystem]
    known: Callable[[fl.PeriodicSystem], np.ndarray]
    near: float
    verdict: str
    source: str
    options: dict = field(default_factory=dict)
    steps: int = STEPS


CASES = [
    HardCase(
        "exponents far apart",
        "exp(-48 pi) is lost beside 1 in one monodromy matrix",
        lambda: fl.PeriodicSystem(colaneri, 2 * np.pi),
        lambda _: np.array([0, -24.0]),
        1e-8,
        "undecided",
        "Colaneri's example, exact",
    ),
    HardCase(
        "exponents of both signs",
        "multipliers from exp(-1885) to exp(+1885) leave the range of floating-point numbers",
        lambda: transformed([60.0, 1.0, -2.0, -60.0], 5),
        lambda _: np.array([60.0, 1.0, -2.0, -60.0]),
        1e-9,
        "unstable",
        "Lyapunov transformation of a constant system, exact",
    ),
    HardCase(
        "strongly unstable",
        "the slow exponents drown in exp(200 T)",
        lambda: transformed([200.0, 5.0, -3.0]),
        lambda _: np.array([200.0, 5.0, -3.0]),
        1e-8,
        "unstable",
        "Lyapunov transformation, exact",
    ),
    HardCase(
        "damped too fast to resolve",
        "exponent -1e7 with a turning direction: 1e7 segments, or an L-stable method and a bound",
        lambda: transformed([-1e7, -0.2], seed=3),
        lambda _: np.array([-0.2]),
        1e-6,
        "stable",
        "Lyapunov transformation, exact",
        {"tol": 1e-6},
    ),
    HardCase(
        "jump in A(t)",
        "a step across the jump has order 1",
        lambda: fl.PeriodicSystem(meissner, np.pi, breaks=(np.pi / 3,)),
        lambda _: np.array([1, -1]) * 0.04137974466122074514 + 1j,
        1e-13,
        "unstable",
        "Meissner's equation, closed form",
    ),
    HardCase(
        "tongue as narrow as rounding",
        "the fifth Ince-Strutt tongue at q = 0.02 is 4e-14 wide",
        lambda: mathieu_second_order(float(mathieu_a(5, 0.02)), 0.02),
        lambda _: np.array([1j, 1j]),
        1e-7,
        "undecided",
        "scipy.special.mathieu_a",
    ),
    HardCase(
        "double multiplier +1",
        "rounding eps moves a defective double multiplier by sqrt(eps)",
        lambda: fl.PeriodicSystem(mathieu(float(mathieu_a(2, 0.8)), 0.8), np.pi),
        lambda _: np.zeros(2),
        1e-6,
        "undecided",
        "scipy.special.mathieu_a",
    ),
    HardCase(
        "double multiplier -1",
        "the same at the principal resonance's boundary",
        lambda: fl.PeriodicSystem(mathieu(float(mathieu_a(1, 0.8)), 0.8), np.pi),
        lambda _: np.array([1j, 1j]),
        1e-6,
        "undecided",
        "scipy.special.mathieu_a",
        {"tol": 1e-12},
    ),
    HardCase(
        "Krein collision",
        "two pairs of opposite signature meet on the axis",
        lambda: gyroscopic(2.0, np.sqrt(2.0)),
        lambda _: np.array([1j, -1j]) * np.sqrt(2.0),
        1e-6,
        "undecided",
        "gyroscopic stabilization, closed form",
    ),
    HardCase(
        "just past a Krein collision",
        "growth 1e-4 out of a double exponent",
        lambda: gyroscopic(2.0, np.sqrt(2.0) * (1 - 2.5e-9)),
        lambda _: gyroscopic_exponents(2.0, np.sqrt(2.0) * (1 - 2.5e-9)),
        1e-6,
        "unstable",
        "gyroscopic stabilization, closed form",
    ),
    HardCase(
        "nearly rigid link (EI x 1e8)",
        "bending modes a million times faster than the motion, damped as fast",
        lambda: link(links__0__bending_stiffness=3.7e8, links__0__modes=2),
        lambda _: fl.floquet(link(links__0__modes=0), tol=1e-11).exponents,
        1e-7,
        "stable",
        "the rigid link, the limit of EI to infinity",
    ),
    HardCase(
        "40 modes",
        "frequencies from 1 to 1600 rad/s, damped up to 2560 1/s, in mixed coordinates",
        forty_modes,
        lambda _: forty_modes_one_by_one(),
        1e-8,
        "stable",
        "each oscillator alone",
        {"tol": 1e-11},
        100,
    ),
    HardCase(
        "payload of 1e-6 times the link",
        "must pass smoothly to no payload",
        lambda: link(effects__payload__mass=1.6e-7, links__0__modes=1),
        hill_exponents,
        1e-6,
        "stable",
        "Hill's matrix",
    ),
    HardCase(
        "payload of 1e6 times the link",
        "the mass matrix has nearly rank 1",
        lambda: link(effects__payload__mass=1.6e5, links__0__modes=1),
        lambda system: fl.floquet(system, method="gauss", order=12, segments=12_000).exponents,
        1e-4,
        "unstable",
        "Gauss collocation on 12,000 segments; exponents of 1e3",
        {"tol": 1e-9},
    ),
    HardCase(
        "hub without inertia",
        "the joint's inertia comes from the link alone",
        lambda: link(effects__hub__inertia=0.0, links__0__modes=1),
        hill_exponents,
        1e-6,
        "stable",
        "Hill's matrix",
    ),
    HardCase(
        "mass matrix near singular",
        "a mass of 1e-10 in one direction: 1e5 rad/s beside 0.7 rad/s",
        near_singular_mass,
        lambda _: near_singular_mass_exponents(),
        1e-2,
        "stable",
        "two quadratics",
        {"tol": 1e-5},
    ),
    HardCase(
        "long period, damped",
        "omega T = 1e4",
        lambda: long_oscillator(0.02),
        lambda _: short_oscillator_exponents(0.02),
        1e-11,
        "stable",
        "the period divided by 1200",
    ),
    HardCase(
        "long period, undamped",
        "the symplectic form must survive 1200 periods",
        lambda: long_oscillator(0.0),
        lambda _: short_oscillator_exponents(0.0),
        1e-11,
        "undecided",
        "the period divided by 1200",
    ),
    HardCase(
        "zero motion",
        "the constant system must come out, not only nearly",
        lambda: link(motion__joints=[{"mean": 0.0, "amplitude": 0.0}], links__0__modes=1),
        lambda system: np.linalg.eigvals(system.A(np.zeros(1))[0]),
        1e-8,
        "stable",
        "eigenvalues of A",
    ),
    HardCase(
        "narrow pulse",
        "a pulse of 2e-4 of the period between the samples: all that grows is in it",
        lambda: reference_pulse().system(),
        lambda _: reference_pulse().exponents,
        1e-8,
        "unstable",
        "integration with the pulse as an interval of its own",
    ),
    HardCase(
        "friction at a turn-around",
        "Coulomb's tanh(q'/eps) is a pulse of 1e-4 of the period at each turn-around",
        turning_link,
        lambda _: turning_link_exponents(),
        1e-7,
        "stable",
        "integration with the pulses as intervals of their own",
    ),
    HardCase(
        "jump that nobody named",
        "A jumps at 1.0002 of 2, where a comparison of resolutions sees nothing",
        lambda: reference_jump().system(),
        lambda _: reference_jump().exponents,
        1e-9,
        "stable",
        "product of two exponentials",
    ),
    HardCase(
        "non-normal",
        "exact eigenvalues -1 to -4 under shears of 4000: rounding moves them by as much as they are",
        lambda: reference_non_normal().system(),
        lambda _: np.array([-1.0, -2, -3, -4]),
        0.1,
        "undecided",
        "construction, exact in binary",
    ),
]


def describe(setting):
    """The method of a row: order and segments where it has any."""
    return f"{setting.method} {setting.order}, {setting.segments} segments" if setting.order else setting.method


def table():
    """The rows of docs/hard-cases.md."""
    lines = [
        "| case | why it is hard | known from | naive code misses by | flexlin misses by | its own error | verdict | method |"
    ]
    lines.append("|---|---|---|---|---|---|---|---|")
    for case in CASES:
        system = case.build()
        known = case.known(system)
        result = fl.floquet(system, **case.options)
        naive = worst_miss(naive_exponents(system, case.steps), known, system.period)
        miss = worst_miss(result.exponents, known, system.period)
        naive_text = f"{naive:.1e}" if np.isfinite(naive) else "overflow"
        setting = describe(result.setting)
        lines.append(
            f"| {case.name} | {case.why} | {case.source} | {naive_text} | {miss:.1e} | {result.error:.1e} "
            f"| {result.verdict} | {setting} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    print(table())
