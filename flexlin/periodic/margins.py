"""How much gain, phase and delay a periodic loop endures: Floquet's verdict on the perturbed loop, no frozen time."""

from collections.abc import Callable, Iterable
from functools import partial
from math import factorial

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from flexlin.arguments import checked
from flexlin.checks import Array, positive
from flexlin.errors import NumericalError, TimeLimit
from flexlin.periodic.coefficients import Combined, MatrixFunction, as_matrix_function, combine, hold_input
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.result import FloquetResult, need_stable
from flexlin.periodic.system import PeriodicSystem, input_of, with_matrices
from flexlin.periodic.transition.choose_segments import FEWER_SEGMENTS
from flexlin.precision import ROOT_EPS
from flexlin.summary import immutable

LARGEST_GAIN, GAIN_RATIO = 1e3, 1.4
"""Factors on the gain that are tried, and the ratio from one gain or delay to the next."""
LONGEST_DELAY = 20.0
"""In times of the slowest exponent of A(t), or periods; the first delay is this part of the time of the fastest."""
DELAY_ORDER = 8
"""Order of the delay line at the most, [7/8] Pade, as short as tol allows for the fastest mode; the next order shows the error."""

Perturbed = Callable[[float], PeriodicSystem]
Found = tuple[float, float]
"""A margin and its error."""
Start = tuple[float, float]
"""A value whose loop is the one without change, and the growth rate of that; the perturbed loop itself need not exist there."""


@immutable
class Margins:
    """What a loop endures before it becomes unstable, all inputs perturbed alike.

    Attributes
    ----------
    gain : tuple of float
        Factors on K below and above one at which the loop becomes unstable; 0 and inf where none is found down to 1/1000, up to 1000.
    phase : float
        Angle phi in rad with K -> exp(i phi) K; inf where none up to pi is found.
    delay : float
        Time in s from the command to the torque; inf where none is found up to 20 periods, or slowest times of A(t) if these are longer.
    errors : tuple of float
        Of the lower gain, the upper gain, the phase and the delay, in their units: on either side at this distance the verdict is decided.
    reason : str
        Why margins are not a number: some perturbed loop on the way has no verdict, or time was over. Empty where all are known.

    Examples
    --------
    An integrator of gain 2 endures a phase of 90 degrees, so a delay of (pi/2)/2:

    >>> import flexlin as fl
    >>> found = fl.margins(fl.PeriodicSystem([[0.0]], 1.0, B=[[1.0]]), [[2.0]])
    >>> print(f"{found.phase:.4f} {found.delay:.4f} {found.gain[1]}")
    1.5708 0.7854 inf
    """

    gain: tuple[float, float]
    phase: float
    delay: float
    errors: tuple[float, float, float, float]
    reason: str = ""


@checked
def margins(system: PeriodicSystem, gain: MatrixFunction | ArrayLike, tol: float = 1e-6) -> Margins:
    """Find the gain, phase and delay margins of the periodic loop x' = A x + B u, u = -K x, broken at the input.

        u = -kappa K x,      u = -exp(i phi) K x,      u(t) = -K(t - tau) x(t - tau)

    Each is the smallest change that moves a Floquet exponent of the perturbed loop to the imaginary axis. The complex gain makes a real
    loop of twice the states; the delay is a line of Legendre polynomials, whose Pade approximation of exp(-s tau) is exact to within
    the stated error. For a constant loop with one input they are the classical margins. What is unstable only between two values of
    the scan (factors of 1.4 of gains and delays, angles of 9 degrees) is not seen.

    Parameters
    ----------
    system : PeriodicSystem
        The plant without feedback, with n states and m inputs.
    gain : array_like (m, n), or function of times (N,) -> (N, m, n)
        K.
    tol : float
        Wanted relative error of a margin.

    Returns
    -------
    Margins
        gain, phase, delay, errors.

    Raises
    ------
    ArgumentError
        When the gain does not fit.
    NotStable
        When the loop is not stable as it is.

    References
    ----------
    Bittanti, Colaneri, Periodic Systems (2009), ch. 3; Voelker, Eliasmith, Neural Computation 30 (2018) 569, Eq. (2.2), for the line.

    Examples
    --------
    >>> import flexlin as fl
    >>> plant = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> print(f"{fl.margins(plant, [[1.0, 1.0]]).phase:.4f}")
    0.9046
    """
    tol = positive("tol", tol)
    B, K = input_of(system), as_matrix_function("gain", gain)
    nominal = system.feedback(K)
    found = floquet(nominal, ROOT_EPS)
    need_stable(found, f"the loop is {found.verdict} as it is")
    breaks, decay = tuple(nominal.resolved.breaks), float(found.exponents[0].real)

    def with_gain(kappa: float) -> PeriodicSystem:
        return system.feedback(combine(partial(np.multiply, kappa), K), breaks)

    def with_phase(phi: float) -> PeriodicSystem:
        return with_matrices(nominal, Combined(partial(turn, phi=phi), (system.A, B, K)), breaks=breaks)

    steps = GAIN_RATIO ** np.arange(1, int(np.log(LARGEST_GAIN) / np.log(GAIN_RATIO)) + 1)
    angles = np.linspace(0.0, np.pi, len(steps) + 1)[1:]
    sizes, fastest = measure_rates(nominal, with_phase, angles)

    def with_delay(tau: float, more: int = 0) -> PeriodicSystem:
        order = choose_order(fastest * tau, tol / 2) + more
        return with_matrices(nominal, Combined(partial(delay, tau=tau, order=order), (system.A, B, K)), breaks=breaks)

    delays = list_delays(nominal.period, sizes)
    searches: list[Callable[[], Found]] = [
        partial(find_first, with_gain, (1.0, decay), 1 / steps, tol),
        partial(find_first, with_gain, (1.0, decay), steps, tol),
        partial(find_first, with_phase, (0.0, decay), angles, tol),
        partial(find_first, with_delay, (0.0, decay), delays, tol, partial(with_delay, more=1)),
    ]
    ((low, below), (high, above), (phase, turned), (longest, late)), reasons = find_known(searches)
    gain = 0.0 if np.isinf(low) else low, high
    return Margins(gain, phase, longest, (below, above, turned, late), "; ".join(dict.fromkeys(reasons)))


def turn(A: Array, B: Array, K: Array, phi: float) -> Array:
    """A - exp(i phi) B K as a real matrix of [Re x; Im x]."""
    feedback = B @ K
    real, turned = A - np.cos(phi) * feedback, np.sin(phi) * feedback
    return np.block([[real, turned], [-turned, real]])


def delay(A: Array, B: Array, K: Array, tau: float, order: int) -> Array:
    """x' = A x - B w, where w is K x a time tau ago, by a line of `order` Legendre polynomials for each input.

    tau z_i' = (2 i + 1) ((-1)^i v + sum_j a_ij z_j),   a_ij = -1 for i < j, (-1)^(i - j + 1) else,   w = sum_i z_i
    """
    i, m = np.arange(order), B.shape[2]
    rates = (2 * i + 1) / tau
    line = np.kron(np.eye(m), rates[:, None] * np.where(i[:, None] < i, -1.0, (-1.0) ** (i[:, None] - i + 1)))
    into = np.repeat(K, order, axis=1) * np.tile(rates * (-1.0) ** i, m)[:, None]
    out, n = hold_input(A, -np.repeat(B, order, axis=2)), A.shape[1]
    out[:, n:, :n], out[:, n:, n:] = into, line
    return out


def find_known(searches: list[Callable[[], Found]]) -> tuple[list[Found], list[str]]:
    """The four margins and their errors, not a number where a loop on the way has no verdict or the time is over; and the reasons.

    Raises: TimeLimit where it is over before the first is known.
    """
    found, reasons = [(np.nan, np.nan)] * len(searches), list[str]()
    for k, search in enumerate(searches):
        try:
            found[k] = search()
        except NumericalError as error:
            if isinstance(error, TimeLimit) and not k:
                raise
            reasons.append(str(error))
            if isinstance(error, TimeLimit):
                break
    return found, reasons


def measure_rates(loop: PeriodicSystem, with_phase: Perturbed, angles: Array) -> tuple[Array, float]:
    """The sizes (33, n) of the eigenvalues of A(t) over a period, and the largest of the loops with a phase, in 1/s.

    With a delay tau as well, s is an eigenvalue of A - exp(-s tau) B K, a loop with a phase where it neither grows nor decays.
    """
    t = loop.period * np.arange(33) / 33
    turned = [np.abs(np.linalg.eigvals(with_phase(phi).A(t))).max() for phi in angles]
    return np.abs(np.linalg.eigvals(loop.A(t))), float(max(turned))


def list_delays(period: float, sizes: Array) -> Array:
    """Rising delays, from a part of the fastest time of A(t) to several of the slowest."""
    longest = LONGEST_DELAY * max(period, 1 / max(float(sizes.max()) / LARGEST_GAIN, float(sizes.mean(axis=0).min())))
    first = 1 / (LONGEST_DELAY * float(sizes.max()))
    return first * GAIN_RATIO ** np.arange(1 + int(np.log(longest / first) / np.log(GAIN_RATIO)))


def choose_order(z: float, tol: float) -> int:
    """The least order q whose [q - 1 / q] Pade approximation delays all up to the frequency z by a share of at most tol wrongly.

    It misses exp(-i z) by z^(2 q) q! (q - 1)! / ((2 q)! (2 q - 1)!), which is z times the share.
    """
    f = factorial
    for q in range(1, DELAY_ORDER):
        if z ** (2 * q - 1) * f(q) * f(q - 1) <= tol * f(2 * q) * f(2 * q - 1):
            return q
    return DELAY_ORDER


def find_first(
    make: Perturbed, start: Start, values: Iterable[float], tol: float, better: Perturbed | None = None
) -> Found:
    """The first change of verdict on the way from a stable start over the values, with its error; inf, 0 where there is none.

    better: the perturbed loops that the error is judged by, where those that are searched are not exact.
    """
    known = {start[0]: start[1]}

    def growth_of(value: float) -> float:
        if value not in known:
            known[value] = float(judge_growth(make(value)).exponents[0].real)
        return known[value]

    before = start[0]
    for value in map(float, values):
        if growth_of(value) > 0:
            root = float(brentq(growth_of, before, value, xtol=tol * abs(value) / 8, rtol=1e-14))
            return find_near(better or make, root, tol * abs(root))
        before = value
    return np.inf, 0.0


def judge_growth(loop: PeriodicSystem) -> FloquetResult:
    """The exponents. Raises: TooManySegments, far beyond twice FEWER_SEGMENTS: a search asks for dozens."""
    return floquet(loop, ROOT_EPS, max_segments=2 * FEWER_SEGMENTS)


def find_near(make: Perturbed, value: float, reach: float) -> Found:
    """The middle and half width, doubled as need be, of an interval about a value at whose ends the verdicts are decided and differ."""
    while reach < abs(value):
        found = [judge_growth(make(value + side * reach)) for side in (-1, 1)]
        if {one.verdict for one in found} == {"stable", "unstable"}:
            return value, reach
        reach *= 2
    return value, np.inf
