"""The equations of motion of a manipulator, M(s) s'' + C(s, s') s' + g(s) + d(s, s') = B tau."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from flexlin.checks import Array, positive
from flexlin.errors import ArgumentError
from flexlin.lazy import lazy
from flexlin.mechanics.coordinates import ClosedLoops, Coordinate, Parameters
from flexlin.mechanics.lagrange import check_coordinates, derive_coriolis, derive_lagrange_equations, describe_model
from flexlin.mechanics.validation import need_quadratic, validate
from flexlin.plots.view import Series, Shown, View
from flexlin.scene.control import RATE
from flexlin.scene.effects import Effects
from flexlin.symbolic import Expressions, as_expression, substituted

if TYPE_CHECKING:
    import control


class NamedFunctions(Mapping[str, ca.Function]):
    """CasADi functions by name, from (named inputs, maker of the output), each built at its first use."""

    def __init__(self, table: dict[str, tuple[dict[str, ca.SX], Callable[[], ca.SX]]]):
        self._table, self._built = table, dict[str, ca.Function]()

    def __getitem__(self, name: str) -> ca.Function:
        if name not in self._built:
            inputs, output = self._table[name]
            self._built[name] = ca.Function(name, list(inputs.values()), [ca.densify(output())], list(inputs), [name])
        return self._built[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._table)

    def __len__(self) -> int:
        return len(self._table)


@dataclass(frozen=True, eq=False)
class Manipulator(Expressions, Shown):
    """A manipulator as CasADi expressions of its coordinates and rates.

        M(s) s'' + C(s, s') s' + g(s) + d(s, s') = B tau

    Attributes
    ----------
    s, s_dot, s_ddot : casadi.SX, shape (n, 1)
        Symbols of coordinates (rad, m), rates and accelerations.
    residual : casadi.SX, shape (n, 1)
        The left side, in N m or N.
    M : casadi.SX, shape (n, n)
        Mass matrix.
    g, damping : casadi.SX, shape (n, 1)
        Forces of gravity and of elastic potentials; resisting forces d(s, s'), less those from outside.
    B : casadi.SX, shape (n, m)
        Input matrix.
    reference : casadi.DM, shape (n, joints)
        The rigid motion is s_R = reference q.
    drives : tuple of int
        The coordinate that each joint's motor moves.
    coordinates : tuple of Coordinate
        What each coordinate is.
    parameters : Parameters
        Scene numbers that stay free, with their values.
    energy, points : casadi.SX or None
        Kinetic and potential energy together, in J; world positions (2, k), in space (3, k), from the base to the tip, in m.
    axes : casadi.SX or None
        World positions (2, k), in space (3, k), of points on the links' axes, as many for each link, in m; None where they are not known.
    coriolis : casadi.SX, shape (n, n), or None
        C as the user gave it; None: Christoffel's symbols of M.
    measured : casadi.SX, shape (joints, n), or None
        What each motor's encoder reads of s; None: the coordinates in `drives`.
    effects : Effects or None
        Tables of the effects in it, None where they are not known.
    rotation : casadi.SX, shape (3, 3), or None
        From the last tip's axes to the world's.
    loops : ClosedLoops or None
        The joints that follow from closed loops, None where there are none.
    phase : casadi.SX or None
        Symbol of the motion's phase t/T, where a load depends on it.
    derive : callable or None
        Makes of these equations, which hold to first order in the deflections, those at any deflection, in symbols of their own.

    Examples
    --------
    >>> import flexlin as fl
    >>> fl.build_manipulator(fl.load_scene("single-link")).M.shape
    (3, 3)
    """

    s: ca.SX
    s_dot: ca.SX
    s_ddot: ca.SX
    residual: ca.SX
    M: ca.SX
    g: ca.SX
    damping: ca.SX
    B: ca.SX
    reference: ca.DM
    drives: tuple[int, ...]
    coordinates: tuple[Coordinate, ...]
    parameters: Parameters = field(default_factory=Parameters)
    energy: ca.SX | None = None
    points: ca.SX | None = None
    axes: ca.SX | None = None
    coriolis: ca.SX | None = None
    measured: ca.SX | None = None
    effects: Effects | None = None
    rotation: ca.SX | None = None
    loops: ClosedLoops | None = None
    phase: ca.SX | None = None
    derive: Callable[["Manipulator"], "Manipulator"] | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({'; '.join(self._names())})"

    def _names(self) -> tuple[str, ...]:
        """Coordinates, inputs and free numbers in words."""
        named = ", ".join(f"{one.title} in {one.unit}" for one in self.coordinates)
        led = ", ".join(self.names[k] for k in self.drives)
        values = zip(self.parameters.paths, self.parameters.values, strict=True)
        free = ", ".join(f"{path} = {value:.6g}" for path, value in values)
        return f"s: {named}", f"joints: {led or 'none'}", *([f"free: {free}"] if free else [])

    def _view(self) -> View:
        drawn: tuple[Series, ...] = ()
        if self.points is not None:
            at = [self.s, self.parameters.symbols], [self.points]
            places = np.array(ca.Function("points", *at)(ca.DM.zeros(self.n), ca.DM(self.parameters.values)))
            drawn = (Series("links", places[0], places[-1]),)
        side = "y" if self.points is None or self.points.size1() == 2 else "z"
        title = "M(s) s'' + C(s, s') s' + g(s) + d(s, s') = B tau"
        return View(title, "", self._names(), "x in m, all coordinates at zero", f"{side} in m", drawn, equal=True)

    @property
    def n(self) -> int:
        """The number of coordinates."""
        return int(self.s.numel())

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the coordinates."""
        return tuple(coordinate.name for coordinate in self.coordinates)

    @property
    def joints(self) -> int:
        """The number of joints that follow the basic motion."""
        return int(self.reference.size2())

    @property
    def encoders(self) -> ca.SX:
        """What the motors' encoders read, (joints, n): angles = encoders s."""
        return ca.SX.eye(self.n)[list(self.drives), :] if self.measured is None else self.measured

    @property
    def near(self) -> "Manipulator":
        """The same arm with equations that hold to first order in the deflections: itself, where it knows no others."""
        return self

    def at_numbers(self, values: Array) -> "Manipulator":
        """Return the same equations with other values of the free numbers.

        Parameters
        ----------
        values : array, shape (P,)
            The values of `parameters`.

        Returns
        -------
        Manipulator
            The equations, with nothing derived anew.
        """
        return replace(self, parameters=replace(self.parameters, values=values))

    @lazy
    def at_large(self) -> "Manipulator":
        """The same arm with equations that hold at any deflection."""
        if self.derive is None:
            return self
        made = self.derive(self)
        own = [
            (arm.s, arm.s_dot, arm.s_ddot, arm.parameters.symbols, *([] if arm.phase is None else [arm.phase]))
            for arm in (made, self)
        ]
        old, new = (ca.vertcat(*symbols) for symbols in own)
        return replace(substituted(made, old, new), parameters=self.parameters)

    @lazy
    def C(self) -> ca.SX:
        """The matrix of centrifugal and Coriolis forces, from M unless the user gave one."""
        return derive_coriolis(self.M, self.s, self.s_dot) if self.coriolis is None else self.coriolis

    @lazy
    def functions(self) -> NamedFunctions:
        """CasADi functions of s, s_dot, s_ddot as needed, and p: M, C, g, damping, residual; points and energy if known."""
        return name_functions(self)

    def to_control(self, name: str = "arm", period: float | None = None) -> "control.NonlinearIOSystem":
        """Return the nonlinear arm as a python-control system.

            s'' = M(s)^-1 (B u - C s' - g - d),   x = [s; s'],   y = x

        States and outputs are named by the coordinates (q1, ..., q1_rate, ...), inputs by those that they drive. Free parameters are its
        `params`, by their paths.

        Parameters
        ----------
        name : str
            Name of the python-control system.
        period : float, optional
            Period in s of the motion; a periodic load needs it.

        Returns
        -------
        control.NonlinearIOSystem
            For `control.input_output_response`, `control.find_operating_point`, `control.linearize` and `control.interconnect`.

        Raises
        ------
        ArgumentError
            When a periodic load has no period.

        Examples
        --------
        >>> import flexlin as fl
        >>> plant = fl.build_manipulator(fl.load_scene("single-link")).to_control()
        >>> plant.state_labels, plant.input_labels
        (['q1', 'w11', 'w12', 'q1_rate', 'w11_rate', 'w12_rate'], ['q1'])
        """
        import control

        if self.phase is not None and period is None:
            todo = "give the period of the motion: arm.to_control(period=lin.period)"
            raise ArgumentError("a periodic load needs a period", got="none", expected="a time in s", todo=todo)
        T = 1.0 if period is None else positive("period", period)
        p, n, phase = self.parameters, self.n, ca.SX.sym("phase") if self.phase is None else self.phase
        left = ca.substitute(self.residual, self.s_ddot, ca.DM.zeros(n))
        outputs = [ca.densify(part) for part in (self.M, left, self.B)]
        equations = ca.Function("equations", [self.s, self.s_dot, phase, p.symbols], outputs)
        known = dict(zip(p.paths, p.values.tolist(), strict=True))

        def update(t: float, x: Array, u: Array, given: Mapping[str, Any]) -> Array:
            values = [given.get(path, value) for path, value in known.items()]
            M, rest, B = (part.full() for part in equations(x[:n], x[n:], t / T % 1.0, values))
            return np.concatenate([x[n:], np.linalg.solve(M, B @ np.atleast_1d(u) - rest[:, 0])])

        states = [*self.names, *(coordinate + RATE for coordinate in self.names)]
        inputs = [self.names[k] for k in self.drives[: self.B.size2()]]
        return control.nlsys(update, None, inputs=inputs or 0, outputs=states, states=states, params=known, name=name)

    @classmethod
    def from_matrices(
        cls,
        s: ca.SX,
        s_dot: ca.SX,
        M: ca.SX,
        C: ca.SX,
        g: ca.SX,
        B: ca.SX | None = None,
        damping: ca.SX | None = None,
        joints: Sequence[int] | None = None,
        names: Sequence[str] | None = None,
        points: ca.SX | None = None,
        units: Sequence[str] | None = None,
    ) -> "Manipulator":
        """Make a manipulator from its matrices, M(s) s'' + C(s, s') s' + g(s) + d(s, s') = B tau.

        Assumes the basic motion moves the coordinates `joints` and leaves the others at zero.

        Parameters
        ----------
        s, s_dot : casadi.SX, shape (n, 1)
            Symbols of coordinates (rad, m) and rates.
        M, C : casadi.SX, shape (n, n)
            Mass matrix, and matrix of centrifugal and Coriolis forces.
        g : casadi.SX, shape (n, 1)
            Forces of potentials, in N m or N.
        B : casadi.SX, shape (n, m), optional
            Input matrix, a column for each of `joints`; by default each has a force of its own.
        damping : casadi.SX, shape (n, 1), optional
            Resisting forces d(s, s').
        joints : sequence of int, optional
            Coordinates that follow the basic motion; by default those that B drives. The others are zero along it: take such as are
            relative to the joints, the twist of a spring and not the angle behind it.
        names : sequence of str, optional
            Names of the coordinates.
        points : casadi.SX, shape (2, k), optional
            World positions from the base to the tip, in m.
        units : sequence of {"rad", "m"}, optional
            Units of the coordinates; by default rad for `joints`, m for the others.

        Returns
        -------
        Manipulator
            The checked equations.

        Raises
        ------
        ModelError
            When a shape does not fit, an expression holds other symbols, or the matrices contradict mechanics: M symmetric and positive
            definite, M' - 2 C skew.

        Examples
        --------
        >>> import casadi as ca
        >>> from flexlin import Manipulator
        >>> q, rate = ca.SX.sym("q"), ca.SX.sym("rate")
        >>> Manipulator.from_matrices(q, rate, ca.SX(1), ca.SX(0), 9.81 * ca.sin(q), names=["q"]).names
        ('q',)
        """
        check_coordinates(s, s_dot)
        M, C, g = (as_expression(name, given) for name, given in (("M", M), ("C", C), ("g", g)))
        n = s.numel()
        damping = ca.SX.zeros(n) if damping is None else damping
        parts = {"M": (M, n, n), "C": (C, n, n), "g": (g, n, 1), "damping": (damping, n, 1)}
        known = describe_model(s, s_dot, parts, B, joints, names, units)
        residual = M @ known["s_ddot"] + C @ s_dot + g + damping
        arm = cls(**known, residual=residual, M=M, g=g, damping=ca.SX(damping), points=points, coriolis=C)
        validate(arm)
        return arm

    @classmethod
    def from_lagrangian(
        cls,
        s: ca.SX,
        s_dot: ca.SX,
        T: ca.SX,
        V: ca.SX,
        dissipation: ca.SX | None = None,
        resistance: ca.SX | None = None,
        B: ca.SX | None = None,
        joints: Sequence[int] | None = None,
        names: Sequence[str] | None = None,
        parameters: Parameters | None = None,
        points: ca.SX | None = None,
        check: bool = True,
        units: Sequence[str] | None = None,
    ) -> "Manipulator":
        """Make a manipulator from its energies by Lagrange's equations of the second kind.

            d/dt (dT/ds') - dT/ds + dV/ds + dR/ds' + r = B tau

        Assumes T quadratic in s'. The basic motion moves the coordinates `joints`.

        Parameters
        ----------
        s, s_dot : casadi.SX, shape (n, 1)
            Symbols of coordinates (rad, m) and rates.
        T, V : casadi.SX, shape (1, 1)
            Kinetic and potential energy, in J.
        dissipation : casadi.SX, shape (1, 1), optional
            Rayleigh's function R, in W.
        resistance : casadi.SX, shape (n, 1), optional
            Resisting forces r(s, s') that no R gives, in N m or N.
        B : casadi.SX, shape (n, m), optional
            Input matrix, a column for each of `joints`; by default each has a force of its own.
        joints : sequence of int, optional
            Coordinates that follow the basic motion; by default those that B drives. The others are zero along it: take such as are
            relative to the joints, the twist of a spring and not the angle behind it.
        names : sequence of str, optional
            Names of the coordinates.
        parameters : Parameters, optional
            Free symbols that the expressions may hold, with their values.
        points : casadi.SX, shape (2, k), optional
            World positions from the base to the tip, in m.
        check : bool
            Look whether the model obeys mechanics.
        units : sequence of {"rad", "m"}, optional
            Units of the coordinates; by default rad for `joints`, m for the others.

        Returns
        -------
        Manipulator
            The equations.

        Raises
        ------
        ModelError
            When a shape does not fit, an expression holds other symbols, or the energies contradict mechanics.

        References
        ----------
        Khang, Dat, Tuan (2019), Eq (55).

        Examples
        --------
        >>> import casadi as ca
        >>> from flexlin import Manipulator
        >>> q, rate = ca.SX.sym("q"), ca.SX.sym("rate")
        >>> arm = Manipulator.from_lagrangian(q, rate, rate**2 / 2, -9.81 * ca.cos(q))
        >>> arm.g
        SX((-(-9.81*sin(q))))
        """
        check_coordinates(s, s_dot)
        T, V = as_expression("T", T), as_expression("V", V)
        n = s.numel()
        R = ca.SX(0) if dissipation is None else dissipation
        resisting = ca.SX.zeros(n) if resistance is None else resistance
        parts = {"T": (T, 1, 1), "V": (V, 1, 1), "dissipation": (R, 1, 1), "resistance": (resisting, n, 1)}
        known = describe_model(s, s_dot, parts, B, joints, names, units, parameters)
        equations = derive_lagrange_equations(T, V, R, resisting, s, s_dot, known["s_ddot"])
        arm = cls(**known, **equations, energy=T + V, points=points)
        if check:
            need_quadratic(T, s, s_dot, arm.parameters)
            validate(arm)
        return arm


class FlexibleManipulator(Manipulator):
    """A manipulator whose links bend as curves; what that takes is derived when it is first asked for.

    near: the same in energies of second order in the deflections, so that its equations are exact to first order about a rigid motion.
    """

    near: Any = None

    def __init__(self, near: Manipulator):
        kept = {one.name: getattr(near, one.name) for one in fields(near) if one.name not in AT_LARGE}
        vars(self).update(kept, near=near)

    def at_numbers(self, values: Array) -> Manipulator:
        """The same equations with other values of the free numbers."""
        return FlexibleManipulator(self.near.at_numbers(values))

    def __reduce__(self) -> tuple[type, tuple[Manipulator]]:
        return FlexibleManipulator, (self.near,)


AT_LARGE = ["residual", "M", "g", "damping", "B", "energy", "points", "axes", "coriolis", "rotation", "loops"]
"""What differs at large deflections."""
for _name in (*AT_LARGE, "C", "functions"):
    setattr(FlexibleManipulator, _name, property(attrgetter(f"near.at_large.{_name}")))


def name_functions(arm: Manipulator) -> NamedFunctions:
    """Functions of s, s_dot, s_ddot and the phase as needed, and p: M, C, g, damping, residual; more if known."""
    p = arm.parameters.symbols
    at, moving = {"s": arm.s, "p": p}, {"s": arm.s, "s_dot": arm.s_dot, "p": p}
    loaded = moving if arm.phase is None else {"s": arm.s, "s_dot": arm.s_dot, "phase": arm.phase, "p": p}
    accelerated = {"s": arm.s, "s_dot": arm.s_dot, "s_ddot": arm.s_ddot, **loaded}
    inputs = {"M": at, "C": moving, "g": at, "damping": loaded, "residual": accelerated}
    more = {"energy": moving, "points": at, "axes": at, "rotation": at}
    inputs |= {name: known for name, known in more.items() if getattr(arm, name) is not None}
    table: dict[str, tuple[dict[str, ca.SX], Callable[[], ca.SX]]] = {
        name: (known, partial(getattr, arm, name)) for name, known in inputs.items()
    }
    if arm.loops is not None:
        loops, following = arm.loops, {"s": arm.s, "v": arm.loops.v, "p": p}
        table["followers"] = (at, lambda: loops.followers)
        table["closing"] = (following, lambda: ca.jacobian(loops.gap, loops.v))
        table["newton_step"] = (following, loops.newton_step)
    return NamedFunctions(table)
