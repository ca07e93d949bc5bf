"""The linear prediction of a simulation."""

import numpy as np

from flexlin.about.linear import Linearization
from flexlin.about.periodic_motion import default_closing, own_gain, rigid_feedforward
from flexlin.checks import Array
from flexlin.periodic.companion import solve_mass
from flexlin.periodic.transition.gauss import gauss_transitions
from flexlin.simulation.law import TorqueLaw


def predict(lin: Linearization, t: Array, start: Array, law: TorqueLaw) -> Array:
    """The linear answer from the same start: forced periodic response and Floquet modes together, (N, 2n).

    The pair [x; 1] obeys a homogeneous equation, so its transition matrices over the output steps carry the forcing too.
    Saturation and sampling are left out: they are not linear.
    """
    n, own = 2 * lin.n, own_gain(lin)

    def augmented(times: Array) -> Array:
        c = lin.sample(times)
        A = np.zeros((len(times), n + 1, n + 1))
        A[:, : lin.n, lin.n : n] = np.eye(lin.n)
        gain, reference = law.gain(times), law.reference(times)
        stiffness = np.concatenate([c.K, c.D], axis=2) + c.B @ (gain - own)
        extra = law.forward(times) - c.tau * (default_closing(lin) is rigid_feedforward)
        force = c.h + np.einsum("tij,tj->ti", c.B, extra + np.einsum("tij,tj->ti", gain, reference))
        A[:, lin.n : n] = solve_mass(c.M, np.concatenate([-stiffness, force[:, :, None]], axis=2), times)
        return A

    states = [np.append(start, 1.0)]
    for transition in gauss_transitions(augmented, t, stages=6):
        states.append(transition @ states[-1])
    return np.array(states)[:, :n]
