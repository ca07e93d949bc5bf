"""Transition matrices of a group of modes against Gauss collocation, what their series leaves out, and equations between groups."""

from itertools import permutations

import numpy as np
import pytest

from flexlin.periodic.decoupling import group_factors
from flexlin.periodic.decoupling.group_factors import fit_group
from flexlin.periodic.decoupling.grouping import Group
from flexlin.periodic.decoupling.superadiabatic import sylvester
from flexlin.periodic.transition.gauss import gauss_transitions

PERIOD = 1.7


def random_group(seed, m, count=64):
    """Values of a random non-normal generator with seven harmonics at the nodes."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-1, 1.5, (m, m))
    phase = 2 * np.pi * np.arange(count)[:, None, None] / count
    return sum(size / (1 + k**2) * np.cos(k * phase + rng.uniform(0, 6, (m, m))) for k in range(8))


@pytest.mark.parametrize("m", [1, 2, 4, 7])
def test_factors_agree_with_collocation_and_converge_with_order_six(m):
    series = fit_group(random_group(m, m), PERIOD, np.full((m, m), 1e-12))
    assert len(series.coefficients) == 8
    best = gauss_transitions(series.sample, np.linspace(0, PERIOD, 41), 12)
    off = []
    for parts in (4, 8):
        made = series.factor(40, parts)
        off.append(np.abs(made - best).max())
    assert m == 1 or 4.5 < np.log2(off[0] / off[1]) < 7.5
    assert off[1] < 1e-6 * np.abs(best).max()


def test_harmonics_are_left_out_only_within_what_is_not_known():
    values = random_group(5, 3)
    for unknown in (1e-12, 0.1, 3.0, 1e3):
        series = fit_group(values, PERIOD, np.full((3, 3), unknown))
        off = np.abs(series.sample(PERIOD * np.arange(64) / 64) - values).max(axis=0)
        assert (off <= np.maximum(series.unknown - unknown, 1e-12)).all()
        assert (series.unknown <= (1 + group_factors.HIDDEN) * unknown).all()
    assert len(series.coefficients) == 1


def test_sylvester_equations_exchange_rows():
    """The group's first entry is the single mode's own: elimination in the given order would divide by zero."""
    rng = np.random.default_rng(8)
    for p, count in ((3, 9), (6, 16), (21, 8)):
        B = rng.standard_normal((count, p + 2, p + 2)) + 1j * rng.standard_normal((count, p + 2, p + 2))
        B[:, 0, 0] = B[:, p, p]
        B[1:, 1, 1] = B[1:, p + 1, p + 1]
        groups = (Group(0, p, 0), Group(p, p + 1, 1), Group(p + 1, p + 2, 2))
        S = sylvester(B, groups)
        for one, other in permutations(groups, 2):
            i, j = one.part, other.part
            left = B[:, i, i] @ S[:, i, j] - S[:, i, j] @ B[:, j, j] + B[:, i, j]
            assert np.abs(left).max() < 1e-12 * np.abs(S).max() * np.abs(B).max()
            assert not S[:, i, i].any()
