"""What the scene's equations say a log should read, window by window, held against what it reads."""

from typing import TYPE_CHECKING

import numpy as np

from flexlin.arguments import checked
from flexlin.checks import Array, positive
from flexlin.errors import NumericalError, counted
from flexlin.identification.equations import Logged
from flexlin.identification.least_squares import Point, Problem, solve
from flexlin.identification.log import Log, varies
from flexlin.identification.shooting import Shooting, Windows, count_substeps
from flexlin.plots.view import Series, Shown, View
from flexlin.scene.scene import Scene
from flexlin.summary import immutable

if TYPE_CHECKING:
    import xarray

MISSED_FIT = 50.0
"""Fit in percent below which a column is said to be missed."""
START_SECONDS = 0.2
"""Seconds of a window from which its starting state is found."""


@immutable(eq=False)
class Prediction(Shown):
    """What was predicted of a log, and how well.

    Attributes
    ----------
    fit : dict of str to float
        By column, 100 (1 - |measured - predicted| / |measured - mean|) over all windows, in percent; not a number where nothing varies.
    time : array, shape (N,)
        Times of the samples in all windows, in s.
    outputs, measured : dict of str to array, shape (N,)
        Predicted and measured readings by column.
    starts : array, shape (W,)
        Times in s at which the windows begin.
    states : array, shape (W, 2n)
        Starting states [s; s'].
    status : str
        What the figures rest on.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> t = np.arange(500) * 0.01
    >>> scene = fl.load_scene("single-link")
    >>> log = fl.Log(t, inputs={"q1": 0 * t}, outputs={"q1": 0.1 + 0.2 * t})
    >>> fl.predict(scene, log).fit["q1"] < 100
    True
    """

    fit: dict[str, float]
    time: Array
    outputs: dict[str, Array]
    measured: dict[str, Array]
    starts: Array
    states: Array
    status: str

    def to_xarray(self) -> "xarray.Dataset":
        """Return predicted and measured readings as a dataset.

        Returns
        -------
        xarray.Dataset
            By time and column, with the fit of each column.
        """
        import xarray

        columns = list(self.outputs)
        series = {
            name: (("time", "column"), np.stack([group[column] for column in columns], axis=1))
            for name, group in (("predicted", self.outputs), ("measured", self.measured))
        }
        fit = ("column", [self.fit[column] for column in columns], {"units": "percent"})
        return xarray.Dataset({**series, "fit": fit}, coords={"time": self.time, "column": columns})

    def _view(self) -> View:
        worst = min(self.fit, key=lambda name: self.fit[name])
        facts = (*map(say_fit, self.fit, self.fit.values()), self.status)
        pairs = (("measured", self.measured, "line"), ("predicted", self.outputs, "dashed"))
        series = tuple(Series(name, self.time, group[worst], style) for name, group, style in pairs)
        return View("prediction of a log", "", facts, "time in s", worst, series)


@checked
def predict(scene: Scene, log: Log, window: float = 2.0, settle: float = START_SECONDS) -> Prediction:
    """Predict what the sensors of a log read from its inputs alone, window by window, and compare.

        x' = f(x, u(t)),   reading = (h(x, u) - offset) / gain,   at the sample's time less the delay

    Nothing is fitted but each window's starting state, [s; s']: by least squares over its first `settle` seconds, all outputs weighed by
    their deviations from the mean. Assumes inputs as smooth between samples as a cubic spline.

    Parameters
    ----------
    scene : Scene
        The arm, with a [log] table where names do not say what the columns are.
    log : Log
        What was measured.
    window : float
        Length of a window, in s.
    settle : float
        Seconds at a window's start that its state is found from.

    Returns
    -------
    Prediction
        Predicted readings, and the fit of each column.

    Raises
    ------
    ArgumentError
        When a column fits no joint or sensor, or the log is too short.
    NumericalError
        When no window can be predicted.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> t = np.arange(500) * 0.01
    >>> log = fl.Log(t, inputs={"q1": 0 * t}, outputs={"q1": 0 * t, "tip.y": 0.01 * np.sin(9 * t)})
    >>> sorted(fl.predict(fl.load_scene("single-link"), log).fit)
    ['q1', 'tip.y']
    """
    model = Logged.of(scene, log)
    windows = Windows.of(log, positive("window", window))
    shooting = prepare(model, windows, model.arm.parameters.values)
    found = find_starts(shooting, positive("settle", settle), model.arm.parameters.values)
    with np.errstate(all="ignore"):
        states = shooting.run(found.start, found.p)
        made = shooting.predict(states, found.p)
    names = [one.name for one in model.outputs]
    readings = np.stack([log.outputs[name] for name in log.outputs], axis=-1)[windows.rows]
    kept = np.asarray(np.isfinite(made).all(axis=(1, 2)))
    if not kept.any():
        raise NumericalError(
            "every window's prediction diverges",
            todo="check signs, units and gains of the inputs, and the scene's stiffness",
        )
    at = windows.there & kept[:, None]
    measured = {name: readings[at][:, j] for j, name in enumerate(names)}
    outputs = {name: made[at][:, j] for j, name in enumerate(names)}
    fit = {name: percent(measured[name], outputs[name]) for name in names}
    status = describe(windows, kept, settle, log, name_missed(fit, measured, outputs))
    return Prediction(fit, log.time[windows.rows[at]], outputs, measured, windows.starts, found.start, status)


def prepare(model: Logged, windows: Windows, values: Array, finer: int = 1) -> Shooting:
    """The windows on a grid that is fine enough for the equations with these numbers, or so many times finer."""
    return Shooting(model, windows.refined(count_substeps(Shooting(model, windows), values, finer)))


def find_starts(shooting: Shooting, settle: float, values: Array) -> Point:
    """The starting state of each window from its first seconds, with these free numbers."""
    head = Shooting(shooting.model, shooting.windows.head(settle))
    readings = head.windows.readings()
    nothing = np.zeros(0)
    fixed = Problem(head, readings, deviations(shooting.windows.readings()), nothing, nothing, nothing)
    return solve(fixed, fixed.at(guess_starts(shooting.model, readings, values), values), 12, 1e-4)


def deviations(readings: Array) -> Array:
    """The standard deviation of each output over all windows, (outputs,); 1 where it is constant or not read."""
    read = np.where(np.isfinite(readings).any(axis=(0, 1)), readings, 0.0)
    return np.array([np.nanstd(one) if varies(one) else 1.0 for one in np.moveaxis(read, 2, 0)])


def guess_starts(model: Logged, readings: Array, values: Array) -> Array:
    """States at rest at the joint angles that some outputs read first; zero where none does."""
    n, arm, none = model.n, model.arm, np.zeros((1, len(model.inputs)))
    rest = np.zeros((1, n))
    given = [rest, rest, none, none, none, values[None, :], rest]
    rows, zero = model.reading_slopes(*given)[0][0], model.read(*given)[0][0, :, 0]
    first = [np.array([one[np.isfinite(one)][:1].sum() for one in column]) for column in np.moveaxis(readings, 2, 0)]
    start = np.zeros((readings.shape[0], 2 * n))
    for j in range(arm.joints):
        direct = [i for i in range(len(first)) if rows[i, j] != 0 and np.count_nonzero(rows[i, : arm.joints]) == 1]
        if direct:
            start[:, j] = (first[direct[0]] - zero[direct[0]]) / rows[direct[0], j]
    placed = np.zeros_like(start)
    placed[:, : arm.n] = start[:, : arm.joints] @ arm.reference.full().T  # motors turn with their joints
    return placed


def percent(measured: Array, predicted: Array) -> float:
    """100 (1 - |error| / |deviation from the mean|) where both are known; not a number where nothing varies."""
    known = np.isfinite(measured) & np.isfinite(predicted)
    if not known.any() or not varies(measured[known]):
        return float("nan")
    around = np.linalg.norm(measured[known] - measured[known].mean())
    return float(100 * (1 - np.linalg.norm((measured - predicted)[known]) / around))


def say_fit(name: str, value: float) -> str:
    """The fit of a column in words."""
    return f"{name}: fit {value:.1f} %" if np.isfinite(value) else f"{name}: no fit, as its readings do not vary"


def name_missed(fit: dict[str, float], measured: dict[str, Array], predicted: dict[str, Array]) -> list[str]:
    """The columns of which less than half is predicted, each with the factor that would make it more than half, where one does."""
    said = []
    for name in [name for name, value in fit.items() if value < MISSED_FIT]:
        known = np.isfinite(measured[name]) & np.isfinite(predicted[name])
        m, p = (group[name][known] - group[name][known].mean() for group in (measured, predicted))
        factor = float(m @ p / max(p @ p, 1e-300))
        also = f", reads {factor:.2g} times what is predicted" if percent(m, factor * p) >= MISSED_FIT else ""
        said.append(f"{name} ({fit[name]:.0f} %{also})")
    return said


def describe(windows: Windows, kept: Array, settle: float, log: Log, missed: list[str]) -> str:
    """What the figures rest on, in words."""
    length = float((windows.ends - windows.starts).max())
    said = [
        f"{counted(windows.count, 'window')} of {length:.3g} s, their starting states from their first {settle:.3g} s"
    ]
    if settle >= length:
        said.append(
            "that is all of them, so nothing is predicted but what was fitted: take longer windows, or less of them"
        )
    if not kept.all():
        said.append(f"{int((~kept).sum())} diverge and are left out")
    if missed:
        said.append(
            f"less than half is predicted of {', '.join(missed)}: check sign, unit and gain, or identify the scene"
        )
    return "; ".join([*said, *log.notes])
