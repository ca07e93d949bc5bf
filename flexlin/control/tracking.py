"""Feedforward for tracking: the motion that the elastic arm should make, and the torque that it takes."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import SAMPLES, Array, at_times, whole
from flexlin.control.sensors import points_of
from flexlin.errors import ArgumentError
from flexlin.linearization.deviation import Deviation
from flexlin.linearization.law import Law
from flexlin.linearization.linearization import Linearization
from flexlin.plots.view import Series, Shown, View

if TYPE_CHECKING:
    import xarray

    from flexlin.linearization.harmonic_balance import Closing, Unknowns
    from flexlin.linearization.periodic_motion import PeriodicMotion

LEAST_TOL = 1e-8
"""The smallest error that a scene's feedforward is asked for."""


@dataclass(frozen=True, eq=False)
class Feedforward(Shown):
    """What to feed forward, and the deviation from the rigid motion that belongs to it.

        torque = torque(t) - K ([y; y'] - reference(t))

    Attributes
    ----------
    kind : str
        "rigid", "joint-exact" or "tip-exact".
    motion : PeriodicMotion or None
        The elastic periodic motion; None for "rigid".
    lin : Linearization
        What it was computed for.
    tip_error : float
        Largest distance of the tip from the rigid motion's tip when the reference is met, by the nonlinear equations, in m.
    linear_tip_error : float
        The same by the linear equations, in m.
    error : float
        Error of the periodic solution, relative to the largest deviation.
    status : str
        What to make of it.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> forward = fl.control.feedforward(lin, "joint-exact")
    >>> forward.torque([0.0, 0.5]).shape, forward.reference([0.0, 0.5]).shape
    ((2, 1), (2, 6))
    """

    kind: str
    motion: "PeriodicMotion | None"
    lin: Linearization
    tip_error: float
    linear_tip_error: float
    error: float
    status: str

    def __repr__(self) -> str:
        return f"Feedforward({self.kind}, tip error {self.tip_error:.3g} m, error {self.error:.1e})"

    def to_xarray(self, points: int = 257) -> "xarray.Dataset":
        """Return torque and reference as tables.

        Parameters
        ----------
        points : int
            Times of the period, both ends included.

        Returns
        -------
        xarray.Dataset
            torque by time and input, reference by time and state; kind, tip error and status as attributes.
        """
        import xarray

        lin, t = self.lin, np.linspace(0.0, self.lin.period, whole("points", points, 2))
        values = {"torque": (("time", "input"), self.torque(t)), "reference": (("time", "state"), self.reference(t))}
        states = [*lin.names, *(f"{name}_rate" for name in lin.names)]
        axes = {"time": ("time", t, {"units": "s"}), "input": list(lin.inputs), "state": states}
        attributes = {"kind": self.kind, "tip_error": self.tip_error, "error": self.error, "status": self.status}
        return xarray.Dataset(values, coords=axes, attrs=attributes)

    def _view(self) -> View:
        t = np.linspace(0.0, self.lin.period, SAMPLES + 1)
        units, torque = self.lin.input_units, self.torque(t)
        series = tuple(Series(name, t, curve) for name, curve in zip(self.lin.inputs, torque.T, strict=True))
        facts = (
            f"the tip leaves the rigid motion's by {self.tip_error:.3g} m, by the linear equations {self.linear_tip_error:.3g} m",
            f"error {self.error:.1e}: {self.status}",
        )
        label = f"torque in {' or '.join(dict.fromkeys(units))}"
        return View(f"Feedforward, {self.kind}", "", facts, "t in s", label, series)

    @property
    def law(self) -> Law:
        """This feedforward with the feedback of `lin`."""
        own = self.lin.law
        if self.motion is None:
            return replace(own, feedforward=self.kind, forward=self.lin.feedforward)
        return replace(own, feedforward=self.kind, forward=self.motion.torque, reference=self.motion.state)

    def torque(self, t: ArrayLike) -> Array:
        """Return the torque to feed forward.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, m) or (m,)
            The torque in N m (N for sliding joints, V for motors).
        """
        return at_times(self.law.forward, t)

    def reference(self, t: ArrayLike) -> Array:
        """Return the deviation from the rigid motion that the feedback should hold.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, 2n) or (2n,)
            [y; y'], in rad or m, and per s.
        """
        return at_times(self.law.reference, t)


def joints_exact(about: Deviation, at: "Unknowns") -> ca.SX:
    """The motors' encoders read exactly what they would on the rigid arm."""
    return about.arm.encoders[list(about.driven), :] @ (at.s - at.rigid)


def tip_exact(about: Deviation, at: "Unknowns") -> ca.SX:
    """Each link's end lies on the line of the rigid link: the chord's cross product with the rigid direction, in m."""
    points = points_of(about.arm)
    if points.rows() != 2:
        what, todo = "tip-exact is for an arm in its plane", "take joint-exact"
        raise ArgumentError(what, got="an arm in space", expected="points in x and y", todo=todo)
    bent, straight = (ca.substitute(points, about.arm.s, s) for s in (at.s, at.rigid))
    chords, lines = bent[:, 1:] - bent[:, :-1], straight[:, 1:] - straight[:, :-1]
    return ca.vertcat(
        *[(lines[0, i] * chords[1, i] - lines[1, i] * chords[0, i]) / ca.norm_2(lines[:, i]) for i in about.driven]
    )


CLOSINGS: "dict[str, Closing]" = {"joint-exact": joints_exact, "tip-exact": tip_exact}
KINDS = ("rigid", *CLOSINGS)


@checked
def feedforward(lin: Linearization, kind: str = "tip-exact", tol: float = 1e-8) -> Feedforward:
    """Compute the feedforward of a periodic motion.

        rigid:        the torque of the rigid arm, nothing else; the elastic links bend and the loop drags the joints off
        joint-exact:  encoders(s) = encoders(s_R); the links take their periodic bending
        tip-exact:    each link's end on its rigid line

    The plant is not of minimum phase at its tip: integrated forwards the tip-exact torque would grow without bound, but its periodic
    solution exists (stable inversion). Assumes a periodic, smooth motion, and no multiplier at 1 of the arm with its joints (or its
    tip) held.

    Parameters
    ----------
    lin : Linearization
        With or without a loop.
    kind : {"rigid", "joint-exact", "tip-exact"}
        What is to be exact.
    tol : float
        Wanted error of the periodic motion, relative to the largest deviation.

    Returns
    -------
    Feedforward
        Torque and reference, with the tip errors that remain.

    Raises
    ------
    ArgumentError
        For an unknown kind, a manipulator without points, tip-exact of an arm in space, or when nothing is driven.
    MotionError
        For a one-way motion.
    NumericalError
        When no periodic motion is found.

    References
    ----------
    Bayo, A finite-element approach to control the end-point motion of a single-link flexible robot, J. Robotic Systems 4 (1987) 63;
    Devasia, Chen, Paden, Nonlinear inversion-based output tracking, IEEE TAC 41 (1996) 930.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> for kind in ("rigid", "joint-exact", "tip-exact"):
    ...     print(f"{kind}: {1000 * fl.control.feedforward(lin, kind, tol=1e-6).tip_error:.2f} mm")
    rigid: 88.82 mm
    joint-exact: 86.01 mm
    tip-exact: 0.67 mm
    """
    if kind not in KINDS:
        raise ArgumentError("there is no such feedforward", got=repr(kind), expected=", ".join(KINDS))
    if not lin.driven:
        raise ArgumentError("nothing to feed forward", got="every joint prescribed", expected="a torque-driven joint")
    from flexlin.linearization.periodic_motion import periodic_motion

    closing = CLOSINGS.get(kind)
    motion = periodic_motion(lin, closing, tol=tol)
    first = periodic_motion(lin, closing, tol=tol, linear=True)
    kept = motion if closing else None
    return Feedforward(
        kind, kept, lin, tip_distance(lin, motion), tip_distance(lin, first), motion.error, motion.status
    )


def scene_feedforward(lin: Linearization, tol: float = 1e-8) -> Feedforward | None:
    """The feedforward of the elastic motion that the scene asks for; None where it asks for another, or for none.

    Raises: what `feedforward` raises.
    """
    control = lin.control
    if control is None or control.feedforward not in CLOSINGS:
        return None
    return feedforward(lin, control.feedforward, max(tol, LEAST_TOL))


def tip_distance(lin: Linearization, motion: "PeriodicMotion") -> float:
    """The largest distance of the tip from the rigid motion's tip, in m; nan when the manipulator has no points."""
    t = lin.period * np.arange(512) / 512
    moved, rigid = (tip_positions(lin, t, y) for y in (motion(t), np.zeros((len(t), lin.n))))
    return float(np.linalg.norm(moved - rigid, axis=1).max())


def tip_positions(lin: Linearization, t: Array, states: Array) -> Array:
    """Return world positions of the tip for deviations from the rigid motion.

    Parameters
    ----------
    lin : Linearization
        With n coordinates.
    t : array, shape (N,)
        Times in s.
    states : array, shape (N, n) or (N, 2n)
        Deviations y or [y; y'], in rad or m.

    Returns
    -------
    array, shape (N, 2), or (N, 3) for an arm in space
        Positions in m; not numbers when the manipulator gives no points.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> from flexlin.simulation import tip_positions
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    >>> tip_positions(lin, np.zeros(1), np.zeros((1, 3))).tolist()
    [[0.96, 0.0]]
    """
    if lin.arm.near.points is None:
        return np.full((len(t), 2), np.nan)
    return arm_positions(lin, t, states)[0][:, :, -1]


def arm_positions(lin: Linearization, t: Array, states: Array) -> tuple[Array, Array]:
    """World positions (N, 2, k) of joints and tip in m, and all coordinates s (N, arm.n), for deviations from the rigid motion."""
    (s,) = lin.about.positions(t, states[:, : lin.n])
    return lin.about.at_positions("points", t, s), s
