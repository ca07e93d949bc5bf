"""What a simulation hands back, with the largest values sought between its output times too."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from flexlin.checks import SUM_ROUNDING, Array
from flexlin.plots.view import Series, Shown, View
from flexlin.summary import immutable

if TYPE_CHECKING:
    import xarray

PEAK_PARTS = 8
"""Parts of a step at whose ends peaks, and what saturates, are looked for; between these they are a parabola's."""
MOST_NUMBERS = 2**24
"""Numbers that are looked at, at the most; where steps are very many each has fewer parts."""
LARGEST_DEVIATION = 100.0
"""A deviation from the rigid motion, in rad or m, at which a simulation is given up as diverging, and a linear motion as lost."""
RESOLVED_SHARE = 0.05
"""An error of this share of the largest state leaves nothing to compare: motions that enlarge every error end so, whatever tol is."""
OUTGROWN = f"the linear motion grows beyond {LARGEST_DEVIATION:g} rad or m, the nonlinear one does not"
"""What to say of a linear motion that is lost."""


@dataclass(frozen=True)
class Peaks:
    """Largest absolute values: of the distances of the nonlinear tip from the linear one, and of both from the rigid one, in m; of the
    coordinates (n,) by the nonlinear equations, by the linear ones, and of their difference; of the torques (m,)."""

    difference: float
    tip: float
    tip_linear: float
    nonlinear: Array
    linear: Array
    apart: Array
    torque: Array

    @classmethod
    def of(cls, t: Array, y: tuple[Array, Array], tips: tuple[Array, Array, Array], torque: Array) -> "Peaks":
        """Those of series at times t (N,): y by both equations, (N, n); the nonlinear, the linear and the rigid tip; the torques (N, m).

        Torques may have corners, so no parabola is laid through them.
        """
        tip, linear, rigid = tips
        away = ((tip, linear), (tip, rigid), (linear, rigid))
        distances = [np.linalg.norm(one - other, axis=1) for one, other in away]
        found = find_peaks(t, np.column_stack([*distances, np.abs(y[0]), np.abs(y[1]), np.abs(y[0] - y[1])]))
        (difference, of_tip, of_linear), (both, by_linear, apart) = found[:3].tolist(), found[3:].reshape(3, -1)
        return cls(
            difference, of_tip, of_linear, both, by_linear, apart, torque=np.abs(torque).max(axis=0, initial=0.0)
        )


def find_peaks(t: Array, values: Array) -> Array:
    """The largest values (k,) of functions (N, k) at times t (N,): of the parabola through the largest one and its neighbours."""
    if len(t) < 3:
        return values.max(axis=0)
    column = np.arange(values.shape[1])
    at = np.clip(values.argmax(axis=0), 1, len(t) - 2)
    before, top, behind = (values[at + k, column] for k in (-1, 0, 1))
    left, right = t[at] - t[at - 1], t[at + 1] - t[at]
    with np.errstate(all="ignore"):
        rise, fall = (top - before) / left, (top - behind) / right
        bend = (rise + fall) / (left + right)
        slope = (rise * right - fall * left) / (left + right)
        more = np.minimum(slope**2 / (4 * bend), top - np.minimum(before, behind))
    inside = (top >= before) & (top >= behind) & (bend > 0)
    return np.maximum(values.max(axis=0), np.where(inside, top + more, -np.inf))


def subdivide(t: Array, reached: Array, columns: int) -> Array:
    """The output times t and, in order with them, the ends of the parts of all steps that ended at `reached`."""
    edges = np.union1d(t[[0, -1]], reached[(reached > t[0]) & (reached < t[-1])])
    parts = min(PEAK_PARTS, MOST_NUMBERS // (columns * len(edges)))
    if parts == 0:
        return t
    inner = edges[:-1, None] + np.diff(edges)[:, None] * np.arange(parts) / parts
    return np.union1d(t, inner)


@immutable
class Simulation(Shown):
    """A nonlinear simulation and the linear prediction of the same motion.

    Attributes
    ----------
    names : tuple of str
        Names of the n coordinates y.
    t : array, shape (N,)
        Times in s.
    nonlinear : array, shape (N, 2n)
        Deviation from the rigid motion [y; y'] by the nonlinear equations, in rad or m, and per s.
    linear : array, shape (N, 2n)
        The same by the linear equations.
    torque : array, shape (N, m)
        Torque that the drives give, in N m.
    tip, tip_linear, tip_rigid : array, shape (N, 2), or (N, 3) for an arm in space
        Positions of the tip, in m; not numbers when the manipulator gives no points.
    error : float
        Error of the nonlinear states, from a second run at a tenth of the tolerance, on other steps and by a method of another
        order, relative to the largest number of the states, or absolute below 1.
    linear_error : float
        Error of the linear states, in the same way.
    energy_error : float
        Largest mismatch between the energy and the work done by torques and damping, relative to the largest energy that went to and
        fro; not a number when the manipulator gives no energy.
    difference_error : float
        Error of `difference`, in m.
    units : tuple of str
        Units of the n coordinates.
    controller : array, shape (N, k)
        States of the controller: integrals of errors, filters.
    controller_names : tuple of str
        Their names.
    driven_by : str
        What moves the arm, in words: feedforward, feedback, both or none.
    events : tuple of (float, str, str)
        Times in s at which a joint sticks, slides from rest or turns round, where friction has `static`; its name, and which.
    peaks : Peaks or None
        Largest values, sought between the times too; None: those at the times.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": []})
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> run = fl.simulate(lin, periods=0.25, tol=1e-6)
    >>> run.difference > run.difference_error, sorted(run.to_xarray().coords)
    (True, ['axis', 'state', 'time', 'unit'])
    """

    names: tuple[str, ...]
    t: Array
    nonlinear: Array
    linear: Array
    torque: Array
    tip: Array
    tip_linear: Array
    tip_rigid: Array
    error: float
    linear_error: float
    energy_error: float
    difference_error: float
    units: tuple[str, ...] = ()
    controller: Array = field(default_factory=lambda: np.zeros((0, 0)))
    controller_names: tuple[str, ...] = ()
    events: tuple[tuple[float, str, str], ...] = ()
    peaks: Peaks | None = None
    driven_by: str = ""

    @property
    def largest(self) -> Peaks:
        """The largest values."""
        if self.peaks is not None:
            return self.peaks
        y = (self.nonlinear[:, : len(self.names)], self.linear[:, : len(self.names)])
        return Peaks.of(self.t, y, (self.tip, self.tip_linear, self.tip_rigid), self.torque)

    @property
    def difference(self) -> float:
        """The largest distance between the nonlinear and the linear tip, in m."""
        return self.largest.difference

    @property
    def tip_error(self) -> float:
        """The largest distance of the nonlinear tip from the rigid one, in m."""
        return self.largest.tip

    @property
    def deviation(self) -> float:
        """The largest deviation of a coordinate from the rigid motion, in rad or m."""
        return float(self.largest.nonlinear.max())

    @property
    def peak_torque(self) -> Array:
        """The largest torque of each drive, (m,) in N m."""
        return self.largest.torque

    @property
    def status(self) -> str:
        """How far the linear model can be trusted here, and what to do."""
        if self.is_unresolved:
            return self.unresolved
        if self.is_lost:
            return f"{OUTGROWN}: beyond the linear model; trust the simulation only"
        what, apart, largest, error = self.apart
        if apart <= error:
            agree = f"agree to the error of the integration, {error:.0e}{self.unit}" if error else "are the same"
            return f"linear and nonlinear {what} {agree}: the linear model holds here"
        if apart <= SUM_ROUNDING * max(1.0, float(np.abs(np.nan_to_num(self.tip)).max())):
            return f"linear and nonlinear {what} agree to rounding: the linear model holds here"
        share = apart / largest
        facts = f"linear and nonlinear {what} differ by {apart:.3g}{self.unit}, {100 * share:.2g} % of the largest deviation"
        if share > 0.2:
            return f"{facts}: {say_beyond(self)}"
        return f"{facts}: the linear model holds here"

    @property
    def sticking(self) -> str:
        """Which joints stick, how often and for how long; nothing where none does."""
        said = []
        events = [event for event in self.events if event[2] != "turns"]
        for joint in dict.fromkeys(name for _, name, _ in events):
            changes = [(t, what == "sticks") for t, name, what in events if name == joint]
            times = [self.t[0], *(t for t, _ in changes), self.t[-1]]
            stuck = [not changes[0][1], *(sticks for _, sticks in changes)]
            rest = float(sum(np.diff(times)[stuck]))
            share = 100 * rest / float(self.t[-1] - self.t[0])
            said.append(
                f"{joint} comes to rest {sum(sticks for _, sticks in changes)} times and sticks for {share:.3g} % of the time"
            )
        return "; ".join(said)

    @property
    def unit(self) -> str:
        """The unit of what is compared: metres of the tips; coordinates bear their own."""
        return " m" if np.isfinite(self.difference) else ""

    @property
    def is_lost(self) -> bool:
        """Whether the linear motion has left all that an arm can do."""
        return not bool((np.abs(self.linear[:, : len(self.names)]) < LARGEST_DEVIATION).all())

    @property
    def is_unresolved(self) -> bool:
        """Whether the nonlinear motion is not known well enough to compare anything with it."""
        return self.error > RESOLVED_SHARE

    @property
    def unresolved(self) -> str:
        """What to say then."""
        return (
            f"the nonlinear motion is known to {100 * min(self.error, 1.0):.0f} % of its largest state only, and judges no linear model: "
            "simulate fewer periods, since some motions enlarge every error, or ask for a smaller tol"
        )

    @property
    def apart(self) -> tuple[str, float, float, float]:
        """What is compared, how far the two answers are apart, the largest deviation of either, and the error of the difference.

        Tips in m against tips; for a model without points that coordinate of which the linear answer misses the largest share.
        """
        peaks = self.largest
        if self.is_lost:
            return "tips", np.inf, peaks.tip, 0.0
        if np.isfinite(peaks.difference):
            return "tips", peaks.difference, max(peaks.tip, peaks.tip_linear), self.difference_error
        error = (self.error + self.linear_error) * max(1.0, float(np.abs(self.nonlinear).max()))
        apart, largest = peaks.apart, np.maximum(peaks.nonlinear, peaks.linear)
        share = np.where(apart > error, apart / np.where(largest > 0, largest, 1.0), 0.0)
        worst = int(np.argmax(share)) if share.any() else int(np.argmax(apart))
        return self.names[worst], float(apart[worst]), float(largest[worst]), error

    def to_xarray(self) -> "xarray.Dataset":
        """Return all series as a dataset.

        Returns
        -------
        xarray.Dataset
            The series by time, with the errors as attributes.
        """
        import xarray

        states = [*self.names, *[f"{name}_rate" for name in self.names]]
        units = [*self.units, *[f"{unit}/s" for unit in self.units]] or [""] * len(states)
        units_of = {"axis": {"units": "m"}, "input": {"units": "N m, or N on a joint that slides"}}
        axes = {"nonlinear": "state", "linear": "state", "torque": "input"}
        axes |= dict.fromkeys(("tip", "tip_linear", "tip_rigid"), "axis")
        series = {name: (("time", axis), getattr(self, name), units_of.get(axis, {})) for name, axis in axes.items()}
        coords = {
            "time": ("time", self.t, {"units": "s"}),
            "state": states,
            "axis": list("xyz")[: self.tip.shape[1]],
            "unit": ("state", units),
        }
        if self.controller_names:
            series["controller"] = (("time", "memory"), self.controller, {})
            coords["memory"] = list(self.controller_names)
        errors = {name: getattr(self, name) for name in ("linear_error", "difference_error", "energy_error")}
        return xarray.Dataset(series, coords, {"integration_error": self.error, **errors})

    def _view(self) -> View:
        pairs = [("nonlinear", "line"), ("linear", "dashed")]
        if np.isfinite(self.difference):
            away = [np.linalg.norm(tip - self.tip_rigid, axis=1) for tip in (self.tip, self.tip_linear)]
            label = "tip off its rigid path in m"
        else:
            away = [states[:, 0] for states in (self.nonlinear, self.linear)]
            label = f"{self.names[0]} minus its rigid motion" + (f" in {self.units[0]}" if self.units else "")
        series = tuple(Series(name, self.t, y, style) for (name, style), y in zip(pairs, away, strict=True))
        driven = [f"driven by {self.driven_by}"] if self.driven_by else []
        facts = (*driven, self.status, f"integration error {self.error:.0e}, energy error {self.energy_error:.0e}")
        return View(f"simulation of {self.t[-1]:.4g} s", "", facts, "time in s", label, series)


def say_beyond(run: Simulation) -> str:
    """What to do where the linear answer misses the nonlinear one; joints that stick do so for longer in a slower motion."""
    less = "" if run.sticking else "reduce speed, payload or disturbance, or "
    return f"beyond the linear model; {less}trust the simulation only"
