"""Systems and designs for python-control, their states, inputs and outputs named."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from flexlin.arguments import checked
from flexlin.checks import Array, check_size, positive, real_array
from flexlin.control.designed_loop import Design
from flexlin.control.export.files import Labels
from flexlin.control.sampled import find_round
from flexlin.errors import ArgumentError
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.sampled import hold_plant
from flexlin.periodic.system import PeriodicSystem

if TYPE_CHECKING:
    import control


def label_system(given: PeriodicSystem | Linearization) -> tuple[PeriodicSystem, Labels]:
    """The system, and the names of its states and inputs: those of the arm, if there is one."""
    lin, system = (given, given.periodic_system()) if isinstance(given, Linearization) else (None, given)
    return system, Labels.fitting(lin, system.n, system.m)


@checked
def to_control(
    system: PeriodicSystem | Linearization, phase: float = 0.0, outputs: Array | None = None, names: Sequence[str] = ()
) -> "control.StateSpace":
    """Freeze a periodic system at a phase of its motion as a python-control StateSpace with named states, inputs and outputs.

        x' = A(phase T) x + B(phase T) u,   y = C x

    Parameters
    ----------
    system : PeriodicSystem or Linearization
        The system, with n states; an arm's own linearization names them (q1, w11, ..., q1_rate, ...) and its inputs.
    phase : float
        Part of the period, in [0, 1).
    outputs : array, shape (p, n), optional
        C; by default all states.
    names : sequence of str
        Names of these outputs.

    Returns
    -------
    control.StateSpace
        Without direct feed-through; it has no inputs when the system has no B.

    Raises
    ------
    ArgumentError
        When the phase is not in [0, 1).

    Examples
    --------
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [-4.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> frozen = fl.control.to_control(system)
    >>> frozen.A.tolist(), frozen.state_labels
    ([[0.0, 1.0], [-4.0, 0.0]], ['x1', 'x2'])
    """
    import control

    system, labels = label_system(system)
    if not 0 <= phase < 1:
        raise ArgumentError("phase is out of range", got=phase, expected="a number in [0, 1)")
    t = np.array([phase * system.period])
    A = system.A(t)[0]
    B = np.zeros((system.n, 0)) if system.B is None else system.B(t)[0]
    C = np.eye(system.n) if outputs is None else real_array("outputs", outputs, (None, system.n))
    seen = list(names) or (list(labels.states) if outputs is None else [f"y{i + 1}" for i in range(len(C))])
    if len(seen) != len(C):
        raise ArgumentError("names do not fit the outputs", got=len(seen), expected=str(len(C)))
    D = np.zeros((len(C), B.shape[1]))
    return control.ss(A, B, C, D, states=list(labels.states), inputs=list(labels.inputs) or 0, outputs=seen)


@checked
def gain_schedule(
    made: Design, name: str = "gain_schedule", lin: Linearization | None = None
) -> "control.NonlinearIOSystem":
    """Return the state feedback u = -K(t) x as a python-control system without states.

    It is meant for `control.input_output_response`: inputs x[0..n), outputs u[0..m). The time of the response is the time of the motion.

    Parameters
    ----------
    made : Design
        The design.
    name : str
        Name of the python-control system.
    lin : Linearization, optional
        The arm, which gives inputs and outputs their names.

    Returns
    -------
    control.NonlinearIOSystem
        The feedback.

    Examples
    --------
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> feedback = fl.control.gain_schedule(fl.control.pd_feedback(system, [0], [4.0], [2.0]))
    >>> feedback.output(0.0, [], [1.0, 0.5]).tolist()
    [-5.0]
    """
    import control

    def feedback(t: float, _: Array, x: Array, __: Any) -> Array:
        return -made.K(np.array([float(t)]))[0] @ x

    labels = Labels.fitting(lin, made.closed_loop.n, made.closed_loop.m, made.controller)
    return control.nlsys(None, feedback, inputs=list(labels.states), outputs=list(labels.inputs), name=name)


@checked
def periodic_plant(system: PeriodicSystem | Linearization, name: str = "plant") -> "control.NonlinearIOSystem":
    """Return the periodic system x' = A(t) x + B(t) u as a python-control system with outputs x.

    Parameters
    ----------
    system : PeriodicSystem or Linearization
        The system; an arm's own linearization names states, inputs and outputs.
    name : str
        Name of the python-control system.

    Returns
    -------
    control.NonlinearIOSystem
        The plant.

    Examples
    --------
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [-4.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> plant = fl.control.periodic_plant(system)
    >>> plant.dynamics(0.0, [1.0, 0.0], [3.0]).tolist()
    [0.0, -1.0]
    """
    import control

    system, labels = label_system(system)

    def update(t: float, x: Array, u: Array, _: Any) -> Array:
        now = np.array([float(t)])
        drift = system.A(now)[0] @ x
        return drift if system.B is None else drift + system.B(now)[0] @ np.atleast_1d(u)

    inputs, states = list(labels.inputs) or 0, list(labels.states)
    return control.nlsys(update, None, inputs=inputs, outputs=states, states=states, name=name)


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

    system, labels = label_system(system)
    h, tol = positive("sample_time", sample_time), positive("tol", tol)
    turn = find_round(system, h, delay)
    N, n, m = turn.samples, system.n, system.m
    check_size(f"a lifted model of {N} samples", 8 * (N * n) * (N * m + n), "take a longer sampling time")
    plant = hold_plant(system, turn, delay / h, tol)
    r = plant.F.shape[1]
    state, effect = np.eye(r), np.zeros((r, N * m))
    C, D = np.zeros((N * n, r)), np.zeros((N * n, N * m))
    for k, (F, G) in enumerate(zip(plant.F, plant.G, strict=True)):
        C[k * n : (k + 1) * n], D[k * n : (k + 1) * n] = state[:n], effect[:n]
        state, effect = F @ state, F @ effect
        effect[:, k * m : (k + 1) * m] += G
    held = [name + LATE for name in labels.inputs] if r > n else []
    inputs, outputs = ([f"{name}[{k}]" for k in range(N) for name in names] for names in (labels.inputs, labels.states))
    named = {"states": [*labels.states, *held], "inputs": inputs, "outputs": outputs}
    return control.ss(state, effect, C, D, turn.periods * system.period, **named)
