"""Questions of the numeric wing that have no answer are refused by a typed error that says why."""

from functools import partial
from operator import add, mul

import numpy as np
import pytest

import flexlin as fl
from flexlin import errors
from flexlin.control import sampled_floquet
from flexlin.errors import ArgumentError, NumericalError
from flexlin.periodic import build_companion, complex_schur, find_spectrum, finite_horizon_riccati, periodic_riccati
from flexlin.periodic.riccati.scattering import scatter_hamiltonian
from tests.periodic.systems import mathieu_second_order, turned

ONE, EYE, TURN = np.eye(1), np.eye(2), 2 * np.pi
UNSTABLE, LAG = (fl.PeriodicSystem([[rate]], 1.0, B=ONE) for rate in (0.1, -1.0))
DEAF = fl.PeriodicSystem([[-1.0]], 1.0)
PLANT = fl.PeriodicSystem([[0.0, 1.0], [-1.0, -1.0]], 1.0, B=[[0.0], [1.0]])
OSCILLATOR = fl.PeriodicSystem([[0.0, 1.0], [-1.0, 0.0]], TURN, B=[[0.0], [1.0]])
UNREACHED, UNSEEN = (fl.PeriodicSystem(np.diag([0.5, -1.0]), 1.0, B=[[b], [1.0]]) for b in (0.0, 1.0))
HIDDEN = fl.PeriodicSystem(np.diag([-1.0, -2.0]), 1.0, B=[[1.0], [0.0]])
APART, SEEN = np.array([[0.5, 0.0], [0.3, -1000.0]]), fl.PeriodicSystem(np.diag([0.5, -1000.0]), 1.0, np.ones((2, 1)))
FAR_FROM_NORMAL = turned([[-1.0, 1e12], [0.0, -1.0]], np.eye(2)[:, 1:], np.eye(2)[1:], 5.0)
TOUCHING = fl.PeriodicStateSpace(LAG, ONE, lambda t: np.sin(TURN * t)[:, None, None] - 2)
FAST = [fl.PeriodicSystem(lambda t, a=a: a * (np.cos(TURN * t) - 0.5)[:, None, None], 1.0, ONE) for a in (500, 4e3)]
MIX = np.linalg.qr(np.random.default_rng(0).normal(size=(2, 2)))[0]
MIXED = fl.PeriodicSystem(MIX @ APART @ MIX.T, 1.0, MIX[:, 1:])
TOO_WEAKLY = "^(?!.*actuator).*too weakly to be computed with.*its share is .e-0[56] in balanced units"
"""A mode that is reached needs no actuator."""


def reached(share):
    return fl.PeriodicSystem(APART, 1.0, [[share], [1.0]])


MATHIEU = mathieu_second_order(1, 0.2)
FLAT, FAR = np.stack([EYE, 0 * EYE]), fl.PeriodicSystem([[0.0, 1e-12], [-1e12, 0.2]], 1.0, B=[[0.0], [1e12]])
COUNTS = ("segments", "order", "max_segments")
finite = partial(finite_horizon_riccati, end=[[0.0]])


def ask(**options):
    return fl.floquet(MATHIEU, **options)


def narrow(t):
    """A weight that loses its sign between the first samples: what was said then was that the accuracy is not reached."""
    return (1 - 2 * np.exp(-(((t - 0.3047) / 1e-3) ** 2)))[:, None, None]


def both_waves(t):
    return np.stack([np.ones_like(t), np.cos(2 * np.pi * t)], axis=1)[:, None]


def swinging_force(t):
    return both_waves(t)[:, 0]


def through(D, system=LAG, C=ONE):
    return fl.PeriodicStateSpace(system, C, D)


CASES = [
    *[(errors.NotStable, "stable", norm, UNSTABLE, ONE) for norm in (fl.h2_norm, fl.hinf_norm)],
    (errors.NotStable, "none that is known", fl.h2_norm, *FAR_FROM_NORMAL),
    *[(errors.ToleranceNotReached, "hides the norm|than numbers hold", fl.hinf_norm, one, ONE) for one in FAST],
    (errors.ToleranceNotReached, "not solved to the asked accuracy", fl.h2_norm, FAST[1], ONE),
    *[(ArgumentError, "C does not fit", norm, LAG, [[1.0, 2.0]]) for norm in (fl.h2_norm, fl.hinf_norm)],
    *[(ArgumentError, "no input", norm, DEAF, ONE) for norm in (fl.h2_norm, fl.hinf_norm, fl.invariant_zeros)],
    (ArgumentError, "D does not fit", fl.hinf_norm, LAG, ONE, [[1.0, 2.0]]),
    (errors.NotStable, "stable", fl.frequency_response, UNSTABLE, ONE, [1.0]),
    (ArgumentError, "no input", fl.frequency_response, DEAF, ONE, [1.0]),
    (ArgumentError, "C does not fit", fl.frequency_response, LAG, [[1.0, 0.0]], [1.0]),
    (ArgumentError, "does not increase", fl.respond, LAG, [1.0, 0.5]),
    (ArgumentError, "no input", partial(fl.respond, u=[1.0]), DEAF, [0.0, 1.0]),
    (errors.NotStable, "stable", fl.margins, UNSTABLE, [[0.0]]),
    (ArgumentError, "fit", fl.margins, PLANT, ONE),
    (ArgumentError, "no input", fl.margins, DEAF, ONE),
    (ArgumentError, "outputs as inputs", fl.invariant_zeros, PLANT, EYE),
    (NumericalError, "does not reach", fl.invariant_zeros, HIDDEN, [[0.0, 1.0]]),
    (NumericalError, "same derivatives", fl.invariant_zeros, PLANT, both_waves),
    (ArgumentError, "shape", fl.forced_response, PLANT, lambda t: np.zeros((len(t), 3))),
    (ArgumentError, "finite", fl.forced_response, PLANT, [np.nan, 0.0]),
    (errors.TooManySegments, "segments", partial(fl.forced_response, max_segments=9), PLANT, swinging_force),
    (ArgumentError, "two periods", add, through(ONE), through(ONE, fl.PeriodicSystem([[-1.0]], 2.0, B=ONE))),
    (ArgumentError, "inputs and outputs", mul, through(ONE), through(np.ones((2, 1)), C=np.ones((2, 1)))),
    (ArgumentError, "no solution", through(ONE).feedback, through(-ONE)),
    (ArgumentError, "no solution.*some time", fl.floquet, through(ONE).feedback(TOUCHING).system),
    (ArgumentError, "does not fit the system", through, None, LAG, np.ones((1, 2))),
    *[(ArgumentError, "delay", sampled_floquet, LAG, ONE, 0.1, late) for late in (0.2, -0.01)],
    (ArgumentError, "sample_time", sampled_floquet, LAG, ONE, 0.0),
    (ArgumentError, "does not fit", sampled_floquet, LAG, [[1.0, 2.0]], 0.1),
    (NumericalError, "leaves the range", partial(sampled_floquet, rates=[[1.0, 1000.0]]), LAG, [[1.0, 1.0]], 1.0),
    (ArgumentError, "begin anew together", fl.sampled_lqr, PLANT, EYE, ONE, 0.1234567),
    (ArgumentError, "delay", fl.sampled_lqr, PLANT, EYE, ONE, 0.1, 0.11),
    ((errors.NotStabilizable, errors.NotDetectable), "sample", fl.sampled_lqr, OSCILLATOR, EYE, ONE, TURN),
    (errors.NotDetectable, "seen", fl.sampled_estimator, OSCILLATOR, [[1.0, 0.0]], EYE, ONE, TURN),
    (errors.NotDetectable, "seen", fl.sampled_lqr, UNSEEN, np.diag([0.0, 1.0]), ONE, 0.1),
    (errors.NotStabilizable, "reached", fl.sampled_lqr, UNREACHED, EYE, ONE, 0.1),
    *[(errors.NotStabilizable, TOO_WEAKLY, fl.periodic_lqr, reached(b), EYE, ONE) for b in (1e-9, 1e-11)],
    (NumericalError, "far apart", fl.periodic_lqr, FAR, EYE, ONE),
    (errors.NotStabilizable, "cannot be reached by the input.*add an actuator", fl.periodic_lqr, MIXED, EYE, ONE),
    (errors.NotDetectable, "is not seen by the weight", fl.periodic_lqr, SEEN, np.diag([0.0, 1.0]), ONE),
    (errors.NotDetectable, "the weight Q too weakly", fl.periodic_lqr, SEEN, [[1e-18, 1e-9], [1e-9, 1.0]], ONE),
    *[(ArgumentError, "Q is .*definite", solve, LAG, narrow, ONE) for solve in (periodic_riccati, finite)],
    *[(ArgumentError, "R is .*definite", solve, LAG, ONE, narrow) for solve in (periodic_riccati, finite)],
    (errors.IllPosedSegment, "P22 of segment 1 of 2", scatter_hamiltonian, FLAT),
    (errors.SingularMassMatrix, r"t = 0\.75 s", build_companion, (FLAT, FLAT, FLAT), np.array([0.5, 0.75])),
    *[(NumericalError, "range of numbers", find_spectrum, np.stack([EYE, EYE + one])) for one in (np.nan, np.inf)],
    (ValueError, "infs or NaNs", complex_schur, np.full((2, 2), np.nan)),
    (errors.TooManySegments, "segments of the period", partial(ask, tol=1e-12, max_segments=2)),
    (errors.TooManySegments, "more segments were asked for", partial(ask, segments=10**9)),
    (ArgumentError, "method", partial(ask, method="euler")),
    (ArgumentError, "no such order", partial(ask, order=3)),
    (errors.TooLarge, "bytes", partial(ask, method="hill", order=10**6)),
    *[(ArgumentError, name, partial(ask, **{name: no})) for name in COUNTS for no in (-5, 0, 2.5, True, "8", np.nan)],
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
