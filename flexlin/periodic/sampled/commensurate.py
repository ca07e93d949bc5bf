"""A sampling time beside a period: after how many samples and periods both begin anew, exactly or nearly."""

from dataclasses import dataclass

from flexlin.periodic.precision import EPS

MOST = 1024
"""Samples of a round, unless a single period takes more."""
EXACT = MOST * EPS
"""Relative distance at which a sampling time counts as a whole part of whole periods."""


@dataclass(frozen=True)
class Round:
    """`samples` N of the sampling time fill `periods` q periods, N h = q T, up to the relative distance `off` of q T / N from h."""

    samples: int
    periods: int
    off: float


def find_rounds(period: float, sample_time: float) -> tuple[Round, ...]:
    """One exact round, or the nearest below and above with at most MOST samples, the nearer one first.

    Source: the Stern-Brocot tree, Graham, Knuth, Patashnik, Concrete Mathematics (1994), section 4.5.
    """
    ratio = sample_time / period
    most = max(MOST, int(2 / ratio) + 1)
    below, above = (int(ratio), 1), (int(ratio) + 1, 1)
    while True:
        for periods, samples in (below, above):
            if abs(periods / (ratio * samples) - 1) <= EXACT:
                return (Round(samples, periods, 0.0),)
        middle = below[0] + above[0], below[1] + above[1]
        if middle[1] > most:
            break
        below, above = (middle, above) if middle[0] <= ratio * middle[1] else (below, middle)
    rounds = [Round(samples, periods, abs(periods / (ratio * samples) - 1)) for periods, samples in (below, above)]
    return tuple(sorted((turn for turn in rounds if turn.periods > 0), key=lambda turn: turn.off))
