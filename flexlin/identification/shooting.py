"""Simulation of all windows of a log side by side by the classical Runge-Kutta method, and the exact derivative of that method."""

from dataclasses import dataclass, field, replace
from itertools import zip_longest

import numpy as np

from flexlin.checks import Array, check_size
from flexlin.errors import ArgumentError, SingularMassMatrix
from flexlin.identification.equations import Logged
from flexlin.identification.log import FEWEST_SAMPLES, Log, varies
from flexlin.lazy import lazy

STEP_ANGLE = 0.5
"""Largest step times the fastest angular frequency of the equations: the method's error is then below 3e-4 of that motion."""
STEP_DECAY = 2.0
"""Largest step times the fastest rate of decay, as that of joints that stick: the method damps up to 2.78."""
MOST_SUBSTEPS = 64
"""Steps for one of the log's, at the most; twice as many to see whether these were enough."""
BLOCK_NODES = 2**10
"""Nodes that are computed at once, and whose slopes are held: a few MB."""


@dataclass(frozen=True, eq=False)
class Windows:
    """W windows of K steps of h seconds each, side by side; a shorter one runs on behind its end, and nothing is compared there.

    starts (W,): times in s; rows (W, N): numbers of the log's rows, -1 where a window has fewer.
    """

    log: Log
    starts: Array
    ends: Array
    h: float
    rows: Array
    driven: dict[bytes, tuple[Array, Array]] = field(default_factory=dict, init=False)

    @classmethod
    def of(cls, log: Log, length: float) -> "Windows":
        """Cut the stretches of a log into windows of a length in s, one after the other; a rest of a quarter is one too.

        Raises: ArgumentError where no stretch is long enough.
        """
        step, chosen = log.step, []
        if length < FEWEST_SAMPLES * step:
            expected = f"{FEWEST_SAMPLES} samples, {FEWEST_SAMPLES * step:.3g} s, or more"
            raise ArgumentError(
                "the windows of the log are too short",
                got=f"{length:.3g} s",
                expected=expected,
                todo=log.advice_on_times,
            )
        for stretch in log.stretches:
            time = log.time[stretch]
            edges = np.arange(time[0], time[-1] - 0.25 * length, length)
            edges = edges if len(edges) else time[:1]
            first, behind = (np.searchsorted(time, at - 1e-6 * step) for at in (edges, edges + length))
            ends = zip(first, behind, strict=True)
            chosen += [stretch.start + np.arange(a, b) for a, b in ends if b - a >= FEWEST_SAMPLES]
        if not chosen:
            raise ArgumentError(
                "the log has no stretch that is long enough",
                got="; ".join(log.notes) or None,
                expected=f"{FEWEST_SAMPLES} rows, with all inputs, without a gap",
                todo="fill short gaps of the inputs, or log without them",
            )
        rows = np.array(list(zip_longest(*chosen, fillvalue=-1))).T
        first, last = rows[:, 0], np.array([one[-1] for one in chosen])
        made = cls(log, log.time[first], log.time[last], step, rows)
        check_size("the log's prediction", 8 * len(chosen) * made.steps * 400, "give a part of the log, or thin it")
        return made

    @lazy
    def steps(self) -> int:
        """The number K of steps, at least four."""
        return max(4, int(np.ceil((self.ends - self.starts).max() / self.h - 1e-6)))

    def refined(self, substeps: int) -> "Windows":
        """The same windows on a grid of so many steps for one of the log's."""
        return replace(self, h=self.log.step / substeps)

    def head(self, seconds: float) -> "Windows":
        """The first seconds of each window."""
        inside = self.there & (self.log.time[self.rows] <= self.starts[:, None] + seconds)
        rows = np.where(inside, self.rows, -1)[:, : int(inside.sum(axis=1).max())]
        return replace(self, ends=np.minimum(self.ends, self.starts + seconds), rows=rows)

    @property
    def count(self) -> int:
        return len(self.starts)

    @property
    def there(self) -> Array:
        """Which rows are samples, (W, N)."""
        return np.asarray(self.rows >= 0)

    def drive(self, delays: Array) -> tuple[Array, Array]:
        """The input columns and their slopes at nodes and in their middles, each (2 K + 1, W, inputs), so much delayed.

        Between samples by a cubic spline through each stretch; before and behind it the input is what it was at its end.
        """
        from scipy.interpolate import CubicSpline

        if delays.tobytes() in self.driven:
            return self.driven[delays.tobytes()]
        times = self.starts + 0.5 * self.h * np.arange(2 * self.steps + 1)[:, None]
        u = np.empty((*times.shape, len(self.log.inputs)))
        slope = np.empty_like(u)
        for stretch in self.log.stretches:
            time = self.log.time[stretch]
            mine = (self.starts >= time[0]) & (self.starts <= time[-1])
            for k, values in enumerate(self.log.inputs.values()):
                spline, at = CubicSpline(time, values[stretch]), times[:, mine] - delays[k]
                held = np.clip(at, time[0], time[-1])
                u[:, mine, k] = spline(held)
                slope[:, mine, k] = np.where(held == at, spline(held, 1), 0.0)
        self.driven.clear()
        self.driven[delays.tobytes()] = u, slope
        return u, slope

    def readings(self) -> Array:
        """The outputs' readings, (W, N, outputs); not a number where there is none, or a sensor is dead while others read."""
        table = np.stack(list(self.log.outputs.values()), axis=-1)
        moves = np.array([varies(values) for values in self.log.outputs.values()])
        return np.where(self.there[:, :, None] & (moves | ~moves.any()), table[self.rows], np.nan)

    def places(self, delay: float) -> Array:
        """Where the samples' times, less a delay, lie on the grid, in steps, (W, N)."""
        return np.asarray((self.log.time[self.rows] - delay - self.starts[:, None]) / self.h)

    def lookup(self, delay: float) -> tuple[Array, Array, Array]:
        """How a value at each sample's time, less a delay, follows from four nodes: Lagrange's cubic.

        Returns: the first node (W, N), weights and their slopes by time (W, N, 4).
        """
        place = np.where(self.there, self.places(delay), 0.0)
        first = np.clip(np.floor(place).astype(int) - 1, 0, self.steps - 3)
        weights, slopes = lagrange(np.maximum(place, 0.0) - first)
        return first, weights, slopes / self.h


def by_phase(values: Array) -> Array:
    """Values at nodes and in their middles, (2 K + 1, W, m), as those at begin, middle and end of each step, (K, W, 3 m)."""
    return np.concatenate([values[:-1:2], values[1::2], values[2::2]], axis=2)


def lagrange(x: Array) -> tuple[Array, Array]:
    """Weights of values at 0, 1, 2, 3 for that at x, and their derivatives, (..., 4)."""
    weights, slopes = np.empty((*x.shape, 4)), np.empty((*x.shape, 4))
    for i in range(4):
        others = [x - j for j in range(4) if j != i]
        scale = np.prod([i - j for j in range(4) if j != i])
        weights[..., i] = others[0] * others[1] * others[2] / scale
        slopes[..., i] = (others[0] * others[1] + others[1] * others[2] + others[0] * others[2]) / scale
    return weights, slopes


@dataclass(frozen=True, eq=False)
class Shooting:
    """The predictions of a log's windows from starting states (W, 2n) and free numbers p (n_p,)."""

    model: Logged
    windows: Windows

    def delays(self, p: Array) -> tuple[Array, Array]:
        """Of inputs and of outputs, in s."""
        inputs, outputs, _ = self.model.delays(p[None, :])
        return inputs[0, :, 0], outputs[0, :, 0]

    def run(self, start: Array, p: Array) -> Array:
        """States at all nodes, (K + 1, W, 2n); a window that diverges holds numbers that are none."""
        w, count = self.windows, self.windows.count
        known = self.delays(p)[0]
        u, du = w.drive(known)
        phases = [by_phase(one) for one in (u, du)]
        same = [np.tile(value, (count, 1)) for value in (known, p, np.array([w.h]))]
        states = np.empty((w.steps + 1, count, 2 * self.model.n))
        states[0] = start
        block = max(1, BLOCK_NODES // count)
        for first in range(0, w.steps, block):
            last = min(first + block, w.steps)
            moving = [states[first:last], *(one[first:last] for one in phases)]
            ahead = np.array([one[0].size for one in moving] + [0] * len(same))
            self.model.step.march(
                last - first, [*(one[0] for one in moving), *same], ahead, [states[first + 1]], ahead[:1]
            )
        return states

    def around(self, p: Array, count: int) -> list[Array]:
        """Known delays and free numbers, for so many points."""
        return [np.tile(value, (count, 1)) for value in (self.delays(p)[0], p)]

    def nodes(self, states: Array, p: Array) -> Array:
        """Readings at all nodes without their delays, (K + 1, W, outputs)."""
        given = self.given(states, *self.windows.drive(self.delays(p)[0]), p)
        a = self.model.slopes(*given)[0][:, :, 0] if self.model.accelerated else np.zeros_like(given[0])
        return self.model.read(*given, a)[0].reshape(*states.shape[:2], -1)

    def given(self, states: Array, u: Array, du: Array, p: Array) -> list[Array]:
        """What the equations are functions of, at nodes one after the other; inputs at nodes and in their middles."""
        inputs = (one[::2].reshape(states[..., 0].size, -1) for one in (u, du))
        at, rate = np.split(states.reshape(-1, 2 * self.model.n), 2, axis=1)
        return [at, rate, *inputs, *self.around(p, len(at))]

    def predict(self, states: Array, p: Array) -> Array:
        """The readings that the outputs should have at the samples' times, (W, N, outputs)."""
        return self.look(self.nodes(states, p), p)

    def look(self, values: Array, p: Array, order: int = 0) -> Array:
        """Values of nodes (K + 1, W, outputs, ...) at the samples, each less its delay, (W, N, outputs, ...); or their slopes in time."""
        delays, which = self.delays(p)[1].tolist(), np.arange(self.windows.count)[:, None]
        found, columns = {delay: self.windows.lookup(delay) for delay in set(delays)}, []
        for j, delay in enumerate(delays):
            first, *weights = found[delay]
            taken = np.stack([values[first + i, which, j] for i in range(4)], axis=2)
            columns.append(np.einsum("wni,wni...->wn...", weights[order], taken))
        return np.stack(columns, axis=2)

    def rates(self, p: Array) -> Array:
        """Eigenvalues of the equations at rest, in 1/s. Raises: SingularMassMatrix."""
        n = self.model.n
        zero = [np.zeros((1, n)), np.zeros((1, n)), *[np.zeros((1, len(self.model.inputs)))] * 2]
        given = [*zero, *self.around(p, 1)]
        by = self.model.slopes(*given)[1][0][:, : 2 * n]
        if not np.isfinite(by).all():
            todo = "give every coordinate inertia, or remove the coordinate"
            raise SingularMassMatrix("the mass matrix is singular at rest", todo=todo)
        return np.asarray(np.linalg.eigvals(np.concatenate([np.eye(n, 2 * n, n), by])))

    def stages(self, states: Array, u: Array, du: Array, p: Array) -> Array:
        """The slopes of each step by x and p, (steps, W, 2n, 2n + n_p)."""
        (nodes, count), h = states.shape[:2], self.windows.h
        points = (nodes - 1) * count
        driven = [by_phase(one).reshape(points, -1) for one in (u, du)]
        given = [states[:-1].reshape(points, -1), *driven, *self.around(p, points), np.full((points, 1), h)]
        made = self.model.step_slopes(*given)[0]
        return made.reshape(nodes - 1, count, *made.shape[1:])

    def sensitivities(self, states: Array, p: Array) -> Array:
        """Slopes of the readings at all nodes by start and p, (K + 1, W, outputs, 2n + n_p)."""
        w, n = self.windows, self.model.n
        u, du = w.drive(self.delays(p)[0])
        S = np.tile(np.eye(2 * n + len(p)), (w.count, 1, 1))  # of [x; p], by x at the start and p
        found = np.empty((w.steps + 1, w.count, len(self.model.outputs), S.shape[2]))
        block = max(2, BLOCK_NODES // w.count)
        for first in range(0, w.steps, block):
            last = min(first + block, w.steps)
            inputs = u[2 * first : 2 * last + 1], du[2 * first : 2 * last + 1]
            steps = self.stages(states[first : last + 1], *inputs, p)
            carried = np.tile(S, (last - first + 1, 1, 1, 1))
            for one, before, after in zip(steps, carried[:-1], carried[1:, :, : 2 * n], strict=True):
                np.matmul(one, before, out=after)
            S = carried[-1]
            found[first : last + 1] = self.seen(states[first : last + 1], *inputs, p, carried)
        return found

    def seen(self, states: Array, u: Array, du: Array, p: Array, carried: Array) -> Array:
        """Slopes of the readings, from those of the states at some nodes."""
        given, S = self.given(states, u, du, p), carried.reshape(-1, *carried.shape[2:])
        a, moved = self.model.slopes(*given) if self.model.accelerated else (np.zeros((*given[0].shape, 1)), None)
        by, by_a = self.model.reading_slopes(*given, a[:, :, 0])
        made = (by if moved is None else by + by_a @ moved) @ S
        return made.reshape(*states.shape[:2], *made.shape[1:])

    def jacobian(self, states: Array, p: Array) -> Array:
        """Slopes of the predicted readings at the samples by start and p, (W, N, outputs, 2n + n_p); delays are moved by their slopes."""
        slopes, by = self.look(self.sensitivities(states, p), p), self.model.delays(p[None, :])[2][0]
        if by.any():
            slopes[..., 2 * self.model.n :] -= self.look(self.nodes(states, p), p, 1)[..., None] * by
        return slopes


def count_substeps(shooting: Shooting, p: Array, finer: int) -> int:
    """Steps for one of the log's, so that the fastest motion of the equations is followed, or so many times more."""
    rates = shooting.rates(p)
    angles = np.maximum(np.abs(rates.imag) / STEP_ANGLE, np.abs(rates) / STEP_DECAY)
    enough = np.clip(np.ceil(angles.max() * shooting.windows.log.step), 1, MOST_SUBSTEPS)
    return int(min(finer * enough, 2 * MOST_SUBSTEPS))
