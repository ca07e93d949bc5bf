"""Exponents of modes decoupled by compiled code, each with its error, by compiled code too."""

import ctypes
from functools import lru_cache

import numpy as np

from flexlin.checks import Array
from flexlin.compiler import address
from flexlin.periodic.circle import wrap_log
from flexlin.periodic.decoupling.compiled import tabulate_waves
from flexlin.periodic.decoupling.decoupled import Decoupled, Refusal
from flexlin.periodic.decoupling.several import SAFETY
from flexlin.periodic.decoupling.tame import FASTEST, INDEPENDENT, LEAST, MORE, STAGES, STEP, measure_size
from flexlin.periodic.decoupling.tame import SAFETY as METHOD_SAFETY
from flexlin.periodic.product.balancing import GROUP_CONDITION
from flexlin.periodic.product.perturbation import CANCELLED, CLOSE, EPS, FACTOR_ROUNDING
from flexlin.periodic.transition.gauss import gauss

MOST = int(np.ceil(FASTEST / STEP))
"""Segments of a group at the most."""
MEMORY = 2**26
"""Bytes that the factors of a group may take."""
FOLLOWED = np.array([STEP, FASTEST, GROUP_CONDITION])
BOUNDED = np.array([METHOD_SAFETY, CANCELLED, CLOSE, FACTOR_ROUNDING, EPS])


def find_steady_exponents(library: ctypes.CDLL, decoupled: Decoupled) -> tuple[Array, Array] | Refusal:
    """Exponents (n,) in 1/s by falling real part, conjugates exactly, and their errors (n,).

    They are those of `decoupled_exponents` where all groups are tame: a single mode's is the mean of its generator; a group is followed.
    """
    known, period = decoupled.diagonal, decoupled.period
    assert known is not None
    values = known.means.copy()
    errors = known.apart + SAFETY * (np.diagonal(decoupled.residual) + np.diagonal(decoupled.rounding))
    for i, group in enumerate(decoupled.groups):
        if group.partner != i:
            mate = decoupled.groups[group.partner].part
            errors[group.part] = np.maximum(errors[group.part], errors[mate])
        elif group.size == 1:
            values[group.start] = values[group.start].real
        else:
            found = follow_group(library, decoupled, i)
            if found is None:
                return Refusal("the modes of a group grow or decay by much against each other")
            mean = float(known.means[group.part].real.mean())
            values[group.part], errors[group.part] = mean + found[0] / period, found[1] / period
    values = wrap_log(values * period) / period
    order = np.argsort(-values.real, kind="stable")
    return values[order], errors[order]


def follow_group(library: ctypes.CDLL, decoupled: Decoupled, index: int) -> tuple[Array, Array] | None:
    """As `tame_exponents`, of the generator of a real group without its mean. Raises: MemoryError."""
    group, (nodes, n, _), period = decoupled.groups[index], decoupled.generator.shape, decoupled.period
    p, part, tables = group.size, group.part, tabulate_waves(nodes // 2)
    if 32 * (MOST + 1) * p * p > MEMORY:
        return None
    out, alias = np.empty((4, MOST + 1, p, p)), np.empty((p, p))
    wide = tables.numbers[-16 * (nodes // 2) * tables.wide :]
    segments = library.follow_group(
        n, group.start, p, nodes // 16, tables.wide, address(wide), address(decoupled.generator), period, LEAST, MOST, STAGES, MORE,
        *map(address, (tabulate_rules(), FOLLOWED, out, alias)),
    )  # fmt: skip
    if segments < 0:
        raise MemoryError("the factors of a group")
    if not segments:
        return None
    unknown = SAFETY * (decoupled.residual + decoupled.rounding)[part, part] + alias
    try:
        multipliers, vectors = np.linalg.eig(out[2, segments])
        rows = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return None
    if not measure_size(vectors) * measure_size(rows) < INDEPENDENT:
        return None
    logs, errors = np.log(multipliers.astype(complex)), np.empty(p)
    given = [out, period / segments * unknown, BOUNDED, vectors.astype(complex), rows.astype(complex), logs, errors]
    if not library.bound_group(
        p, segments, MOST, *map(address, map(np.ascontiguousarray, given[:-1])), address(errors)
    ):
        raise MemoryError("the errors of a group")
    mate = np.abs(logs.conj()[:, None] - logs).argmin(axis=1)
    return logs, np.maximum(errors, errors[mate])


@lru_cache(maxsize=1)
def tabulate_rules() -> Array:
    """Gauss' rules one after another: c, a, b of each."""
    rules = [gauss(stages) for stages in (STAGES, STAGES + MORE)]
    return np.concatenate([part.ravel() for rule in rules for part in (rule.c, rule.a, rule.b)])
