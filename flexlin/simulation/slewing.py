"""A drive whose torque changes at a limited rate: it follows what is asked while it can, and goes at the limit until it has caught up."""

from itertools import pairwise

import numpy as np

from flexlin.checks import Array
from flexlin.simulation.controlled_arm import ControlledArm
from flexlin.simulation.events import Switching
from flexlin.simulation.marks import INSIDE, with_breaks

STEP = 1e-6
"""Half of the step, in periods, of the difference that is the rate at which the asked torque changes."""
JUMP = 1e-9
"""A torque further from what is asked than this share of it has not caught up."""


class Slewing(Switching):
    """States [z; g] of a loop whose m inputs follow what is asked (mode 0), or move at their limit (mode 1 or -1).

    mode 0: torque = asked, as long as |asked'| <= limit;   else torque = g, g' = mode limit, until g = asked
    """

    def __init__(self, loop: ControlledArm, limit: Array):
        self.loop, self.limit, self.mode = loop, limit, np.zeros(len(limit))

    def asked(self, t: float, z: Array) -> tuple[Array, Array]:
        """What the law asks (m,), and what of it the largest torque allows."""
        asked = self.loop.law(t, z[: self.loop.states])
        return asked, self.loop.drive.saturated(asked)

    def given(self, t: float, z: Array) -> Array:
        """The torque (m,)."""
        return np.where(self.mode == 0, self.asked(t, z)[1], z[-len(self.mode) :])

    def flow(self, t: float, z: Array) -> Array:
        """The rate of the loop's own states."""
        given, m = self.given(t, z), len(self.mode)
        remembered = self.loop.law.rate(t, z[: self.loop.states], self.asked(t, z)[0] - given)
        return self.loop.rate(t, z[:-m], given, remembered)

    def pace(self, t: float, z: Array) -> Array:
        """The rate (m,) at which what is asked, within the largest torque, changes along the motion."""
        h, rate = STEP * self.loop.lin.period, np.concatenate([self.flow(t, z), np.zeros(len(self.mode))])
        ahead, behind = (self.asked(t + sign * h, z + sign * h * rate)[1] for sign in (1, -1))
        return np.asarray((ahead - behind) / (2 * h))

    def derivative(self, t: float, z: Array) -> Array:
        slews = (
            self.mode * self.limit
            if self.mode.all()
            else np.where(self.mode == 0, self.pace(t, z), self.mode * self.limit)
        )
        return np.concatenate([self.flow(t, z), slews])

    def guards(self, t: float, z: Array) -> Array:
        behind = self.mode * (self.asked(t, z)[1] - z[-len(self.mode) :])
        return behind if self.mode.all() else np.where(self.mode == 0, self.limit - np.abs(self.pace(t, z)), behind)

    def describe(self, which: int) -> str:
        return f"input {which + 1} goes on leaving and reaching the limit of its rate"

    def switch(self, t: float, z: Array, which: int) -> Array:
        z, m, asked = z.copy(), len(self.mode), self.asked(t, z)[1]
        follows = self.mode[which] != 0
        self.mode[which], z[which - m] = 0.0, asked[which]
        pace = self.pace(t, z)[which]
        if not follows or abs(pace) > self.limit[which]:
            self.mode[which] = np.sign(pace)
        return z

    def enter(self, t: float, z: Array) -> Array:
        """Go on from torques g behind a break of the motion, where what is asked may jump."""
        asked, m = self.asked(t, z)[1], len(self.mode)
        apart = asked - z[-m:]
        self.mode = np.where(np.abs(apart) > JUMP * np.maximum(np.abs(asked), np.abs(z[-m:])), np.sign(apart), 0.0)
        pace = self.pace(t, z)
        self.mode = np.where((self.mode == 0) & (np.abs(pace) > self.limit), np.sign(pace), self.mode)
        return z

    def run(self, t: Array, z: Array, rtol: float) -> tuple[Array, Array]:
        """States (N, len(z)) of the loop and torques (N, m) at times t; the drive begins with what is asked, within its largest torque."""
        m, T = len(self.mode), self.loop.lin.period
        z, out = np.concatenate([z, self.asked(float(t[0]), z)[1]]), np.empty((len(t), len(z) + m))
        out[0], marks = z, with_breaks(t[[0, -1]], self.loop.lin, self.loop.rough)
        for begin, end in pairwise(marks):
            inside, first, last = (t > begin) & (t <= end), begin + INSIDE * T, end - INSIDE * T
            times = np.concatenate([[first], np.clip(t[inside], first, last), [last]])
            found = self.follow(times, self.enter(float(first), z), rtol)
            out[inside], z = found[1:-1], found[-1]
        return out[:, :-m], out[:, -m:]
