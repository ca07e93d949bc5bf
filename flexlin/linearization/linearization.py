"""What `linearize` returns: M_L y'' + D_L y' + K_L y = h_L + B_L u along the rigid basic motion, and the periodic system of it."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import SAMPLES, Array, at_times, times, whole
from flexlin.errors import MotionError, counted
from flexlin.lazy import lazy
from flexlin.linearization.closed_loops import keeps_clear
from flexlin.linearization.deviation import Deviation
from flexlin.linearization.law import Controller, Feedback, Law, scene_law
from flexlin.mechanics.coordinates import Coordinate
from flexlin.mechanics.effects import Effect, effects_of
from flexlin.mechanics.effects.narrow import Features
from flexlin.mechanics.manipulator import Manipulator
from flexlin.motion import Motion, SymbolicMotion
from flexlin.periodic.coefficients import SecondOrder, build_companion, build_input
from flexlin.periodic.system import PeriodicSystem
from flexlin.plots.view import Series, Shown, View
from flexlin.scene.control import Control
from flexlin.scene.parameters import replace_value
from flexlin.summary import immutable
from flexlin.symbolic import Part

if TYPE_CHECKING:
    import xarray

Route = Literal["jacobian", "kronecker"]


@immutable
class Coefficients:
    """M_L, D_L, K_L (N, n, n), h_L (N, n), B_L (N, n, m) and the feedforward torque of the rigid motion tau (N, m), at N times."""

    M: Array
    D: Array
    K: Array
    h: Array
    B: Array
    tau: Array


@dataclass(frozen=True, eq=False)
class Linearization(Shown):
    """The linear equations of the small motion y about the rigid basic motion s_R.

        M_L(t) y'' + D_L(t) y' + K_L(t) y = h_L(t) + B_L(t) u,     s = s_R + y

    Without a loop h_L = -(M s_R'' + C s_R' + g + d) and u is the whole torque. With a loop, torque = feedforward + feedback + u:
    D_L and K_L hold what of the feedback answers at once, h_L the feedforward. The coefficients are one CasADi function; a loop adds
    B gain to [K_L, D_L] and the torque of the rigid motion to h_L. Integrals and filters of the loop are states z behind the arm's own:
    x = [y; y'; z].

    Attributes
    ----------
    about : Deviation
        The deviation y in which the equations are written.
    of_arm : casadi.Function
        Place on the motion and free parameters -> M, D, K, h, B, tau of the arm without a loop.
    route : {"jacobian", "kronecker"}
        How they were derived.
    control : Control or None
        The scene's control, when its loop is closed.
    feedback : Feedback or None
        Its feedback, as a function of the free parameters.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    >>> lin.n, lin.inputs, lin.K(0.0).shape, lin.B([0.0, 0.1]).shape
    (3, ('q1',), (3, 3), (2, 3, 1))
    >>> lin.forcing([0.0]).shape
    (1, 6)
    """

    about: Deviation
    of_arm: ca.Function
    route: Route
    control: Control | None = None
    feedback: Feedback | None = None

    def __repr__(self) -> str:
        return f"Linearization({'; '.join(self._names())})"

    @property
    def arm(self) -> Manipulator:
        """The manipulator."""
        return self.about.arm

    @property
    def motion(self) -> Motion:
        """The rigid basic motion."""
        return self.about.motion

    @property
    def kept(self) -> tuple[int, ...]:
        """Which coordinates of the arm are in y."""
        return self.about.kept

    @property
    def driven(self) -> tuple[int, ...]:
        """Which joints a torque drives."""
        return self.about.driven

    @property
    def period(self) -> float:
        """The period of the basic motion, in s."""
        return self.motion.period

    @property
    def n(self) -> int:
        """The number of coordinates of the linear equations."""
        return self.about.n

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """What each coordinate of y is."""
        return tuple(self.arm.coordinates[k] for k in self.kept)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the coordinates y."""
        return tuple(self.arm.names[k] for k in self.kept)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The names of the coordinates that the inputs drive."""
        return tuple(self.arm.names[self.arm.drives[i]] for i in self.driven)

    def sample(self, t: Array) -> Coefficients:
        """Return all coefficients at many times, in one mapped call.

        Parameters
        ----------
        t : array, shape (N,)
            Times in s.

        Returns
        -------
        Coefficients
            M, D, K (N, n, n), h (N, n), B (N, n, m) and the torque of the rigid motion tau (N, m).
        """
        M, D, K, h, B, tau = self.about.evaluate(self.coefficients, times(t))
        return Coefficients(M, D, K, h[:, :, 0], B, tau[:, :, 0])

    def _part(self, t: Array, *names: str) -> Any:
        """Some of the coefficients at times (N,), without the work for the others."""
        return self.about.evaluate(Part(self.coefficients, names), times(t))

    def M(self, t: ArrayLike) -> Array:
        """Return the mass matrix, Eq (65).

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n, n) or (n, n)
            M_L, in kg m^2, kg m and kg.
        """
        return at_times(lambda t: self.mass_and_input(t)[0], t)

    def D(self, t: ArrayLike) -> Array:
        """Return the matrix of y', Eq (66).

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n, n) or (n, n)
            D_L, in the unit of M per s.
        """
        return at_times(lambda t: self.equations(t)[1], t)

    def K(self, t: ArrayLike) -> Array:
        """Return the matrix of y, Eq (67).

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n, n) or (n, n)
            K_L, in the unit of M per s^2.
        """
        return at_times(lambda t: self.equations(t)[2], t)

    def h(self, t: ArrayLike) -> Array:
        """Return the forcing that the rigid motion leaves over, Eq (64).

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n) or (n,)
            h_L, in N m or N.
        """
        return at_times(lambda t: self.sample(t).h, t)

    def B(self, t: ArrayLike) -> Array:
        """Return the input matrix.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n, m) or (n, m)
            B_L.
        """
        return at_times(lambda t: self.mass_and_input(t)[1], t)

    def feedforward(self, t: ArrayLike) -> Array:
        """Return the torque of the rigid motion: what the arm would need if its links were rigid.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, m) or (m,)
            The torque, in N m (N for sliding joints, V for motors).
        """
        return at_times(lambda t: self._part(t, "tau")[0][:, :, 0], t)

    def equations(self, t: Array) -> tuple[Array, Array, Array]:
        """Return M, D, K without the rest.

        Parameters
        ----------
        t : array, shape (N,)
            Times in s.

        Returns
        -------
        tuple of array, each of shape (N, n, n)
            M, D, K.
        """
        return self._part(t, "M", "D", "K")

    def mass_and_input(self, t: Array) -> tuple[Array, Array]:
        """Return M and B without the rest.

        Parameters
        ----------
        t : array, shape (N,)
            Times in s.

        Returns
        -------
        M : array, shape (N, n, n)
            Mass matrix.
        B : array, shape (N, n, m)
            Input matrix.
        """
        return self._part(t, "M", "B")

    @property
    def input_units(self) -> tuple[str, ...]:
        """The units of the inputs: what an effect makes of them, such as V behind a motor, else the force of each joint."""
        return self.about.input_units

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times in [0, T) at which the coefficients lose smoothness."""
        return self.motion.breaks

    @property
    def features(self) -> Features:
        """Pairs (time, half-width) in s about which the coefficients change fast: what motion and effects know of it."""
        own = (pair for effect in self.effects for pair in effect.features(self.motion))
        return tuple(sorted([*self.motion.features, *own]))

    @property
    def may_be_narrow(self) -> bool:
        """Whether an effect in the arm may have features, for some values of its numbers."""
        return any(type(effect).features is not Effect.features for effect in self.effects)

    @lazy
    def complete(self) -> bool:
        """Whether breaks and features name everything in the coefficients that is narrower than T/200."""
        known = self.arm.effects is not None and all(effect.smooth for effect in self.effects)
        if not known or not self.motion.complete:
            return False
        return self.arm.near.loops is None or (not self.may_be_narrow and keeps_clear(self.about.near))

    def at_numbers(self, values: Array, period: float) -> "Linearization":
        """Return the same equations with other values of the arm's free numbers.

        Assumes a motion that is an expression of these numbers.

        Parameters
        ----------
        values : array, shape (P,)
            The values of `arm.parameters`.
        period : float
            The period of the motion that they make, in s.

        Returns
        -------
        Linearization
            The equations, with nothing derived anew.
        """
        about, motion = self.about, self.motion
        assert isinstance(motion, SymbolicMotion)
        arm = self.arm.at_numbers(values)
        moved = replace(self, about=replace(about, arm=arm, motion=motion.at_numbers(values, period)))
        vars(moved)["coefficients"] = self.coefficients
        return moved

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects in the arm, with the present values of its free numbers; none where they are not known."""
        arm, tables = self.arm, self.arm.effects
        if tables is None:
            return ()
        for path, value in zip(arm.parameters.paths, arm.parameters.values, strict=True):
            if path.startswith("effects."):
                tables = replace_value(tables, path.removeprefix("effects."), float(value))
        return effects_of(tables)

    @lazy
    def coefficients(self) -> ca.Function:
        """Place on the motion and free parameters -> M, D, K, h, B, tau, with what the loop adds."""
        if self.control is None or self.feedback is None:
            return self.of_arm
        names, inputs = self.of_arm.name_out(), self.of_arm.sx_in()
        values = dict(zip(names, self.of_arm.call(inputs), strict=True))
        values |= self.feedback.close(values, inputs[-1])
        if self.control.feedforward != "none":
            values["h"] += values["B"] @ values["tau"]
        dense = [ca.densify(value) for value in values.values()]
        return ca.Function(self.of_arm.name(), inputs, dense, self.of_arm.name_in(), names)

    @lazy
    def closed_by(self) -> Law:
        """The law that the linear equations hold: the scene's, or no torque at all where they were made without one."""
        return scene_law(self.about, self.control, self.feedforward, self.feedback)

    @property
    def law(self) -> Law:
        """The law that runs on the arm unless another is given: the scene's, or the torque of the rigid motion alone."""
        return self.closed_by if self.control else scene_law(self.about, Control(), self.feedforward, None)

    @lazy
    def controller(self) -> Controller | None:
        """What the loop remembers, if it is closed and remembers anything."""
        return self.closed_by.controller

    @property
    def states(self) -> int:
        """The number of states 2n + k, the controller's k included."""
        return 2 * self.n + (0 if self.controller is None else self.controller.states)

    def periodic_system(self) -> PeriodicSystem:
        """Return the linear system x' = A(t) x + B(t) u with x = [y; y'], followed by the controller's states z.

        Returns
        -------
        PeriodicSystem
            The system of 2n + k states; k = 0 unless the loop has integrals or filters.

        Raises
        ------
        MotionError
            For a one-way motion, which has no period.
        """
        if not self.motion.periodic:
            raise MotionError(
                "a one-way motion has no period",
                got="course = 'one-way'",
                expected="a periodic basic motion",
                todo="use course = 'there-and-back', or a finite-horizon design",
            )
        return self._periodic_system

    @lazy
    def _periodic_system(self) -> PeriodicSystem:
        """Made once, so that its coefficients are resolved once."""
        force, B = (self.B, self.input_matrix) if self.about.m else (None, None)
        second_order = None if self.controller is not None else SecondOrder(self.equations, force)
        return PeriodicSystem(self.A, self.period, B, self.breaks, second_order, self.features, self.complete)

    def A(self, t: ArrayLike) -> Array:
        """Return A = [[0, I], [-M^-1 K, -M^-1 D]], with a controller [[A, -[0; M^-1 B] gain_z], [rates]].

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, 2n + k, 2n + k) or (2n + k, 2n + k)
            A(t).

        Raises
        ------
        SingularMassMatrix
            When M cannot be inverted.
        """
        return at_times(self._state_matrix, t)

    def _state_matrix(self, t: Array) -> Array:
        A, controller = build_companion(self.equations(t), t), self.controller
        if controller is None:
            return A
        upper = -build_input(*self.mass_and_input(t), t) @ self.closed_by.gain(t)[:, :, 2 * self.n :]
        lower = np.broadcast_to(controller.rates, (len(t), *controller.rates.shape))
        return np.concatenate([np.concatenate([A, upper], axis=2), lower], axis=1)

    def input_matrix(self, t: ArrayLike) -> Array:
        """Return the input matrix in state form, [0; M^-1 B; 0]: a torque beside the controller's.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, 2n + k, m) or (2n + k, m)
            B(t).

        Raises
        ------
        SingularMassMatrix
            When M cannot be inverted.
        """
        return at_times(lambda t: self._with_controller(build_input(*self.mass_and_input(t), t)), t)

    def forcing(self, t: ArrayLike) -> Array:
        """Return the forcing in state form, [0; M^-1 h; 0], x' = A x + forcing.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, 2n + k) or (2n + k,)
            The forcing, in the unit of x per s.

        Raises
        ------
        SingularMassMatrix
            When M cannot be inverted.
        """
        return at_times(self._forcing, t)

    def _forcing(self, t: Array) -> Array:
        M, h = self._part(t, "M", "h")
        return self._with_controller(build_input(M, h, t))[:, :, 0]

    def to_xarray(self, points: int = 257) -> "xarray.Dataset":
        """Return the coefficients as tables with names and units.

        Parameters
        ----------
        points : int
            Times of the motion, both ends included.

        Returns
        -------
        xarray.Dataset
            M, D, K by time, equation and coordinate, h, B and tau; beside the coordinates' names their units and the robot's joints.
        """
        import xarray

        t = np.linspace(0.0, self.period, whole("points", points, 2))
        c, square = self.sample(t), ("time", "equation", "coordinate")
        values = {"M": (square, c.M), "D": (square, c.D), "K": (square, c.K), "h": (square[:2], c.h)}
        values |= {"B": (("time", "equation", "input"), c.B), "tau": (("time", "input"), c.tau)}
        units = [one.unit for one in self.coordinates]
        axes = {
            "time": ("time", t, {"units": "s"}),
            "equation": list(self.names),
            "coordinate": list(self.names),
            "input": list(self.inputs),
            "unit": ("coordinate", units),
            "joint": ("coordinate", [one.joint for one in self.coordinates]),
        }
        return xarray.Dataset(values, coords=axes, attrs={"period": self.period, "closed": self.control is not None})

    def _view(self) -> View:
        t = np.linspace(0.0, self.period, SAMPLES + 1)
        c, unbalanced = self.sample(t), self._unbalanced(t)
        squares = np.sort(np.linalg.eigvals(np.linalg.solve(c.M, c.K)).real, axis=1)
        curves = np.sqrt(np.where(squares > 0, squares, np.nan)) / (2 * np.pi)
        series = tuple(Series(f"mode {i + 1}", t, curve) for i, curve in enumerate(curves.T))
        facts = (*self._names(), *([unbalanced] if unbalanced else []))
        title = "M y'' + D y' + K y = h + B u along the rigid motion"
        return View(title, "", facts, "t in s", "sqrt(eig M⁻¹K) / 2π in Hz", series)

    def _names(self) -> tuple[str, ...]:
        """Coordinates, inputs, time and states in words."""
        named = ", ".join(f"{one.title} in {one.unit}" for one in self.coordinates)
        driven = ", ".join(f"{name} in {unit}" for name, unit in zip(self.inputs, self.input_units, strict=True))
        time = f"{'period' if self.motion.periodic else 'duration'} {self.period:.6g} s"
        loop = "loop closed" if self.control is not None else "loop open"
        return f"y: {named}", f"u: {driven or 'none'}", f"{time}, {loop}, {counted(self.states, 'state')}"

    def _unbalanced(self, t: Array) -> str:
        """What of h no input balances, in words: the deviation that the arm then has is no error of the equations."""
        c = self.sample(t)
        inputs = np.linalg.pinv(c.B) if c.B.shape[2] else np.zeros((len(t), 0, self.n))
        left = np.abs(c.h - (c.B @ inputs @ c.h[:, :, None])[:, :, 0]).max(axis=0)
        if not left.any():
            return ""
        worst = int(np.argmax(left))
        unit = {"rad": "N m", "m": "N"}.get(self.coordinates[worst].unit, "")
        return (
            f"up to {left[worst]:.3g} {unit} in {self.coordinates[worst].title} that no input balances: "
            "the arm leaves its rigid motion for one that flexlin.control.periodic_motion finds"
        )

    def _with_controller(self, columns: Array) -> Array:
        """Columns (N, 2n, p) of the arm's states, with zeros for those of the controller."""
        return np.pad(columns, ((0, 0), (0, self.states - 2 * self.n), (0, 0)))
