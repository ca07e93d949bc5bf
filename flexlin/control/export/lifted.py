"""A sampled plant lifted over a period: one time-invariant discrete-time model for python-control."""

from typing import TYPE_CHECKING

import numpy as np

from flexlin.about.linearization import Linearization
from flexlin.arguments import checked
from flexlin.checks import check_size, positive
from flexlin.control.export.labels import Labels
from flexlin.errors import ArgumentError
from flexlin.periodic.sampled.commensurate import find_rounds
from flexlin.periodic.sampled.hold import hold_plant
from flexlin.periodic.system import PeriodicSystem

if TYPE_CHECKING:
    import control

LATE = "_held"
"""What stands behind an input's name where its last value is a state, because it takes effect late."""


@checked
def lifted_model(
    system: PeriodicSystem | Linearization, sample_time: float, delay: float = 0.0, tol: float = 1e-9
) -> "control.StateSpace":
    """Lift a plant with a held input over the samples of a period into one time-invariant discrete-time model.

        z[j + 1] = F_(N-1) ... F_0 z[j] + sum_k F_(N-1) ... F_(k+1) G_k u_k[j],   y_k[j] = x(t_k) of the round j,   N h = q T

    Parameters
    ----------
    system : PeriodicSystem or Linearization
        The plant with n states and m inputs; an arm's own linearization names them.
    sample_time : float
        h, in s; N samples must fill q periods.
    delay : float
        Time until the input takes effect, 0 to h, in s; the input held before is then a state too.
    tol : float
        Wanted relative error of a transition matrix.

    Returns
    -------
    control.StateSpace
        With sampling time q T, inputs u[0], u[1], ... of all N samples, and the states x at all of them as outputs.

    Raises
    ------
    ArgumentError
        When the sampling time does not fit the period.

    References
    ----------
    Chen, Francis, Optimal Sampled-Data Control Systems (1995), ch. 8.

    Examples
    --------
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0]], 1.0, B=[[1.0]])
    >>> lifted = fl.control.lifted_model(system, 0.5)
    >>> lifted.B.tolist(), lifted.dt, lifted.input_labels, lifted.output_labels
    ([[0.5, 0.5]], 1.0, ['u1[0]', 'u1[1]'], ['x1[0]', 'x1[1]'])
    """
    import control

    lin = system if isinstance(system, Linearization) else None
    system = system.periodic_system() if isinstance(system, Linearization) else system
    h = positive("sample_time", sample_time)
    turn = find_rounds(system.period, h)[0]
    if turn.off > 0 or not 0 <= delay <= h:
        raise ArgumentError(
            "samples and periods do not begin anew together, or the delay is longer than a sample",
            got=f"sample_time = {h:g} s, delay = {delay:g} s, period = {system.period:g} s",
            expected=f"such as sample_time = {system.period * turn.periods / turn.samples:.9g} s",
        )
    N, n, m = turn.samples, system.n, system.m
    check_size(f"a lifted model of {N} samples", 8 * (N * n) * (N * m + n), "take a longer sampling time")
    plant = hold_plant(system, N, turn.periods, delay / h, tol)
    r = plant.F.shape[1]
    state, effect = np.eye(r), np.zeros((r, N * m))
    C, D = np.zeros((N * n, r)), np.zeros((N * n, N * m))
    for k, (F, G) in enumerate(zip(plant.F, plant.G, strict=True)):
        C[k * n : (k + 1) * n], D[k * n : (k + 1) * n] = state[:n], effect[:n]
        state, effect = F @ state, F @ effect
        effect[:, k * m : (k + 1) * m] += G
    labels = Labels.fitting(lin, n, m)
    held = [name + LATE for name in labels.inputs] if r > n else []
    inputs, outputs = ([f"{name}[{k}]" for k in range(N) for name in names] for names in (labels.inputs, labels.states))
    named = {"states": [*labels.states, *held], "inputs": inputs, "outputs": outputs}
    return control.ss(state, effect, C, D, turn.periods * system.period, **named)
