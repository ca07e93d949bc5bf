"""Loops whose torque the drive cuts or holds: corners in time would spoil the order of collocation, so steps are taken one by one."""

from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.sampled.hold import hold_controller
from flexlin.simulation.controlled_arm import ControlledArm
from flexlin.simulation.events import Slewing, Sticking, skips_layer
from flexlin.simulation.marks import INSIDE, with_breaks
from flexlin.simulation.stepping import march

if TYPE_CHECKING:
    from scipy.integrate import DOP853, LSODA


def follow_cut(loop: ControlledArm, t: Array, z: Array, rtol: float) -> Array:
    """States (N, 2n + k + 1) of a loop whose torque is cut, by a multistep method, which bears corners."""
    from scipy.integrate import LSODA

    def follow(now: float, z: Array) -> Array:
        asked = loop.law(now, z[:-1])
        given = loop.drive.saturated(asked)
        return loop.rate(now, z, given, loop.law.rate(now, z[:-1], asked - given))

    def make(now: float, z: Array, first: float | None, end: float) -> "LSODA":
        return LSODA(follow, now, z, end, first_step=first, rtol=rtol, atol=rtol * 1e-2)

    out, marks, aside = [z[None]], with_breaks(t[[0, -1]], loop.lin, loop.rough), INSIDE * loop.lin.period
    for begin, end in pairwise(marks):
        first, last, stops = begin + aside, end - aside, t[(t > begin) & (t <= end)]
        stops = np.clip(stops, first, last)
        z, values = march(
            partial(make, end=last), z, first, last, stops, loop.accept, partial(skips_layer, loop.layers)
        )
        out.append(values)
    return np.concatenate(out)


def follow_sticking(loop: ControlledArm, t: Array, z: Array, rtol: float) -> Array:
    """States (N, 2n + k + 1) of a loop whose joints stick and slide, from event to event; the loop's `events` are set."""

    def torque(now: float, z: Array) -> tuple[Array, Array]:
        asked = loop.law(now, z[:-1])
        given = loop.drive.saturated(asked)
        return given, loop.law.rate(now, z[:-1], asked - given)

    joints = Sticking(loop, torque)
    out = joints.follow(t, joints.begin(float(t[0]), z), rtol)
    loop.events = tuple(joints.events)
    return out


def follow_slewing(loop: ControlledArm, t: Array, z: Array, rtol: float) -> Array:
    """States (N, 2n + k + 1) of a loop whose drive changes its torque at a limited rate; the loop's `given` torques are set."""
    out, loop.given = Slewing(loop, np.array(loop.drive.rate)).run(t, z, rtol)
    return out


def follow_held(loop: ControlledArm, t: Array, z: Array, rtol: float) -> Array:
    """States (N, 2n + k + 1) from instant to instant at which the torque changes, sampling measured `delay` before.

    The controller's own states move from sample to sample, as what was measured and asked at the first of them has it. The loop's `given`
    torques are set.
    """
    step, delay = loop.drive.sample_time or 1.0, loop.drive.delay
    law, plant = loop.law, 2 * loop.n
    held = None if law.controller is None else hold_controller(law.controller.rates, step)
    out, torque = np.empty((len(t), len(z))), loop.command(t[0], loop.measure(t[0], z[:-1]))
    out[0], now, done, sample = z, float(t[0]), 1, 0
    loop.given = np.tile(torque, (len(t), 1))
    while done < len(t):
        measured = t[0] + sample * step
        seen = loop.measure(measured, z[:-1])
        asked = law(measured, seen)
        given, after = loop.drive.saturated(asked), z[plant:-1]
        if held is not None:
            after = after + held @ law.rate(measured, seen, asked - given)
        for until, later in ((measured + delay, given), (measured + step, given)):
            if until > now:
                stops = t[done : int(np.searchsorted(t, until + 1e-12 * step, side="right"))]
                make = partial(explicit, loop, torque=torque, end=until, rtol=rtol)
                z, values = march(
                    make, z, now, until, stops, loop.accept, partial(skips_layer, loop.layers), first=until - now
                )
                out[done : done + len(stops)], loop.given[done : done + len(stops)] = values, torque
                done, now = done + len(stops), until
            torque = later
        z = np.concatenate([z[:plant], after, z[-1:]])
        sample += 1
    return out


def explicit(loop: ControlledArm, t: float, z: Array, first: float, torque: Array, end: float, rtol: float) -> "DOP853":
    """An integrator under a constant torque."""
    from scipy.integrate import DOP853

    rate = partial(loop.rate, torque=torque)
    return DOP853(rate, t, z, end, rtol=max(rtol, 1e-13), atol=rtol * 1e-2, first_step=first)
