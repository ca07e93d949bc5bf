"""A periodic system under a held input: its exact discrete-time model from sample to sample, the delay included."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from flexlin.checks import Array
from flexlin.errors import ArgumentError, TooManySegments
from flexlin.periodic.coefficients import MatrixFunction
from flexlin.periodic.grid import divide_segments, edges_of_short
from flexlin.periodic.resolved.matrix import ResolvedMatrix
from flexlin.periodic.resolved.panels import NODES
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.gauss import gauss_transitions
from flexlin.periodic.transition.setting import MAX_SEGMENTS, choose_gauss_step, measure_pace

STAGES = 6
"""Gauss stages between samples; two more show the error."""
PARTS = NODES // STAGES
"""Steps, at the least, over a panel of the coefficients: it may hold more waves than the stages of one follow."""
MOST_STEPS = NODES * MAX_SEGMENTS


@dataclass(frozen=True, eq=False)
class Augmented:
    """[[A, B], [0, 0]]: the state with an input that is held."""

    A: MatrixFunction
    B: MatrixFunction
    period: float

    def __call__(self, t: Array) -> Array:
        now = np.mod(t, self.period)
        A, B = self.A(now), self.B(now)
        n, m = B.shape[1:]
        out = np.zeros((len(t), n + m, n + m))
        out[:, :n, :n], out[:, :n, n:] = A, B
        return out


@dataclass(frozen=True, eq=False)
class HeldPlant:
    """z_(k+1) = F_k z_k + G_k u_k at the instants t_k = k h, with z = x, or z = [x; u_(k-1)] where the input comes late.

    F (N, r, r), G (N, r, m), instants (N,) in s; states n of x, inputs m.
    """

    F: Array
    G: Array
    instants: Array
    states: int
    inputs: int

    def closed_by(self, K: Array) -> Array:
        """F_k - G_k [K_k, 0] with gains K (N, m, n) at the instants, or (N, m, r) of all that is known there."""
        loop = self.F.copy()
        loop[:, :, : K.shape[2]] -= self.G @ K
        return loop


def hold_plant(
    system: PeriodicSystem, samples: int, periods: int, delay: float, tol: float, stages: int = STAGES
) -> HeldPlant:
    """Discretize x' = A x + B u over `samples` equal intervals of `periods` periods; delay as a part of one interval, in [0, 1].

    x(t_(k+1)) = P1 (P0 x_k + G0 u_(k-1)) + G1 u_k,    0: from t_k to t_k + delay,  1: from there to t_(k+1)
    """
    if system.B is None:
        raise ArgumentError("the system has no input", got="B = None", expected="an input matrix B(t)")
    n, m, T = system.n, system.m, system.period
    h = T * periods / samples
    t = T * periods * np.arange(samples) / samples
    first = sections(system, t, t + delay * h, tol, stages) if delay else None
    second = sections(system, t + delay * h, t + h, tol, stages) if delay < 1 else None
    eye = np.broadcast_to(np.eye(n + m), (samples, n + m, n + m))
    P0, P1 = (eye if part is None else part for part in (first, second))
    if not delay:
        return HeldPlant(P1[:, :n, :n], P1[:, :n, n:], t, n, m)
    F, G = np.zeros((samples, n + m, n + m)), np.zeros((samples, n + m, m))
    F[:, :n] = P1[:, :n, :n] @ P0[:, :n]
    G[:, :n], G[:, n:] = P1[:, :n, n:], np.eye(m)
    return HeldPlant(F, G, t, n, m)


def hold_controller(rates: Array, step: float) -> Array:
    """The integral (k, k) of exp(F s) over one step, for z' = rates [x; z] with F the last k columns.

    Under inputs that are held, z moves by this times its rate at the beginning of the step.
    """
    k = len(rates)
    block = np.zeros((2 * k, 2 * k))
    block[:k, :k], block[:k, k:] = rates[:, -k:], np.eye(k)
    with np.errstate(over="ignore", invalid="ignore"):  # of a controller that grows beyond numbers
        return np.asarray(expm(step * block)[:k, k:])


def with_controller_states(plant: HeldPlant, rates: Array, step: float) -> HeldPlant:
    """The plant with a controller's states z behind its own, z_(k+1) = z_k + held rates [x_k; z_k]: they count as states of it."""
    n, k, (count, size) = plant.states, len(rates), plant.F.shape[:2]
    moved = hold_controller(rates, step) @ rates
    moved[:, n:] += np.eye(k)
    F, G = np.zeros((count, size + k, size + k)), np.zeros((count, size + k, plant.inputs))
    of_plant = np.r_[:n, n + k : size + k]
    F[:, of_plant[:, None], of_plant], G[:, of_plant] = plant.F, plant.G
    F[:, n : n + k, : n + k] = moved
    return HeldPlant(F, G, plant.instants, n + k, plant.inputs)


def sections(system: PeriodicSystem, begin: Array, end: Array, tol: float, stages: int) -> Array:
    """Transition matrices (N, n + m, n + m) of the augmented system from begin (N,) to end (N,), all of one length."""
    augmented = Augmented(system.resolved, system.resolved_input, system.period)
    parts = step_sections(augmented, divide(system, begin, end, tol), stages)
    whole = parts[:, 0]
    for k in range(1, parts.shape[1]):
        whole = parts[:, k] @ whole
    return whole


def step_sections(A: MatrixFunction, edges: Array, stages: int) -> Array:
    """Transition matrices (N, c, s, s) of x' = A x over all steps between edges (N, c + 1)."""
    count = edges.shape[1] - 1
    together = np.concatenate([edges[:, :-1].ravel(), edges[-1:, -1]])
    if np.all(edges[1:, 0] == edges[:-1, -1]):
        steps = gauss_transitions(A, together, stages)
    else:  # gaps between the sections are integrated too and left out
        flat = gauss_transitions(A, edges.ravel(), stages)
        keep = np.arange(len(edges) * (count + 1) - 1) % (count + 1) != count
        steps = flat[keep]
    return steps.reshape(len(edges), count, *steps.shape[1:])


def divide(
    system: PeriodicSystem, begin: Array, end: Array, tol: float, others: Sequence[ResolvedMatrix] = ()
) -> Array:
    """Edges (N, c + 1) of steps inside sections, short enough for tol; none passes over a corner or a part of a panel of A, B or others."""
    T = system.period
    longest = float(choose_gauss_step(measure_pace(system).rate.max(keepdims=True), tol, STAGES).min())
    width = float((end - begin).max())
    count = max(1, int(np.ceil(width / longest)))
    if count * len(begin) > MOST_STEPS:
        raise TooManySegments(
            "the sampled loop takes too many steps", got=count * len(begin), expected=f"at most {MOST_STEPS}"
        )
    edges = begin[:, None] + (end - begin)[:, None] * np.arange(count + 1) / count
    resolved = (system.resolved, system.resolved_input, *others)
    panels = (divide_segments(one.edges, PARTS) for one in resolved if one.panels > 1)
    short = [np.mod(edges_of_short(edges, width / count), T) for edges in panels]
    corners = np.unique(np.concatenate([*short, *(one.breaks for one in resolved)]))
    if len(corners):
        turns = np.floor((begin[:, None] - corners) / T) + 1
        inner = np.clip(corners + turns * T, begin[:, None], end[:, None])
        edges = np.sort(np.concatenate([edges, inner], axis=1), axis=1)
    edges[:, 0], edges[:, -1] = begin, end
    return edges
