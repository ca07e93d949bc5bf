"""The equations that take the coupling between groups out, for groups of all sizes."""

import itertools

import numpy as np

from flexlin.periodic import Group, sylvester


def test_every_block_solves_its_equation():
    rng = np.random.default_rng(5)
    for sizes in ((1, 1, 2), (2, 3, 1), (2, 2, 4), (6, 5), (4, 6, 1)):
        edges = np.concatenate([[0], np.cumsum(sizes)])
        groups = tuple(Group(int(a), int(b), i) for i, (a, b) in enumerate(itertools.pairwise(edges)))
        n = int(edges[-1])
        apart = np.repeat(20j * np.arange(len(sizes)), sizes)
        B = rng.standard_normal((7, n, n)) + 1j * rng.standard_normal((7, n, n)) + np.diag(apart)
        S = sylvester(B, groups)
        for one in groups:
            for other in groups:
                own, across = B[:, one.part, one.part], S[:, one.part, other.part]
                if one is other:
                    assert np.abs(across).max() == 0
                    continue
                left = own @ across - across @ B[:, other.part, other.part] + B[:, one.part, other.part]
                assert np.abs(left).max() < 1e-13 * np.abs(B).max()


def test_rows_are_exchanged():
    """The group's first entry is the single mode's own: elimination in the given order would divide by zero."""
    rng = np.random.default_rng(8)
    for p, count in ((3, 9), (6, 16), (21, 8)):
        B = rng.standard_normal((count, p + 2, p + 2)) + 1j * rng.standard_normal((count, p + 2, p + 2))
        B[:, 0, 0] = B[:, p, p]
        B[1:, 1, 1] = B[1:, p + 1, p + 1]
        groups = (Group(0, p, 0), Group(p, p + 1, 1), Group(p + 1, p + 2, 2))
        S = sylvester(B, groups)
        for g, h in itertools.permutations(groups, 2):
            left, right = B[:, g.part, g.part] @ S[:, g.part, h.part], S[:, g.part, h.part] @ B[:, h.part, h.part]
            assert np.abs(left - right + B[:, g.part, h.part]).max() < 1e-9 * np.abs(S).max()
