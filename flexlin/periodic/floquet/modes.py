"""Floquet modes: the periodic right and left eigenvectors of x' = A(t) x, without the period's product; and frozen modes."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked, instance
from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError, counted
from flexlin.periodic.circle import assign, measure_distances
from flexlin.periodic.floquet.by_decoupling import solve_decoupled_modes
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.product import periodic_vectors
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.choose_segments import (
    FEWER_SEGMENTS,
    METHODS,
    choose_setting,
    factor_by,
    place_segments,
)
from flexlin.periodic.transition.gauss import gauss
from flexlin.plots.view import Series, Shown, View
from flexlin.precision import EPS, ROOT_EPS

if TYPE_CHECKING:
    import pandas
    import xarray

MODES_TOL = 1e-9
"""Accuracy of transition matrices where nobody asks for one."""


@dataclass(frozen=True)
class FloquetModes(Shown):
    """Modes p_i exp(lambda_i t) of x' = A x, and q_i of the adjoint -x' = A' x, with q_i^H p_i = 1 at every time.

    Attributes
    ----------
    times : array, shape (N,)
        In [0, T), in s: Gauss nodes of panels and the panels' edges, or equidistant where the system was decoupled.
    weights : array, shape (N,)
        The mean over a period is weights @ f; zero at the edges.
    period : float
        T in s.
    exponents : array, shape (n,)
        The exponents lambda_i, in 1/s, by falling real part.
    errors : array, shape (n,)
        Of the exponents, in 1/s; inf for those not resolved, whose modes mean nothing.
    right : array, shape (N, n, n)
        right[:, :, i] is p_i at the times.
    left : array, shape (N, n, n)
        left[:, :, i] is q_i at the times.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> modes = fl.floquet_modes(fl.PeriodicSystem([[-1.0, 3.0], [0.0, -2.0]], 1.0))
    >>> products = np.einsum("tki,tkj->tij", modes.left.conj(), modes.right)
    >>> bool(np.allclose(products, np.eye(2)))
    True
    """

    times: Array
    weights: Array
    period: float
    exponents: Array
    errors: Array
    right: Array
    left: Array

    def __repr__(self) -> str:
        return (
            f"FloquetModes({counted(len(self.exponents), 'mode')} at {counted(len(self.times), 'time')} of the period {self.period:.6g} s, "
            f"growth rates {self.exponents.real.min():.6g} to {self.exponents.real.max():.6g} 1/s)"
        )

    def to_xarray(self) -> "xarray.Dataset":
        """Return the modes with names and units.

        Returns
        -------
        xarray.Dataset
            exponents and error by mode, participation by state and mode, right and left (complex) by time, state and mode.
        """
        import xarray

        by_time = ("time", "state", "mode")
        values = {
            "exponents": ("mode", self.exponents, {"units": "1/s"}),
            "error": ("mode", self.errors, {"units": "1/s"}),
            "participation": (("state", "mode"), self.participation),
            "right": (by_time, self.right),
            "left": (by_time, self.left),
        }
        return xarray.Dataset(
            values, coords={"time": ("time", self.times, {"units": "s"})}, attrs={"period": self.period}
        )

    def to_dataframe(self) -> "pandas.DataFrame":
        """Return a row for each mode: growth rate and error in 1/s, frequency in Hz, the condition of its exponent.

        Returns
        -------
        pandas.DataFrame
            growth_rate, error, frequency and condition by mode.
        """
        import pandas

        columns = {
            "growth_rate": self.exponents.real,
            "error": self.errors,
            "frequency": np.abs(self.exponents.imag) / (2 * np.pi),
            "condition": self.condition,
        }
        return pandas.DataFrame(columns).rename_axis("mode")

    def _view(self) -> View:
        upper = self.exponents.imag >= 0
        places = Series("exponents", self.exponents[upper].real, self.exponents[upper].imag / (2 * np.pi), "dots")
        worst = int(np.argmax(self.condition))
        facts = (repr(self), f"largest condition {self.condition[worst]:.3g}, of mode {worst}")
        return View("Floquet modes", "", facts, "growth rate in 1/s", "frequency in Hz", (places,), True)

    @property
    def condition(self) -> Array:
        """Mean |q_i| |p_i| over a period, (n,): how much an exponent moves with A. Large where two modes nearly coincide."""
        return self.weights @ (np.linalg.norm(self.left, axis=1) * np.linalg.norm(self.right, axis=1))

    @property
    def participation(self) -> Array:
        """Share of state k in mode i over a period, (n, n), columns sum to 1: |mean conj(q_ki) p_ki|, normalised.

        Source: Perez-Arriaga, Verghese, Schweppe (1982), averaged over the period.
        """
        share = np.abs(np.einsum("t,tki,tki->ki", self.weights, self.left.conj(), self.right))
        return share / share.sum(axis=0)


@checked
def floquet_modes(system: PeriodicSystem, result: FloquetResult | None = None, tol: float = 1e-9) -> FloquetModes:
    """Compute the periodic eigenvectors for the exponents of `floquet`.

        p_(k+1) = exp(-lambda h_k) Phi_k p_k,   p_K = p_0;      q_k = exp(-conj(lambda) h_k) Phi_k^H q_(k+1)

    Where `floquet` has decoupled the system, they are the columns of its frame. Else they follow from the periodic Schur form of the
    segments: fast modes do not spoil slow ones, and those too fast for the segments, or that swell by more than exp(300) within the
    period, get an infinite error.
    Assumes simple or semisimple exponents; at a defective one both modes coincide and `condition` is huge.

    Parameters
    ----------
    system : PeriodicSystem
        The system with n states.
    result : FloquetResult, optional
        From `floquet`; it is computed where it is not given.
    tol : float
        Wanted error of the exponents, as in `floquet`, where no result is given.

    Returns
    -------
    FloquetModes
        Right and left modes at times of a period, with the weights of the mean.

    Raises
    ------
    ArgumentError, NotPeriodic, UnresolvedCoefficient, TooManySegments
        As `floquet`, where no result is given.

    References
    ----------
    Fairgrieve, Jepson, O.K. Floquet multipliers, SIAM J. Numer. Anal. 28 (1991), for what the product of a period loses.

    Examples
    --------
    An exponent moves with A by the mean of q' dA p; here a damper of 0.001 moves both by half of it:

    >>> import numpy as np
    >>> import flexlin as fl
    >>> modes = fl.floquet_modes(fl.PeriodicSystem([[0.0, 1.0], [-1.0, 0.0]], 1.0))
    >>> change = np.array([[0.0, 0.0], [0.0, -0.001]])
    >>> moved = modes.weights @ np.einsum("tki,kl,tli->ti", modes.left.conj(), change, modes.right)
    >>> moved.real.round(9).tolist()
    [-0.0005, -0.0005]
    """
    if result is not None:
        instance("result", result, FloquetResult, "give what floquet hands back")
    result = result or floquet(system, tol)
    alike = find_coinciding(result.log_multipliers).sum() > system.n
    if (decoupled := result.decoupled) is not None and not alike:
        modes = solve_decoupled_modes(decoupled, result.exponents)
        if modes is not None:
            weights = np.full(len(decoupled.times), 1 / len(decoupled.times))
            return FloquetModes(decoupled.times, weights, system.period, result.exponents, result.errors, *modes)
    return solve_modes_at_nodes(system, result)


def solve_modes_at_nodes(system: PeriodicSystem, result: FloquetResult) -> FloquetModes:
    """The modes of some exponents, from transition matrices between the nodes."""
    times, weights, Phi = factor_at_nodes(system, result)
    right, left, known = periodic_vectors(Phi, times, result.exponents)
    errors = np.where(known, result.errors, np.inf)
    return FloquetModes(times[:-1], weights, system.period, result.exponents, errors, right, left)


def factor_at_nodes(system: PeriodicSystem, result: FloquetResult) -> tuple[Array, Array, Array]:
    """Times (N + 1,) of Gauss nodes and panel edges, weights (N,) of the mean, and the transition matrices between the times."""
    setting = result.setting
    if setting.method not in METHODS:
        setting = choose_setting(system, MODES_TOL)
    if setting.segments > FEWER_SEGMENTS:  # an L-stable method only knows the modes that it resolves
        setting = choose_setting(system, MODES_TOL, "radau")
    grid = place_segments(system, setting)
    stages = max(4, setting.order // 2)
    rule = gauss(stages)
    h = np.diff(grid)[:, None]
    times = np.append((grid[:-1, None] + h * np.append(0.0, rule.c)).ravel(), system.period)
    weights = (h / system.period * np.append(0.0, rule.b)).ravel()
    return times, weights, factor_by(system, times, setting.method, 2 * max(4, (stages + 1) // 2))


def find_coinciding(logs: Array) -> Array:
    """Which logs of multipliers agree modulo 2 pi i, (n, n) booleans."""
    return measure_distances(logs, logs) < ROOT_EPS


def differentiate_exponents(
    modes: FloquetModes, slope: ArrayLike, A: ArrayLike | None = None, period_slope: ArrayLike = 0.0
) -> Array:
    """Derivative of every exponent by every parameter.

        d lambda / d theta = (1/T) int_0^T q^H (dA/dtheta + (T'/T) A) p dt - lambda T'/T

    with dA/dtheta at fixed phase t/T and T' = dT/dtheta. Assumes a simple exponent: where two coincide only their mean has a
    derivative, and `modes.condition` is large.

    Parameters: slope: dA/dtheta (N, n, n) or (P, N, n, n) for P parameters, sampled at `modes.times`; A (N, n, n) there, and
    period_slope, one or (P,), where the period depends on the parameters.
    Returns: (n,) or (P, n) complex, in 1/s per unit of the parameter.
    Raises: ArgumentError on shapes, or when period_slope is given without A.
    Source: Seyranian, Mailybaev, Multiparameter Stability Theory (2003), section 9.3.
    """
    change = real_array("slope", slope)
    if change.shape[-3:] != (len(modes.times), *modes.right.shape[1:]):
        raise ArgumentError(
            "slope has the wrong shape", got=change.shape, expected=f"{(len(modes.times), *modes.right.shape[1:])}"
        )
    stretch = real_array("period_slope", period_slope)[..., None] / modes.period
    if np.any(stretch):
        if A is None:
            raise ArgumentError("the period varies but A is missing", expected="A sampled at modes.times")
        change = change + stretch[..., None, None] * real_array("A", A, modes.right.shape)
    moved = np.einsum("t,tki,...tkl,tli->...i", modes.weights, modes.left.conj(), change, modes.right, optimize=True)
    return moved - modes.exponents * stretch


@dataclass(frozen=True)
class FrozenModes:
    """Eigenvalues (N, n) in 1/s and eigenvectors (N, n, n) of A at N times; mode i keeps its place i."""

    values: Array
    vectors: Array

    @property
    def frequencies(self) -> Array:
        """Im / 2 pi in Hz of the eigenvalue of each pair that turns forward, (N, n); nan where a mode does not oscillate."""
        turns = self.values.imag > ROOT_EPS * np.abs(self.values)
        return np.where(turns, self.values.imag / (2 * np.pi), np.nan)


def follow_frozen_modes(A: Array) -> FrozenModes:
    """Order the eigenvalues of A (N, n, n), n states at N times close to each other, such that neighbours belong to one mode.

        overlap_ij = |w_i(k) v_j(k+1)| |w_j(k+1) v_i(k)|,   w the rows of inv([v_1 ... v_n])

    It is 1 for the same mode and 0 for another in whatever units the states are and however the vectors are scaled. The assignment
    takes the largest overlap less the relative distance of the eigenvalues, so modes that cross keep their shapes, and those that turn
    into each other at an avoided crossing keep their frequencies' order.
    """
    values, vectors = np.linalg.eig(np.asarray(A, dtype=float))
    values, vectors = values.astype(complex), vectors.astype(complex)
    inverse = np.linalg.pinv(vectors, rcond=EPS)  # of a defective matrix eigenvectors coincide
    forward, backward = np.abs(inverse[:-1] @ vectors[1:]), np.abs(inverse[1:] @ vectors[:-1])
    overlap = np.minimum(np.nan_to_num(forward * np.swapaxes(backward, 1, 2)), 1.0)
    size = np.abs(values[:-1, :, None]) + np.abs(values[1:, None, :])
    apart = np.abs(values[:-1, :, None] - values[1:, None, :]) / np.where(size == 0, 1.0, size)
    order = np.empty(values.shape, dtype=int)
    order[0] = np.lexsort((values[0].real, values[0].imag))
    for k, cost in enumerate(apart - overlap):
        order[k + 1] = assign(cost[order[k]])
    return FrozenModes(
        np.take_along_axis(values, order, axis=1), np.take_along_axis(vectors, order[:, None, :], axis=2)
    )
