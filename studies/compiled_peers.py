"""How far is flexlin from compiled code that a good programmer writes for one question, without an error of the answer?

Systems that a user brings as plain functions: random ones with 4 and 8 states, A(t) = A0 + A1 cos t + A2 sin 2t, and a chain of ten masses,
springs and dampers whose springs are excited; the single link with its PD loop; a family of 4 states at thousands of values. flexlin
resolves the coefficients and gives each exponent with its error. Its peers are compiled by numba for the number of states at hand and give
exponents alone: the exponential of Magnus' series of order 6 (Pade's or Taylor's polynomials) and DOP853 with its published coefficients,
then NumPy's eigenvalues of the transition matrix; of the link the transition matrix alone is asked, in which the weakest multipliers are
lost. Each runs at the cheapest of its settings that meets the tolerance against a common reference, its compilation left out; CPU time of
one thread, the least of several runs, all in one process. `fl.periodic_lqr` on random systems is timed beside them, without a peer.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python studies/compiled_peers.py [--size small] [--only GROUP ...] [--out DIR]
"""

import ctypes
import json
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import lru_cache, partial
from importlib.util import find_spec
from math import factorial
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from outside.scipy_ode import derive_state_matrix
from scipy.integrate._ivp import dop853_coefficients as dop
from scipy.optimize import linear_sum_assignment
from shared.running import least_time, run_study

import flexlin as fl
from flexlin.linearization.free import ParametricLoop, parametric_loop

NUMBA = find_spec("numba") is not None
TOL, FAMILY_TOL = 1e-9, 1e-8
"""Of exponents, relative to those above 1; of a family's, as charts have it."""
TARGETS = {"4 states": 15.0, "8 states": 12.0, "chain, 20 states": 8.0, "link, 1 mode": 1.0, "link, 3 modes": 0.7,
           "link, 6 modes": 0.2, "family": 1.5}  # fmt: skip
"""Times its peer's time that flexlin may take: Magnus' for plain functions, DOP853's for the link and the family."""
OWN, KINDS = "flexlin", ("Magnus 6", "DOP853")
STEPS = tuple(round(2 ** (k / 4)) for k in range(12, 49))
"""Of equal length a period: each setting is a fifth finer than the one before."""
GUESSES = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)
"""Tolerances of DOP853 with steps of its own choice."""
FINEST, STEPS_OF_VALUES = 6000, (12, 16, 20, 24, 32, 48, 64, 96, 128, 192, 256, 384)
"""Steps of the reference; steps that are tried for a whole family."""
LOADED: list[Any] = []
"""Functions of loaded libraries, which have to outlive the code that calls them."""

Array = np.ndarray
Transition = Callable[..., Array]


@dataclass(frozen=True)
class Row:
    """One program on one system at its cheapest setting; reached: whether it met the tolerance."""

    group: str
    case: str
    program: str
    setting: str
    error: float
    milliseconds: float
    reached: bool


@dataclass(frozen=True)
class Problem:
    """A system made anew by `make` for flexlin; its peers' transition matrices of one period by name and setting.

    What is asked of the peers: `answer` of their transition matrix, whose `error` against that of the `exact` one is to meet the tolerance.
    """

    group: str
    case: str
    make: Callable[[], fl.PeriodicSystem]
    period: float
    peers: dict[str, dict[str, Callable[[], Array]]]
    exact: Array
    answer: Callable[[Array], Array]
    error: Callable[[Array, Array], float]


def exponents_of(P: Array, period: float) -> Array:
    """Of a transition matrix of one period, or of many; none where it overflowed."""
    if not np.isfinite(P).all():
        return np.full(P.shape[:-1], np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(np.linalg.eigvals(P).astype(complex)) / period


def distance(found: Array, exact: Array, period: float) -> float:
    """The largest distance of paired exponents, modulo 2 pi i / T, relative to exponents above 1; infinite where steps were too coarse."""
    if not np.isfinite(found).all():
        return float("inf")
    apart = found[:, None] - exact
    apart = apart.real + 1j * (apart.imag - np.round(apart.imag * period / (2 * np.pi)) * 2 * np.pi / period)
    cost = np.abs(apart) / np.maximum(1.0, np.abs(exact))
    return float(cost[linear_sum_assignment(cost)].max())


# --- the peers -----------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=64)
def operations(n: int, second_order: bool = False) -> tuple[Callable[..., None], Callable[..., None]]:
    """(product of n x n matrices, product A X) for a size known when they are compiled; A = [0 c I; *] where of second order."""
    import numba

    half, first = n // 2, n // 2 if second_order else 0

    @numba.njit(fastmath=True)
    def multiply(A, X, out):  # type: ignore[no-untyped-def]
        for i in range(n):
            for j in range(n):
                out[i, j] = A[i, 0] * X[0, j]
            for k in range(1, n):
                for j in range(n):
                    out[i, j] += A[i, k] * X[k, j]

    @numba.njit(fastmath=True)
    def rate(A, X, out):  # type: ignore[no-untyped-def]
        for i in range(first):
            for j in range(n):
                out[i, j] = A[i, half + i] * X[half + i, j]
        for i in range(first, n):
            for j in range(n):
                out[i, j] = A[i, 0] * X[0, j]
            for k in range(1, n):
                for j in range(n):
                    out[i, j] += A[i, k] * X[k, j]

    return multiply, rate


def compile_dop853(n: int, fill: Callable[..., None], second_order: bool = False) -> Transition:
    """(T, steps, tol, *data of fill) -> X(T) of X' = A X, X(0) = I: `steps` equal steps, or of its own choice to tol where that is not 0.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I (1993), II.5, II.10; coefficients as SciPy has them.
    """
    import numba

    rate, size, stages = operations(n, second_order)[1], n * n, len(dop.B)
    names = {"fill": fill, "rate": rate, "n": n, "size": size}
    exec(write_step(stages), names)  # every coefficient is a number that the compiler knows
    step, miss = (numba.njit(fastmath=True)(names[name]) for name in ("step", "miss"))

    @numba.njit(fastmath=True)
    def transition(T, steps, tol, a, b, c):  # type: ignore[no-untyped-def]
        X, Y, K, A = np.eye(n).ravel(), np.empty(size), np.empty((stages, size)), np.empty((n, n))
        t, h = 0.0, T / steps
        fill(t, a, b, c, A)
        rate(A, X.reshape(n, n), K[0].reshape(n, n))
        refused = False
        end = T * (1 - 1e-14) if tol > 0 else T - 0.5 * h
        while t < end:
            h = min(h, T - t) if tol > 0 else h
            step(t, h, X, K, A, Y, a, b, c)
            grow = 1.0
            if tol > 0:
                error = miss(X, Y, K, h, tol)
                grow = 10.0 if error == 0.0 else max(0.2, min(10.0, 0.9 * error**-0.125))
                if error >= 1.0:
                    h, refused = h * grow, True
                    continue
                grow = min(1.0, grow) if refused else grow
            t, h, refused = t + h, h * grow, False
            rate(A, Y.reshape(n, n), K[0].reshape(n, n))  # the last stage stood at the end of the step
            X, Y = Y, X
        return X.reshape(n, n).copy()

    return transition


def write_step(stages: int) -> str:
    """One step, its first rate in K[0], and how far it is off in units of tol, with the coefficients as literals."""

    def sum_of(weights: Array) -> str:
        return " + ".join(f"{float(w)!r} * K[{j}, i]" for j, w in enumerate(weights) if w)

    lines = ["def step(t, h, X, K, A, Y, a, b, c):"]
    for k in range(1, stages):
        lines += [" for i in range(size):", f"  Y[i] = X[i] + h * ({sum_of(dop.A[k, :k])})"]
        if dop.C[k] != dop.C[k - 1]:
            lines.append(f" fill(t + {float(dop.C[k])!r} * h, a, b, c, A)")
        lines.append(f" rate(A, Y.reshape(n, n), K[{k}].reshape(n, n))")
    lines += [" for i in range(size):", f"  Y[i] = X[i] + h * ({sum_of(dop.B)})"]
    lines += ["def miss(X, Y, K, h, tol):", " large, small = 0.0, 0.0", " for i in range(size):"]
    lines += ["  scale = tol * (1.0 + max(abs(X[i]), abs(Y[i])))"]
    lines += [f"  large += (({sum_of(dop.E5[:stages])}) / scale) ** 2"]
    lines += [f"  small += (({sum_of(dop.E3[:stages])}) / scale) ** 2"]
    lines += [" total = large + 0.01 * small", " return abs(h) * large / (total * size) ** 0.5 if total > 0.0 else 0.0"]
    return "\n".join(lines) + "\n"


def compile_magnus(n: int, fill: Callable[..., None], pade: bool) -> Transition:
    """(T, steps, *data of fill) -> X(T) by the exponential of Magnus' series of order 6 on equal steps, Gauss' three nodes in each.

    Source: Blanes, Casas, Oteo, Ros, The Magnus expansion and some of its applications, Physics Reports 470 (2009), Eq. (259);
    degrees by the norm of a step's exponent as in Higham, Functions of Matrices (2008), ch. 10.
    """
    import numba

    multiply = operations(n)[0]
    inverse_factorials = np.array([1.0 / factorial(k) for k in range(16)])
    pade_table = np.array([[120.0, 60.0, 12.0, 1.0, 0, 0, 0, 0], [30240.0, 15120.0, 3360.0, 420.0, 30.0, 1.0, 0, 0],
                           [17297280.0, 8648640.0, 1995840.0, 277200.0, 25200.0, 1512.0, 56.0, 1.0]])  # fmt: skip
    root = np.sqrt(15.0)

    @numba.njit(fastmath=True)
    def commutator(A, B, work, out):  # type: ignore[no-untyped-def]
        multiply(A, B, out)
        multiply(B, A, work)
        for i in range(n):
            for j in range(n):
                out[i, j] -= work[i, j]

    @numba.njit(fastmath=True)
    def one_norm(A):  # type: ignore[no-untyped-def]
        most = 0.0
        for j in range(n):
            total = 0.0
            for i in range(n):
                total += abs(A[i, j])
            most = max(most, total)
        return most

    @numba.njit(fastmath=True)
    def solve(A, B):  # type: ignore[no-untyped-def]
        for k in range(n):
            p = k
            for i in range(k + 1, n):
                if abs(A[i, k]) > abs(A[p, k]):
                    p = i
            if p != k:
                for j in range(n):
                    A[k, j], A[p, j] = A[p, j], A[k, j]
                    B[k, j], B[p, j] = B[p, j], B[k, j]
            for i in range(k + 1, n):
                f = A[i, k] / A[k, k]
                for j in range(k + 1, n):
                    A[i, j] -= f * A[k, j]
                for j in range(n):
                    B[i, j] -= f * B[k, j]
        for k in range(n - 1, -1, -1):
            for i in range(k + 1, n):
                for j in range(n):
                    B[k, j] -= A[k, i] * B[i, j]
            for j in range(n):
                B[k, j] /= A[k, k]

    @numba.njit(fastmath=True)
    def pade_exponential(S, W, E):  # type: ignore[no-untyped-def]
        norm, squarings = one_norm(S), 0
        while norm > 0.95:
            norm *= 0.5
            squarings += 1
        c = 0 if norm < 1.5e-2 else 1 if norm < 0.25 else 2
        scale = 0.5**squarings
        A, A2, P, U, V = W[0], W[1], W[2], W[3], W[4]
        for i in range(n):
            for j in range(n):
                A[i, j] = scale * S[i, j]
                P[i, j] = 1.0 if i == j else 0.0
                U[i, j] = pade_table[c, 1] * P[i, j]
                V[i, j] = pade_table[c, 0] * P[i, j]
        multiply(A, A, A2)
        for k in range(1, c + 2):
            if k == 1:
                P[:] = A2
            else:
                multiply(A2, P, E)
                P[:] = E
            for i in range(n):
                for j in range(n):
                    U[i, j] += pade_table[c, 2 * k + 1] * P[i, j]
                    V[i, j] += pade_table[c, 2 * k] * P[i, j]
        multiply(A, U, A2)
        for i in range(n):
            for j in range(n):
                E[i, j] = V[i, j] + A2[i, j]
                P[i, j] = V[i, j] - A2[i, j]
        solve(P, E)
        for _ in range(squarings):
            multiply(E, E, A)
            E[:] = A

    @numba.njit(fastmath=True)
    def taylor_exponential(S, W, E):  # type: ignore[no-untyped-def]
        norm, squarings = one_norm(S), 0
        while norm > 0.6:
            norm *= 0.5
            squarings += 1
        blocks = 2 if norm < 1.5e-2 else 3 if norm < 0.13 else 4  # of three powers each: degrees 6, 9, 12
        scale = 0.5**squarings
        A, A2, A3, H = W[0], W[1], W[2], W[3]
        for i in range(n):
            for j in range(n):
                A[i, j] = scale * S[i, j]
        multiply(A, A, A2)
        multiply(A, A2, A3)
        last = 3 * blocks
        for i in range(n):
            for j in range(n):
                H[i, j] = inverse_factorials[last] * A3[i, j]
        for b in range(blocks - 1, -1, -1):
            for i in range(n):
                for j in range(n):
                    H[i, j] += inverse_factorials[3 * b + 1] * A[i, j] + inverse_factorials[3 * b + 2] * A2[i, j]
                H[i, i] += inverse_factorials[3 * b]
            if b > 0:
                multiply(A3, H, E)
                H[:] = E
        E[:] = H
        for _ in range(squarings):
            multiply(E, E, A)
            E[:] = A

    exponential = pade_exponential if pade else taylor_exponential

    @numba.njit(fastmath=True)
    def transition(T, steps, a, b, c):  # type: ignore[no-untyped-def]
        h = T / steps
        X, Y, E, W = np.eye(n), np.empty((n, n)), np.empty((n, n)), np.empty((9, n, n))
        first, third, C1, C2 = W[0], W[1], W[2], W[3]
        a1, a2, a3, left, S = W[4], W[5], W[6], W[7], W[8]
        for k in range(steps):
            t = k * h
            fill(t + (0.5 - root / 10) * h, a, b, c, first)
            fill(t + 0.5 * h, a, b, c, a1)
            fill(t + (0.5 + root / 10) * h, a, b, c, third)
            for i in range(n):
                for j in range(n):
                    low, middle, high = first[i, j], a1[i, j], third[i, j]
                    a1[i, j] = h * middle
                    a2[i, j] = root * h / 3 * (high - low)
                    a3[i, j] = 10 * h / 3 * (high - 2 * middle + low)
            commutator(a1, a2, Y, C1)
            for i in range(n):
                for j in range(n):
                    left[i, j] = 2 * a3[i, j] + C1[i, j]
            commutator(a1, left, Y, C2)
            for i in range(n):
                for j in range(n):
                    left[i, j] = -20 * a1[i, j] - a3[i, j] + C1[i, j]
                    C2[i, j] = a2[i, j] - C2[i, j] / 60
            commutator(left, C2, Y, S)
            for i in range(n):
                for j in range(n):
                    S[i, j] = a1[i, j] + a3[i, j] / 12 + S[i, j] / 240
            exponential(S, W, E)
            multiply(E, X, Y)
            X, Y = Y, X
        return X

    return transition


@lru_cache(maxsize=1)
def fill_two_harmonics() -> Callable[..., None]:
    """A0 + A1 cos t + A2 sin 2t."""
    import numba

    @numba.njit(fastmath=True)
    def fill(t, A0, A1, A2, out):  # type: ignore[no-untyped-def]
        c, s = np.cos(t), np.sin(2 * t)
        for i in range(out.shape[0]):
            for j in range(out.shape[1]):
                out[i, j] = A0[i, j] + A1[i, j] * c + A2[i, j] * s

    return fill


@lru_cache(maxsize=8)
def plain_peers(n: int) -> dict[str, Transition]:
    """The compiled peers for A0 + A1 cos t + A2 sin 2t with n states."""
    fill = fill_two_harmonics()
    return {
        "Magnus 6, Pade": compile_magnus(n, fill, True),
        "Magnus 6, Taylor": compile_magnus(n, fill, False),
        "DOP853": compile_dop853(n, fill),
    }


def settings_of(name: str, transition: Transition, T: float, data: tuple[Any, ...]) -> Iterator[tuple[str, Any]]:
    """Families of settings, each from coarse to fine."""
    if not name.startswith("DOP853"):
        yield name, {f"{k} steps": partial(transition, T, k, *data) for k in STEPS}
        return
    yield name + ", equal steps", {f"{k} steps": partial(transition, T, k, 0.0, *data) for k in STEPS}
    yield name, {f"tol {tol:.0e}": partial(transition, T, 32, tol, *data) for tol in GUESSES}


# --- the systems ---------------------------------------------------------------------------------------------------------


def two_harmonics(n: int, seed: int) -> tuple[Array, Array, Array]:
    """Random A0, A1, A2 of spectral radius about 1."""
    rng = np.random.default_rng([n, seed])
    A0, A1, A2 = rng.standard_normal((3, n, n)) / np.sqrt(n)
    return A0 - 0.5 * np.eye(n), A1, A2


def chain(masses: int, seed: int) -> tuple[Array, Array, Array]:
    """Masses of about 1 kg between springs of about 10 N/m and dampers, the springs excited by a fifth at their rate 1 and 2."""
    rng = np.random.default_rng([masses, seed])
    k, first, second = rng.uniform(8, 12, masses + 1), rng.uniform(-2, 2, masses + 1), rng.uniform(-2, 2, masses + 1)
    m = rng.uniform(0.8, 1.25, masses)

    def stiffness(k: Array) -> Array:
        return (np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)) / m[:, None]

    zero, one = np.zeros((masses, masses)), np.eye(masses)
    A0 = np.block([[zero, one], [-stiffness(k), -0.01 * stiffness(k) - 0.05 * one]])
    A1, A2 = (np.block([[zero, zero], [-stiffness(each), zero]]) for each in (first, second))
    return A0, A1, A2


def plain_problem(group: str, case: str, data: tuple[Array, Array, Array]) -> Problem:
    """flexlin gets a plain function of an array of times, its peers a compiled one."""
    A0, A1, A2 = data
    T = 2 * np.pi

    def A(t: Array) -> Array:
        return A0 + A1 * np.cos(t)[:, None, None] + A2 * np.sin(2 * t)[:, None, None]

    compiled = plain_peers(len(A0))
    peers = dict(one for name, call in compiled.items() for one in settings_of(name, call, T, data))
    exact = compiled["DOP853"](T, FINEST, 0.0, *data)
    answer = partial(exponents_of, period=T)
    return Problem(group, case, lambda: fl.PeriodicSystem(A, T), T, peers, exact, answer, partial(distance, period=T))


def link_problem(modes: int) -> Problem:
    """The single link with its PD loop; of the peers the transition matrix is asked, in which weak multipliers are lost.

    Time in units of the period for the peers, as CasADi's code has it.
    """
    loop = parametric_loop(
        fl.load_scene("single-link", {"links.0.modes": modes, "designs": []}), ["effects.payload.mass"]
    )
    lin, n = loop.linearization, loop.states
    series, (fill, data) = fourier_series(loop), compiled_coefficients(loop)
    by_c = compile_dop853(n, fill, True)
    by_series = compile_dop853(n, fill_series(n, len(series) // 2), True)
    peers: dict[str, Any] = {}
    for name, transition, given in (
        ("DOP853, CasADi's C", by_c, data),
        ("DOP853, Fourier series", by_series, (series, np.zeros(len(series)), lin.period)),
    ):
        peers |= dict(settings_of(name, transition, 1.0, given))

    def make() -> fl.PeriodicSystem:
        known = lin.periodic_system()
        return fl.PeriodicSystem(
            known.A, known.period, known.B, known.breaks, known.second_order, known.features, known.complete
        )

    group = f"link, {modes} mode{'s' * (modes > 1)}"
    exact = by_c(1.0, FINEST, 0.0, *data)
    return Problem(group, "PD loop", make, lin.period, peers, exact, lambda P: P, relative_error)


def relative_error(P: Array, exact: Array) -> float:
    """The largest error of an entry, relative to the largest entry."""
    return float(np.abs(P - exact).max() / np.abs(exact).max()) if np.isfinite(P).all() else float("inf")


def compiled_coefficients(loop: ParametricLoop) -> tuple[Callable[..., None], tuple[Array, ...]]:
    """T A at a phase by C that CasADi writes, and the data that it asks for."""
    import numba

    function, n = derive_state_matrix(loop), loop.states
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise SystemExit("the link's peers need a C compiler")
    with tempfile.TemporaryDirectory() as folder:
        code = ca.CodeGenerator("peer.c")
        code.add(function)
        source, library = code.generate(f"{folder}/"), str(Path(folder) / "peer.so")
        subprocess.run([compiler, "-O3", "-march=native", "-w", "-shared", "-fPIC", source, "-o", library], check=True)
        call = getattr(ctypes.CDLL(library), function.name())
    call.argtypes, call.restype = [ctypes.c_size_t] * 4 + [ctypes.c_int], ctypes.c_int
    p, numbers = np.array(loop.nominal), np.zeros(1 + n * n + function.sz_w())  # phase, columns of A, CasADi's own
    size = numbers.itemsize
    places = np.array([numbers.ctypes.data, p.ctypes.data, numbers.ctypes.data + size], dtype=np.int64)

    @numba.njit
    def fill(t, p, numbers, places, out):  # type: ignore[no-untyped-def]
        numbers[0] = t
        given = places.ctypes.data
        call(given, given + 2 * size, 0, places[2] + n * n * size, 0)
        for i in range(n):
            for j in range(n):
                out[i, j] = numbers[1 + n * j + i]

    return fill, (p, numbers, places)


def fourier_series(loop: ParametricLoop) -> Array:
    """Coefficients (1 + 2 H, n / 2, n) of the lower half of T A: mean, cosines, sines, as many as rounding leaves."""
    N = 256
    function, n = derive_state_matrix(loop), loop.states
    values = np.array(function.map(N)(np.arange(N)[None] / N, np.repeat(loop.nominal[:, None], N, axis=1)))
    found = np.fft.rfft(values.reshape(n, N, n).transpose(1, 0, 2)[:, n // 2 :], axis=0) / N
    size = np.abs(found).max(axis=(1, 2))
    H = int(np.flatnonzero(size > 1e-14 * size.max()).max())
    return np.concatenate([found[:1].real, 2 * found[1 : H + 1].real, -2 * found[1 : H + 1].imag])


def fill_series(n: int, harmonics: int) -> Callable[..., None]:
    """T A at a phase from its series."""
    import numba

    half = n // 2

    @numba.njit(fastmath=True)
    def fill(t, series, waves, period, out):  # type: ignore[no-untyped-def]
        c, s = np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)
        waves[0], x, y = 1.0, 1.0, 0.0
        for k in range(1, harmonics + 1):
            x, y = x * c - y * s, x * s + y * c
            waves[k], waves[harmonics + k] = x, y
        for i in range(half):
            out[i, half + i] = period
            for j in range(n):
                out[half + i, j] = series[0, i, j]
        for k in range(1, 2 * harmonics + 1):
            w = waves[k]
            for i in range(half):
                for j in range(n):
                    out[half + i, j] += w * series[k, i, j]

    return fill


# --- the race ------------------------------------------------------------------------------------------------------------


def race(problem: Problem, repeats: int, tol: float = TOL) -> list[Row]:
    """flexlin, and each peer at the cheapest of its settings."""
    T = problem.period
    truth = fl.floquet(problem.make(), 0.01 * tol).exponents
    systems = [problem.make() for _ in range(3 * repeats)]
    found, time = least_time(lambda: fl.floquet(systems.pop(), tol), 3 * repeats)
    error = distance(found.exponents, truth, T)
    if problem.error is not relative_error:  # the peers' own truth, too
        error = max(error, distance(found.exponents, exponents_of(problem.exact, T), T))
    rows = [Row(problem.group, problem.case, OWN, f"states {found.error:.0e}", error, 1e3 * time, error <= tol)]
    rows += [cheapest(problem, name, settings, repeats, tol) for name, settings in problem.peers.items()]
    return rows


def cheapest(problem: Problem, name: str, settings: dict[str, Callable[[], Array]], repeats: int, tol: float) -> Row:
    """The first setting, from coarse to fine, that meets the tolerance."""
    exact = problem.answer(problem.exact)
    setting, error = "", float("inf")
    for setting in settings:
        error = problem.error(problem.answer(settings[setting]()), exact)
        if error <= tol:
            break
    time = least_time(lambda: problem.answer(settings[setting]()), 5 * repeats)[1]
    return Row(problem.group, problem.case, name, setting, error, 1e3 * time, error <= tol)


def coupled_oscillators() -> tuple[Array, Array, Array]:
    """Two damped oscillators, A0 + p A1 cos t + p A2 sin 2t, that p makes unstable between 0 and 3."""
    K, first, second = np.array([[1.3, -0.3], [-0.3, 2.2]]), np.array([[0.5, 0.1], [0.1, 0.4]]), np.diag([0.2, 0.3])
    zero, one = np.zeros((2, 2)), np.eye(2)
    lower = (np.block([[zero, zero], [-S, zero]]) for S in (first, second))
    return np.block([[zero, one], [-K, -0.2 * one]]), *lower  # type: ignore[return-value]


def family(values: int, repeats: int) -> list[Row]:
    """A family of 4 states at many values of p in [0, 3]: time of all of them."""
    import numba

    A0, A1, A2 = coupled_oscillators()
    T, points = 2 * np.pi, np.linspace(0.0, 3.0, values)
    one = compile_dop853(4, fill_two_harmonics())

    @numba.njit(fastmath=True)
    def all_of(points, steps, tol):  # type: ignore[no-untyped-def]
        out = np.empty((len(points), 4, 4))
        for i in range(len(points)):
            out[i] = one(T, steps, tol, A0, points[i] * A1, points[i] * A2)
        return out

    probe = np.linspace(0, values - 1, min(values, 60)).astype(int)
    exact = [exponents_of(one(T, FINEST, 0.0, A0, p * A1, p * A2), T) for p in points[probe]]

    def worst(found: Array) -> float:
        return max(distance(found[i], e, T) for i, e in zip(probe, exact, strict=True))

    case, group = f"{values} values", "family"
    rows = []
    settings = {
        **{f"{k} equal steps": partial(all_of, points, k, 0.0) for k in STEPS_OF_VALUES},
        **{f"tol {tol:.0e}": partial(all_of, points, 32, tol) for tol in GUESSES},
    }
    for kind in ("equal", "tol"):
        for name, call in settings.items():
            if kind in name and (error := worst(exponents_of(call(), T))) <= FAMILY_TOL:
                time = least_time(lambda call=call: exponents_of(call(), T), repeats)[1]
                rows.append(
                    Row(group, case, f"DOP853, {kind} steps".replace("tol", "own"), name, error, 1e3 * time, True)
                )
                break
    if hasattr(fl, "PeriodicFamily"):
        t, p = ca.SX.sym("t"), ca.SX.sym("p")
        A = ca.DM(A0) + p * ca.cos(t) * ca.DM(A1) + p * ca.sin(2 * t) * ca.DM(A2)
        made = fl.PeriodicFamily(A, t, [p], T)
        fl.sweep(made, {"p": points[:: max(1, values // 64)]}, FAMILY_TOL)
        found, time = least_time(lambda: fl.sweep(made, {"p": points}, FAMILY_TOL), repeats)
        error = worst(np.asarray(found.exponents.values))
        rows.insert(0, Row(group, case, OWN, "fl.sweep", error, 1e3 * time, error <= FAMILY_TOL))
    else:
        print("family: flexlin has no fl.PeriodicFamily yet; its peers alone")
    return rows


def lqr(states: int, repeats: int) -> Row:
    """`fl.periodic_lqr` of a random system with two harmonics and three inputs, unit weights: its time alone."""
    rng = np.random.default_rng(states)
    A0, A1, A2 = rng.standard_normal((3, states, states)) / np.sqrt(states)
    B = rng.standard_normal((states, 3))

    def make() -> fl.PeriodicSystem:
        def A(t: Array) -> Array:
            return A0 + A1 * np.cos(t)[:, None, None] + A2 * np.sin(2 * t)[:, None, None]

        return fl.PeriodicSystem(A, 2 * np.pi, B)

    found, time = least_time(lambda: fl.periodic_lqr(make(), np.eye(states), np.eye(3), tol=TOL), repeats)
    return Row("periodic LQR", f"{states} states", OWN, "", float(found.error), 1e3 * time, bool(found.error <= TOL))


def ratios_of(rows: list[Row]) -> dict[str, dict[str, float]]:
    """flexlin's time over that of the fastest setting of each kind of peer that met the tolerance: the median of a group's systems."""
    found: dict[str, dict[str, list[float]]] = {}
    for own in (row for row in rows if row.program == OWN):
        for kind in KINDS:
            times = [row.milliseconds for row in rows if is_rival(row, own, kind)]
            if times:
                found.setdefault(own.group, {}).setdefault(kind, []).append(own.milliseconds / min(times))
    return {group: {kind: float(np.median(r)) for kind, r in kinds.items()} for group, kinds in found.items()}


def is_rival(row: Row, own: Row, kind: str) -> bool:
    """Whether a peer of this kind answered the same question."""
    return (row.group, row.case) == (own.group, own.case) and row.program.startswith(kind) and row.reached


def draw(ratios: dict[str, dict[str, float]], path: Path) -> None:
    """flexlin's time over that of each kind of peer, and what is aimed at."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 3), layout="constrained")
    axes = figure.subplots()
    for k, kind in enumerate(KINDS):
        places = [place + 0.35 * (k - 0.5) for place, group in enumerate(ratios) if kind in ratios[group]]
        times = [found[kind] for found in ratios.values() if kind in found]
        axes.barh(places, times, 0.3, color=f"C{k}", label=f"over {kind}")
    axes.plot(
        [TARGETS[group] for group in ratios], range(len(ratios)), "kD", markersize=5, markeredgecolor="w", label="aim"
    )
    axes.set_yticks(range(len(ratios)), ratios)
    axes.invert_yaxis()
    axes.set(xscale="log", xlabel="ratio of CPU times", title="All exponents with errors, over compiled peers")
    figure.legend(loc="outside right center", frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path)


def problems(full: bool, only: list[str]) -> Iterator[Problem]:
    """The single systems, one group after the other."""
    seeds = range(5 if full else 1)
    for n in (4, 8) if full else (4,):
        for seed in seeds if f"{n} states" in only else ():
            yield plain_problem(f"{n} states", f"seed {seed}", two_harmonics(n, seed))
    for seed in range(3) if full and "chain, 20 states" in only else ():
        yield plain_problem("chain, 20 states", f"seed {seed}", chain(10, seed))
    for modes in (1, 3, 6) if full else (1,):
        if f"link, {modes} mode{'s' * (modes > 1)}" in only:
            yield link_problem(modes)


def main(size: str = "full", out: str | Path = "out/studies", only: list[str] | None = None) -> dict[str, Any]:
    """Run the race, print it, write compiled_peers.json; returns rows, and ratios by group and kind of peer."""
    full, chosen = size == "full", only or [*TARGETS, "periodic LQR"]
    rows: list[Row] = []
    if NUMBA:
        for problem in problems(full, chosen):
            rows += shown(race(problem, 9 if full else 2))
        if "family" in chosen:
            rows += shown(family(8000 if full else 64, 3 if full else 1))
    else:
        print('numba is not installed: no peers; pip install "flexlin[peers]" brings it')
    if "periodic LQR" in chosen:
        for states in (12, 24, 28, 40) if full else (6,):
            rows += shown([lqr(states, 3 if full else 1)])
    ratios = ratios_of(rows)
    for group, kinds in ratios.items():
        text = "".join(f"{ratio:8.2f} times {kind}" for kind, ratio in kinds.items())
        print(f"{group:18s}{text}; aim {TARGETS[group]:g}")
    if ratios:
        draw(ratios, Path(out) / "compiled_peers.svg")
    data = {"rows": [asdict(row) for row in rows], "ratios": ratios, "targets": TARGETS}
    (Path(out) / "compiled_peers.json").write_text(json.dumps(data, indent=1))
    return data


def shown(rows: list[Row]) -> list[Row]:
    """The same rows, printed."""
    for row in rows:
        note = "" if row.reached else "  (not reached)"
        print(
            f"{row.group:18s} {row.case:10s} {row.program:38s} {row.setting:14s} {row.error:8.1e}"
            f" {row.milliseconds:10.3f} ms{note}",
            flush=True,
        )
    return rows


if __name__ == "__main__":
    run_study(
        main,
        "one system of a kind, few values",
        only={"nargs": "+", "choices": [*TARGETS, "periodic LQR"], "help": "some groups alone"},
    )
