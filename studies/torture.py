"""Is anything lost, endless or let in? Mutated scenes, kills, full disks, several writers and little memory, against the command line.

Scenes are drawn by hypothesis from the JSON schema, or are built-in ones with some places changed; each run is a process of its own. A run
is uncaught when an exception or a signal ends it; without a key when it refuses a scene and names none of its keys. After a kill or on
a full disk a reader who knows nothing but docs/results.md looks for sets that are mixed or half, and for leftovers after the next run.

    OMP_NUM_THREADS=1 python studies/torture.py [--size small|full] [--part NAME ...] [--seed 0] [--out DIR]
"""

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # scenes, trials and reader live with the tests

from tests.files.reader import leftovers, standing
from tests.torture.scenes import Raw, from_schema, mutated, to_toml
from tests.torture.trial import Trial, run

SIZES = {
    "small": {"check": 40, "commands": 5, "kills": 4, "disks": 3, "writers": 30, "memory": 2},
    "full": {"check": 10_000, "commands": 500, "kills": 200, "disks": 50, "writers": 1000, "memory": 40},
}
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
SETS = {"report": "report", "chart": "chart", "design": "gains", "simulate": "simulation", "export": "export"}


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


def fuzz(row: Row, scenes: st.SearchStrategy, count: int, number: int, work: Callable[[str, Raw, int], None]) -> Row:
    """Do the work for so many scenes, drawn by hypothesis."""
    turn = iter(range(count))

    @seed(number)
    @settings(
        max_examples=count,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(scenes)
    def each(scene: tuple[str, Raw]) -> None:
        at = next(turn, None)
        if at is not None:
            work(*scene, at)

    each()
    return row


def check(count: int, number: int, out: Path) -> Row:
    """Mutated scenes through `flexlin check`; each refusal must name a key."""
    row = Row("check")

    def work(name: str, raw: Raw, at: int) -> None:
        path = out / "scene.toml"
        path.write_text(to_toml(raw), encoding="utf-8")
        trial = run(["check", str(path)])
        row.count(trial, keep(path, out, f"check-{number}-{at}"))
        if trial.code == 2 and not names_a_key(trial):
            row.keyless += 1
            row.wrong.append(f"without a key: {name}: {trial.said[:300]}")

    return fuzz(row, st.one_of(mutated(), mutated(), from_schema()), count, number, work)


def commands(count: int, number: int, out: Path) -> Row:
    """Scenes with changed numbers through what computes, the commands in turn, with the limits that flexlin sets itself."""
    row = Row("commands")

    def work(name: str, raw: Raw, at: int) -> None:
        path, command = out / "scene.toml", list(COMMANDS)[at % len(COMMANDS)]
        path.write_text(to_toml(raw), encoding="utf-8")
        first, *rest = COMMANDS[command]
        trial = run([first, str(path), *rest, "--out", str(out / "results")])
        row.count(trial, f"{command} {keep(path, out, f'commands-{number}-{at}')}")
        if trial.code == 2 and not names_a_key(trial):
            row.keyless += 1
            row.wrong.append(f"without a key: {command} {name}: {trial.said[:300]}")
        if leftovers(out / "results"):
            row.left += 1

    return fuzz(row, mutated(3, wild=False), count, number, work)


def keep(path: Path, out: Path, name: str) -> str:
    """Keep the scene of a run until the next one, under a name that says which it was."""
    (out / "last-case.toml").write_text(f"# {name}\n" + path.read_text(encoding="utf-8"), encoding="utf-8")
    return f"{name}: {path.read_text(encoding='utf-8')[:4000]!r}"


def kills(count: int, number: int, out: Path) -> Row:
    """SIGKILL and SIGTERM at random times, half of them while files are written; then the next run."""
    row, chance = Row("kills"), random.Random(number)
    for at in range(count):
        command = chance.choice(["report", "chart", "design", "export"])
        folder = out / f"{command}-{at % 7}" / "out"
        folder.parent.mkdir(exist_ok=True)
        if at % 3 == 0 and folder.is_dir():
            (folder / "foreign.txt").write_text("mine")
        words = case_of(command, f"title='{at}'", folder)
        how = chance.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGTERM])
        before = whole_set(folder, command)
        trial = run(words, stop_after=partial(kill_at, folder=folder, chance=chance, how=how))
        row.runs, row.slowest = row.runs + 1, max(row.slowest, trial.seconds)
        judge_rest(row, folder, command, before, f"{command} {at} {how.name}")
        if at % 4 == 3 or at == count - 1:
            row.count(run(case_of(command, "title='next'", folder)), f"after {command} {at}")
            if leftovers(folder) or whole_set(folder, command) is None:
                row.left += 1
                row.wrong.append(f"left after the next run of {command} {at}: {leftovers(folder)}")
    return row


def case_of(command: str, change: str, folder: Path) -> list[str]:
    """The command line of a quick run."""
    scene = {"design": "khang-2019", "export": "khang-2019"}.get(command, QUICK)
    first, *rest = COMMANDS[command]
    if command == "chart":
        rest = ["--over", "motion.joints.0.rate=3:4:4"]
    small = ["designs=[]"] if command == "report" else []
    return [first, scene, *rest, "--set", change, *small, "--out", str(folder)]


def kill_at(child: int, folder: Path, chance: random.Random, how: signal.Signals) -> None:
    """Kill a run after a random time, or a random moment after its files have begun to appear."""
    start, during = time.monotonic(), chance.random() < 0.6
    until = start + (20.0 if during else chance.uniform(0.0, 2.5))
    while time.monotonic() < until and not (during and any(folder.parent.rglob(".*.flexlin-*"))):
        if os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None:
            return
        time.sleep(0.0005)
    if during:
        time.sleep(chance.choice([0.0, chance.uniform(0.0, 0.01), chance.uniform(0.0, 0.2)]))
    os.kill(child, how)


def whole_set(folder: Path, command: str) -> dict[str, bytes] | None:
    """The set of a command, if the manifest vouches for it."""
    return standing(folder, SETS[command])


def judge_rest(row: Row, folder: Path, command: str, before: dict[str, bytes] | None, case: str) -> None:
    """A set that is neither the old one nor a whole new one is mixed, unless its switch is declared and will be finished."""
    found = whole_set(folder, command)
    declared = any(folder.parent.rglob(".*.whole/set/flexlin-results.json"))
    if (found is None and not declared) or (before and found == {}):
        row.mixed += 1
        row.wrong.append(f"mixed or half: {case}")


@contextmanager
def small_disk(size: int, out: Path) -> Iterator[Path]:
    """A disk of so many bytes: a tmpfs where that may be mounted, else nothing."""
    place = Path(tempfile.mkdtemp(dir=out))
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", place], capture_output=True, check=False
    )
    if done.returncode:
        place.rmdir()
        raise PermissionError(done.stderr.decode().strip())
    try:
        yield place
    finally:
        subprocess.run(["umount", place], check=True)
        place.rmdir()


def disks(count: int, number: int, out: Path) -> Row:
    """Full disks of random sizes, with old results on them; then room again."""
    row, chance = Row("disks"), random.Random(number)
    for at in range(count):
        command = chance.choice(list(SETS))
        with small_disk(2**22, out) as disk:
            folder = disk / "out"
            row.count(run(case_of(command, "title='old'", folder)), f"{command} before {at}")
            before = whole_set(folder, command)
            need = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
            free = shutil.disk_usage(disk).free
            ballast = disk / "ballast"
            ballast.write_bytes(b"\0" * (free - 4096 * int(chance.uniform(0, 1.1) * need / 4096)))
            trial = run(case_of(command, "title='new'", folder))
            row.count(trial, f"{command} {at}")
            judge_rest(row, folder, command, before, f"{command} on a full disk")
            if trial.code and ("cannot be written" not in trial.said or leftovers(folder)):
                row.left += 1
                row.wrong.append(f"full disk: {command} {at}: {trial.code} {trial.said[-200:]} {leftovers(folder)}")
            ballast.unlink()
            row.count(run(case_of(command, "title='next'", folder)), f"{command} after {at}")
            row.left += bool(leftovers(folder))
    return row


def writers(count: int, number: int, out: Path) -> Row:
    """Two programs that write C source to one place without end, and a reader who opens the folder and reads its files."""
    row, folder = Row("writers"), out / "shared"
    code = (
        "import sys, numpy as np, flexlin as fl\n"
        "from flexlin.control import gain_source, pd_feedback\n"
        "system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])\n"
        "made = pd_feedback(system, [0], [float(sys.argv[2])], [2.0])\n"
        "while True: gain_source(made, 1.0, sys.argv[1], name='gain', knots=int(sys.argv[3]))\n"
    )
    gain = {"shared": folder, "16": "16", "32": "32"}
    run_one = [sys.executable, "-c", code, str(gain["shared"])]
    both = [subprocess.Popen([*run_one, "4", "16"]), subprocess.Popen([*run_one, "5", "32"])]
    try:
        while row.runs < count and all(process.poll() is None for process in both):
            parts = read_together(folder, ("gain.c", "gain.h", "main.c", "flexlin-results.json"))
            if parts is None:
                time.sleep(0.001)
                continue
            row.runs += 1
            row.answered += 1
            if not agree(parts):
                row.mixed += 1
    finally:
        for process in both:
            process.terminate()
            process.wait()
    row.uncaught = count - row.runs
    with_gain = [sys.executable, "-c", code.replace("while True: ", ""), str(folder), "4", "16"]
    subprocess.run(with_gain, check=True)
    row.left = len(leftovers(folder))
    return row


def read_together(folder: Path, names: tuple[str, ...]) -> dict[str, bytes] | None:
    """Files of one moment: the folder is opened first; None where it is being taken away."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except FileNotFoundError:
        return None
    try:
        files = [os.open(name, os.O_RDONLY, dir_fd=handle) for name in names]
    except FileNotFoundError:
        return None
    finally:
        os.close(handle)
    found = {}
    for name, file in zip(names, files, strict=True):
        with open(file, "rb") as opened:
            found[name] = opened.read()
    return found


def agree(parts: dict[str, bytes]) -> bool:
    """Whether the files have the checksums of the manifest that was read with them."""
    import hashlib

    stated = json.loads(parts["flexlin-results.json"])["sets"]["gain"]["sha256"]
    return all(hashlib.sha256(parts[name]).hexdigest() == digest for name, digest in stated.items())


def memory(count: int, number: int, out: Path) -> Row:
    """Runs in so little address space that something fails: a message, no trace, and nothing half-written."""
    row, chance = Row("memory"), random.Random(number)
    for at in range(count):
        command, space = chance.choice(list(SETS)), int(2 ** chance.uniform(20, 28))
        folder = out / "tight" / command
        before = whole_set(folder, command)
        row.count(run(case_of(command, f"title='{at}'", folder), space=space), f"{command} in {space} bytes")
        judge_rest(row, folder, command, before, f"{command} in {space} bytes")
        row.left += bool(leftovers(folder))
    return row


PARTS = {"check": check, "commands": commands, "kills": kills, "disks": disks, "writers": writers, "memory": memory}


def warm() -> None:
    """Load what the commands need, once, before the first fork."""
    from flexlin.cli.main import main as command

    with tempfile.TemporaryDirectory() as folder, open(os.devnull, "w") as nowhere:
        kept = sys.stdout, sys.stderr
        sys.stdout = sys.stderr = nowhere
        try:
            for name in SETS:
                command(case_of(name, "title='warm'", Path(folder)))
        finally:
            sys.stdout, sys.stderr = kept


def draw(rows: list[Row], path: Path) -> None:
    """Runs of each part, and what went wrong."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 3))
    axes = figure.add_subplot(title="Runs, and what should not be among them", xlabel="number, logarithmic above 1")
    names = [row.part for row in rows]
    bad = [row.uncaught + row.keyless + row.mixed + row.left for row in rows]
    axes.barh(names, [row.runs for row in rows], color="0.8", label="runs")
    axes.barh(names, bad, color="tab:red", label="uncaught, without a key, mixed or left over")
    axes.set_xscale("symlog", linthresh=1.0)
    axes.invert_yaxis()
    axes.legend(loc="lower right", fontsize=8)
    figure.savefig(path, bbox_inches="tight")


def main(size: str, out: Path | str, parts: tuple[str, ...] = tuple(PARTS), number: int = 0) -> dict:
    """Run the parts; print and keep what they found."""
    place = Path(out)
    place.mkdir(parents=True, exist_ok=True)
    warm()
    print("part        runs answered uncaught keyless mixed left  slowest  largest (s, MiB)")
    rows = []
    for part in parts:
        with tempfile.TemporaryDirectory(dir=place) as folder:
            try:
                rows.append(PARTS[part](SIZES[size][part], number, Path(folder)))
            except PermissionError as error:  # who may not mount a disk cannot fill one
                print(f"{part}: {error}")
                continue
        print(rows[-1].line(), flush=True)
        (place / f"torture-{part}-{number}.json").write_text(json.dumps(asdict(rows[-1]), indent=1), encoding="utf-8")
    draw(rows, place / "torture.svg")
    return {"rows": [asdict(row) for row in rows]}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", choices=SIZES, default="full")
    parser.add_argument("--part", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out/studies"))
    options = parser.parse_args()
    found = main(options.size, options.out, tuple(options.part), options.seed)
    sys.exit(any(row["wrong"] for row in found["rows"]))
