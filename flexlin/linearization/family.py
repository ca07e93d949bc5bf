"""Families of periodic systems: A(t, p), written by the user as CasADi expressions of the time and of parameters."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.arguments import checked
from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError, counted
from flexlin.lazy import lazy
from flexlin.periodic.interpolation import golden
from flexlin.periodic.system import PeriodicSystem
from flexlin.summary import immutable
from flexlin.symbolic import Expressions, as_expression


@immutable(init=False, eq=False)
class PeriodicFamily(Expressions):
    """Linear systems whose coefficients repeat with a period and depend on parameters, as expressions.

        x' = A(t, p) x + B(t, p) u,   A(t + T, p) = A(t, p),   T = T(p)

    `sweep`, `critical_values` and `stability_boundary` take a family where they take a scene, a parameter's path being its symbol's
    name; their values then go through compiled code together.

    Assumes A smooth between the breaks. What is narrow at some values is seen where `floquet` sees it at a few of them; name a jump.

    Parameters
    ----------
    A : casadi.SX, shape (n, n)
        The state matrix, an expression of t and the parameters.
    t : casadi.SX
        The symbol of the time, in s.
    parameters : casadi.SX, shape (P,), or sequence of casadi.SX
        The symbols of the parameters, with a name each.
    period : float or casadi.SX
        T in s, a number or an expression of the parameters.
    B : casadi.SX, shape (n, m), optional
        The input matrix.
    breaks : sequence of float or casadi.SX
        Times in [0, T) at which A or B jumps or loses smoothness; numbers, or expressions of the parameters.

    Attributes
    ----------
    paths : tuple of str
        Names of the parameters.
    n : int
        Number of states.

    Raises
    ------
    ArgumentError
        For what is no expression, a matrix that is not square, symbols that are no parameters, and a period that depends on t.

    See Also
    --------
    PeriodicFamily.from_second_order : M y'' + D y' + K y = F u.

    Examples
    --------
    Mathieu's equation y'' + (a - 2 q cos 2t) y = 0 at q = 0.2 is unstable between a = 0.795 and a = 1.195:

    >>> import casadi as ca
    >>> import numpy as np
    >>> import flexlin as fl
    >>> t, a, q = ca.SX.sym("t"), ca.SX.sym("a"), ca.SX.sym("q")
    >>> stiffness = a - 2 * q * ca.cos(2 * t)
    >>> mathieu = fl.PeriodicFamily(ca.blockcat([[0, 1], [-stiffness, 0]]), t, [a, q], np.pi)
    >>> mathieu
    PeriodicFamily(period=<SX (1, 1)>, n=2, paths=('a', 'q'))
    >>> fl.floquet(mathieu.at({"a": 1.0, "q": 0.2})).verdict
    'unstable'
    >>> fl.sweep(mathieu, {"a": [0.7, 1.0, 1.3], "q": [0.2, 0.2, 0.2]})["verdict"].values.tolist()
    ['undecided', 'unstable', 'undecided']
    """

    matrices: tuple[ca.SX, ...] = field(repr=False)
    t: ca.SX = field(repr=False)
    p: ca.SX = field(repr=False)
    period: ca.SX
    input: ca.SX | None = field(repr=False)
    times: tuple[ca.SX, ...] = field(repr=False)
    n: int = field(default=0)
    paths: tuple[str, ...] = ()

    @checked
    def __init__(
        self,
        A: Any,
        t: ca.SX,
        parameters: ca.SX | Sequence[ca.SX],
        period: float | ca.SX,
        B: Any = None,
        breaks: Sequence[float | ca.SX] = (),
    ):
        keep(self, (as_square("A", A),), t, parameters, period, B, breaks)

    @classmethod
    @checked
    def from_second_order(
        cls,
        M: Any,
        D: Any,
        K: Any,
        t: ca.SX,
        parameters: ca.SX | Sequence[ca.SX],
        period: float | ca.SX,
        B: Any = None,
        breaks: Sequence[float | ca.SX] = (),
    ) -> "PeriodicFamily":
        """The family of M(t, p) y'' + D(t, p) y' + K(t, p) y = B(t, p) u, with x = [y; y'].

        Parameters
        ----------
        M, D, K : casadi.SX, shape (n, n)
            Mass, damping and stiffness. Assumes M symmetric and positive definite.
        t : casadi.SX
            The symbol of the time, in s.
        parameters : casadi.SX, shape (P,), or sequence of casadi.SX
            The symbols of the parameters, with a name each.
        period : float or casadi.SX
            T in s.
        B : casadi.SX, shape (n, m), optional
            What the inputs drive.
        breaks : sequence of float or casadi.SX
            As of the class.

        Returns
        -------
        PeriodicFamily
            It keeps M, D and K.

        Raises
        ------
        ArgumentError
            As the class, and where M, D and K differ in shape.
        """
        given = tuple(as_square(name, one) for name, one in (("M", M), ("D", D), ("K", K)))
        if len({one.shape for one in given}) > 1:
            raise ArgumentError(
                "M, D and K differ in shape", got=str([one.shape for one in given]), expected="(n, n) each"
            )
        made = object.__new__(cls)
        keep(made, given, t, parameters, period, B, breaks)
        return made

    def at(self, values: Mapping[str, float] | Sequence[float]) -> PeriodicSystem:
        """The system at values of the parameters.

        Parameters
        ----------
        values : mapping of str to float, or sequence of float
            A number for each parameter, by its name or in the parameters' order.

        Returns
        -------
        PeriodicSystem
            Its coefficients are compiled from the expressions.

        Raises
        ------
        ArgumentError
            For names that are no parameters, missing ones, numbers that are not finite, and a period that is not positive there.
        """
        if isinstance(values, Mapping):
            self.find_places(values)
            values = [values[path] for path in self.paths]
        return self.system_at(real_array("values", values, (len(self.paths),)))

    def system_at(self, point: Array) -> PeriodicSystem:
        """The system at one point.

        Parameters
        ----------
        point : array, shape (P,)
            A number for each parameter, in the parameters' order.

        Returns
        -------
        PeriodicSystem
            As of `at`.
        """
        point = real_array("the parameters", point, (len(self.paths),))
        period, *breaks = self.durations(point).full().ravel().tolist()
        found = {name: partial(self._sample, name, point) for name in self.coefficients.name_out()}
        if "A" in found:
            return PeriodicSystem(found["A"], period, found.get("B"), breaks)
        return PeriodicSystem.from_second_order(found["M"], found["D"], found["K"], period, found.get("B"), breaks)

    def find_places(self, names: Iterable[str], loop: str = "own") -> list[int]:
        """Where each parameter stands among names.

        Parameters
        ----------
        names : iterable of str
            What is varied, in this order.
        loop : str
            The closed loop that is asked for; a family has its own only.

        Returns
        -------
        list of int
            The place of each parameter.

        Raises
        ------
        ArgumentError
            Unless these are the parameters' names.
        """
        given = list(names)
        if set(given) != set(self.paths) or loop != "own":
            got = ", ".join(given) + ("" if loop == "own" else f"; loop {loop}")
            todo = "give each of them one value or more, or write the numbers that are fixed into the matrices"
            raise ArgumentError(
                "these are not all of the family's parameters, and no others",
                got=got or "none",
                expected=", ".join(self.paths),
                todo=todo,
            )
        return [given.index(path) for path in self.paths]

    def _sample(self, name: str, point: Array, t: Array) -> Array:
        """A matrix at one point, at times (N,) in s, (N, rows, columns)."""
        part = symbolic.Part(self.coefficients, (name,))
        return symbolic.evaluate(part, t[:, None], np.broadcast_to(point, (len(t), len(point))))[0]

    @lazy
    def coefficients(self) -> ca.Function:
        """(t, p) -> A or M, D, K, and B."""
        outputs = [ca.densify(one) for one in (*self.matrices, *([] if self.input is None else [self.input]))]
        names = [*("A" if len(self.matrices) == 1 else "MDK"), *([] if self.input is None else "B")]
        return ca.Function("family", [self.t, self.p], outputs, ["t", "p"], names)

    @lazy
    def durations(self) -> ca.Function:
        """p -> T and the breaks, in s."""
        return ca.Function("durations", [self.p], [ca.densify(ca.vertcat(self.period, *self.times))], ["p"], ["T"])

    @lazy
    def phase_breaks(self) -> tuple[float, ...] | None:
        """Phases in [0, 1) at which the coefficients lose smoothness; None where these move with the parameters."""
        if not self.times:
            return ()
        tried = 1 + golden(np.arange(3))  # values of all parameters
        found = [self.durations(np.full(len(self.paths), value)).full().ravel() for value in tried]
        phases = np.array([one[1:] / one[0] for one in found])
        return tuple(np.sort(phases[0]).tolist()) if np.allclose(phases, phases[0], rtol=0, atol=1e-13) else None

    may_be_narrow = False
    is_smooth = False

    def is_narrow(self, point: Array) -> bool:
        """Whether the coefficients are known to have narrow features at one point.

        Parameters
        ----------
        point : array, shape (P,)
            A number for each parameter.

        Returns
        -------
        bool
            False: nothing is known.
        """
        return False

    @property
    def states(self) -> int:
        """The number of states."""
        return self.n

    @property
    def title(self) -> str:
        """What stands above a result."""
        return f"a family of {counted(self.n, 'state')}"

    @lazy
    def text(self) -> str:
        """All that decides the systems."""
        return str(self.coefficients.serialize()) + str(self.durations.serialize())


def keep(
    made: PeriodicFamily, matrices: tuple[ca.SX, ...], t: Any, parameters: Any, period: Any, B: Any, breaks: Any
) -> None:
    """Check what is given and put it in place."""
    symbols, time = list_symbols(parameters), as_expression("t", t)
    names = tuple(one.name() for one in symbols)
    if time.shape != (1, 1) or not time.is_symbolic() or time.name() in names:
        raise ArgumentError("t is no symbol of its own", got=str(t)[:80], expected='ca.SX.sym("t")')
    duration, times = as_expression("period", period), tuple(as_expression("breaks", one) for one in breaks)
    force = None if B is None else as_expression("B", B)
    size = matrices[0].size1()
    for name, one in [("period", duration), *(("a break", one) for one in times)]:
        if one.shape != (1, 1):
            raise ArgumentError(f"{name} has the wrong shape", got=str(one.shape), expected="one number")
        refuse_strangers(name, one, names)
    if force is not None and force.size1() != size:
        raise ArgumentError("B has the wrong number of rows", got=force.size1(), expected=str(size))
    for one in (*matrices, *([] if force is None else [force])):
        refuse_strangers("a matrix", one, (*names, time.name()))
    if duration.is_constant() and not (np.isfinite(float(duration)) and float(duration) > 0):
        raise ArgumentError("period is not positive", got=str(duration), expected="a positive number of seconds")
    states = size * (1 if len(matrices) == 1 else 2)
    fields = {"matrices": matrices, "t": time, "p": ca.vertcat(*symbols), "period": duration, "input": force}
    for name, value in {**fields, "times": times, "n": states, "paths": names}.items():
        object.__setattr__(made, name, value)


def list_symbols(parameters: ca.SX | Sequence[ca.SX]) -> list[ca.SX]:
    """The parameters one by one. Raises: ArgumentError for what is no symbol, none, and two of one name."""
    given = [parameters] if isinstance(parameters, ca.SX) else parameters
    found = [one for each in given for one in ca.vertsplit(ca.vec(as_expression("parameters", each))) if one.numel()]
    known = found and all(one.is_symbolic() for one in found)
    if not known or len({one.name() for one in found}) < len(found):
        raise ArgumentError("parameters are symbols with a name each", got=str(parameters)[:80])
    return found


def as_square(name: str, value: object) -> ca.SX:
    """A square matrix of expressions."""
    found = as_expression(name, value)
    if found.size1() != found.size2() or not found.numel():
        raise ArgumentError(f"{name} is not square", got=str(found.shape), expected="(n, n)")
    return found


def refuse_strangers(what: str, expression: ca.SX, known: tuple[str, ...]) -> None:
    """Raise where an expression holds a symbol that is not known, or a number that is not finite."""
    strangers = [one.name() for one in ca.symvar(expression) if one.name() not in known]
    if strangers:
        raise ArgumentError(
            f"{what} holds symbols that are no parameters", got=", ".join(strangers), expected=", ".join(known)
        )
    if expression.is_constant() and not np.isfinite(ca.DM(expression).full()).all():
        raise ArgumentError(f"{what} holds numbers that are not finite", got=str(expression)[:80])
