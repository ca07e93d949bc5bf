"""A simulation of the closed loop, nonlinear and linear side by side."""

import math

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, check_size, positive, real_array, whole
from flexlin.control.tracking import Feedforward, scene_feedforward, tip_positions
from flexlin.errors import ArgumentError
from flexlin.linearization.law import Law
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.coefficients import MatrixFunction
from flexlin.precision import ROOT_EPS
from flexlin.simulation.collocation import RUNS, distance, predict
from flexlin.simulation.loop import NonlinearLoop
from flexlin.simulation.modes import Drive, scene_drive
from flexlin.simulation.result import Peaks, Simulation, subdivide


@checked
def simulate(
    lin: Linearization,
    periods: float = 5.0,
    initial: ArrayLike | None = None,
    feedback: MatrixFunction | ArrayLike | None = None,
    tol: float = 1e-8,
    points_per_period: int = 128,
    feedforward: Feedforward | None = None,
    drive: Drive | None = None,
    law: Law | None = None,
) -> Simulation:
    """Integrate the full nonlinear equations under a control law, and the linear ones beside them.

        M(s) s'' + C s' + g + d = B torque,   torque = tau_ff(t) - K ([y; y'] - reference(t)),   s = s_R + y

    The law is that of `lin` (the scene's own feedback, and the torque of the rigid motion), unless another is given.
    Assumes prescribed joints follow their angles. The drive, by default the scene's, may saturate and sample the torque; the linear
    answer leaves that out.

    Parameters
    ----------
    lin : Linearization
        From `linearize(arm, motion, control)`, with n coordinates and m inputs.
    periods : float
        Length of the simulation, in periods of the motion.
    initial : array_like, shape (2n,), optional
        Deviation [y; y'] at t = 0; by default the law's reference. The states of a controller begin at zero.
    feedback : array_like (m, 2n), or function of times (N,) -> (N, m, 2n), optional
        Takes the place of the law's gain, and of its controller.
    tol : float
        Wanted error of the nonlinear and of the linear states.
    points_per_period : int
        Output times of a period.
    feedforward : Feedforward, optional
        From `control.feedforward`; takes the place of the law's.
    drive : Drive, optional
        Saturation, sampling and delay.
    law : Law, optional
        A whole law.

    Returns
    -------
    Simulation
        Both answers with their errors, and the error of the energy.

    Raises
    ------
    ArgumentError
        When arguments do not fit.
    NumericalError
        When the integrator cannot go on (a loop that diverges).
    TooLarge
        When the result would not fit into memory.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": []})
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> run = fl.simulate(lin, periods=0.25, tol=1e-6)
    >>> run.t.shape, run.nonlinear.shape, run.error < 1e-5, run.energy_error < 1e-5
    ((33,), (33, 4), True, True)
    """
    t = np.linspace(0.0, periods * lin.period, check_duration(lin, periods, points_per_period) + 1)
    tol, n = positive("tol", tol), lin.n
    if law is None:
        feedforward = feedforward or scene_feedforward(lin, tol)
        law = lin.law if feedforward is None else feedforward.law
    elif feedforward is not None:
        raise ArgumentError("a law and a feedforward exclude each other", got="both", expected="one of them")
    law = law if feedback is None else law.with_gain(feedback)
    start = law.reference(np.zeros(1))[0] if initial is None else real_array("initial", initial, (2 * n,))
    start = np.append(start, np.zeros(law.memory))
    loop = NonlinearLoop(lin, law, drive or scene_drive(lin))
    (stages, share), (more, less) = RUNS
    rough, coarse = loop.beside_linear(t, start, share * tol, stages)
    often = subdivide(t, np.array(loop.reached), 6 * len(start))
    fine, linear = loop.beside_linear(often, start, less * tol, more, trail=loop.trail)
    at, arm = np.searchsorted(often, t), slice(2 * n)
    if linear is None or coarse is None:
        linear, coarse = predict(lin, often, start, law, tol)
        coarse = coarse[at]
    torque = loop.commands(often, fine[:, :-1]) if loop.given is None else loop.given
    y, y_linear, zeros = fine[:, :n], linear[:, :n], np.zeros((len(often), n))
    tips = place_tips(lin, [(often, y), (often, y_linear), (often, zeros), (t, rough[:, :n]), (t, coarse[:, :n])])
    tip, tip_linear, tip_rigid, *others = tips
    peaks = Peaks.of(often, (y, y_linear), (tip, tip_linear, tip_rigid), torque)
    fine, linear, torque, tip, tip_linear, tip_rigid = (
        x[at] for x in (fine, linear, torque, tip, tip_linear, tip_rigid)
    )
    states, work = fine[:, :-1], fine[:, -1]
    missed = float(np.linalg.norm(np.stack([tip, tip_linear]) - np.stack(others), axis=2).max(axis=1).sum())
    return Simulation(
        lin.names,
        t,
        states[:, arm],
        linear[:, arm],
        torque,
        tip=tip,
        tip_linear=tip_linear,
        tip_rigid=tip_rigid,
        peaks=peaks,
        error=distance(states, rough[:, :-1]),
        linear_error=distance(linear, coarse),
        energy_error=energy_error(lin, t, states, work),
        difference_error=missed,
        units=tuple(c.unit for c in lin.coordinates),
        controller=states[:, 2 * n :],
        controller_names=() if law.controller is None else law.controller.names,
        events=loop.events,
        driven_by=describe_drive(law, lin.period),
    )


def place_tips(lin: Linearization, motions: list[tuple[Array, Array]]) -> list[Array]:
    """The tips (N, 2 or 3) of motions y (N, n) at times t (N,), in one call; not numbers where a linear motion has outgrown them."""
    t, y = (np.concatenate(parts) for parts in zip(*motions, strict=True))
    known = np.isfinite(y).all(axis=1, keepdims=True)
    tips = np.where(known, tip_positions(lin, t, np.where(known, y, 0.0)), np.nan)
    return np.split(tips, np.cumsum([len(times) for times, _ in motions])[:-1])


def describe_drive(law: Law, period: float) -> str:
    """What of a law moves the arm, in words: without a control the torque of the rigid motion does, and nobody may have asked for it."""
    t = np.linspace(0.0, period, 17)
    parts = []
    if law.forward(t).any():
        kind = "the torque of the rigid motion" if law.feedforward == "rigid" else f"{law.feedforward} feedforward"
        parts.append(kind)
    if law.gain(t).any():
        parts.append("feedback")
    return " and ".join(parts) + (" alone" if len(parts) == 1 else "") if parts else "no torque"


def check_duration(lin: Linearization, periods: float, points_per_period: int = 128) -> int:
    """Refuse a simulation whose result would not fit into memory, before it begins.

    Parameters
    ----------
    lin : Linearization
        The loop that is simulated.
    periods : float
        Duration in periods of the motion.
    points_per_period : int
        Times of a period at which the result is kept.

    Returns
    -------
    int
        How many steps there are between the kept times.

    Raises
    ------
    ArgumentError
        For a duration that is not positive.
    TooLarge
        With the figure.

    Examples
    --------
    >>> import flexlin as fl
    >>> from flexlin.simulation import check_duration
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> check_duration(lin, periods=2.5)
    320
    """
    whole("points_per_period", points_per_period)
    steps = math.ceil(positive("periods", periods) * points_per_period)
    numbers = 8 * lin.n + 2 * lin.about.m + 16
    check_size(
        f"a simulation of {periods:g} periods", 8 * numbers * (steps + 1), "simulate fewer periods or fewer points"
    )
    return steps


def energy_error(lin: Linearization, t: Array, states: Array, work: Array) -> float:
    """The largest |energy(t) - energy(0) - work(t)|, relative to the energy that goes to and fro.

    energy = T + V, V being that at rest;   scale: the range of T and the range of V together, or that of the work;
    of an energy that stays as it is a ROOT_EPS, since rounding alone moves it
    """
    if lin.arm.near.energy is None:
        return float("nan")
    y, y_rate = states[:, : lin.n], states[:, lin.n : 2 * lin.n]
    s, rates = lin.about.positions(t, y, y_rate)
    at_rest = np.tile(t, 2), np.tile(s, (2, 1)), np.concatenate([rates, np.zeros_like(rates)])
    energy, potential = np.split(lin.about.at_positions("energy", *at_rest)[:, 0, 0], 2)
    moved = max(np.ptp(energy - potential) + np.ptp(potential), np.ptp(work))
    scale = max(moved, np.abs(energy).max() * ROOT_EPS, np.finfo(float).tiny)
    return float(np.abs(energy - energy[0] - work).max() / scale)
