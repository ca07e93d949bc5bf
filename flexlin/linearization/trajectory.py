"""From x' = f(t, x, u) and a trajectory that solves it to the linear system of small deviations."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin import symbolic
from flexlin.arguments import checked
from flexlin.checks import SAMPLES, SUM_ROUNDING, Array, at_times, positive
from flexlin.errors import ArgumentError, MotionError
from flexlin.mechanics.beam.integrals import panels
from flexlin.periodic.coefficients import MatrixFunction, as_matrix_function, check_samples
from flexlin.periodic.system import PeriodicSystem
from flexlin.summary import immutable

TRAJECTORY_NODES = 4
"""Panels of the trajectory, and Gauss nodes in each, on which it is held against f: exact to 1e-8 for 60 harmonics."""


@immutable(init=False, eq=False)
class Trajectory:
    """A solution x*(t), u*(t) of x' = f(t, x, u), along which `linearize` linearizes.

    Parameters
    ----------
    x : casadi.SX (n, 1), an expression of t, or function of times (N,) -> (N, n)
        The states.
    u : casadi.SX (m, 1), or function of times (N,) -> (N, m), optional
        The inputs.
    period : float
        Period in s; of a trajectory with an end its duration.
    t : casadi.SX, optional
        The symbol of the time in s that the expressions hold.
    breaks : sequence of float
        Times in [0, period) at which a derivative of x* jumps.
    periodic : bool
        False for a trajectory with an end: its system is for `fl.control.finite_horizon_lqr`. Otherwise A and B repeat; x* need not, as an
        angle that turns on.
    tol : float
        The largest part of its rates by which the trajectory may miss x' = f(t, x, u), as a measured or tabulated one does.

    Raises
    ------
    ArgumentError
        When something is of another kind or shape, or not finite.

    Examples
    --------
    >>> import casadi as ca
    >>> import flexlin as fl
    >>> t = ca.SX.sym("t")
    >>> fl.Trajectory(ca.vertcat(ca.sin(t), ca.cos(t)), period=6.28318530718, t=t)([0.0]).tolist()
    [[0.0, 1.0]]
    """

    x: MatrixFunction
    u: MatrixFunction | None
    period: float
    breaks: tuple[float, ...]
    periodic: bool
    tol: float

    @checked
    def __init__(
        self,
        x: object,
        u: object = None,
        *,
        period: float,
        t: ca.SX | None = None,
        breaks: Sequence[float] = (),
        periodic: bool = True,
        tol: float = 1e-6,
    ):
        period = positive("period", period)
        states = as_column("x", x, t, period)
        inputs = None if u is None else as_column("u", u, t, period)
        within = [edge for edge in breaks if not 0 <= edge < period]
        if within:
            raise ArgumentError("a break lies outside the trajectory", got=within[0], expected=f"0 <= t < {period:g}")
        vars(self).update(x=states, u=inputs, period=period, periodic=periodic, tol=positive("tol", tol))
        vars(self).update(breaks=tuple(sorted(breaks)))

    def __call__(self, t: ArrayLike) -> Array:
        return at_times(lambda t: self.x(t)[:, :, 0], t)

    @property
    def edges(self) -> Array:
        """The edges (K + 1,) of the panels on which the trajectory is held against f; the breaks are among them."""
        return np.union1d(np.linspace(0.0, self.period, SAMPLES + 1), self.breaks)


def sample_column(of: Any, t: Array) -> Array:
    """A column at times (N,): of an expression of t, or of a function (N,) -> (N, n) of the user."""
    if isinstance(of, ca.Function):
        return symbolic.evaluate(of, t[:, None])[0]
    values = np.asarray(of(t))
    return values[:, :, None] if values.ndim == 2 else values


def as_column(name: str, given: object, t: ca.SX | None, period: float) -> MatrixFunction:
    """x* or u* as a function of times (N,) -> (N, n, 1). Raises: ArgumentError."""
    if callable(given):
        found = as_matrix_function(name, partial(sample_column, given))
    else:
        expression = ca.densify(symbolic.as_expression(name, given))
        symbol = ca.SX.sym("t") if t is None else t
        strange = [str(one) for one in ca.symvar(expression) if t is None or not ca.depends_on(one, t)]
        if strange:
            known = "t alone; name its symbol: Trajectory(x, u, period=..., t=t)"
            raise ArgumentError(f"{name} holds symbols that are not known", got=", ".join(strange), expected=known)
        found = partial(sample_column, ca.Function(name, [symbol], [expression]))
    shape = check_samples(name, found, period).shape[1:]
    if shape[1] != 1 or not shape[0]:
        raise ArgumentError(f"{name} is no column", got=shape, expected="(n, 1), or a function of times (N,) -> (N, n)")
    return found


@dataclass(frozen=True, eq=False)
class Along:
    """One output of a function of t, x and u as a function of the time along a trajectory."""

    function: ca.Function
    name: str
    trajectory: Trajectory

    def __call__(self, t: ArrayLike) -> Array:
        return at_times(lambda t: self.sample(t)[self.function.name_out().index(self.name)], t)

    def sample(self, t: Array) -> tuple[Array, ...]:
        """All outputs at times (N,)."""
        x, u = self.trajectory.x, self.trajectory.u
        return symbolic.evaluate(self.function, t[:, None], x(t)[:, :, 0], *([] if u is None else [u(t)[:, :, 0]]))


def linearize_along(f: ca.Function, trajectory: Trajectory) -> PeriodicSystem:
    """The linear system y' = A(t) y + B(t) v of x = x* + y, u = u* + v, with A = df/dx and B = df/du along the trajectory.

    Raises: ArgumentError where f does not fit the trajectory; MotionError where the trajectory is no solution of x' = f.
    """
    along = Along(differentiate(f, trajectory), "A", trajectory)
    refuse_wrong_rates(along)
    B = None if trajectory.u is None else replace(along, name="B")
    breaks = trajectory.breaks if trajectory.periodic else (0.0, *trajectory.breaks)
    return PeriodicSystem(along, trajectory.period, B, sorted(set(breaks)))


def differentiate(f: ca.Function, trajectory: Trajectory) -> ca.Function:
    """(t, x[, u]) -> f, A, B, whatever of x, (x, u) or (t, x, u) f takes. Raises: ArgumentError."""
    n = trajectory.x(np.zeros(1)).shape[1]
    m = 0 if trajectory.u is None else trajectory.u(np.zeros(1)).shape[1]
    sizes = [("x", n), ("u", m)] if m else [("x", n)]
    wanted = [("t", 1), *sizes] if f.n_in() == len(sizes) + 1 else sizes
    got = [f.size_in(i) for i in range(f.n_in())]
    if got != [(size, 1) for _, size in wanted] or f.n_out() != 1 or f.size_out(0) != (n, 1):
        takes = ", ".join(f"{name} {(size, 1)}" for name, size in sizes)
        gives = ", ".join(str(f.size_out(i)) for i in range(f.n_out()))
        raise ArgumentError(
            "f does not fit the trajectory",
            got=f"inputs {', '.join(map(str, got)) or 'none'}; outputs {gives or 'none'}",
            expected=f"inputs ([t], {takes}), one output ({n}, 1)",
            todo="give fl.Trajectory(x, u, ...) all states x and all inputs u of f",
        )
    t, x, u = ca.SX.sym("t"), ca.SX.sym("x", n), ca.SX.sym("u", m)
    named = {"t": t, "x": x, "u": u}
    try:
        rate = f.call([named[name] for name, _ in wanted])[0]
    except RuntimeError:
        raise ArgumentError(
            "f cannot be written in scalar operations", got=f.name(), expected="a casadi.Function that expands to SX"
        ) from None
    outputs = {"f": rate, "A": ca.jacobian(rate, x), "B": ca.jacobian(rate, u)}
    inputs = {"t": t, **{name: named[name] for name, _ in sizes}}
    kept = {name: ca.densify(value) for name, value in outputs.items() if m or name != "B"}
    return ca.Function("along_trajectory", list(inputs.values()), list(kept.values()), list(inputs), list(kept))


def refuse_wrong_rates(along: Along) -> None:
    """Hold x*(t2) - x*(t1) against the integral of f between panel edges; MotionError where the mean rates differ."""
    trajectory, edges = along.trajectory, along.trajectory.edges
    (t, weights), lengths = panels(edges, TRAJECTORY_NODES), np.diff(edges)[:, None]
    rates, A, *B = along.sample(t)
    gained = (weights[:, None] * rates[:, :, 0]).reshape(len(lengths), TRAJECTORY_NODES, -1).sum(axis=1)
    x = trajectory(edges)
    missed = np.abs(np.diff(x, axis=0) - gained) / lengths
    sizes = np.abs(x).max(axis=0) / trajectory.period + np.abs(rates).max(axis=0)[:, 0]
    sizes += np.einsum("tij,tj->ti", np.abs(A), np.abs(trajectory(t))).max(axis=0)
    rounding = SUM_ROUNDING * np.abs(A).sum(axis=2).max(axis=0)
    if B and trajectory.u is not None:
        sizes += np.einsum("tij,tjk->ti", np.abs(B[0]), np.abs(trajectory.u(t))).max(axis=0)
        rounding += SUM_ROUNDING * np.abs(B[0]).sum(axis=2).max(axis=0)
    beyond = missed - rounding > trajectory.tol * sizes
    if beyond.any():
        panel, state = np.unravel_index(
            int(np.argmax(np.where(beyond, missed / (sizes + rounding), 0.0))), missed.shape
        )
        raise MotionError(
            "the trajectory does not solve x' = f(t, x, u)",
            got=f"x' - f = {missed[panel, state]:.3g} in x[{state}] at t = {edges[panel]:.4g} s, where f is up to "
            f"{np.abs(rates).max(axis=0)[state, 0]:.3g}",
            expected=f"at most {trajectory.tol:.0e} of the rates",
            todo="find u*(t) that drives this path, name the breaks, or give tol= for measured or tabulated values",
        )
