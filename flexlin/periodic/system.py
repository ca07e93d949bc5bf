"""The periodic linear system x' = A(t) x + B(t) u, the common currency of the numeric wing, and systems that are made of others."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import SAMPLES, Array, positive, whole
from flexlin.errors import ArgumentError, counted
from flexlin.lazy import lazy
from flexlin.periodic.coefficient_series.matrix import ResolvedCompanion, ResolvedMatrix, weigh_entries
from flexlin.periodic.coefficient_series.panels import first_edges
from flexlin.periodic.coefficient_series.resolve import check_places, resolve, resolve_constant
from flexlin.periodic.coefficients import (
    Combined,
    Constant,
    MatrixFunction,
    SecondOrder,
    SecondOrderFunction,
    as_matrix_function,
    build_companion,
    build_input,
    check_samples,
    close_loop,
    gather,
    has_nothing_narrow,
    hold_input,
    varies,
)
from flexlin.periodic.interpolation import ChebyshevPanels
from flexlin.plots.view import Series, Shown, View

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class PeriodicSystem(Shown):
    """A linear system whose coefficients repeat with a period.

        x' = A(t) x + B(t) u,   A(t + T) = A(t),   B(t + T) = B(t)

    Before anything is integrated, A is sampled and represented by series that agree with it between the samples, to about 1e-13 of the
    size of each entry. Jumps and kinks that `breaks` does not name are looked for and found. It pickles when its functions do.

    What no sampler can promise: to see what happens between its samples. A is compared with its series at 10240 times on no regular
    grid, with gaps below T / 10000: a pulse on at least T / 10000 is seen, a shorter one perhaps. Name it in `features`. What happens
    within 1e-11 T of a jump counts as part of the jump.

    Parameters
    ----------
    A : array_like (n, n), or function of times (N,) -> (N, n, n)
        The state matrix, at any time t in s; its entries in the units of x' and x, 1/s where these agree.
    period : float
        T in s.
    B : array_like (n, m), or function of times (N,) -> (N, n, m), optional
        The input matrix.
    breaks : sequence of float
        Times in [0, T) at which A or B jumps or loses smoothness.
    second_order : SecondOrder, optional
        The equations M y'' + D y' + K y = force u behind A, as `from_second_order` keeps them.
    features : sequence of (float, float)
        Pairs (time, half-width) in s about which A or B changes fast.
    complete : bool
        Whether `breaks` and `features` name everything of a half-width below T / 200. You guarantee it; both are then sampled less often.
        Weights, gains, outputs and forces that stand beside them as functions are looked at everywhere all the same.

    Attributes
    ----------
    n : int
        Number of states.
    m : int
        Number of inputs.

    Raises
    ------
    ArgumentError
        When shapes, period or breaks do not fit, or values are not finite.

    See Also
    --------
    floquet : raises NotPeriodic or UnresolvedCoefficient when A cannot be represented.

    References
    ----------
    Pachón, Platte, Trefethen, Piecewise-smooth chebfuns, IMA J. Numer. Anal. 30 (2010), for the places that are found.

    Examples
    --------
    Mathieu's equation y'' + 0.2 y' + (1 + 0.3 cos 2t) y = u:

    >>> import numpy as np
    >>> import flexlin as fl
    >>> def A(t):
    ...     values = np.zeros((len(t), 2, 2))
    ...     values[:, 0, 1], values[:, 1, 0], values[:, 1, 1] = 1.0, -1.0 - 0.3 * np.cos(2 * t), -0.2
    ...     return values
    >>> system = fl.PeriodicSystem(A, np.pi, B=[[0.0], [1.0]])
    >>> system.n, system.m, fl.floquet(system).verdict
    (2, 1, 'stable')
    """

    A: MatrixFunction
    period: float
    B: MatrixFunction | None = None
    breaks: tuple[float, ...] = ()
    second_order: SecondOrder | None = None
    features: tuple[tuple[float, float], ...] = ()
    complete: bool = False
    n: int = field(init=False)
    m: int = field(init=False)

    def __repr__(self) -> str:
        sizes = {"state": self.n, "input": self.m, "break": len(self.breaks), "feature": len(self.features)}
        states, inputs, *named = (
            counted(size, what) for what, size in sizes.items() if size or what in ("state", "input")
        )
        return f"PeriodicSystem({', '.join([states, inputs, f'period {self.period:.6g} s', *named])})"

    @checked
    def __init__(
        self,
        A: MatrixFunction | ArrayLike,
        period: float,
        B: MatrixFunction | ArrayLike | None = None,
        breaks: Sequence[float] = (),
        second_order: SecondOrder | None = None,
        features: Sequence[tuple[float, float]] = (),
        complete: bool = False,
    ):
        period = positive("period", period)
        named, pairs = check_places(period, breaks, features)
        A = as_matrix_function("A", A)
        probe = check_samples("A", A, period)
        if probe.shape[1] != probe.shape[2]:
            raise ArgumentError("A is not square", got=probe.shape[1:], expected="(n, n)")
        n, m = probe.shape[1], 0
        if n == 0:
            raise ArgumentError("A is empty", got=probe.shape[1:], expected="at least one state")
        if B is not None:
            B = as_port("B", B, (n, None), period)
            m = B(np.zeros(1)).shape[2]
        places = {"breaks": tuple(named.tolist()), "features": tuple((t, width) for t, width in pairs.tolist())}
        vars(self).update(A=A, period=period, B=B, second_order=second_order, complete=complete, n=n, m=m, **places)

    def to_xarray(self, points: int = 257) -> "xarray.Dataset":
        """Return A(t) and B(t) as tables.

        Parameters
        ----------
        points : int
            Times of the period, both ends included.

        Returns
        -------
        xarray.Dataset
            A by time, row and state, B by time, row and input; the period as attribute.
        """
        import xarray

        t = np.linspace(0.0, self.period, whole("points", points, 2))
        values = {"A": (("time", "row", "state"), self.A(t))}
        if self.B is not None:
            values["B"] = (("time", "row", "input"), self.B(t))
        return xarray.Dataset(values, coords={"time": ("time", t, {"units": "s"})}, attrs={"period": self.period})

    def _view(self) -> View:
        t = np.linspace(0.0, self.period, SAMPLES + 1)
        A = self.A(t)
        moving = [(i, j) for i, j in np.ndindex(self.n, self.n) if np.ptp(A[:, i, j]) > 0]
        moving.sort(key=lambda at: -np.ptp(A[:, *at]))
        series = tuple(Series(f"x{i + 1}' per x{j + 1}", t, A[:, i, j]) for i, j in moving)
        facts = (repr(self), f"{len(moving)} of {self.n**2} entries of A vary")
        title = "x' = A(t) x + B(t) u" if self.m else "x' = A(t) x"
        return View(title, "", facts, "t in s", "entries of A that vary, in the units of x' per x", series)

    @lazy
    def resolved(self) -> ResolvedMatrix | ResolvedCompanion:
        """A(t) as series that agree with it everywhere; it is sampled for them once, and all integration reads them.

        Raises: NotPeriodic, UnresolvedCoefficient, ArgumentError as `resolve`.
        """
        if isinstance(self.A, Constant) and not self.breaks and not self.features:
            return resolve_constant(self.A.value, self.period)
        named = (self.period, self.breaks, self.features)
        if self.second_order is None:
            return resolve(self.A, *named, complete=self.complete)
        blocks = resolve(self.second_order.stacked, *named, complete=self.complete, least=weigh_entries)
        return ResolvedCompanion(**vars(blocks))

    @lazy
    def resolved_input(self) -> ResolvedMatrix:
        """B(t) as series that agree with it everywhere: all that integrates under an input reads them.

        Raises: ArgumentError where there is no input; NotPeriodic, UnresolvedCoefficient, ArgumentError as `resolve`.
        """
        return resolve_port(self, input_of(self), self.complete)

    @classmethod
    @checked
    def from_second_order(
        cls,
        M: MatrixFunction | ArrayLike,
        D: MatrixFunction | ArrayLike,
        K: MatrixFunction | ArrayLike,
        period: float,
        B: MatrixFunction | ArrayLike | None = None,
        breaks: Sequence[float] = (),
        together: SecondOrderFunction | None = None,
        features: Sequence[tuple[float, float]] = (),
        complete: bool = False,
    ) -> "PeriodicSystem":
        """Build the first-order system of M y'' + D y' + K y = B u with x = [y; y'].

            A = [[0, I], [-M^-1 K, -M^-1 D]],   B = [0; M^-1 B]

        Parameters
        ----------
        M, D, K : array_like (n, n), or function of times (N,) -> (N, n, n)
            Mass, damping and stiffness, in kg m^2, N m s and N m for angles.
        period : float
            T in s.
        B : array_like (n, m), or function of times (N,) -> (N, n, m), optional
            Forces of a unit of each input.
        breaks : sequence of float
            Times in [0, T) at which a matrix jumps or loses smoothness.
        together : function of times (N,) -> (M, D, K), optional
            All three in one call, where that is cheaper than three.
        features : sequence of (float, float)
            Pairs (time, half-width) in s about which a matrix changes fast.
        complete : bool
            Whether `breaks` and `features` name everything of a half-width below T / 200.

        Returns
        -------
        PeriodicSystem
            It keeps M, D, K, so that methods made for second order can use them.

        Raises
        ------
        ArgumentError
            When shapes do not fit.
        SingularMassMatrix
            When M cannot be inverted.
        """
        period, M = positive("period", period), as_matrix_function("M", M)
        size = check_samples("M", M, period).shape[1:]
        if size[0] != size[1] or not size[0]:
            raise ArgumentError("M is not square", got=size, expected="(n, n), at least one coordinate")
        D, K = (as_port(name, f, size, period) for name, f in (("D", D), ("K", K)))
        force = None if B is None else as_port("B", B, (size[0], None), period)
        equations = SecondOrder(together or Combined(gather, (M, D, K)), force)
        B = None if force is None else Combined(build_input, (M, force, np.asarray))
        A = Combined(build_companion, (equations.sample, np.asarray))
        return cls(A, period, B, breaks, equations, features, complete)

    def feedback(self, gain: MatrixFunction | ArrayLike, breaks: Sequence[float] = ()) -> "PeriodicSystem":
        """Close the loop u = -K(t) x: the system x' = (A - B K) x + B u.

        A second-order system stays one: M y'' + (D + F K_v) y' + (K + F K_y) y = F u with the gain [K_y, K_v].

        Parameters
        ----------
        gain : array_like (m, n), or function of times (N,) -> (N, m, n)
            The gain K.
        breaks : sequence of float
            Times in [0, T) at which the gain jumps or loses smoothness, beside those of the system.

        Returns
        -------
        PeriodicSystem
            The closed loop.

        Raises
        ------
        ArgumentError
            When the system has no input, or the gain does not fit.
        """
        B, K = input_of(self), as_port("gain", gain, (self.m, self.n), self.period)
        second_order = None if self.second_order is None else self.second_order.feedback(K)
        loop = Combined(close_loop, (self.A, B, K))
        complete = self.complete and has_nothing_narrow(K)
        corners = (*self.breaks, *breaks, *(K.edges[:-1] if isinstance(K, ChebyshevPanels) else ()))
        return PeriodicSystem(loop, self.period, B, corners, second_order, self.features, complete)


def input_of(system: PeriodicSystem) -> MatrixFunction:
    """B(t). Raises: ArgumentError where there is none."""
    if system.B is None:
        raise ArgumentError("the system has no input", got="B = None", expected="an input matrix B(t)")
    return system.B


def resolve_port(system: PeriodicSystem, given: MatrixFunction, complete: bool) -> ResolvedMatrix:
    """What stands beside A(t), an input, an output or a weight, as `resolve` does it where it varies."""
    if not varies(given, system.period):
        return resolve_constant(given(np.zeros(1))[0], system.period)
    return resolve(given, system.period, system.breaks, system.features, complete=complete)


def resolve_beside(system: PeriodicSystem, given: MatrixFunction) -> ResolvedMatrix:
    """What stands beside A(t), an output or a weight, as series: where it may hold a pulse of its own it is looked at everywhere.

    Raises: NotPeriodic, UnresolvedCoefficient, ArgumentError as `resolve`.
    """
    return resolve_port(system, given, system.complete and has_nothing_narrow(given))


def as_port(
    name: str, value: MatrixFunction | ArrayLike, shape: tuple[int | None, ...], period: float
) -> MatrixFunction:
    """What stands beside A(t) as a function of time. Raises: ArgumentError where it is not of the shape (None: of any length)."""
    function = as_matrix_function(name, value)
    got = check_samples(name, function, period).shape[1:]
    if any(wanted not in (None, length) for wanted, length in zip(shape, got, strict=True)):
        wanted = ", ".join("any" if one is None else str(one) for one in shape)
        raise ArgumentError(f"{name} does not fit the system", got=got, expected=f"({wanted})")
    return function


def with_matrices(
    system: PeriodicSystem,
    A: MatrixFunction,
    B: MatrixFunction | None = None,
    breaks: Sequence[float] = (),
    others: Sequence[MatrixFunction] = (),
) -> PeriodicSystem:
    """x' = A(t) x + B(t) u with matrices that are made of those of a system, and perhaps of others with breaks of their own."""
    corners, complete = (*system.breaks, *breaks), system.complete and all(map(has_nothing_narrow, others))
    return PeriodicSystem(A, system.period, B, corners, features=system.features, complete=complete)


def dual_system(system: PeriodicSystem, C: MatrixFunction | None = None) -> PeriodicSystem:
    """x' = A(-t)' x + C(-t)' u, whose cost is the covariance of the system's states, as a function of -t.

    Source: Bittanti, Colaneri, Periodic Systems (2009), ch. 7.
    """
    T = system.period
    breaks = [(T - t) % T for t in system.breaks]
    features = [((T - t) % T, width) for t, width in system.features]
    B = None if C is None else Backward(C, T)
    complete = system.complete and (B is None or B.complete)
    return PeriodicSystem(Backward(system.A, T), T, B, breaks, features=features, complete=complete)


def corners_of(system: PeriodicSystem) -> tuple[float, ...]:
    """Times in [0, T) between which what is made of the system's coefficients is smooth and changes slowly, as far as they are named."""
    if not system.features:
        return system.breaks
    edges = first_edges(system.period, np.array(system.breaks), np.array(system.features))
    return tuple(edges[:-1].tolist())


def edges_between(*series: ResolvedMatrix | ResolvedCompanion) -> list[float]:
    """Times in [0, T) between which all series are smooth: edges of their panels, or breaks."""
    places = [one.breaks if one.panels == 1 else one.edges[:-1] for one in series]
    return np.unique(np.concatenate(places)).astype(float).tolist()


@dataclass(frozen=True, eq=False)
class Backward:
    """t -> coefficient(-t)', taken inside one period; as complete as the coefficient."""

    coefficient: MatrixFunction
    period: float

    def __call__(self, t: Array) -> Array:
        return np.swapaxes(self.coefficient(np.mod(-t, self.period)), 1, 2)

    @property
    def complete(self) -> bool:
        return has_nothing_narrow(self.coefficient)


def extend_state(A: Array, rates: Array) -> Array:
    """[[A, 0], [rates]] for rates (k, n + k)."""
    out = hold_input(A, np.zeros((*A.shape[:2], len(rates))))
    out[:, A.shape[1] :] = rates
    return out


def lead_states(values: Array, n: int, states: int) -> Array:
    """The first n rows (N, n or more, ...) as the first of `states`, the others zero."""
    out = np.zeros((len(values), states, *values.shape[2:]))
    out[:, :n] = values[:, :n]
    return out


def of_plant(function: MatrixFunction, n: int, states: int) -> Combined:
    """What acts on the n states of a plant in a system of `states` states: a function of the motion, narrow where the coefficients are."""
    return Combined(partial(lead_states, n=n, states=states), (function,), True)


def extend_system(system: PeriodicSystem, rates: Array) -> PeriodicSystem:
    """The system with the states z of a controller behind its own, its loop still open.

    [x; z]' = [[A, 0], [rates]] [x; z] + [B; 0] u,   rates (k, n + k)
    """
    B = None if system.B is None else of_plant(system.B, system.n, system.n + len(rates))
    return with_matrices(system, Combined(partial(extend_state, rates=rates), (system.A,)), B)
