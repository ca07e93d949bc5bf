"""How near the loops of an arm come to a dead point along its rigid motion: there they move fast for a short time."""

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.about.deviation import Deviation
from flexlin.checks import Array
from flexlin.motion import SymbolicMotion

PHASES, STEP = 512, 1e-5
"""Phases that are looked at, and the step of the differences, as a share of the period."""
CLEAR = 1 / 50
"""Of the period: what a motion keeps from its dead points has no feature of a half-width below T / 200."""


def keeps_clear(about: Deviation) -> bool:
    """Whether all dead points of the loops lie at least CLEAR T from real times, in the complex plane.

        det V(t) = 0,   V = D_v f:   t - t_0 ~ 1 / mu for the largest eigenvalue mu of V^-1 V'

    The followers v(u(t)), and with them all coefficients, are analytic in t but for zeros of det V. Newton's step towards the nearest zero
    is right within a factor of two where v has a branch point, so one at a distance of T / 200 is seen from every third phase that is
    looked at. The elastic coordinates are at rest.
    """
    T = about.motion.period
    t, step = T * np.arange(PHASES) / PHASES, STEP * T
    try:
        before, after = (closings(about, t + side * step) for side in (-1, 1))
        rates = np.linalg.eigvals(np.linalg.solve(before + after, (after - before) / step))
    except np.linalg.LinAlgError:  # a loop that is open or at a dead point
        return False
    return bool(np.abs(rates).max(initial=0.0) * CLEAR * T <= 1)


def moves_followers(about: Deviation) -> bool:
    """Whether free numbers of the arm move its followers at a given phase, or how V depends on them."""
    loops, motion, p = about.arm.loops, about.motion, about.arm.parameters.symbols
    if loops is None or not isinstance(motion, SymbolicMotion):
        return True
    symbols = (part for part in (p, motion.parameters.symbols) if part.numel())
    return any(ca.depends_on(ca.vertcat(loops.gap, motion.angles), part) for part in symbols)


def closings(about: Deviation, t: Array) -> Array:
    """V (N, k, k) at times (N,), along the motion."""
    (s,) = about.positions(t, np.zeros((len(t), about.n)))
    v = about.of_arm("followers", t, np.zeros((len(t), about.n)))[:, :, 0]
    if not np.isfinite(v).all():
        raise np.linalg.LinAlgError
    p = np.broadcast_to(about.arm.parameters.values, (len(t), len(about.arm.parameters.values)))
    return symbolic.evaluate(about.arm.functions["closing"], s, v, p)[0]
