"""What to say of a simulation that cannot go on."""

import numpy as np

from flexlin.checks import Array
from flexlin.errors import SimulationStopped
from flexlin.linearization.linearization import Linearization
from flexlin.precision import SLIGHT

SHORTEST_STEP = 1e-13
"""A step this short against the whole time is no step any more."""
SINGULAR_SHARE = SLIGHT
"""The mass matrix of a state is called singular where its smallest eigenvalue has fallen to this share of that on the rigid motion."""
GENTLER = "slow the motion down, stiffen the links or raise the gains; or simulate fewer periods"
"""What helps where a step is too hard; where there are only too many, SHORTER does."""
SHORTER = "simulate fewer periods, or ask for a larger tol"


def stopped(t: float, why: str, reached: Array | None = None, todo: str = GENTLER) -> SimulationStopped:
    """What to say when the integrator cannot go on from an accepted state; `reached` (2n,) is that state."""
    return SimulationStopped(
        f"the nonlinear simulation stopped at t = {t:.4g} s", got=why, todo=todo, t=t, reached=reached
    )


def explain_end(lin: Linearization, end: SimulationStopped) -> SimulationStopped:
    """The error with what is found at the state that was reached: how far it is, and whether its mass matrix has become singular.

    The beams' equations hold for small bending. Far out the shortening of a bent link can take more kinetic energy from a body
    behind it than its motion gives, and M(s) loses its definiteness: there the equations end, not the arm.
    """
    t, x = np.array([end.t]), np.asarray(end.reached)[None]
    here, rigid = (float(smallest_masses(lin, t, state)[0]) for state in (x, np.zeros_like(x)))
    where = f"{name_largest(lin, np.abs(x[0, : lin.n]))} off the rigid motion"
    if here <= SINGULAR_SHARE * rigid:
        got = f"a mass matrix that becomes singular, {where}: the equations, which are those of small bending, have no meaning beyond it"
    else:
        got = f"{end.got}; the state that was reached is {where}, and its mass matrix is sound"
    return SimulationStopped(
        end.what, got=got, todo=end.todo, t=end.t, reached=end.reached, left_range=here <= SINGULAR_SHARE * rigid
    )


def smallest_masses(lin: Linearization, t: Array, x: Array) -> Array:
    """The smallest eigenvalue of M, scaled to a diagonal of the rigid motion's, at states x (N, 2n) and times t (N,)."""
    kept, both = list(lin.kept), np.concatenate([x[:, : lin.n], np.zeros((len(t), lin.n))])
    M, rigid = np.split(lin.about.of_arm("M", np.concatenate([t, t]), both)[:, kept][:, :, kept], 2)
    scale = 1 / np.sqrt(np.einsum("tii->ti", rigid))
    return np.linalg.eigvalsh(M * scale[:, :, None] * scale[:, None, :])[:, 0]


def find_indefinite(lin: Linearization, t: Array, x: Array) -> int | None:
    """The first of states x (N, 2n) at times t (N,) whose mass matrix is not positive definite."""
    kept = list(lin.kept)
    try:
        np.linalg.cholesky(lin.about.of_arm("M", t, x[:, : lin.n])[:, kept][:, :, kept])
    except np.linalg.LinAlgError:
        positive = smallest_masses(lin, t, x) > 0
        return None if positive.all() else int(np.argmin(positive))
    return None


def name_largest(lin: Linearization, deviation: Array) -> str:
    """The largest of the deviations (n,) in each unit, with its coordinate: 0.41 rad in q1 and 0.22 m in w11."""
    size, units = np.where(np.isnan(deviation), np.inf, deviation), [c.unit for c in lin.coordinates]
    found = []
    for unit in dict.fromkeys(units):
        worst = max((i for i in range(lin.n) if units[i] == unit), key=lambda i: size[i])
        found.append(f"{deviation[worst]:.3g} {unit} in {lin.coordinates[worst].title}")
    return " and ".join(found)
