"""A simulation of the closed loop, nonlinear and linear side by side."""

import numpy as np
from numpy.typing import ArrayLike

from flexlin import symbolic
from flexlin.about.linear import Linearization
from flexlin.checks import Array, positive, real_array
from flexlin.control.tracking import Feedforward, tip_positions
from flexlin.periodic.system import MatrixFunction
from flexlin.simulation.law import Drive, scene_drive, torque_law
from flexlin.simulation.loop import NonlinearLoop
from flexlin.simulation.prediction import predict
from flexlin.simulation.result import Simulation


def simulate(
    lin: Linearization,
    periods: float = 5.0,
    initial: ArrayLike | None = None,
    feedback: MatrixFunction | None = None,
    tol: float = 1e-8,
    points_per_period: int = 128,
    feedforward: Feedforward | None = None,
    drive: Drive | None = None,
) -> Simulation:
    """Integrate the full nonlinear equations under the loop of `lin`, and the linear ones beside them.

        M(s) s'' + C s' + g + d = B torque,   torque = tau_ff(t) - K ([y; y'] - reference(t)),   s = s_R + y

    K is the scene's own feedback and tau_ff the torque of the rigid motion (reference 0), unless others are given.
    Assumes prescribed joints follow their angles. The drive, by default the scene's, may saturate and sample the torque; the linear
    answer leaves that out.

    Parameters: lin: from `linearize(arm, motion, control)`; periods: length of the simulation; initial: deviation [y; y'] (2n,) at t = 0,
    default the feedforward's reference; feedback: gain function (N,) -> (N, m, 2n); feedforward: from `control.feedforward`.
    Returns: a `Simulation` with its integration error and its energy error.
    Raises: NumericalError when the integrator cannot go on (a loop that diverges).
    """
    positive("periods", periods)
    law, n = torque_law(lin, feedback, feedforward), lin.n
    start = law.reference(np.zeros(1))[0] if initial is None else real_array("initial", initial, (2 * n,))
    t = np.linspace(0.0, periods * lin.period, int(np.ceil(periods * points_per_period)) + 1)
    loop = NonlinearLoop(lin, law, drive or scene_drive(lin))
    rough, fine = (loop.integrate(t, start, rtol) for rtol in (tol, tol / 10))
    states, work = fine[:, :-1], fine[:, -1]
    error = float(np.abs(rough[:, :-1] - states).max() / max(1.0, np.abs(states).max()))
    linear = predict(lin, t, start, law)
    torque = np.array([loop.command(time, x) for time, x in zip(t, states, strict=True)])
    tip, tip_linear, tip_rigid = (tip_positions(lin, t, part) for part in (states, linear, np.zeros_like(states)))
    balance = energy_error(lin, t, states, work)
    return Simulation(lin.names, t, states, linear, torque, tip, tip_linear, tip_rigid, error, balance)


def energy_error(lin: Linearization, t: Array, states: Array, work: Array) -> float:
    """The largest |energy(t) - energy(0) - work(t)|, relative to the largest energy that was moved."""
    if lin.arm.energy is None:
        return float("nan")
    q, q_rate, _ = lin.motion.sample(t)
    E, kept = lin.arm.reference.full(), list(lin.kept)
    s, s_rate = q @ E.T, q_rate @ E.T
    s[:, kept] += states[:, : lin.n]
    s_rate[:, kept] += states[:, lin.n :]
    p = np.broadcast_to(lin.arm.parameters.values, (len(t), len(lin.arm.parameters.values)))
    energy = symbolic.evaluate(lin.arm.functions["energy"], s, s_rate, p)[0][:, 0, 0]
    moved = max(np.ptp(energy), np.ptp(work), np.abs(energy).max() * 1e-12, np.finfo(float).tiny)
    return float(np.abs(energy - energy[0] - work).max() / moved)
