"""What is no periodic matrix function, or cannot be followed, is refused; what is written for one period is taken."""

import numpy as np
import pytest

from flexlin.errors import ArgumentError, NotPeriodic, UnresolvedCoefficient
from flexlin.periodic import resolve
from tests.periodic.coefficient_series.functions import scalar


@pytest.mark.parametrize(
    ("f", "period"),
    [
        (lambda t: np.cos(2 * t), 2.0),
        (np.sin, np.pi),
        (lambda t: np.cos(2 * t), 3.14159),
        (lambda t: np.abs(np.sin(t)), 4.0),
        (lambda t: np.sign(np.sin(t)), np.pi),
        (lambda t: np.exp(-(((np.mod(t, 2) - 0.3) / 2e-4) ** 2)), 1.0),
        (lambda t: np.exp(30 * np.cos(t - 1.5) - 30), 3.0),
    ],
)
def test_another_period_is_refused(f, period):
    with pytest.raises(NotPeriodic, match="does not repeat"):
        resolve(scalar(f), period)
    with pytest.raises(NotPeriodic, match="of its size"):
        resolve(scalar(f), period, breaks=(0.7,))


def raising(t):
    if np.any(t > 1):
        raise ValueError("beyond the table")
    return np.cos(2 * np.pi * t)


@pytest.mark.parametrize(
    ("f", "period"),
    [
        (lambda t: np.where(t < 1.0002, 1.0, 9.0), 2.0),
        (lambda t: np.interp(t, [0, 0.3, 0.7, 1], [1, 2, 0, 1]), 1.0),
        (lambda t: np.exp(-(((t - 0.3) / 2e-4) ** 2)), 1.0),
        (lambda t: np.where(t <= 1, np.cos(2 * np.pi * t), np.nan), 1.0),
        (lambda t: np.cos(2 * t), 3.14159265),
        (raising, 1.0),
    ],
)
def test_functions_written_for_one_period_are_taken(f, period):
    series, t = resolve(scalar(f), period), np.random.default_rng(8).uniform(0, period, 500)
    assert np.all(np.abs(series(t) - scalar(f)(t)) <= series.error)


def test_arguments_are_checked():
    one = scalar(np.ones_like)
    for wrong in ({"breaks": (1.0,)}, {"features": [(0.2, 0.0)]}, {"features": [(-0.2, 0.1)]}):
        with pytest.raises(ArgumentError):
            resolve(one, 1.0, **wrong)
    assert resolve(lambda t: np.broadcast_to(np.array([[0, 1], [-1, 0]]), (len(t), 2, 2)), 1.0).constant


@pytest.mark.parametrize(
    ("f", "place"),
    [
        (lambda t: np.tan(np.pi * (t - 0.3123)), 0.8123),
        (lambda t: np.abs(np.mod(t, 1) - 0.3123) ** -0.25, 0.3123),
        (lambda t: np.sin(1 / (np.mod(t, 1) - 0.3123)), 0.3123),
    ],
)
def test_what_cannot_be_followed_is_refused_with_its_place(f, place):
    with pytest.raises(UnresolvedCoefficient, match="cannot be resolved near t = ") as caught:
        resolve(scalar(f), 1.0)
    assert float(str(caught.value).split("t = ")[1].split(" s")[0]) == pytest.approx(place, abs=1e-2)


@pytest.mark.parametrize("size", [1.0, 1e-12])
def test_a_function_that_is_all_noise_is_refused_before_it_is_cut_to_the_last_bit(size):
    draw, asked = np.random.default_rng(3), []

    def noisy(t):
        asked.append(len(t))
        return size * draw.standard_normal(len(t))

    with pytest.raises(UnresolvedCoefficient, match="not the same when it is called twice"):
        resolve(scalar(noisy), 1.0)
    assert sum(asked) < 200_000


def test_fast_waves_are_not_taken_for_noise():
    with pytest.raises(UnresolvedCoefficient):
        resolve(scalar(lambda t: np.sin(2e6 * np.pi * t)), 1.0)
