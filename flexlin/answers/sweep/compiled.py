"""Exponents of many values together by the compiled kernel: when it pays, how it is prepared, and one block of values."""

import time
from dataclasses import dataclass
from functools import partial

import numpy as np

from flexlin.about.free import ParametricLoop
from flexlin.about.kernel_source import write_model
from flexlin.answers.sweep.batches import PILOTS, SLACK, Batches, Plan
from flexlin.answers.sweep.found import Found
from flexlin.checks import Array
from flexlin.errors import ArgumentError, NumericalError
from flexlin.periodic.compiler import find_compiler
from flexlin.periodic.many.algebra import solve_positive
from flexlin.periodic.many.compiled import WIDTH, CompiledKernel
from flexlin.periodic.many.extrapolation import MULTIPLES
from flexlin.periodic.many.romberg import balance_states, measure_spread

PAYS = 1.0
"""Seconds of work by NumPy, predicted, from which the kernel is compiled; more where there are more than `SHORT` coordinates."""
SHORT = 6
NUMPY_VALUE = 1.5e-4
"""Seconds that NumPy takes for a value of four states; it grows with the cube of the states."""
LARGEST = 16
"""Coordinates up to which code with all sizes written out is compiled in a few seconds."""
STARTS = (4, 6, 8, 10, 12, 14, 16, 18, 20, 24, 28, 32, 40, 48, 56, 64, 80, 96, 112, 128, 192, 256, 384, 512, 768, 1024)
"""Numbers of segments among which the pilot chooses; the resolutions are multiples of it."""
WORSE = 1.3
"""The pilot stops at a number of segments that costs so much more than the best."""
FINER, FINEST = 4, 2048
"""Values that missed tol are tried again with so many times more segments, up to so many, before `floquet` has them."""
BLOCK_WORK = 2e9
"""Multiplications of a block."""
PROBES = 32
"""Phases at which the size of the coefficients is taken."""


def pays(loop: ParametricLoop, values: int) -> bool:
    """Whether compiling takes less time than it saves."""
    n = loop.linearization.n
    worth = values * NUMPY_VALUE * (n / 2) ** 3 > PAYS * max(1.0, (n / SHORT) ** 2)
    return worth and n <= LARGEST and find_compiler() is not None


@dataclass(frozen=True)
class CompiledBatches:
    """The compiled computation of blocks of values; `scale` (2n,) balances the states."""

    loop: ParametricLoop
    tol: float
    kernel: CompiledKernel
    scale: Array
    plan: Plan
    seconds: float = 0.0
    route = "compiled"

    @classmethod
    def prepare(cls, loop: ParametricLoop, points: Array, tol: float) -> "CompiledBatches | None":
        """Compile, and choose the number of segments on a few values; nothing where the expressions or the compiler do not allow it."""
        start = time.perf_counter()
        try:
            kernel = CompiledKernel(write_model(loop), loop.linearization.n, loop.of_phase, loop.phase_breaks)
            _ = kernel.library
        except (ArgumentError, NumericalError, OSError):
            return None
        seconds = time.perf_counter() - start
        starts = WIDTH * np.unique(np.linspace(0, (len(points) - 1) // WIDTH, PILOTS).round().astype(int))
        scale = balance_coefficients(loop, points[starts])
        some = [points[start : start + WIDTH] for start in starts]
        return cls(loop, tol, kernel, scale, choose_segments(kernel, some, scale, tol), seconds)

    @property
    def threaded(self) -> bool:
        """All values are computed by the kernel, which lets other threads work meanwhile."""
        return not self.loop.linearization.may_be_narrow

    @property
    def block(self) -> int:
        """Values of a block: as many whatever machine or worker computes it, so that results do not depend on where the cuts are."""
        work = sum(MULTIPLES[:3]) * self.plan.segments * 12 * (2 * self.loop.linearization.n) ** 3
        return WIDTH * int(np.clip(BLOCK_WORK / work / WIDTH, 1, 1024))

    def spectra(self, points: Array, segments: int) -> tuple[Array, Array, Array]:
        """Logs (V, n) of the multipliers, their errors (V, n), and whether they meet tol (V,)."""
        given = (segments, self.scale, self.tol / 100, np.inf, self.tol)
        logs, errors, sound, T, _ = self.kernel.find_logs(points, *given)
        return logs, errors, sound & np.all(errors <= self.tol * np.maximum(T[:, None], np.abs(logs)), axis=1)

    def compute(self, points: Array) -> Found:
        """All values of a block: together, those that miss tol on more and more segments, and the rest one by one."""
        found = Found.empty(len(points), self.loop.states)
        narrow = Batches(self.loop, points, self.tol, 0).find_narrow(np.arange(len(points)))
        alone, rest, segments = np.flatnonzero(narrow), np.flatnonzero(~narrow), self.plan.segments
        spread = SLACK * self.plan.spread
        while len(rest) and segments <= max(FINEST, self.plan.segments):
            given = (segments, self.scale, self.tol / 100, spread, self.tol)
            result = self.kernel.judge(*self.kernel.find_logs(points[rest], *given)[:4], self.tol)
            done = rest[result.reached]
            found.exponents[done], found.error[done] = result.exponents[result.reached], result.error[result.reached]
            found.verdict[done], found.period[done] = result.verdict[result.reached], result.period[result.reached]
            # moduli may lie further apart than the pilot's
            rest, segments, spread = rest[~result.reached], FINER * segments, np.inf
        found.explain()
        for i in (*alone, *rest):
            found.put_alone(i, partial(self.loop.system_at, points[i]), self.tol)
        return found


def choose_segments(kernel: CompiledKernel, some: list[Array], scale: Array, tol: float) -> Plan:
    """The number of segments from which some values, as many together as a vector holds, reach the tolerance with the least work."""
    best, least = Plan(STARTS[-1]), np.inf
    for segments in STARTS:
        runs = [kernel.find_logs(points, segments, scale, tol / 100, np.inf, tol) for points in some]
        logs, errors, sound, T, work = (np.concatenate(part) for part in zip(*runs, strict=True))
        reached = sound & np.all(errors <= tol * np.maximum(T[:, None], np.abs(logs)), axis=1)
        spent = float(np.where(reached, work, (1 + FINER) * work).mean())
        if reached.any() and spent < least:
            best, least = Plan(segments, spread=measure_spread(logs[reached].T)), spent
        elif spent > WORSE * least:
            break
    return best


def balance_coefficients(loop: ParametricLoop, points: Array) -> Array:
    """The scaling (2n,) of the states that evens the coefficients' mean over the period and the points."""
    phases, n, T = np.arange(PROBES) / PROBES, loop.linearization.n, loop.periods(points)
    M, D, K = (np.moveaxis(A.reshape(PROBES, len(points), n, n), (0, 1), (2, 3)) for A in loop.sample(phases, points))
    stacked = np.concatenate([T**2 * K, T * D], axis=1).reshape(n, 2 * n, -1)
    Z = solve_positive(M.reshape(n, n, -1), stacked)
    usable = np.isfinite(Z).all(axis=(0, 1))
    Z = np.moveaxis(Z[..., usable], 2, 0)[..., None]
    return balance_states(Z[:, :, :n], Z[:, :, n:]) if usable.any() else np.ones(2 * n)
