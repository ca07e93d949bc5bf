"""Truncated power series of explicit and implicit functions, one order after the other."""

from collections.abc import Sequence

import numpy as np

from flexlin.checks import Array
from flexlin.series.nodes import Increments, Series, Space
from flexlin.series.tape import Tape


def seeded(space: Space, values: Array, seeds: Array) -> list[Array]:
    """Return the series of u = u0 + S xi, one for each entry of u.

    Parameters: values u0 (nu, ...); seeds S (nu, n), or (nu, n, ...) with a direction for each point.
    """
    series = [space.zero() for _ in range(len(values))]
    for one, value, seed in zip(series, values, seeds, strict=True):
        one[0] = value
        if space.indices.order > 0:
            one[space.indices.degree(1)] = seed
    return series


def start(tape: Tape, space: Space, inputs: Sequence[Sequence[Array]]) -> Series:
    """Return the nodes' coefficients with inputs, constants and all parts of degree 0 in place."""
    c: Series = [space.zero() for _ in range(tape.size)]
    for nodes, series in zip(tape.inputs, inputs, strict=True):
        for node, one in zip(nodes, series, strict=True):
            c[node] = one
    for node, value in tape.constants.items():
        c[node][0] = value if value != 0 else 0
    for node, operation in tape.operations:
        c[node][:1] = space.clean(operation.value(space, c))
    return c


def advance(tape: Tape, space: Space, c: Series, k: int) -> None:
    """Compute all parts of degree k from those of lower degree and the inputs' parts of degree k."""
    where = space.indices.degree(k)
    for node, operation in tape.operations:
        c[node][where] = space.clean(operation.part(space, c, k))


def increments(tape: Tape, space: Space, c: Series, moved: Increments) -> dict[int, Array]:
    """Return how all parts of one degree move when those of some nodes do."""
    delta = dict(moved)
    for node, operation in tape.operations:
        if any(i in delta for i in operation.operands):
            delta[node] = space.clean(operation.increment(c, delta))
    return delta


@np.errstate(all="ignore")
def expand(tape: Tape, space: Space, inputs: Sequence[Sequence[Array]]) -> list[list[Array]]:
    """Return the series of all outputs of a tape, given those of its inputs; nan or infinite where they do not exist."""
    c = start(tape, space, inputs)
    for k in range(1, space.indices.order + 1):
        advance(tape, space, c, k)
    return [[c[node] for node in nodes] for nodes in tape.outputs]


def jacobian(tape: Tape, space: Space, c: Series, which: int) -> Array:
    """Return D f (m, n, ...) by one input at the point of evaluation: the movement of f under unit movements of the input."""
    identity: Array = np.eye(len(tape.inputs[which]), dtype=int).astype(space.dtype)
    moved = {}
    for node, row in zip(tape.inputs[which], identity, strict=True):
        moved[node] = row.reshape(-1, *[1] * (c[node].ndim - 1))
    delta = increments(tape, space, c, moved)
    shape = (len(identity), *c[tape.inputs[which][0]].shape[1:])
    return np.array([np.broadcast_to(delta.get(node, np.zeros(shape, dtype=int)), shape) for node in tape.outputs[0]])


@np.errstate(all="ignore")
def expand_implicit(tape: Tape, space: Space, u: Sequence[Array], v0: Array) -> list[Array]:
    """Return the series of v(u) with f(u, v) = 0, given those of u and v's value.

        V_0 v_k = -[f(u, v_0 + ... + v_(k-1))]_k,   k = 1, 2 ...

    After each order the parts of all nodes move with v_k by their linearization.

    Assumes f(u0, v0) = 0 and V = D_v f regular there.
    Parameters: tape of f(u, v); u: series of u's entries; v0 (nv, ...).
    Returns: the series of v's entries.
    Source: the equations of de Jong et al. (14)-(25), order by order instead of by Kronecker products.
    """
    v = seeded(space, v0, np.zeros((len(v0), space.indices.n, *[1] * (v0.ndim - 1)), dtype=int))
    c = start(tape, space, [u, v])
    V = jacobian(tape, space, c, 1)
    for k in range(1, space.indices.order + 1):
        where = space.indices.degree(k)
        advance(tape, space, c, k)
        residual = np.array([c[node][where] for node in tape.outputs[0]])
        step = space.solve(V, -residual)
        if k == space.indices.order:
            for one, part in zip(v, step, strict=True):
                one[where] = part
            break
        moved = dict(zip(tape.inputs[1], step, strict=True))
        for node, part in increments(tape, space, c, moved).items():
            c[node][where] = c[node][where] + part
    return v
