"""What all stages of one piece of work may take together, and what of it the next one gets."""

import time
from dataclasses import dataclass, field
from math import inf

from flexlin.answers.limits import Allowance
from flexlin.errors import TimeLimit
from flexlin.resources import SECONDS, read_resident
from flexlin.scene.accuracy import Accuracy

SHARE = 2 / 3
"""A stage that others follow gets so much of what is left: one that never ends leaves them something."""


@dataclass
class Budget:
    """Time and memory of one piece of work; `begun`: its begin by `time.perf_counter`, `held`: bytes in use before its first stage."""

    begun: float = field(default_factory=time.perf_counter)
    held: int | None = None

    def allow(
        self, name: str, asked: Accuracy, share: float = 1.0, at_most: float = inf, by_tol: bool = False, last: bool = False
    ) -> Allowance:  # fmt: skip
        """What a stage gets: a share of what is left, at most some s (more of a long whole); the last one takes what was kept too.

        Raises: TimeLimit where no time is left.
        """
        if self.held is None:
            self.held = read_resident()
        left = self.begun + (asked.last_end if last else asked.stages_end) - time.perf_counter()
        most, memory = at_most * max(1.0, asked.seconds / SECONDS), asked.memory + self.held - read_resident()
        above = max(asked.seconds, SECONDS) if most < share * left else asked.seconds
        allowed = Allowance(min(share * left, most), max(memory, 1.0), asked.seconds, asked.memory, above, by_tol)
        if left <= 0:
            kept = "" if last else "; the rest is for drawing and writing"
            used = f"{asked.last_end if last else asked.stages_end:g} of {asked.seconds:g} s are used up{kept}"
            raise TimeLimit(f"{name}: not begun", got=used, todo=allowed.more_time)
        return allowed
