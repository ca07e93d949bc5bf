"""How long each step took, and what is called when one begins."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Step:
    """One step of the work and its wall time, in s."""

    name: str
    seconds: float


@dataclass
class Clock:
    """Collects the steps; `progress` is called with the name of each step as it begins."""

    progress: Progress | None = None
    steps: list[Step] = field(default_factory=list)

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Time the block."""
        if self.progress is not None:
            self.progress(name)
        start = time.perf_counter()
        yield
        self.steps.append(Step(name, time.perf_counter() - start))
