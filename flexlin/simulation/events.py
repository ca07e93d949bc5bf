"""Events of a loop: a torque reaches or leaves a limit or is sampled, a joint sticks or breaks loose; found on whole windows at once."""

from copy import deepcopy
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import brentq

from flexlin.checks import Array
from flexlin.control.sensors import encoder_rows
from flexlin.errors import ArgumentError
from flexlin.linearization.law import Law
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.sampled import hold_controller
from flexlin.simulation.drive import Drive
from flexlin.simulation.equations import Places, find_held, from_coordinates, to_coordinates
from flexlin.simulation.mesh import BREAK_DISTANCE, law_times
from flexlin.simulation.modes import SAMPLED, Friction, Modes, find_holding
from flexlin.simulation.stopping import stopped
from flexlin.simulation.window import Grid, Path, Rule, between

GUARD_PLACES = np.arange(1, 17) / 16
"""Parts of a step at which the guards are looked at."""
GUARD_HALVINGS = 16
"""Of a sixteenth of a step, in which a guard is looked for that rises from zero."""
MOST_EVENTS, MOST_AT_ONCE = 20_000, 20
"""Events of a run, and at one time, after which it is given up."""
LIMIT_SLACK = 1e-9
"""Of the static friction and of the largest torque: what is exactly at the limit stays within."""
NEAR_SAMPLE = 1e-6
"""An instant nearer than this share of a sample is meant."""
JUMP_SHARE = 1e-8
"""A torque further from what is asked than this share of it has not caught up."""


@dataclass(frozen=True)
class Signals:
    """What the guards look at on a grid: polynomials of each step, coefficients (K, s + 1, q) of powers of the time from 0 to 1.

    They are of what the law asks of the m inputs, of the rates of the p joints, and of the friction that these need.
    """

    grid: Grid
    coefficients: Array
    inputs: int

    def at(self, step: int | slice, u: Array) -> tuple[Array, ...]:
        """What is asked, its rate, the joints' rates and their friction at parts u (Q,) of a step, (Q, ..), or of all, (K, Q, ..)."""
        c, m = self.coefficients[step], self.inputs
        powers = np.arange(c.shape[-2])
        values = u[:, None] ** powers @ c
        slopes = powers[1:] * u[:, None] ** (powers[1:] - 1) @ c[..., 1:, :m]
        rates, holding = np.split(values[..., m:], 2, axis=-1)
        return values[..., :m], slopes / self.grid.h[step][..., None, None], rates, holding


@dataclass(frozen=True)
class Event:
    """Where a mode ends: the time, the step of the window, the guard, and what is asked there with its rate, (m,) each."""

    time: float
    step: int
    guard: int
    asked: Array
    pace: Array


@lru_cache(maxsize=16)
def through_start(stages: int) -> Array:
    """Values at the beginning and the stages of a step -> coefficients of the polynomial through them, (s + 1, s + 1)."""
    return np.linalg.inv(np.vander(np.append(0.0, Rule.of(stages).tableau.c), increasing=True))


class Events:
    """The modes of a loop as they follow each other.

    modes: the present ones; passed: the earlier ones with the times at which they began; notes: time, joint, and what it does then.
    """

    def __init__(self, lin: Linearization, law: Law, drive: Drive, friction: Friction | None):
        self._lin, self._law, self._about, self._drive, self._friction = lin, law, lin.about, drive, friction
        m = lin.about.m
        self._limit = np.full(m, np.inf) if drive.limit is None else np.array(drive.limit)
        self._fastest = np.full(m, np.inf) if drive.rate is None else np.array(drive.rate)
        self.modes = Modes.free(m, 0 if self._friction is None else len(self._friction.rows))
        self.passed: list[tuple[float, Modes]] = []
        self.notes: list[tuple[float, str, str]] = []
        self._count, self._at_once, self._memory = 0, 0, law.memory

    def begin(self, t: float, x: Array) -> Array:
        """The modes of a start x = [y; y'; z]; returns the state, with the rates of joints that stick made exact."""
        self._begin_inputs(t, x)
        if self._friction is not None:
            rates = self._rates(t, x)
            self.modes.slip = np.where(np.abs(rates) > LIMIT_SLACK, np.sign(rates), 0.0)
            x = self._settle(t, x.copy())
        self.passed.append((t, deepcopy(self.modes)))
        return x

    def _begin_inputs(self, t: float, x: Array) -> None:
        """The modes of the inputs at a start."""
        asked = self._asked(t, x)
        for which, given in enumerate(np.clip(asked, -self._limit, self._limit)):
            self._choose(t, which, asked[which], 0.0, given)

    def pass_break(self, t: float, x: Array, before: Array | None) -> None:
        """Behind a break of the motion what is asked may have jumped; before: the torque (m,) that was given until then."""
        if np.isfinite(self._fastest).any() and before is not None:
            asked = self._asked(t + BREAK_DISTANCE * self._lin.period, from_coordinates(x, self._lin.n, self._memory))
            for which in range(len(asked)):
                self._choose(t, which, asked[which], 0.0, before[which])
            self.passed.append((t, deepcopy(self.modes)))

    def first(self, grid: Grid, path: Path, at: Places) -> Event | None:
        """The first event on a motion at the stages `at` of a grid."""
        if self._friction is None and np.all(self.modes.held == SAMPLED):
            return None
        signals = self._signals(grid, path, at)
        t = grid.edges[:-1, None] + grid.h[:, None] * GUARD_PLACES
        left = self._guards(t, *signals.at(slice(None), GUARD_PLACES)) < 0
        for step, look in np.argwhere(left.any(axis=2)).tolist():
            ends = GUARD_PLACES[look - 1] if look else 0.0, GUARD_PLACES[look]
            roots = [(self._root(signals, path, step, ends, int(i)), int(i)) for i in np.flatnonzero(left[step, look])]
            u, guard = min(roots)
            if np.isfinite(u):
                asked, pace, *_ = self._looked_at(signals, path, step, u)
                return Event(float(grid.edges[step] + u * grid.h[step]), step, guard, asked[0], pace[0])
        return None

    def switch(self, event: Event, begin: float, x: Array) -> Array:
        """Change the modes in a state x of the coordinates [y; c; y'; z]; returns the state from which it goes on.

        Raises: SimulationStopped where events follow each other without end.
        """
        t, n, m = event.time, self._lin.n, len(self._limit)
        self._count, self._at_once = self._count + 1, self._at_once + 1 if t <= begin else 0
        if self._count > MOST_EVENTS or self._at_once > MOST_AT_ONCE:
            raise stopped(t, self._describe(event.guard), np.concatenate([x[:n], x[len(x) // 2 :][:n]]))
        z = from_coordinates(x, n, self._memory)
        if event.guard < 2 * m:
            which = event.guard % m
            given = self.modes.given(np.array(t), event.asked)[which]
            self._choose(t, which, event.asked[which], event.pace[which], given)
        else:
            z = self._change_joint(t, z, event.guard - 2 * m)
        self.passed.append((t, deepcopy(self.modes)))
        return to_coordinates(z, n)

    def torques(self, t: Array, asked: Array) -> Array:
        """What was given (N, m) at times t (N,) at which the law asked for `asked`."""
        begun = np.searchsorted([time for time, _ in self.passed], t, side="left") - 1
        modes = Modes.at_many([one for _, one in self.passed], np.maximum(begun, 0))
        return np.clip(modes.given(t, asked), -self._limit, self._limit)

    def _asked_along(self, t: Array, x: Array) -> Array:
        """The torque (N, m) for which the law asks in states [y; y'; z] (N, ..)."""
        return self._law.torque(law_times(self._lin, t), x)

    def _asked(self, t: float, x: Array) -> Array:
        return self._asked_along(np.array([t]), x[None])[0]

    def _rates(self, t: float, x: Array) -> Array:
        """The rates (p,) of the joints themselves, the motion's included."""
        assert self._friction is not None
        y, v = np.split(x[None, : 2 * self._lin.n], 2, axis=1)
        return self._about.positions(np.array([t]), y, v)[1][0, list(self._friction.places)]

    def _signals(self, grid: Grid, path: Path, at: Places) -> Signals:
        """The polynomials through the beginnings and the stages of the steps."""
        n, half = self._lin.n, path.x.shape[1] // 2
        y, v, w = path.stages
        parts = tuple(np.ascontiguousarray(part[:, :n]) for part in (y, v, w))
        begun = grid.edges[:-1] + BREAK_DISTANCE * self._lin.period
        stages, starts = self._follow(at.t, y, v), self._follow(begun, path.x[:-1, :half], path.x[:-1, half:])
        values = np.concatenate([starts[:, None], stages.reshape(grid.count, grid.stages, -1)], axis=1)
        if self._friction is not None:
            given = self.modes.given(at.t, stages[:, : len(self._limit)])
            holding = find_holding(self._about, self._friction, at.t, parts, given)
            holding = holding.reshape(grid.count, grid.stages, -1)
            before = grid.rule.to_start @ holding
            values = np.concatenate([values, np.concatenate([before[:, None], holding], axis=1)], axis=2)
        return Signals(grid, through_start(grid.stages) @ values, len(self._limit))

    def _follow(self, t: Array, y: Array, v: Array) -> Array:
        """What is asked and the joints' rates (N, m + p) in a motion [y; c], [y'; z] (N, n + k)."""
        n = self._lin.n
        asked = self._asked_along(t, np.concatenate([y[:, :n], v], axis=1))
        if self._friction is None:
            return asked
        rates = self._about.positions(t, y[:, :n], v[:, :n])[1][:, list(self._friction.places)]
        return np.concatenate([asked, rates], axis=1)

    def _looked_at(self, signals: Signals, path: Path, step: int, u: float) -> tuple[Array, ...]:
        """The signals (1, ..) at a part of a step: what follows from the state, of the state itself."""
        grid, m = signals.grid, len(self._limit)
        t = grid.edges[step] + np.array([u]) * grid.h[step]
        x = between(grid, path, np.zeros((grid.count, grid.stages)), t)[0]
        _, pace, _, holding = signals.at(step, np.array([u]))
        asked, rates = np.split(self._follow(t, *np.split(x, 2, axis=1)), [m], axis=1)
        return asked, pace, rates, holding

    def _guards(self, t: Array, asked: Array, pace: Array, rates: Array, holding: Array) -> Array:
        """What stays above zero (.., 2 m + p) as long as the modes hold."""
        modes, sign = self.modes, np.sign(self.modes.held)
        behind = sign * (np.clip(asked, -self._limit, self._limit) - modes.given(t, asked))
        beyond = sign * asked - (1 - LIMIT_SLACK) * self._limit
        free = (1 + LIMIT_SLACK) * self._limit - np.abs(asked)
        size = np.choose(np.abs(modes.held).astype(int), [free, beyond, behind, np.ones(len(sign))])
        speed = np.where(modes.held == 0, self._fastest - np.abs(pace), 1.0)
        if self._friction is None:
            return np.concatenate([size, speed], axis=-1)
        stuck = (1 + LIMIT_SLACK) * self._friction.static - np.abs(holding)
        return np.concatenate([size, speed, np.where(modes.slip == 0, stuck, modes.slip * rates)], axis=-1)

    def _root(self, signals: Signals, path: Path, step: int, ends: tuple[float, float], guard: int) -> float:
        """Where in a step a guard reaches zero between two ends, infinite where it is above zero at the last one.

        One that is zero at the first end, where a mode has just begun, may rise from there before it falls.
        """

        def at(u: float) -> float:
            t = signals.grid.edges[step] + np.array([u]) * signals.grid.h[step]
            return float(self._guards(t, *self._looked_at(signals, path, step, u))[0, guard])

        first, last = ends
        if at(last) > 0:
            return np.inf
        above = first if at(first) > 0 else last
        for _ in range(GUARD_HALVINGS if above == last else 0):
            above = (first + above) / 2
            if at(above) > 0:
                break
            last = above
        return float(brentq(at, above, last, xtol=1e-15, rtol=1e-14)) if above < last else first

    def _choose(self, t: float, which: int, asked: float, pace: float, given: float) -> None:
        """The mode of an input of which so much is asked, at such a rate, and which gave so much until now."""
        modes, limit, fastest = self.modes, self._limit[which], self._fastest[which]
        target = np.clip(asked, -limit, limit)
        apart = target - given if np.isfinite(fastest) else 0.0
        held, base, ramp = 0.0, target, 0.0
        if abs(apart) > JUMP_SHARE * max(abs(target), abs(given)):
            held, base, ramp = 2 * np.sign(apart), given, np.sign(apart) * fastest
        elif abs(asked) >= limit:
            held = np.sign(asked)
        elif abs(pace) > fastest:
            held, base, ramp = 2 * np.sign(pace), given, np.sign(pace) * fastest
        modes.held[which], modes.base[which], modes.ramp[which], modes.since[which] = held, base, ramp, t

    def _change_joint(self, t: float, x: Array, which: int) -> Array:
        """What stuck breaks loose; what slid rests, and moves on only if friction cannot hold it."""
        modes, before = self.modes, self.modes.slip.copy()
        if before[which] == 0:
            held = self._holding(t, x)
            modes.slip[which] = np.sign(held[int(np.sum(before[:which] == 0))])
        else:
            modes.slip[which] = 0.0
        x = self._settle(t, x.copy())
        assert self._friction is not None
        for i in np.flatnonzero(modes.slip != before):
            what = "sticks" if not modes.slip[i] else "turns" if before[i] else "slides"
            self.notes.append((t, self._friction.names[i], what))
        return x

    def _holding(self, t: float, x: Array) -> Array:
        """The friction of the joints that stick."""
        assert self._friction is not None
        slip, given = self.modes.slip, self.modes.given(np.array([t]), self._asked(t, x))
        held = find_held(self._about, self._friction, np.array([t]), x[None, : 2 * self._lin.n], given, slip[None])
        return held[0, slip == 0]

    def _settle(self, t: float, x: Array) -> Array:
        """Let joints break loose that friction cannot hold, the worst first, and stop those that stick exactly."""
        assert self._friction is not None
        slip = self.modes.slip
        for place, row in enumerate(self._friction.rows):
            if slip[place] == 0:
                x[self._lin.n + row] -= self._rates(t, x)[place]
        for _ in range(len(slip)):
            stuck = np.flatnonzero(slip == 0)
            if not len(stuck):
                break
            holding = self._holding(t, x)
            over = np.abs(holding) - (1 + LIMIT_SLACK) * self._friction.static[stuck]
            worst = int(np.argmax(over))
            if over[worst] <= 0:
                break
            slip[stuck[worst]] = np.sign(holding[worst])
        return x

    def _describe(self, guard: int) -> str:
        """What goes on happening where one guard reaches zero again and again."""
        m = len(self._limit)
        if guard < 2 * m:
            return f"input {guard % m + 1} goes on leaving and reaching {'its limit' if guard < m else 'the limit of its rate'}"
        assert self._friction is not None
        return f"joint {self._friction.names[guard - 2 * m]} goes on changing between sticking and sliding"


class Samples(Events):
    """Those of a loop whose torque is computed from samples, takes effect some time later, and is held.

    The controller's own states move from sample to sample, as what was measured and asked at the first of them has it.
    remembered: these states with the times of the samples.
    """

    def __init__(self, lin: Linearization, law: Law, drive: Drive, friction: Friction | None):
        super().__init__(lin, law, drive, friction)
        self._step, self._delay, self._start = drive.sample_time or 1.0, drive.delay, 0.0
        self._moves = None if law.controller is None else hold_controller(law.controller.rates, self._step)
        self._next, self._after, self._memory = np.zeros(0), np.zeros(0), 0
        self.remembered: list[tuple[float, Array]] = []

    def instants(self, end: float) -> Array:
        """When samples are taken and torques take effect, up to a time."""
        samples = self._start + self._step * np.arange(np.ceil((end - self._start) / self._step))
        late = self._delay / self._step
        found = np.union1d(samples, samples + self._delay) if NEAR_SAMPLE < late < 1 - NEAR_SAMPLE else samples
        return found[found < end]

    def pass_break(self, t: float, x: Array, before: Array | None) -> None:
        """Let the torque of the last sample act, or take the next one, where it is time; a torque without delay acts behind its sample."""
        passed, late = (t - self._start) / self._step, self._delay / self._step
        sampled, acts = (abs(part - round(part)) < NEAR_SAMPLE for part in (passed, passed - late))
        if acts and late >= NEAR_SAMPLE and passed > late - NEAR_SAMPLE:
            self._act(t)
        if sampled:
            seen, asked, self._next = self._take_sample(t, x)
            self.remembered.append((t, self._after))
            if self._moves is not None:
                self._after = self._after + self._moves @ self._remember(t, seen, asked - self._next)
        if acts and late < NEAR_SAMPLE:
            self._act(t)

    def _act(self, t: float) -> None:
        """From here on the torque is that of the last sample."""
        self.modes.base = self._next
        self.passed.append((t, deepcopy(self.modes)))

    def memory(self, t: Array) -> Array:
        """The controller's states (N, k) at times (N,)."""
        begun = np.searchsorted([time for time, _ in self.remembered], t, side="left") - 1
        return np.array([self.remembered[max(0, which)][1] for which in begun])

    def _begin_inputs(self, t: float, x: Array) -> None:
        """The torque of the first sample acts at once."""
        self._start, self._after = t, x[2 * self._lin.n :]
        self.modes.held[:] = SAMPLED
        self.modes.base = self._take_sample(t, x[: 2 * self._lin.n])[2]

    def _take_sample(self, t: float, x: Array) -> tuple[Array, Array, Array]:
        """What is measured in a state [y; y'], with the controller's states, the torque asked, and the torque given."""
        seen = self._measure(t, np.concatenate([x, self._after]))
        asked = self._law.torque(law_times(self._lin, np.array([t])), seen[None])[0]
        return seen, asked, self._drive.saturated(asked)

    def _asked_along(self, t: Array, x: Array) -> Array:
        """What is held."""
        return np.tile(self.modes.base, (len(t), 1))

    def _remember(self, t: float, x: Array, missing: Array) -> Array:
        """z' (k,) of the controller's states in a state [y; y'; z] that was measured, with the torque (m,) that is asked but not given."""
        controller = self._law.controller
        assert controller is not None
        steer = self._law.steer(self._law.reference(law_times(self._lin, np.array([t]))))[0]
        return controller.rates @ x + steer + controller.unwinding @ missing

    def _measure(self, t: float, x: Array) -> Array:
        """What encoders of finite steps make of a state [y; y'; z], by the least change of y; rates are taken as they are."""
        if self._drive.encoders is None:
            return x
        steps, rows, n = np.array(self._drive.encoders), encoder_rows(self._lin), self._lin.n
        if len(rows) != len(steps):
            raise ArgumentError("encoders do not fit the arm", got=len(steps), expected=str(len(rows)))
        angles = self._lin.motion.sample(law_times(self._lin, np.array([t])))[0][0]
        read = angles[list(self._lin.driven)] + rows @ x[:n]
        return np.concatenate([x[:n] + np.linalg.pinv(rows) @ (steps * np.round(read / steps) - read), x[n:]])
