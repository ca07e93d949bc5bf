"""How a batch of values is computed."""

from dataclasses import dataclass

import numpy as np

SLACK = 1.1
"""The spread of the moduli may exceed the pilot's by this factor."""
HARMONICS = (6, 8, 10, 12, 16, 24, 32, 48, 64)
"""Harmonics of the period with which the coefficients may be represented."""


@dataclass(frozen=True)
class Plan:
    """How a batch is computed: segments of the coarsest resolution, harmonics tried first, expected spread of the moduli."""

    segments: int
    harmonics: int = HARMONICS[0]
    spread: float = np.inf
