"""Systems on which straightforward Floquet code fails, each with exponents known from elsewhere.

`python -m tests.periodic.hard_cases` prints the table of docs/hard-cases.md.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import mathieu_a

import flexlin as fl
from flexlin.periodic.grid import place_edges
from tests.periodic.jumping_systems import reference_jump, reference_pulse
from tests.periodic.non_normal_systems import reference_non_normal
from tests.periodic.systems import colaneri, lyapunov_transformed, mathieu, mathieu_second_order, meissner

STEPS = 2000
"""Runge-Kutta steps a period of the naive code."""


@dataclass(frozen=True)
class HardCase:
    """A system, the exponents that are known (some of them or all), how near flexlin must come, and the verdict it must give."""

    name: str
    why: str
    build: Callable[[], fl.PeriodicSystem]
    known: Callable[[], np.ndarray]
    near: float
    verdict: str
    source: str
    options: dict = field(default_factory=dict)
    steps: int = STEPS


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
        monodromy = eye
        for step in eye + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4):
            monodromy = step @ monodromy
        if not np.isfinite(monodromy).all():
            return np.full(len(eye), np.inf)
        return np.log(np.linalg.eigvals(monodromy).astype(complex)) / system.period


def worst_miss(exponents, known, period):
    """The largest distance of a known exponent to the nearest one found, imaginary parts modulo 2 pi / T."""
    if not np.isfinite(exponents).all():
        return np.inf
    apart = known[:, None] - exponents[None, :]
    turns = np.round(apart.imag * period / (2 * np.pi))
    return float(np.abs(apart - 2j * np.pi / period * turns).min(axis=1).max())


def transformed(exponents, periods=1.0, seed=1):
    A = lyapunov_transformed(np.diag(exponents), 1.0, 1, np.random.default_rng(seed))
    return fl.PeriodicSystem(A, 2 * np.pi * periods)


def gyroscopic(stiffness, spin):
    """y'' + 2 spin J y' - stiffness y = 0: z^2 + (4 spin^2 - 2 stiffness) z + stiffness^2 = 0 for z = lambda^2."""
    J = np.array([[0, 1.0], [-1, 0]])
    return fl.PeriodicSystem.from_second_order(np.eye(2), 2 * spin * J, -stiffness * np.eye(2), 1.7)


def gyroscopic_exponents(stiffness, spin):
    z = np.roots([1, 4 * spin**2 - 2 * stiffness, stiffness**2]).astype(complex)
    return np.concatenate([np.sqrt(z), -np.sqrt(z)])


def link(**changes):
    """The closed loop of the built-in single link, with changed numbers."""
    paths = {path.replace("__", "."): value for path, value in changes.items()}
    scene = fl.load_scene("single-link", {"designs": [], **paths})
    return fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control).periodic_system()


def hill_exponents(system):
    return fl.floquet(system, tol=1e-7, method="hill").exponents


FREQUENCIES = 1.0 * np.arange(1, 41) ** 2
"""In rad/s, spaced like a beam's bending frequencies."""
SHAPES = np.linalg.qr(np.random.default_rng(8).standard_normal((40, 40)))[0]


def modulated(stiffness, damping):
    n = len(stiffness)
    return fl.PeriodicSystem.from_second_order(
        np.eye(n), damping, lambda t: (1 + 0.02 * np.cos(200 * t))[:, None, None] * stiffness, np.pi / 100
    )


def forty_modes():
    """Forty oscillators, damped in proportion to their stiffness and modulated together, seen in mixed coordinates."""
    stiffness = SHAPES.T @ np.diag(FREQUENCIES**2) @ SHAPES
    return modulated(stiffness, 1e-3 * stiffness)


def forty_modes_one_by_one():
    return np.concatenate(
        [fl.floquet(modulated(w * w * np.eye(1), 1e-3 * w * w * np.eye(1)), tol=1e-11).exponents for w in FREQUENCIES]
    )


def turning_link():
    """A rigid link under weak feedback whose joint has dry friction; loops of CasADi name their turn-arounds themselves."""
    return loop_of(
        {
            "schema": 1,
            "title": "dry friction",
            "links": [{"length": 0.5, "mass_per_length": 0.4, "modes": 0}],
            "effects": {"coulomb_friction": {"torque": [0.02], "rate": 0.001}},
            "motion": {"kind": "harmonic", "frequency": 1.0, "joints": [{"mean": 0.0, "amplitude": 0.5}]},
            "control": {"feedback": {"kind": "pd", "kp": [0.2], "kd": [0.001]}},
        }
    )


def turning_link_exponents():
    """The same by SciPy: J y'' + (kd + c / eps sech^2(q' / eps)) y' + kp y = 0, J = 1 / 60 kg m^2, q' = pi cos(2 pi t)."""
    J, kp, kd, c, eps = 0.2 * 0.5**2 / 3, 0.2, 0.001, 0.02, 0.001

    def rate(t, y):
        damping = kd + c / eps / np.cosh(np.minimum(abs(np.pi * np.cos(2 * np.pi * t) / eps), 300)) ** 2
        Y = y.reshape(2, 2)
        return np.array([Y[1], -(kp * Y[0] + damping * Y[1]) / J]).ravel()

    y = np.eye(2).ravel()
    for a, b in pairwise([0, 0.247, 0.253, 0.747, 0.753, 1]):
        y = solve_ivp(rate, (a, b), y, "DOP853", rtol=1e-12, atol=1e-14, max_step=(b - a) / 200).y[:, -1]
    return np.log(np.linalg.eigvals(y.reshape(2, 2)).astype(complex))


def loop_of(raw):
    """The periodic system of a scene's own loop."""
    scene = fl.parse_scene(raw)
    return fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control).periodic_system()


def near_singular_mass():
    M = np.array([[1.0, 1 - 1e-10], [1 - 1e-10, 1.0]])
    return fl.PeriodicSystem.from_second_order(M, 1e-3 * M + 1e-8 * np.eye(2), np.eye(2), 2.0)


def near_singular_mass_exponents():
    masses = np.array([1 + (1 - 1e-10), 1 - (1 - 1e-10)])  # of the matrix as it is stored
    return np.concatenate([np.roots([m, 1e-3 * m + 1e-8, 1.0]) for m in masses])


def long_oscillator(damping):
    return fl.PeriodicSystem.from_second_order(
        np.eye(1), [[damping]], lambda t: (7.0 + np.cos(2 * t))[:, None, None], 1200 * np.pi
    )


def short_oscillator_exponents(damping):
    short = fl.PeriodicSystem.from_second_order(
        np.eye(1), [[damping]], lambda t: (7.0 + np.cos(2 * t))[:, None, None], np.pi
    )
    return fl.floquet(short, tol=1e-13).exponents


CASES = [
    HardCase(
        "exponents far apart",
        "exp(-48 pi) is lost beside 1 in one monodromy matrix",
        lambda: fl.PeriodicSystem(colaneri, 2 * np.pi),
        lambda: np.array([0, -24.0]),
        1e-8,
        "undecided",
        "Colaneri's example, exact",
    ),
    HardCase(
        "exponents of both signs",
        "multipliers from exp(-1885) to exp(+1885) leave the range of floating-point numbers",
        lambda: transformed([60.0, 1.0, -2.0, -60.0], 5),
        lambda: np.array([60.0, 1.0, -2.0, -60.0]),
        1e-9,
        "unstable",
        "Lyapunov transformation of a constant system, exact",
    ),
    HardCase(
        "strongly unstable",
        "the slow exponents drown in exp(200 T)",
        lambda: transformed([200.0, 5.0, -3.0]),
        lambda: np.array([200.0, 5.0, -3.0]),
        1e-8,
        "unstable",
        "Lyapunov transformation, exact",
    ),
    HardCase(
        "damped too fast to resolve",
        "exponent -1e7 with a turning direction: 1e7 segments, or an L-stable method and a bound",
        lambda: transformed([-1e7, -0.2], seed=3),
        lambda: np.array([-0.2]),
        1e-6,
        "stable",
        "Lyapunov transformation, exact",
        {"tol": 1e-6},
    ),
    HardCase(
        "jump in A(t)",
        "a step across the jump has order 1",
        lambda: fl.PeriodicSystem(meissner, np.pi, breaks=(np.pi / 3,)),
        lambda: np.array([1, -1]) * 0.04137974466122074514 + 1j,
        1e-13,
        "unstable",
        "Meissner's equation, closed form",
    ),
    HardCase(
        "tongue as narrow as rounding",
        "the fifth Ince-Strutt tongue at q = 0.02 is 4e-14 wide",
        lambda: mathieu_second_order(float(mathieu_a(5, 0.02)), 0.02),
        lambda: np.array([1j, 1j]),
        1e-7,
        "undecided",
        "scipy.special.mathieu_a",
    ),
    HardCase(
        "double multiplier +1",
        "rounding eps moves a defective double multiplier by sqrt(eps)",
        lambda: fl.PeriodicSystem(mathieu(float(mathieu_a(2, 0.8)), 0.8), np.pi),
        lambda: np.zeros(2),
        1e-6,
        "undecided",
        "scipy.special.mathieu_a",
    ),
    HardCase(
        "double multiplier -1",
        "the same at the principal resonance's boundary",
        lambda: fl.PeriodicSystem(mathieu(float(mathieu_a(1, 0.8)), 0.8), np.pi),
        lambda: np.array([1j, 1j]),
        1e-6,
        "undecided",
        "scipy.special.mathieu_a",
        {"tol": 1e-12},
    ),
    HardCase(
        "Krein collision",
        "two pairs of opposite signature meet on the axis",
        lambda: gyroscopic(2.0, np.sqrt(2.0)),
        lambda: np.array([1j, -1j]) * np.sqrt(2.0),
        1e-6,
        "undecided",
        "gyroscopic stabilization, closed form",
    ),
    HardCase(
        "just past a Krein collision",
        "growth 1e-4 out of a double exponent",
        lambda: gyroscopic(2.0, np.sqrt(2.0) * (1 - 2.5e-9)),
        lambda: gyroscopic_exponents(2.0, np.sqrt(2.0) * (1 - 2.5e-9)),
        1e-6,
        "unstable",
        "gyroscopic stabilization, closed form",
    ),
    HardCase(
        "nearly rigid link (EI x 1e8)",
        "bending modes a million times faster than the motion, damped as fast",
        lambda: link(links__0__bending_stiffness=3.7e8, links__0__modes=2),
        lambda: fl.floquet(link(links__0__modes=0), tol=1e-11).exponents,
        1e-7,
        "stable",
        "the rigid link, the limit of EI to infinity",
    ),
    HardCase(
        "40 modes",
        "frequencies from 1 to 1600 rad/s, damped up to 2560 1/s, in mixed coordinates",
        forty_modes,
        forty_modes_one_by_one,
        1e-6,
        "stable",
        "each oscillator alone",
        {"tol": 1e-11},
        100,
    ),
    HardCase(
        "payload of 1e-6 times the link",
        "must pass smoothly to no payload",
        lambda: link(effects__payload__mass=1.6e-7, links__0__modes=1),
        lambda: hill_exponents(link(effects__payload__mass=1.6e-7, links__0__modes=1)),
        1e-6,
        "stable",
        "Hill's matrix",
    ),
    HardCase(
        "payload of 1e6 times the link",
        "the mass matrix has nearly rank 1",
        lambda: link(effects__payload__mass=1.6e5, links__0__modes=1),
        lambda: (
            fl.floquet(
                link(effects__payload__mass=1.6e5, links__0__modes=1), method="gauss", order=12, segments=12_000
            ).exponents
        ),
        1e-4,
        "unstable",
        "Gauss collocation on 12,000 segments; exponents of 1e3",
        {"tol": 1e-9},
    ),
    HardCase(
        "hub without inertia",
        "the joint's inertia comes from the link alone",
        lambda: link(effects__hub__inertia=0.0, links__0__modes=1),
        lambda: hill_exponents(link(effects__hub__inertia=0.0, links__0__modes=1)),
        1e-6,
        "stable",
        "Hill's matrix",
    ),
    HardCase(
        "mass matrix near singular",
        "a mass of 1e-10 in one direction: 1e5 rad/s beside 0.7 rad/s",
        near_singular_mass,
        near_singular_mass_exponents,
        1e-2,
        "stable",
        "two quadratics",
        {"tol": 1e-5},
    ),
    HardCase(
        "long period, damped",
        "omega T = 1e4",
        lambda: long_oscillator(0.02),
        lambda: short_oscillator_exponents(0.02),
        1e-11,
        "stable",
        "the period divided by 1200",
    ),
    HardCase(
        "long period, undamped",
        "the symplectic form must survive 1200 periods",
        lambda: long_oscillator(0.0),
        lambda: short_oscillator_exponents(0.0),
        1e-11,
        "undecided",
        "the period divided by 1200",
    ),
    HardCase(
        "zero motion",
        "the constant system must come out, not only nearly",
        lambda: link(motion__joints=[{"mean": 0.0, "amplitude": 0.0}], links__0__modes=1),
        lambda: np.linalg.eigvals(
            link(motion__joints=[{"mean": 0.0, "amplitude": 0.0}], links__0__modes=1).A(np.zeros(1))[0]
        ),
        1e-8,
        "stable",
        "eigenvalues of A",
    ),
    HardCase(
        "narrow pulse",
        "a pulse of 2e-4 of the period between the samples: all that grows is in it",
        lambda: reference_pulse().system(),
        lambda: reference_pulse().exponents,
        1e-8,
        "unstable",
        "integration with the pulse as an interval of its own",
    ),
    HardCase(
        "friction at a turn-around",
        "Coulomb's tanh(q'/eps) is a pulse of 1e-4 of the period at each turn-around",
        turning_link,
        turning_link_exponents,
        1e-7,
        "stable",
        "integration with the pulses as intervals of their own",
    ),
    HardCase(
        "jump that nobody named",
        "A jumps at 1.0002 of 2, where a comparison of resolutions sees nothing",
        lambda: reference_jump().system(),
        lambda: reference_jump().exponents,
        1e-9,
        "stable",
        "product of two exponentials",
    ),
    HardCase(
        "non-normal",
        "exact eigenvalues -1 to -4 under shears of 4000: rounding moves them by as much as they are",
        lambda: reference_non_normal().system(),
        lambda: np.array([-1.0, -2, -3, -4]),
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
        system, known = case.build(), case.known()
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
