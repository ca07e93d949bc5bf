"""Questions of the numeric wing that have no answer are refused by a typed error that says why."""

from functools import partial
from operator import add, mul

import numpy as np
import pytest

import flexlin as fl
from flexlin.control import sampled_floquet
from flexlin.errors import ArgumentError, NotDetectable, NotStabilizable, NotStable, NumericalError, TooManySegments
from flexlin.periodic import periodic_riccati

ONE, EYE, TURN = np.eye(1), np.eye(2), 2 * np.pi
UNSTABLE, LAG = (fl.PeriodicSystem([[rate]], 1.0, B=ONE) for rate in (0.1, -1.0))
DEAF = fl.PeriodicSystem([[-1.0]], 1.0)
PLANT = fl.PeriodicSystem([[0.0, 1.0], [-1.0, -1.0]], 1.0, B=[[0.0], [1.0]])
OSCILLATOR = fl.PeriodicSystem([[0.0, 1.0], [-1.0, 0.0]], TURN, B=[[0.0], [1.0]])
UNREACHED, UNSEEN = (fl.PeriodicSystem(np.diag([0.5, -1.0]), 1.0, B=[[b], [1.0]]) for b in (0.0, 1.0))
HIDDEN = fl.PeriodicSystem(np.diag([-1.0, -2.0]), 1.0, B=[[1.0], [0.0]])
APART, SEEN = np.array([[0.5, 0.0], [0.3, -1000.0]]), fl.PeriodicSystem(np.diag([0.5, -1000.0]), 1.0, np.ones((2, 1)))
MIX = np.linalg.qr(np.random.default_rng(0).normal(size=(2, 2)))[0]
MIXED = fl.PeriodicSystem(MIX @ APART @ MIX.T, 1.0, MIX[:, 1:])
TOO_WEAKLY = "^(?!.*actuator).*too weakly to be computed with.*its share is "
"""A mode that is reached needs no actuator."""


def reached(share):
    return fl.PeriodicSystem(APART, 1.0, [[share], [1.0]])


def both_waves(t):
    return np.stack([np.ones_like(t), np.cos(2 * np.pi * t)], axis=1)[:, None]


def through(D, system=LAG, C=ONE):
    return fl.PeriodicStateSpace(system, C, D)


CASES = [
    *[(NotStable, "stable", norm, UNSTABLE, ONE) for norm in (fl.h2_norm, fl.hinf_norm)],
    *[(ArgumentError, "C does not fit", norm, LAG, [[1.0, 2.0]]) for norm in (fl.h2_norm, fl.hinf_norm)],
    *[(ArgumentError, "no input", norm, DEAF, ONE) for norm in (fl.h2_norm, fl.hinf_norm, fl.invariant_zeros)],
    (ArgumentError, "D does not fit", fl.hinf_norm, LAG, ONE, [[1.0, 2.0]]),
    (NotStable, "stable", fl.frequency_response, UNSTABLE, ONE, [1.0]),
    (ArgumentError, "no input", fl.frequency_response, DEAF, ONE, [1.0]),
    (ArgumentError, "C does not fit", fl.frequency_response, LAG, [[1.0, 0.0]], [1.0]),
    (ArgumentError, "does not increase", fl.respond, LAG, [1.0, 0.5]),
    (ArgumentError, "no input", partial(fl.respond, u=[1.0]), DEAF, [0.0, 1.0]),
    (NotStable, "stable", fl.margins, UNSTABLE, [[0.0]]),
    (ArgumentError, "fit", fl.margins, PLANT, ONE),
    (ArgumentError, "no input", fl.margins, DEAF, ONE),
    (ArgumentError, "outputs as inputs", fl.invariant_zeros, PLANT, EYE),
    (NumericalError, "does not reach", fl.invariant_zeros, HIDDEN, [[0.0, 1.0]]),
    (NumericalError, "same derivatives", fl.invariant_zeros, PLANT, both_waves),
    (ArgumentError, "shape", fl.forced_response, PLANT, lambda t: np.zeros((len(t), 3))),
    (ArgumentError, "finite", fl.forced_response, PLANT, [np.nan, 0.0]),
    (TooManySegments, "segments", partial(fl.forced_response, max_segments=10), PLANT, lambda t: both_waves(t)[:, 0]),
    (ArgumentError, "two periods", add, through(ONE), through(ONE, fl.PeriodicSystem([[-1.0]], 2.0, B=ONE))),
    (ArgumentError, "inputs and outputs", mul, through(ONE), through(np.ones((2, 1)), C=np.ones((2, 1)))),
    (ArgumentError, "no solution", through(ONE).feedback, through(-ONE)),
    (ArgumentError, "does not fit the system", through, None, LAG, np.ones((1, 2))),
    *[(ArgumentError, "delay", sampled_floquet, LAG, ONE, 0.1, late) for late in (0.2, -0.01)],
    (ArgumentError, "sample_time", sampled_floquet, LAG, ONE, 0.0),
    (ArgumentError, "does not fit", sampled_floquet, LAG, [[1.0, 2.0]], 0.1),
    (NumericalError, "leaves the range", partial(sampled_floquet, rates=[[1.0, 1000.0]]), LAG, [[1.0, 1.0]], 1.0),
    (ArgumentError, "begin anew together", fl.sampled_lqr, PLANT, EYE, ONE, 0.1234567),
    (ArgumentError, "delay", fl.sampled_lqr, PLANT, EYE, ONE, 0.1, 0.11),
    ((NotStabilizable, NotDetectable), "sample", fl.sampled_lqr, OSCILLATOR, EYE, ONE, TURN),  # sampled once a turn
    (NotDetectable, "seen", fl.sampled_estimator, OSCILLATOR, [[1.0, 0.0]], EYE, ONE, TURN),
    (NotDetectable, "seen", fl.sampled_lqr, UNSEEN, np.diag([0.0, 1.0]), ONE, 0.1),
    (NotStabilizable, "reached", fl.sampled_lqr, UNREACHED, EYE, ONE, 0.1),
    *[(NotStabilizable, f"{TOO_WEAKLY}{b:.0e}", fl.periodic_lqr, reached(b), EYE, ONE) for b in (1e-9, 1e-11)],
    (NotStabilizable, "cannot be reached by the input.*add an actuator", fl.periodic_lqr, MIXED, EYE, ONE),
    (NotDetectable, "is not seen by the weight", fl.periodic_lqr, SEEN, np.diag([0.0, 1.0]), ONE),
    (NotDetectable, "the weight Q too weakly", fl.periodic_lqr, SEEN, [[1e-18, 1e-9], [1e-9, 1.0]], ONE),
    (ArgumentError, "R is not positive definite", periodic_riccati, PLANT, EYE, -ONE),
    (ArgumentError, "Q is indefinite", periodic_riccati, PLANT, np.diag([1.0, -1e-3]), ONE),
    (ArgumentError, r"Q - N R\^-1 N' is indefinite", periodic_riccati, PLANT, EYE, ONE, [[2.0], [0.0]]),
    (ArgumentError, "Q does not fit", periodic_riccati, PLANT, np.eye(3), ONE),
    (ArgumentError, "Q is not symmetric", periodic_riccati, PLANT, [[1.0, 1.0], [0.0, 1.0]], ONE),
]


@pytest.mark.parametrize(("error", "words", "function", "given"), [(*case[:3], case[3:]) for case in CASES])
def test_what_has_no_answer_is_refused(error, words, function, given):
    with pytest.raises(error, match=words):
        function(*given)
