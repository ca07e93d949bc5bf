"""Folds of v(u), where V is singular: found by Newton's method, also in the complex plane."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.series.engine import Tape, expand, jacobian, seeded, start
from flexlin.series.indices import shared_indices
from flexlin.series.space import Numeric


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


@dataclass(frozen=True)
class Fold:
    """A point u = u0 + S t with f(u, v) = 0 and V phi = 0; `defect`: the larger of Newton's last step and what is left of f and V phi."""

    t: Array
    v: Array
    phi: Array
    defect: float


@np.errstate(all="ignore")
def find_fold(tape: Tape, u0: Array, S: Array, start: tuple[Array, Array], steps: int = 30) -> Fold:
    """Solve for the fold that Newton's method reaches from a start.

        f(u0 + S t, v) = 0,   V phi = 0,   c phi = 1     with c = conj(phi) of the start

    Square for one parameter t; for more, each step is the shortest one, so a near fold is found.

    Parameters: u0 (nu,), S (nu, p), start (t (p,), v (nv,)), real or complex.
    Returns: the last iterate with its defect; infinite when the iteration broke down.
    """
    t, v = start
    nv, p = len(v), len(t)
    _, V, _ = second_order(tape, u0, S, t, v)
    if not np.all(np.isfinite(V)):
        return Fold(t, v, np.full(nv, np.nan), np.inf)
    phi = np.linalg.svd(V[:, :nv])[2][-1].conj()
    c, defect = phi.conj(), np.inf
    for _ in range(steps):
        f, J, H = second_order(tape, u0, S, t, v)
        V, turned = J[:, :nv], np.einsum("ijl,l->ij", H[:, :, :nv], phi)
        matrix = np.zeros((2 * nv + 1, 2 * nv + p), dtype=J.dtype)
        matrix[:nv, : nv + p], matrix[nv:-1, : nv + p], matrix[nv:-1, nv + p :], matrix[-1, nv + p :] = J, turned, V, c
        right = np.concatenate([f, V @ phi, [c @ phi - 1]])
        if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(right))):
            return Fold(t, v, phi, np.inf)
        step = np.linalg.lstsq(matrix, right, rcond=None)[0]
        defect = max(float(np.abs(step).max()), float(np.abs(right).max()))
        if defect < 1e-13 * (1 + np.abs(v).max()):
            break
        v, t, phi = v - step[:nv], t - step[nv : nv + p], phi - step[nv + p :]
    return Fold(t, v, phi, defect)


def second_order(tape: Tape, u0: Array, S: Array, t: Array, v: Array) -> tuple[Array, Array, Array]:
    """Return f (m,), its Jacobian (m, n) and second derivatives (m, n, n) by [v; t], n = nv + p."""
    nv, p = len(v), len(t)
    table = shared_indices(nv + p, 2)
    space = Numeric(table, (), np.result_type(u0, t, v).type)
    seeds = np.eye(nv + p)
    inputs = [seeded(space, u0 + S @ t, S @ seeds[nv:]), seeded(space, v, seeds[:nv])]
    coefficients = np.array(expand(tape, space, inputs)[0])
    places = table.dense(2)
    H = (coefficients[:, places] * table.factorials[places]).reshape(-1, nv + p, nv + p)
    return coefficients[:, 0], coefficients[:, table.degree(1)], H
