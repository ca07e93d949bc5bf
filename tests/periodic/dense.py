"""Dense integration by SciPy's DOP853 from stop to stop: nothing of flexlin is part of it."""

from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp


def integrate(rate, start, stops, rtol=1e-12, atol=1e-13):
    """States (N, ...) at increasing or decreasing stops, from `start` at the first one; rate(t, x) has the shape of x.

    It is asked strictly between the stops: what jumps there is met from the side that is integrated.
    """
    x = np.multiply(start, 1.0)
    found = [x]
    for a, b in pairwise(stops):
        low, high = sorted((float(np.nextafter(a, b)), float(np.nextafter(b, a))))

        def flat(t, y, low=low, high=high, shape=x.shape):
            return np.ravel(rate(min(max(t, low), high), y.reshape(shape)))

        run = solve_ivp(flat, (a, b), x.ravel(), "DOP853", rtol=rtol, atol=atol)
        assert run.success
        x = run.y[:, -1].reshape(x.shape)
        found.append(x)
    return np.array(found)


def transition(A, start, stops, **tolerances):
    """X at the last stop by X' = A(t) X from `start` at the first one: for the identity the transition matrix; A is of one time."""
    return integrate(lambda t, X: A(t) @ X, start, stops, **tolerances)[-1]


def at(function, t):
    """The value at one time of a function of many."""
    return function(np.array([t]))[0]
