"""Newton's method on closure equations, at many points at once, real or complex, by the series tape alone."""

import numpy as np

from flexlin.checks import Array
from flexlin.series.engine import jacobian, seeded, start
from flexlin.series.indices import shared_indices
from flexlin.series.space import Numeric
from flexlin.series.tape import Tape


@np.errstate(all="ignore")
def closure_and_jacobian(tape: Tape, u: Array, v: Array) -> tuple[Array, Array]:
    """Return f (N, m) and V = D_v f (N, m, m) at u (N, nu), v (N, nv)."""
    space = Numeric(shared_indices(1, 0), (len(u),), np.result_type(u, v).type)
    inputs = [seeded(space, x.T, np.zeros_like(x.T)) for x in (u, v)]
    c = start(tape, space, inputs)
    f = np.array([c[node][0] for node in tape.outputs[0]]).T
    return f, np.moveaxis(jacobian(tape, space, c, 1), 2, 0)


def newton_step(tape: Tape, u: Array, v: Array) -> Array:
    """Return V^-1 f (N, nv); infinite where V is singular or not finite."""
    f, V = closure_and_jacobian(tape, u, v)
    regular = np.all(np.isfinite(V), axis=(1, 2)) & np.all(np.isfinite(f), axis=1)
    regular[regular] = np.linalg.matrix_rank(V[regular]) == V.shape[1]
    step = np.full(f.shape, np.inf, dtype=f.dtype)
    step[regular] = np.linalg.solve(V[regular], f[regular][..., None])[..., 0]
    return step


def newton(tape: Tape, u: Array, v: Array, steps: int = 25) -> tuple[Array, Array]:
    """Refine v until f(u, v) = 0 to rounding.

    Returns: v (N, nv) and the size of the last step of each point (N,): above 1e-12 or infinite where the iteration did not end.
    """
    v, size = v.copy(), np.full(len(v), np.inf)
    active = np.arange(len(v))
    for _ in range(steps):
        step = newton_step(tape, u[active], v[active])
        size[active] = np.abs(step).max(axis=1)
        moving = np.isfinite(size[active])
        v[active[moving]] -= step[moving]
        active = active[moving & (size[active] > 1e-14 * (1 + np.abs(v[active]).max(axis=1)))]
        if not active.size:
            break
    return v, size
