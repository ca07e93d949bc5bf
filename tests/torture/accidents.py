"""Kills, full disks, little memory and rival writers, and what a reader finds afterwards."""

import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path

from tests.files.reader import leftovers, standing
from tests.torture.trial import ALL_SETS, LATER, SETS, Row, Trial, case_of, run


def kills(count: int, number: int, out: Path) -> Row:
    """SIGKILL and SIGTERM at random times, half of them while files are written; then the next run."""
    row, chance = Row("kills"), random.Random(number)
    for at in range(count):
        command = chance.choice(["report", "chart", "design", "export", *LATER])
        folder = out / f"{command}-{at % 7}" / "out"
        folder.parent.mkdir(exist_ok=True)
        if at % 3 == 0 and folder.is_dir():
            (folder / "foreign.txt").write_text("mine")
        words = case_of(command, f"title='{at}'", folder)
        how = chance.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGTERM])
        before = whole_set(folder, command)
        trial = run(words, stop_after=partial(kill_at, folder=folder, chance=chance, how=how))
        row.runs, row.slowest = row.runs + 1, max(row.slowest, trial.seconds)
        judge_rest(row, trial, folder, command, before, f"{command} {at} {how.name}")
        if at % 4 == 3 or at == count - 1:
            row.count(run(case_of(command, "title='next'", folder)), f"after {command} {at}")
            if leftovers(folder) or whole_set(folder, command) is None:
                row.blame("left", f"after the next run of {command} {at}: {leftovers(folder)}")
    return row


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
    return standing(folder, ALL_SETS[command])


def judge_rest(row: Row, trial: Trial, folder: Path, command: str, before: dict[str, bytes] | None, case: str) -> None:
    """A set that is neither the old one nor a whole new one is mixed, unless its switch is declared and will be finished; and what was said
    to be written is there."""
    found = whole_set(folder, command)
    declared = any(folder.parent.rglob(".*.whole/set/flexlin-results.json"))
    if (found is None and not declared) or (before and found == {}):
        row.blame("mixed", f"or half: {case}")
    for line in trial.said.splitlines():
        if line.startswith("wrote ") and not Path(line.removeprefix("wrote ")).exists():
            row.blame("mixed", f"said, but not written: {case}: {line}")


@contextmanager
def small_disk(size: int, out: Path) -> Iterator[Path]:
    """A disk of so many bytes: a tmpfs where that may be mounted, else nothing."""
    place = Path(tempfile.mkdtemp(dir=out))
    words = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", place]
    done = subprocess.run(words, capture_output=True, check=False)
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
        command = chance.choice(list(ALL_SETS))
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
            judge_rest(row, trial, folder, command, before, f"{command} on a full disk")
            if trial.code and ("cannot be written" not in trial.said or leftovers(folder)):
                row.blame("left", f"full disk: {command} {at}: {trial.code} {trial.said[-200:]} {leftovers(folder)}")
            ballast.unlink()
            row.count(run(case_of(command, "title='next'", folder)), f"{command} after {at}")
            row.left += bool(leftovers(folder))
    return row


def memory(count: int, number: int, out: Path) -> Row:
    """Runs in so little address space that something fails: a message, no trace, and nothing half-written."""
    row, chance = Row("memory"), random.Random(number)
    for at in range(count):
        command, space = chance.choice(list(SETS)), int(2 ** chance.uniform(23, 28))
        folder = out / "tight" / command
        before = whole_set(folder, command)
        trial = run(case_of(command, f"title='{at}'", folder), space=space)
        row.count(trial, f"{command} in {space} bytes")
        judge_rest(row, trial, folder, command, before, f"{command} in {space} bytes")
        row.left += bool(leftovers(folder))
    return row


ROBOT = """<robot name="r{mass}">
  <link name="base"/>
  <link name="arm"><inertial><origin xyz="0.4 0 0"/><mass value="{mass}"/>
    <inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>
</robot>"""


def lone_files(count: int, number: int, out: Path) -> Row:
    """Kill a writer at a random time, every other time with a second one beside it; then run once more."""
    row, chance = Row("files"), random.Random(number)
    for mass in (1, 2):
        (out / f"{mass}.urdf").write_text(ROBOT.format(mass=mass), encoding="utf-8")
    cases = {
        "new": (["new", "{}", "--like", "single-link"], ["new", "{}", "--like", "spinning-link"]),
        "import": (["import", str(out / "1.urdf"), "--out", "{}"], ["import", str(out / "2.urdf"), "--out", "{}"]),
    }
    whole = {name: {written(one, out / name / "own.toml") for one in both} for name, both in cases.items()}
    for at in range(count):
        name = chance.choice(list(cases))
        path = out / f"{name}-{at}" / "own.toml"
        path.parent.mkdir()
        first, second = ([word.format(path) for word in one] for one in cases[name])

        def stop(child: int, second: list[str] = second, at: int = at, wait: float = chance.expovariate(8.0)) -> None:
            if at % 2:
                row.count(run(second), f"{second[0]} beside {at}")
            time.sleep(wait)
            os.kill(child, signal.SIGKILL)

        run(first, stop_after=stop)
        row.runs += 1
        if path.exists() and path.read_bytes() not in whole[name]:
            row.blame("mixed", f"half written: {name} {at}")
        row.count(run(first), f"{name} after {at}")
        if not path.exists() or path.read_bytes() not in whole[name] or leftovers(path):
            row.blame("left", f"by {name} {at}: {leftovers(path)}")
    return row


def written(words: list[str], path: Path) -> bytes:
    """What a run that nobody disturbs writes."""
    path.parent.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    run([word.format(path) for word in words])
    return path.read_bytes()


def writers(count: int, number: int, out: Path) -> Row:
    """Two programs that write C source to one place without end, and a reader who opens the folder and reads its files."""
    row, folder = Row("writers"), out / "shared"
    code = (
        "import sys, numpy as np, flexlin as fl\n"
        "from flexlin.control import gain_source, pd_feedback\n"
        "system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])\n"
        "made = pd_feedback(system, [0], [float(sys.argv[2])], [2.0])\n"
        "while True: gain_source(made, 1.0, sys.argv[1])\n"
    )
    one = [sys.executable, "-c", code, str(folder)]
    both = [subprocess.Popen([*one, "4"]), subprocess.Popen([*one, "5"])]
    try:
        while row.runs < count and all(process.poll() is None for process in both):
            parts = read_together(folder, ("gain.c", "gain.h", "main.c", "flexlin-results.json"))
            if parts is None:
                time.sleep(0.001)
                continue
            stated = json.loads(parts["flexlin-results.json"])["sets"]["gain"]["sha256"]
            mixed = any(hashlib.sha256(parts[name]).hexdigest() != digest for name, digest in stated.items())
            row.runs, row.answered, row.mixed = row.runs + 1, row.answered + 1, row.mixed + mixed
    finally:
        for process in both:
            process.terminate()
            process.wait()
    row.uncaught = count - row.runs
    with_gain = [sys.executable, "-c", code.replace("while True: ", ""), str(folder), "4"]
    subprocess.run(with_gain, check=True)
    row.left = len(leftovers(folder))
    return row


def read_together(folder: Path, names: tuple[str, ...]) -> dict[str, bytes] | None:
    """Files of one moment: the folder is opened first; None where it is being taken away."""
    found = {}
    with ExitStack() as kept, suppress(FileNotFoundError):
        handle = os.open(folder, os.O_RDONLY)
        kept.callback(os.close, handle)
        files = {name: kept.enter_context(open(name, "rb", opener=partial(os.open, dir_fd=handle))) for name in names}
        found = {name: file.read() for name, file in files.items()}
    return found or None
