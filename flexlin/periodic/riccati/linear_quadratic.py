"""The linear-quadratic problem of a system with time-varying coefficients: its gain, its solution, and what keeps it from one."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, at_times, real_array
from flexlin.errors import ArgumentError, NotDetectable, NotStabilizable, NumericalError
from flexlin.periodic.coefficient_series.sampling import stratified
from flexlin.periodic.coefficients import PROBES, Constant, MatrixFunction
from flexlin.periodic.floquet.modes import find_coinciding, floquet_modes
from flexlin.periodic.interpolation import ChebyshevPanels, FourierSeries, divided
from flexlin.periodic.riccati.scattering import balance_states
from flexlin.periodic.system import PeriodicSystem, as_port, dual_system, input_of
from flexlin.precision import CUBE_ROOT_EPS, EPS, ROOT_EPS, SLIGHT, TINY
from flexlin.summary import immutable

WEIGHT_TIMES = 64
"""Times of a period at which the weights are checked, and on which X is begun."""
PANEL_HARMONICS = 3.0
"""Harmonics of a Fourier series for each panel of degree NODES - 1 that replaces it."""


@dataclass(frozen=True)
class LinearQuadratic:
    """Minimise the integral of x' Q x + 2 x' N u + u' R u along x' = A x + B u.

    With the costate l = X x the optimum obeys a Hamiltonian system, where Ar = A - B R^-1 N', Qr = Q - N R^-1 N':

        [x'; l'] = [[Ar, -B R^-1 B'], [-Qr, -Ar']] [x; l],   u = -K x,   K = R^-1 (B' X + N')

    Each coefficient is a function (N,) -> (N, rows, columns).
    """

    A: MatrixFunction
    B: MatrixFunction
    Q: MatrixFunction
    R: MatrixFunction
    N: MatrixFunction

    def reduced(self, t: Array) -> tuple[Array, Array, Array]:
        """Return Ar, B R^-1 B', Qr: the problem without its cross term."""
        A, G, Q = self.factored(t)
        return A, np.broadcast_to(G @ np.swapaxes(G, 1, 2), A.shape), Q

    def factored(self, t: Array) -> tuple[Array, Array, Array]:
        """Return Ar, G with G G' = B R^-1 B', Qr; G once where it is constant."""
        A, B, Q = self.A(t), take_once(self.B(t)), self.Q(t)
        root = np.linalg.cholesky(take_once(self.R(t)))
        G = np.swapaxes(np.linalg.solve(root, np.swapaxes(B, 1, 2)), 1, 2)
        cross = take_once(self.N(t))
        if not cross.any():
            return A, G, Q
        half = np.swapaxes(np.linalg.solve(root, np.swapaxes(cross, 1, 2)), 1, 2)
        return A - G @ np.swapaxes(half, 1, 2), G, Q - half @ np.swapaxes(half, 1, 2)

    def describe_sizes(self, t: Array) -> str:
        """How large its coefficients are at times (N,)."""
        sizes = [float(np.abs(part).max()) for part in self.reduced(t)]
        return "|A| = {:.2g}, |B R^-1 B'| = {:.2g}, |Q| = {:.2g} (less what N takes)".format(*sizes)

    def ease(self, factor: float) -> "LinearQuadratic":
        """The problem with a larger R."""
        R = self.R
        eased = Constant(factor * R.value) if isinstance(R, Constant) else lambda t: factor * R(t)
        return replace(self, R=eased)

    def gain(self, t: Array, X: Array) -> Array:
        """Return K = R^-1 (B' X + N'), (N, m, n)."""
        return np.linalg.solve(self.R(t), np.swapaxes(self.B(t), 1, 2) @ X + np.swapaxes(self.N(t), 1, 2))


def take_once(values: Array) -> Array:
    """Return the one matrix of a coefficient that is constant (a broadcast array), so that work on it is done once."""
    return values[:1] if values.strides[0] == 0 else values


@checked
def linear_quadratic(
    system: PeriodicSystem,
    Q: MatrixFunction | ArrayLike,
    R: MatrixFunction | ArrayLike,
    N: MatrixFunction | ArrayLike | None = None,
) -> LinearQuadratic:
    """Pose the problem of a system with an input and check its weights at samples of the period.

    Parameters: Q (n, n), R (m, m), N (n, m): constants or functions (N,) -> (N, ., .); a number where one entry is all; N = None: no
    cross term.
    Returns: the problem; its weights are used as they are given.
    Raises: ArgumentError when the system has no input, a shape does not fit, a weight is not symmetric, R is not positive
    definite, or Q - N R^-1 N' is indefinite: each names the time and the eigenvalue.
    """
    B, n, m = input_of(system), system.n, system.m
    cross = np.zeros((n, m)) if N is None else N
    weights = [
        check_weight(name, value, shape, system.period)
        for name, value, shape in (("Q", Q, (n, n)), ("R", R, (m, m)), ("N", cross, (n, m)))
    ]
    problem = LinearQuadratic(system.A, B, *weights)
    check_weights(problem, system.period * np.arange(WEIGHT_TIMES) / WEIGHT_TIMES)
    return problem


def check_weights(problem: LinearQuadratic, t: Array) -> None:
    """Refuse weights of which R is not positive definite at all times, or Q - N R^-1 N' is indefinite."""
    check_definite("R", problem.R, t, strict=True)
    alone = isinstance(problem.N, Constant) and not problem.N.value.any()
    check_definite("Q" if alone else "Q - N R^-1 N'", lambda times: problem.factored(times)[2], t, strict=False)


def check_between(problem: LinearQuadratic, edges: Array) -> None:
    """The same inside each of several panels: a weight may lose its sign in a pulse between the samples."""
    if len(edges) > 2:
        check_weights(problem, (edges[:-1, None] + np.diff(edges)[:, None] * stratified(3)).ravel())


def check_weight(name: str, value: MatrixFunction | ArrayLike, shape: tuple[int, int], period: float) -> MatrixFunction:
    """Return a weight as a function of time, its shape and symmetry checked."""
    if shape == (1, 1) and np.ndim(value) == 0 and not callable(value):  # type: ignore[arg-type]
        value = np.reshape(real_array(name, value, ()), (1, 1))
    function = as_port(name, value, shape, period)
    if name != "N":
        samples = function(period * PROBES)
        asymmetry = np.abs(samples - np.swapaxes(samples, 1, 2)).max()
        if asymmetry > 1e-12 * np.abs(samples).max():
            raise ArgumentError(f"{name} is not symmetric", got=f"|{name} - {name}'| = {asymmetry:.3g}", expected="0")
    return function


def check_definite(name: str, weight: Callable[[Array], Array], t: Array, strict: bool) -> None:
    """Refuse a weight with an eigenvalue that is negative (or zero, when strict), naming it, its direction and time."""
    samples = take_once(weight(t))
    units = np.sqrt(np.abs(np.diagonal(samples, axis1=1, axis2=2)).max(axis=0)) if strict else np.ones(samples.shape[1])
    values = np.linalg.eigvalsh(samples / np.outer(*2 * [np.where(units > 0, units, 1.0)]))
    floor = 1e-13 * max(np.abs(values).max(), TINY)
    smallest = values[:, 0]
    worst = int(np.argmin(smallest))
    if smallest[worst] < -floor or (strict and smallest[worst] <= floor):
        least, directions = np.linalg.eigh(samples[worst])
        direction = np.array2string(directions[:, 0], precision=3, suppress_small=True)
        raise ArgumentError(
            f"{name} is {'not positive definite' if strict else 'indefinite'}",
            got=f"eigenvalue {least[0]:.6g} at t = {t[worst]:.6g} s in the direction {direction}",
            expected=f"eigenvalues {'> 0' if strict else '>= 0'}",
            todo=f"raise the weight of that direction in {name}",
        )


@immutable
class RiccatiSolution:
    """X(t) and the gain K(t) of a linear-quadratic problem, at any time, with the evidence that they are right.

    Times are wrapped into the period when `periodic`, and held inside [0, horizon] otherwise.

    Attributes
    ----------
    problem : LinearQuadratic
        The coefficients and weights.
    horizon : float
        Period or length of the horizon, in s.
    periodic : bool
        Whether X repeats.
    series : ChebyshevPanels or FourierSeries
        X between its nodes.
    error : float
        Bounds |X error| / max |X| over the horizon: what its residual amounts to, by the closed loop's Lyapunov equation.
    gain_error : float
        Bounds |K error| / max |K| likewise.
    method_error : float
        The part of `error` that is not rounding.
    entry_errors : array, shape (n, n)
        Bound on |X error| entry by entry, at all times.
    doublings : int
        How often the period was doubled.
    segments : int
        Nodes.
    status : str
        What to make of it.

    Examples
    --------
    >>> import flexlin as fl
    >>> from flexlin.periodic.riccati.riccati import periodic_riccati
    >>> solution = periodic_riccati(fl.PeriodicSystem([[1.0]], 1.0, B=[[1.0]]), [[1.0]], [[1.0]])
    >>> print(f"{solution.X(0.5).item():.8f} {solution.K([0.5, 0.7]).shape} {solution.status}")
    2.41421356 (2, 1, 1) converged
    """

    problem: LinearQuadratic
    horizon: float
    periodic: bool
    series: ChebyshevPanels | FourierSeries
    error: float
    gain_error: float
    method_error: float
    entry_errors: Array
    doublings: int
    segments: int
    status: str

    @property
    def edges(self) -> Array:
        """Times from 0 to the horizon between which polynomials follow X and the coefficients."""
        if isinstance(self.series, ChebyshevPanels):
            return self.series.edges
        return divided(self.series.edges, self.horizon * PANEL_HARMONICS / max(self.series.degree, 1))

    def X(self, t: ArrayLike) -> Array:
        """Return the cost matrix.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n, n) or (n, n)
            X(t), symmetric.
        """
        return at_times(lambda s: self.series(self._inside(s)), t)

    def K(self, t: ArrayLike) -> Array:
        """Return the gain K = R^-1 (B' X + N').

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, m, n) or (m, n)
            K(t).
        """
        return at_times(self._gain, t)

    def _gain(self, t: Array) -> Array:
        inside = self._inside(t)
        return self.problem.gain(inside, self.series(inside))

    def _inside(self, t: Array) -> Array:
        return np.mod(t, self.horizon) if self.periodic else np.clip(t, 0.0, np.nextafter(self.horizon, 0.0))


def bound_sizes(problem: LinearQuadratic, horizon: float) -> tuple[float, float]:
    """Return the sizes of H and G from which on a mode's coupling to B or Q cannot be distinguished from rounding.

    One mode of rate a needs X = 2 a / b for its share b of B R^-1 B', and dually 2 a / q of G for its share q of Q.
    """
    A, S, Q = problem.reduced(horizon * (np.arange(32) + 0.5) / 32)
    tiny = 1e-100  # only growth without end reaches its inverse
    rate = np.linalg.norm(A, 2, axis=(1, 2)).max() + 1 / horizon
    S_size, Q_size = np.abs(S).max() + tiny, np.abs(Q).max() + tiny
    of_H, of_G = max(rate / S_size, Q_size / rate), max(rate / Q_size, S_size / rate)
    return min(1e13 * of_H, 1 / tiny), min(1e13 * of_G, 1 / tiny)


def name_blocked_mode(unreached: bool, problem: LinearQuadratic, edges: Array) -> NumericalError:
    """Name the mode that no input reaches (or that no weight sees): its exponent's real part and its direction.

    Parameters: edges: times from 0 to the period between which the coefficients are smooth.
    """
    T = float(edges[-1])
    loop = PeriodicSystem(lambda t: problem.reduced(t)[0], T, breaks=edges[:-1].tolist(), complete=True)
    growth, share, rounding, vector = find_blocked(unreached, problem, dual_system(loop) if unreached else loop)
    got = f"real part of its exponent about {growth:.3g}/s, direction {np.array2string(vector, precision=3)} at t = 0"
    todo = "bring states, inputs and weights to like sizes, ask for a larger tol, or leave out the fastest modes"
    if share > SLIGHT:  # its square leaves ten digits
        return NumericalError(
            "the problem's coefficients lie too far apart to be computed with",
            got=problem.describe_sizes(edges[:-1]),
            todo=todo,
        )
    if share > rounding:
        kind, what = (NotStabilizable, "reached by the input") if unreached else (NotDetectable, "seen by the weight Q")
        got += f"; its share is {share:.1g} in balanced units, and what it needs grows as the share's inverse square"
        return kind(f"a mode is {what} too weakly to be computed with", got=got, todo=todo)
    return refuse_mode(unreached, got)


def refuse_mode(unreached: bool, got: str, when: str = "", else_do: str = "") -> NumericalError:
    """The error of a mode that does not decay and that no input reaches, or that no weight sees."""
    lasting = "a mode that does not decay"
    if unreached:
        todo = f"add an actuator that moves it{else_do}"
        return NotStabilizable(f"{lasting} cannot be reached by the input{when}", got=got, todo=todo)
    todo = f"give the mode's states weight in Q{else_do}"
    return NotDetectable(f"{lasting} is not seen by the weight Q{when}", got=got, todo=todo)


def find_blocked(unreached: bool, problem: LinearQuadratic, loop: PeriodicSystem) -> tuple[float, float, float, Array]:
    """Growth in 1/s of the mode that does not decay with the least share in the weight (or in the input), the share, how much of a share
    rounding makes, and its direction at t = 0.

        max over t of |Q p| / (|Q| |p|)   (or of |S q| / (|S| |q|),   S = B R^-1 B')

    in balanced units. p(t) is a right Floquet vector, q(t) a left one: a right one of the dual loop. Of modes with one exponent every
    combination is one.
    """
    modes = floquet_modes(loop)
    parts = problem.reduced(np.mod(-modes.times, loop.period) if unreached else modes.times)
    units = balance_states(*parts) ** (-1.0 if unreached else 1.0)
    weight = parts[1 if unreached else 2] / np.outer(units, units)
    weight = weight / np.maximum(np.linalg.norm(weight, 2, axis=(1, 2)), TINY)[:, None, None]
    same, found = find_coinciding(loop.period * modes.exponents), []
    for i in np.flatnonzero(modes.exponents.real >= -np.maximum(ROOT_EPS, modes.errors)):
        p = modes.right[:, :, same[i]] * units[:, None]
        p = p @ np.linalg.svd(np.linalg.qr((weight @ p).reshape(-1, p.shape[2]), mode="r"))[2][-1].conj()
        length = np.linalg.norm(p, axis=1)
        share = float((np.linalg.norm((weight @ p[:, :, None])[:, :, 0], axis=1) / length).max())
        condition = float((np.linalg.norm(modes.left[:, :, i] / units, axis=1) * length).max())
        rounding = min(CUBE_ROOT_EPS, 1e2 * len(modes.exponents) * EPS * max(condition, 1.0))
        found.append(
            (float(modes.exponents[i].real), share, rounding, (p[0] / units / np.linalg.norm(p[0] / units)).real)
        )
    nothing = 0.0, 1.0, 0.0, np.zeros(loop.n)
    return min(found, key=lambda mode: mode[1] if mode[1] > mode[2] else 0.0, default=nothing)
