"""What a part of the torture found, and the command lines that it runs."""

from dataclasses import dataclass, field
from pathlib import Path

from tests.torture.trial import Trial

KEYS = (
    "links",
    "motion",
    "effects",
    "control",
    "designs",
    "accuracy",
    "parameters",
    "model",
    "schema",
    "title",
    "source",
    "file",
    "scene",
)
"""One of these stands in every message that names a key."""
QUICK = "spinning-link"
"""The scene of the runs that are killed: what it says matters less than when."""
COMMANDS = {
    "report": ["report"],
    "chart": ["chart", "--over", "motion.frequency=0.2:3:20"],
    "design": ["design", "--points", "16"],
    "simulate": ["simulate", "--periods", "1"],
    "export": ["export", "--points", "16"],
}
SMALL = ["links.0.modes=1", "effects.geometric_stiffening=off", "designs=[]"]
LATER = {
    "linearize": ["linearize", QUICK, "--points", "16"],
    "respond": ["respond", "single-link", "--push", "tip 1 N 20 ms", "--set", *SMALL],
    "tune": ["tune", "single-link", "--gain", "control.feedback.kp.0=2:4", "--set", *SMALL],
}
"""More commands that write a set, on small scenes; --set comes last."""
SETS = {"report": "report", "chart": "chart", "design": "gains", "simulate": "simulation", "export": "export"}
ALL_SETS = {**SETS, "linearize": "coefficients", "respond": "respond", "tune": "tune"}
"""The sets that commands write."""


@dataclass
class Row:
    """What a part found; times in s, memory in bytes; `wrong` holds a line for each thing that should not be."""

    part: str
    runs: int = 0
    answered: int = 0
    uncaught: int = 0
    keyless: int = 0
    mixed: int = 0
    left: int = 0
    slowest: float = 0.0
    largest: int = 0
    wrong: list[str] = field(default_factory=list)

    def count(self, trial: Trial, case: str) -> None:
        """Enter a run."""
        self.runs += 1
        self.answered += trial.code == 0
        self.slowest, self.largest = max(self.slowest, trial.seconds), max(self.largest, trial.memory)
        if trial.uncaught:
            self.uncaught += 1
            self.wrong.append(f"uncaught: {case}: {trial.code}: {trial.said[-300:]}")
        if trial.seconds > 60 or trial.memory > 2**30:
            self.wrong.append(f"costly: {case}: {trial.seconds:.1f} s, {trial.memory / 2**20:.0f} MiB")

    def line(self) -> str:
        """The row of the table."""
        cells = f"{self.runs:>6} {self.answered:>8} {self.uncaught:>8} {self.keyless:>7} {self.mixed:>5} {self.left:>4}"
        return f"{self.part:<9} {cells} {self.slowest:>8.1f} {self.largest / 2**20:>8.0f}"


def names_a_key(trial: Trial) -> bool:
    """Whether a refusal of the scene says which key it is about."""
    return any(key in trial.said for key in KEYS)


def case_of(command: str, change: str, folder: Path) -> list[str]:
    """The command line of a quick run."""
    if command in LATER:
        words = LATER[command]
        return [*words, *([] if "--set" in words else ["--set"]), change, "--out", str(folder)]
    scene = {"design": "khang-2019", "export": "khang-2019"}.get(command, QUICK)
    first, *rest = COMMANDS[command]
    if command == "chart":
        rest = ["--over", "motion.joints.0.rate=3:4:4"]
    small = ["designs=[]"] if command == "report" else []
    return [first, scene, *rest, "--set", change, *small, "--out", str(folder)]
