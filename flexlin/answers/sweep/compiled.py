"""Exponents of many values together by the compiled kernel: when it pays, how it is prepared, and one block of values."""

import time
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from flexlin.answers.sweep.found import Found
from flexlin.answers.sweep.later import Later
from flexlin.answers.sweep.needs import FEW, ORDER, STARTS, Needs, learn_needs, pack
from flexlin.answers.sweep.plan import SLACK, Plan
from flexlin.checks import Array
from flexlin.compiler import find_compiler
from flexlin.errors import ArgumentError, NumericalError
from flexlin.periodic.many.algebra import solve_positive
from flexlin.periodic.many.compiled import WIDTH, CompiledKernel
from flexlin.periodic.many.extrapolation import MULTIPLES

if TYPE_CHECKING:
    from flexlin.about.free import ParametricLoop

PAYS = 1.0
"""Seconds of work by NumPy, predicted, from which the kernel is compiled; more where there are more than `SHORT` coordinates."""
SHORT = 6
NUMPY_VALUE = 1.5e-4
"""Seconds that NumPy takes for a value of four states; it grows with the cube of the states."""
LONGER = 8.0
"""How many times as long NumPy takes for a loop whose controller has states: 6 to 39, by how fast its filters' poles are."""
WIDE, MANY = 8, 400
"""With so many coordinates or more `floquet` is what it is beside, and it takes so many values to be worth the compiler and the pilots."""
LARGEST = 16
"""Coordinates up to which code with all sizes written out is compiled in a few seconds."""
CLOSER, FINER = (1.15, 2.0), 2
"""Values that missed tol are tried again with so many times more segments, once by what they missed, before `floquet` has them."""
BLOCK_WORK = 8e9
"""Multiplications of a block at the most: in a larger one more values are alike, but it is shared out and seen later."""
BLOCKS, SMALL_BLOCK = 16, 12
"""Blocks that a sweep is cut into at the least, unless they have fewer vectors of values than this."""
PROBES, BALANCED = 32, 24
"""Phases and values at which the size of the coefficients is taken."""


def pays(loop: "ParametricLoop", values: int) -> bool:
    """Whether compiling takes less time than it saves."""
    n, longer = loop.coordinates, LONGER if loop.memory else 1.0
    worth = values * longer * NUMPY_VALUE * (n / 2) ** 3 > PAYS * max(1.0, (n / SHORT) ** 2)
    return worth and (n < WIDE or values >= MANY) and n <= LARGEST and find_compiler() is not None


@dataclass(frozen=True)
class CompiledBatches:
    """The compiled computation of blocks of values; `scale` balances the states; `needs` says on how many segments.

    `given`: the loop, for values that are computed one by one; `may_be_narrow`: whether its coefficients may have narrow features.
    Where neither is asked for, a worker loads NumPy and the compiled code alone.
    """

    given: "Later[ParametricLoop]"
    may_be_narrow: bool
    tol: float
    kernel: CompiledKernel
    scale: Array
    needs: Needs
    values: int
    seconds: float = 0.0
    route = "compiled"

    @classmethod
    def prepare(cls, loop: "ParametricLoop", points: Array, tol: float) -> "CompiledBatches | None":
        """Compile, and choose the number of segments on a few values; nothing where the expressions or the compiler do not allow it."""
        from flexlin.about.kernel_source import write_model

        start, of_phase = time.perf_counter(), take_phases if loop.kept is None else loop.of_phase
        try:
            kernel = CompiledKernel(write_model(loop), loop.coordinates, of_phase, loop.phase_breaks, loop.memory)
            _ = kernel.library
        except (ArgumentError, NumericalError, OSError):
            return None
        seconds = time.perf_counter() - start
        scale = balance_coefficients(loop, points[np.linspace(0, len(points) - 1, BALANCED).astype(int)])
        needs = learn_needs(kernel, points, scale, tol)
        return cls(Later(loop), loop.linearization.may_be_narrow, tol, kernel, scale, needs, len(points), seconds)

    @property
    def hopeless(self) -> bool:
        """Whether the pilots needed the most segments there are, or more: `floquet` takes less."""
        return self.needs.usual >= STARTS[-1]

    @property
    def loop(self) -> "ParametricLoop":
        """The loop that is asked about."""
        return self.given.value

    @property
    def plan(self) -> Plan:
        """The number of segments in the middle of the parameters, and the spread of the moduli."""
        return Plan(self.needs.usual, spread=self.needs.spread)

    @property
    def threaded(self) -> bool:
        """All values are computed by the kernel, which lets other threads work meanwhile."""
        return not self.may_be_narrow

    @property
    def block(self) -> int:
        """Values of a block: as many whatever machine or worker computes it, so that results do not depend on where the cuts are."""
        work = sum(MULTIPLES[:FEW]) * self.plan.segments * 12 * (2 * self.kernel.coordinates) ** 3
        shared = max(SMALL_BLOCK, self.values // (BLOCKS * WIDTH))
        return WIDTH * int(np.clip(BLOCK_WORK / work / WIDTH, 1, min(shared, 1024)))

    def spectra(self, points: Array, segments: int) -> tuple[Array, Array, Array]:
        """Logs (V, n) of the multipliers, their errors (V, n), and whether they meet tol (V,)."""
        given = (segments, self.scale, self.tol / 100, np.inf, self.tol)
        logs, errors, sound, T, _ = self.kernel.find_logs(points, *given)
        return logs, errors, sound & np.all(errors <= self.tol * np.maximum(T[:, None], np.abs(logs)), axis=1)

    def compute(self, points: Array) -> Found:
        """All values of a block: together, those that miss tol on more and more segments, and the rest one by one."""
        found = Found.empty(len(points), self.kernel.states)
        narrow = self.find_narrow(points)
        rest, alone = np.flatnonzero(~narrow), [np.flatnonzero(narrow)]
        wanted, spread, trial = self.needs.predict(points[rest]), SLACK * self.needs.spread, 0
        while len(rest):
            misses, levels = np.empty(len(rest)), FEW if trial < 2 else len(MULTIPLES)
            for segments, which in pack(wanted):
                misses[which] = self.enter(found, points, rest[which], segments, spread, levels)
                wanted[which] = segments
            missed = misses > 1
            growth = FINER if trial else np.clip(misses[missed] ** (1 / ORDER), *CLOSER)
            rest, wanted = rest[missed], growth * wanted[missed]
            alone.append(rest[wanted > STARTS[-1]])
            rest, wanted = rest[wanted <= STARTS[-1]], wanted[wanted <= STARTS[-1]]
            spread, trial = np.inf, trial + 1  # moduli may lie further apart than the pilots'
        found.explain()
        for i in np.concatenate(alone):
            found.put_alone(i, partial(self.loop.system_at, points[i]), self.tol)
        return found

    def find_narrow(self, points: Array) -> Array:
        """Which values have coefficients with narrow features, (V,)."""
        if not self.may_be_narrow:
            return np.zeros(len(points), dtype=bool)
        from flexlin.answers.sweep.batches import Batches

        return Batches(self.loop, points, self.tol, 0).find_narrow(np.arange(len(points)))

    def enter(self, found: Found, points: Array, which: Array, segments: int, spread: float, levels: int) -> Array:
        """Compute values together and enter those that meet tol; the errors of all in units of it, (V,)."""
        given = (segments, self.scale, self.tol / 100, spread, self.tol, levels)
        result = self.kernel.judge(*self.kernel.find_logs(points[which], *given)[:4], self.tol)
        reached = result.misses <= 1
        done = which[reached]
        found.exponents[done], found.error[done] = result.exponents[reached], result.error[reached]
        found.verdict[done], found.period[done] = result.verdict[reached], result.period[reached]
        return result.misses


def balance_coefficients(loop: "ParametricLoop", points: Array) -> Array:
    """The scaling of the coordinates and their rates that evens the coefficients' mean over the period and the points."""
    from flexlin.periodic.many.romberg import balance_states

    phases, n, T = np.arange(PROBES) / PROBES, loop.coordinates, loop.periods(points)
    M, D, K = (np.moveaxis(A.reshape(PROBES, len(points), n, n), (0, 1), (2, 3)) for A in loop.sample(phases, points))
    stacked = np.concatenate([T**2 * K, T * D], axis=1).reshape(n, 2 * n, -1)
    Z = solve_positive(M.reshape(n, n, -1), stacked)
    usable = np.isfinite(Z).all(axis=(0, 1))
    Z = np.moveaxis(Z[..., usable], 2, 0)[..., None]
    return balance_states(Z[:, :, :n], Z[:, :, n:], loop.memory) if usable.any() else np.ones(2 * n)


def take_phases(phases: Array) -> Array:
    """What the phase decides of a loop without a kept gain: itself, (N, 1)."""
    return phases[:, None]
