"""Floquet exponents of a decoupled system, each with its error."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import wrap_log
from flexlin.periodic.decoupling.coupling import Coupled
from flexlin.periodic.decoupling.decoupled import Decoupled
from flexlin.periodic.decoupling.grouping import block_mask, connected
from flexlin.periodic.decoupling.hidden import link_modes
from flexlin.periodic.decoupling.several import SAFETY, UNRESOLVED, bound_growth, several
from flexlin.periodic.decoupling.waves import aliasing


@dataclass(frozen=True)
class DecoupledExponents:
    """Exponents (n,) in 1/s by falling real part, imaginary parts in (-pi/T, pi/T], and their errors (n,).

    discretization, coupling, rounding (n,): the parts of the errors; of larger groups all three stand in `discretization`.
    """

    exponents: Array
    errors: Array
    discretization: Array
    coupling: Array
    rounding: Array


def decoupled_exponents(decoupled: Decoupled, tol: float = 1e-9) -> DecoupledExponents:
    """Floquet exponents of all groups.

    A single mode's exponent is the mean of its generator; the nodes that built the frame and those half-way between them give it
    once each, and their difference is its error. A larger group is a small system without fast modes, followed by Magnus series to a
    part of tol: its error is bounded by perturbation theory, from the product itself where its modes grow little against each other
    (`tame_exponents`), elsewhere from the Floquet vectors along it (`group_logs`).
    """
    period = decoupled.period
    values, parts = exponents_in_place(decoupled, tol)
    values = wrap_log(values * period) / period
    order = np.argsort(-values.real, kind="stable")
    discretization, coupling, rounding = parts[:, order]
    return DecoupledExponents(values[order], parts.sum(axis=0)[order], discretization, coupling, rounding)


def exponents_in_place(decoupled: Decoupled, tol: float) -> tuple[Array, Array]:
    """The exponents (n,) in the order of the modes, and the three parts of their errors (3, n)."""
    n = decoupled.generator.shape[-1]
    values, parts = np.zeros(n, complex), np.zeros((3, n))
    enclose = cache(partial(enclosures, decoupled))
    single = [i for i, group in enumerate(decoupled.groups) if group.size == 1 and group.partner >= i]
    places = [decoupled.groups[i].start for i in single]
    values[places], parts[:, places] = singles(decoupled, single, enclose)
    for i, group in enumerate(decoupled.groups):
        if group.partner < i:
            mate = decoupled.groups[group.partner].part
            values[group.part], parts[:, group.part] = values[mate].conj(), parts[:, mate]
        elif group.size > 1:
            with np.errstate(over="ignore", invalid="ignore"):  # what overflows comes out unresolved and is enclosed
                linked = is_linked(decoupled, i)
                found = enclose_linked(decoupled, i, enclose()) if linked else several(decoupled, i, tol)
                values[group.part], parts[0, group.part] = found
    return values, parts


def enclose_linked(decoupled: Decoupled, index: int, enclosed: tuple[Array, Array]) -> tuple[Array, Array]:
    """The exponents of a larger group, enclosed by what it and all that is linked to it may do (`enclosures`)."""
    part, period = decoupled.groups[index].part, decoupled.period
    own, mean = decoupled.traceless(index)
    low, high = bound_growth(own, period)
    low, high = min(mean.real + low, enclosed[0][part].min()), max(mean.real + high, enclosed[1][part].max())
    values = np.full(part.stop - part.start, (low + high) / 2 + 1j * mean.imag)
    return values, np.full(len(values), np.hypot((high - low) / 2, np.pi / period))


def is_linked(decoupled: Decoupled, index: int) -> bool:
    """Whether a larger group may take the place of others at any time, so that its own equations say nothing of its exponents."""
    part = decoupled.groups[index].part
    return bool(SAFETY * decoupled.residual[part, part].max() * decoupled.period > UNRESOLVED)


def singles(
    decoupled: Decoupled, indices: list[int], enclose: Callable[[], tuple[Array, Array]]
) -> tuple[Array, Array]:
    """The exponents (s,) of groups of one, and their three errors (3, s).

    Where the coupling's bound exceeds what the real parts of the coupled modes `enclose`, the enclosure counts.
    """
    groups = [decoupled.groups[i] for i in indices]
    places = [group.start for group in groups]
    B = decoupled.generator[:, places, places]
    real = np.array([group.partner for group in groups]) == indices
    values = B.mean(axis=0)
    values = np.where(real, values.real + 1j * np.pi / decoupled.period * decoupled.turning[indices], values)
    apart = np.maximum(np.abs(B[::2].mean(axis=0) - B[1::2].mean(axis=0)), aliasing(B))
    coupling = SAFETY * decoupled.residual[places, places]
    loose = coupling * decoupled.period > UNRESOLVED
    if loose.any():
        low, high = (each[places] for each in enclose())
        reach = np.hypot(np.maximum(high - values.real, values.real - low), np.pi / decoupled.period)
        coupling[loose] = np.minimum(coupling, reach)[loose]
    return values, np.array([apart, coupling, SAFETY * decoupled.rounding[places, places]])


def enclosures(decoupled: Decoupled) -> tuple[Array, Array]:
    """Bounds from below and above on the real part of each exponent (n,): the means of the least and the largest of modes that are linked.

    Those may take each other's place at any time.
    """
    B, groups, period = decoupled.generator, decoupled.groups, decoupled.period
    coupled = decoupled.coupled or Coupled(B, period, groups)
    member = connected(link_modes(coupled, decoupled.rounding) | block_mask(groups))
    linked, real = member[:, None] == member, coupled.values.real[:, :, None]
    low, high = np.where(linked, real, np.inf).min(axis=1), np.where(linked, real, -np.inf).max(axis=1)
    return low.mean(axis=0), high.mean(axis=0)
