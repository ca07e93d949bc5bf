"""The cost of a held input: exact weights from sample to sample, as the discrete-time model of the plant is exact."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.quadratic.linear_quadratic import assemble_hamiltonian
from flexlin.periodic.quadratic.scattering import scatter_hamiltonian, transpose
from flexlin.periodic.resolved.matrix import ResolvedMatrix
from flexlin.periodic.sampled.hold import Augmented, divide, step_sections
from flexlin.periodic.system import PeriodicSystem


@dataclass(frozen=True, eq=False)
class SampledProblem:
    """Minimise the sum of z' Q z + 2 z' N u + u' R u along z_(k+1) = F z_k + G u_k: each (N, ., .), repeating after N samples.

    What an input that comes late costs until the next sample counts where it is chosen, so R > 0 whatever the delay: X is that of the
    stated cost less [0, 0; 0, late], late (N, m, m).
    """

    F: Array
    G: Array
    Q: Array
    N: Array
    R: Array
    late: Array


@dataclass(frozen=True, eq=False)
class Weighed:
    """The Hamiltonian [[A, 0], [-W, -A']] of the augmented system with W = diag(Q, R), as a function of time."""

    plant: Augmented
    Q: ResolvedMatrix
    R: ResolvedMatrix

    def __call__(self, t: Array) -> Array:
        now, A = np.mod(t, self.plant.period), self.plant(t)
        W, n = np.zeros_like(A), self.Q.shape[0]
        W[:, :n, :n], W[:, n:, n:] = self.Q(now), self.R(now)
        return assemble_hamiltonian(A, np.zeros_like(A), W)


def weigh_samples(
    system: PeriodicSystem,
    Q: ResolvedMatrix,
    R: ResolvedMatrix,
    samples: int,
    periods: int,
    delay: float,
    tol: float,
    stages: int,
) -> SampledProblem:
    """The discrete-time problem over `samples` equal intervals of `periods` periods; delay as a part of one interval, in [0, 1].

        [x; u](t) = P(t) [x; u](t0),   S = integral of P' diag(Q, R) P dt

    of the section before the input changes, with the input held before, and of the section behind it.
    Source: Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Automat. Control 23 (1978) 395.
    """
    n, m = system.n, system.m
    span = system.period * periods
    t, h = span * np.arange(samples) / samples, span / samples
    weighed = Weighed(Augmented(system.resolved, system.resolved_input, system.period), Q, R)

    def section(begin: Array, end: Array) -> tuple[Array, Array]:
        if not np.any(end > begin):
            return np.broadcast_to(np.eye(n + m), (samples, n + m, n + m)), np.zeros((samples, n + m, n + m))
        return add_costs(step_sections(weighed, divide(system, begin, end, tol, (Q, R)), stages))

    (P0, S0), (P1, S1) = section(t, t + delay * h), section(t + delay * h, t + h)
    if not delay:
        nothing = np.zeros((samples, m, m))
        return SampledProblem(P1[:, :n, :n], P1[:, :n, n:], S1[:, :n, :n], S1[:, :n, n:], S1[:, n:, n:], nothing)
    late = integrate_weight(R, divide(system, t, t + delay * h, tol, (Q, R)))
    through = np.zeros((samples, n + m, n + 2 * m))
    through[:, :n, : n + m], through[:, n:, n + m :] = P0[:, :n], np.eye(m)
    whole = transpose(through) @ S1 @ through
    whole[:, : n + m, : n + m] += S0
    whole[:, n : n + m, n : n + m] -= late
    whole[:, n + m :, n + m :] += np.roll(late, -1, axis=0)
    F, G = np.zeros((samples, n + m, n + m)), np.zeros((samples, n + m, m))
    F[:, :n], G[:, :n], G[:, n:] = P1[:, :n, :n] @ P0[:, :n], P1[:, :n, n:], np.eye(m)
    r = n + m
    return SampledProblem(F, G, whole[:, :r, :r], whole[:, :r, r:], whole[:, r:, r:], late)


def add_costs(steps: Array) -> tuple[Array, Array]:
    """P and S (N, s, s) over all steps (N, c, 2 s, 2 s) of the Hamiltonian: S = S_1 + P_1' S_2 P_1."""
    parts, _ = scatter_hamiltonian(steps)
    P, S = parts.F[:, 0], parts.H[:, 0]
    for k in range(1, steps.shape[1]):
        S = S + transpose(P) @ parts.H[:, k] @ P
        P = parts.F[:, k] @ P
    return P, S


def integrate_weight(R: ResolvedMatrix, edges: Array) -> Array:
    """The integral of R (N, m, m) over all steps between edges (N, c + 1), by Gauss's rule."""
    x, w = np.polynomial.legendre.leggauss(8)
    h = np.diff(edges, axis=1)[:, :, None]
    t = edges[:, :-1, None] + h * (x + 1) / 2
    values = R(np.mod(t, R.period).ravel()).reshape(*t.shape, *R.shape)
    return np.einsum("kcs,kcsij->kij", h * w / 2, values)


@dataclass(frozen=True, eq=False)
class Excited:
    """The Hamiltonian [[A, -W], [0, -A']], in scattering form the covariance that noise of intensity W adds up to."""

    system: PeriodicSystem
    W: ResolvedMatrix

    def __call__(self, t: Array) -> Array:
        now = np.mod(t, self.system.period)
        A, W = self.system.resolved(now), self.W(now)
        return assemble_hamiltonian(A, W, np.zeros_like(A))


def spread_noise(
    system: PeriodicSystem, W: ResolvedMatrix, samples: int, periods: int, tol: float, stages: int
) -> tuple[Array, Array]:
    """F and the integral of P W P' dt (N, n, n) over equal intervals, P the transition matrix to their ends."""
    span = system.period * periods
    t, h = span * np.arange(samples) / samples, span / samples
    parts, _ = scatter_hamiltonian(step_sections(Excited(system, W), divide(system, t, t + h, tol, (W,)), stages))
    F, G = parts.F[:, 0], parts.G[:, 0]
    for k in range(1, parts.F.shape[1]):
        F, G = parts.F[:, k] @ F, parts.G[:, k] + parts.F[:, k] @ G @ transpose(parts.F[:, k])
    return F, G
