"""Transition matrices of second-order systems by NumPy alone, which compiled code is held against."""

import numpy as np

from flexlin.periodic.transition.gauss import collocate_accelerations, fold_samples, gauss, place_nodes


def second_order_transitions(second, edges, stages):
    """Of M y'' + D y' + K y = 0 for x = [y; y'], (K, 2n, 2n); second: times (N,) -> M, D, K."""
    t = place_nodes(edges, gauss(stages).c)
    return collocate_accelerations(
        *(fold_samples(part, t) for part in second(t.ravel())), np.diff(edges), gauss(stages)
    )
