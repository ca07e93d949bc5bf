"""The harmonic frequency response of a periodic system: one frequency in, that frequency and its sidebands out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, positive, real_array
from flexlin.errors import ArgumentError, NotStable, ToleranceNotReached
from flexlin.periodic.coefficients import MatrixFunction, as_matrix_function, check_samples
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.fourier import fourier_differentiation
from flexlin.periodic.precision import SAFETY
from flexlin.periodic.system import PeriodicSystem, as_system
from flexlin.summary import represent

FEWEST, LARGEST = 8, 2000
"""Harmonics that are tried first, and unknowns of one frequency at the most."""


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """What u = exp(i omega t) v does in the long run: y = sum over k of H_k exp(i (omega + 2 pi k / T) t) v.

    Attributes
    ----------
    omega : array, shape (W,)
        Frequencies of the input, in rad/s.
    orders : array, shape (K,)
        The k, in rising order, 0 in the middle.
    H : complex array, shape (W, K, p, m)
        In units of the output per unit of the input.
    error : float
        Of any entry, relative to the largest at its frequency.
    period : float
        T in s.

    Examples
    --------
    >>> import flexlin as fl
    >>> found = fl.frequency_response(fl.PeriodicSystem([[-1.0]], 1.0, B=[[1.0]]), [[1.0]], [1.0])
    >>> print(f"{found.direct.item():.6f}")
    0.500000-0.500000j
    """

    omega: Array
    orders: Array
    H: Array
    error: float
    period: float

    __repr__ = represent

    @property
    def direct(self) -> Array:
        """H_0 (W, p, m): what comes out at the frequency that went in."""
        return self.H[:, len(self.orders) // 2]


@checked
def frequency_response(
    system: PeriodicSystem, C: MatrixFunction | ArrayLike, omega: ArrayLike, tol: float = 1e-8
) -> FrequencyResponse:
    """Compute the harmonic transfer functions of x' = A x + B u, y = C x.

        x = exp(i omega t) p(t),   p' + i omega p = A p + B,   p(t + T) = p(t),   H_k = the k-th Fourier coefficient of C p

    p by Fourier collocation on ever more times. Assumes a stable system with smooth coefficients.

    Parameters
    ----------
    system : PeriodicSystem
        With inputs; n states, m inputs.
    C : array_like (p, n), or function of times (N,) -> (N, p, n)
        The output matrix.
    omega : array_like, shape (W,)
        Frequencies of the input, in rad/s.
    tol : float
        Wanted error, relative to the largest entry at each frequency.

    Returns
    -------
    FrequencyResponse
        H_k at all frequencies, and their error.

    Raises
    ------
    ArgumentError
        When the system has no input, or C does not fit.
    NotStable
        When the system is unstable or undecided.
    ToleranceNotReached
        When coefficients jump, or change too fast for the harmonics that can be computed.

    References
    ----------
    Wereley, Hall, Frequency response of linear time periodic systems, Proc. 29th IEEE CDC (1990) 3650.

    Examples
    --------
    An output that is modulated answers in two sidebands alone:

    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[-1.0]], 2 * np.pi, B=[[1.0]])
    >>> found = fl.frequency_response(system, lambda t: np.cos(t)[:, None, None], [0.0])
    >>> [(int(k), round(float(abs(H)), 6)) for k, H in zip(found.orders, found.H[0, :, 0, 0]) if abs(H) > 1e-12]
    [(-1, 0.5), (1, 0.5)]
    """
    system, tol = as_system(system), positive("tol", tol)
    frequencies = np.atleast_1d(real_array("omega", omega))
    if system.B is None:
        raise ArgumentError("the system has no input", got="B = None", expected="an input matrix B(t)")
    output = as_matrix_function("C", C)
    if check_samples("C", output, system.period).shape[2] != system.n:
        raise ArgumentError("C does not fit the system", expected=f"(p, {system.n})")
    verdict = floquet(system)
    if verdict.verdict != "stable":
        raise NotStable("there is no response that lasts", got=verdict.status, expected="a stable system")
    harmonics, before = FEWEST, solve_harmonics(system, output, frequencies, FEWEST)
    while True:
        harmonics *= 2
        found = solve_harmonics(system, output, frequencies, harmonics)
        shared = found[:, harmonics // 2 : 3 * harmonics // 2 + 1]
        size = np.abs(found).max(axis=(1, 2, 3)) + np.finfo(float).tiny
        left = np.abs(found).max(axis=(2, 3))
        beyond = np.maximum(left[:, : harmonics // 2].max(axis=1), left[:, 3 * harmonics // 2 + 1 :].max(axis=1))
        change = float((np.maximum(np.abs(shared - before).max(axis=(1, 2, 3)), beyond) / size).max(initial=0.0))
        if SAFETY * change <= tol:
            orders = np.arange(-harmonics, harmonics + 1)
            return FrequencyResponse(
                frequencies, orders, found, SAFETY * change + np.finfo(float).eps * harmonics, system.period
            )
        if (4 * harmonics + 1) * system.n > LARGEST:
            raise ToleranceNotReached(
                "the response was not resolved",
                got=f"a change of {change:.2g} at {harmonics} harmonics",
                expected=f"at most {tol / SAFETY:.2g}",
                todo="smooth the coefficients, or ask for a larger tol",
            )
        before = found


def solve_harmonics(system: PeriodicSystem, output: MatrixFunction, omega: Array, harmonics: int) -> Array:
    """H (W, 2 H + 1, p, m) by collocation at 2 H + 1 times."""
    assert system.B is not None
    count, n = 2 * harmonics + 1, system.n
    t = system.period * np.arange(count) / count
    operator = np.einsum("ts,ab->tasb", fourier_differentiation(count, system.period), np.eye(n)).copy()
    operator[np.arange(count), :, np.arange(count), :] -= system.resolved(t)
    matrix, right, C = operator.reshape(count * n, count * n), system.resolved_input(t), output(t)
    eye = np.eye(count * n)
    waves = [
        C @ np.linalg.solve(matrix + 1j * w * eye, right.reshape(count * n, -1)).reshape(count, n, -1) for w in omega
    ]
    return np.fft.fftshift(np.fft.fft(np.array(waves), axis=1), axes=1) / count
