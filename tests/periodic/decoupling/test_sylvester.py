"""The equations that take the coupling between groups out, for groups of all sizes."""

from itertools import pairwise, permutations

import numpy as np
import pytest

from flexlin.periodic import Group, sylvester


def random_values(rng, count, n):
    return rng.standard_normal((count, n, n)) + 1j * rng.standard_normal((count, n, n))


APART = (1, 1, 2), (2, 3, 1), (2, 2, 4), (6, 5), (4, 6, 1)
MET = (3, 1, 1), (6, 1, 1), (21, 1, 1)


@pytest.mark.parametrize(
    ("sizes", "exchanged"), [*((sizes, False) for sizes in APART), *((sizes, True) for sizes in MET)]
)
def test_every_block_solves_its_equation(sizes, exchanged):
    """exchanged: a group's first entry is a mode's of the next one: elimination in the given order would divide by zero."""
    rng, edges = np.random.default_rng(5), np.concatenate([[0], np.cumsum(sizes)])
    groups = tuple(Group(int(a), int(b), i) for i, (a, b) in enumerate(pairwise(edges)))
    B, first = random_values(rng, 9, edges[-1]), edges[1]
    if exchanged:
        B[:, 0, 0] = B[:, first, first]
    else:
        B += np.diag(np.repeat(20j * np.arange(len(sizes)), sizes))
    S = sylvester(B, groups)
    for g in groups:
        assert not S[:, g.part, g.part].any()
    for g, h in permutations(groups, 2):
        across = B[:, g.part, g.part] @ S[:, g.part, h.part] - S[:, g.part, h.part] @ B[:, h.part, h.part]
        allowed = 1e-9 * np.abs(S).max() if exchanged else 1e-13 * np.abs(B).max()
        assert np.abs(across + B[:, g.part, h.part]).max() < allowed
