"""Periodic systems: they refuse what is no coefficient, know their sizes, and come back from a pickle with the same numbers."""

import pickle

import numpy as np
import pytest

import flexlin as fl
from flexlin import PeriodicSystem
from flexlin.errors import ArgumentError
from flexlin.periodic import periodic_riccati, place_edges

M, D, K = np.array([[2.0, 0.3], [0.3, 1.0]]), 0.1 * np.eye(2), np.diag([5.0, 9.0])
B = np.array([[1.0], [0.5]])
T = np.linspace(-1.0, 3.0, 17)


def swing(t):
    """A coefficient that pickles by its name."""
    return np.array([[0.0, 1.0], [-1.0, -0.1]]) + 0.2 * np.cos(2 * np.pi * t)[:, None, None] * np.eye(2)


def plant():
    return PeriodicSystem.from_second_order(M, D, K, 1.3, B=B)


def test_systems_come_back_from_a_pickle():
    for system in (plant(), plant().feedback(np.array([[1.0, 2.0, 0.1, 0.2]])), PeriodicSystem(swing, 1.0, B)):
        copy = pickle.loads(pickle.dumps(system))
        np.testing.assert_array_equal(copy.A(T), system.A(T))
        np.testing.assert_array_equal(copy.B(T), system.B(T))
        assert (copy.n, copy.m, copy.period, copy.breaks) == (system.n, system.m, system.period, system.breaks)
        if system.second_order is not None:
            np.testing.assert_array_equal(copy.second_order.sample(T), system.second_order.sample(T))
        np.testing.assert_array_equal(fl.floquet(copy).exponents, fl.floquet(system).exponents)


def test_one_time_gives_one_value():
    system = plant()
    solution = periodic_riccati(system, np.eye(4), np.eye(1))
    response = fl.forced_response(system, [0.0, 0.0, 1.0, 0.0])
    for function, shape in ((solution.X, (4, 4)), (solution.K, (1, 4)), (response, (4,))):
        assert function(0.4).shape == shape
        np.testing.assert_array_equal(function(0.4), function(np.array([0.4]))[0])
        assert function([0.1, 0.4]).shape == (2, *shape)
        for no_time in (np.nan, [[0.1]]):
            with pytest.raises(ArgumentError):
                function(no_time)


@pytest.mark.parametrize(
    ("A", "message"),
    [
        (np.zeros((0, 0)), "empty"),
        (lambda t: swing(t).tolist(), "no array"),
        (lambda t: [[0.0, 1.0], [-1.0, 0.0]], "single time"),
        (lambda t: np.array([[np.sin(t), np.cos(t)], [np.cos(t), np.sin(t)]]), "single time"),
        (lambda t: swing(t)[0] if len(t) == 1 else swing(t), "shape"),
        (lambda t: swing(t)[0], "shape"),
        (lambda t: np.where(t[:, None, None] > 0.2, np.nan, swing(t)), "t = 0.618034 s"),
        (np.array([[np.inf]]), "finite"),
        (lambda t: 1j * swing(t), "complex"),
        (lambda t: swing(t).astype(np.float16), "precision"),
        (lambda t: np.full((len(t), 1, 1), "a"), "numeric"),
    ],
)
def test_what_is_no_coefficient_is_refused(A, message):
    with pytest.raises(ArgumentError, match=message):
        PeriodicSystem(A, 1.0)


@pytest.mark.parametrize("method", ["auto", "gauss", "radau", "hill"])
def test_a_hole_between_the_first_samples_is_found_with_its_time(method):
    def A(t):
        values = swing(t)
        values[(t > 0.7) & (t < 0.9)] = np.nan
        return values

    with pytest.raises(ArgumentError, match=r"t = 0\.[78]\d* s"):
        fl.floquet(PeriodicSystem(A, 1.0), method=method)


def test_breaks_one_rounding_apart_leave_no_segment_without_length():
    grid = place_edges(1.0, (0.3, np.nextafter(0.3, 1.0)), 4, least=3)
    assert np.all(np.diff(grid) > 0)
    assert {0.3, np.nextafter(0.3, 1.0)} <= set(grid)
