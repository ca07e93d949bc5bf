"""Exponents of groups of modes by their Floquet vectors, against groups whose exponents are known in closed form."""

import numpy as np
import pytest

from flexlin.periodic.decoupling.tame import tame_exponents

PERIOD = 0.9


def turned_group(seed, pairs, damped=0, beyond=0.0, count=128):
    """Values of P' P^-1 + P C P^-1 at the nodes, P(t) periodic, and log exp(C T) of the constant C: pairs of modes that decay, some by
    `beyond` faster."""
    rng = np.random.default_rng(seed)
    t, w, n = PERIOD * np.arange(count) / count, 2 * np.pi / PERIOD, 2 * pairs
    rates, turns = rng.uniform(-6, -0.1, pairs), w * rng.uniform(0.1, 9.0, pairs)
    rates[:damped] -= beyond
    C = np.zeros((n, n))
    for k in range(pairs):
        C[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[rates[k], turns[k]], [-turns[k], rates[k]]]
    X, Y = 0.1 * rng.standard_normal((2, n, n))
    P = np.eye(n) + X * np.cos(w * t)[:, None, None] + Y * np.sin(2 * w * t)[:, None, None]
    slope = -w * X * np.sin(w * t)[:, None, None] + 2 * w * Y * np.cos(2 * w * t)[:, None, None]
    values = (slope + P @ C) @ np.linalg.inv(P)
    return values, np.concatenate([rates + 1j * turns, rates - 1j * turns]) * PERIOD


@pytest.mark.parametrize("pairs", [1, 2, 4])
@pytest.mark.parametrize("allowed", [1e-4, 1e-7, 1e-11])
def test_groups_are_followed_as_finely_as_is_asked(pairs, allowed):
    for seed in range(6):
        values, exact = turned_group(seed, pairs)
        logs, errors = tame_exponents(values, PERIOD, np.full(values.shape[1:], 1e-15), allowed)
        assert errors.max() < allowed
        with np.errstate(divide="ignore"):
            apart = np.exp(exact)[:, None] / np.exp(logs) - 1
        nearest = np.abs(apart).argmin(axis=0)
        assert sorted(nearest) == list(range(2 * pairs))
        assert (np.abs(apart).min(axis=0) <= errors).all()
        if allowed == 1e-4:
            assert np.abs(apart).min(axis=0).max() > 1e-11  # no more is done than is asked for


@pytest.mark.parametrize(("damped", "beyond"), [(1, 60.0), (1, 200.0), (2, 120.0)])
def test_modes_in_two_bands_of_growth_are_followed_however_far_these_lie_apart(damped, beyond):
    """Their product holds nothing of the weaker band: exp(-60) and less of the stronger."""
    for seed in range(8):
        values, exact = turned_group(seed, 3, damped, beyond)
        logs, errors = tame_exponents(values, PERIOD, np.full(values.shape[1:], 1e-15), 1e-8)
        apart = np.abs(np.exp(exact[:, None] - logs) - 1)
        assert sorted(apart.argmin(axis=0)) == list(range(6))
        assert (apart.min(axis=0) <= errors).all()
        assert errors.max() < 1e-7


def test_modes_in_three_bands_are_not_served():
    values, _ = turned_group(3, 3, 1, 100.0)
    values = values - np.diag([0, 0, 0, 0, 60.0, 60.0])
    found = tame_exponents(values, PERIOD, np.full((6, 6), 1e-15), 1e-8)
    assert found is None
