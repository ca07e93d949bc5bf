"""Mutated scenes through the commands, and whole commands in little time: each ends soon after its limit, and says how."""

import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.files.reader import leftovers
from tests.torture.scenes import BUILT_IN, Raw, at, from_schema, mutated, places, put_files, to_toml
from tests.torture.trial import COMMANDS, LOG, Row, log_file, run


def check(count: int, number: int, out: Path) -> Row:
    """Mutated scenes through `flexlin check`; each refusal must name a key."""
    row, chance = Row("check"), random.Random(number)
    put_files(out)
    for index in range(count):
        path, (name, raw) = out / "scene.toml", chance.choice((mutated, mutated, from_schema))(chance)
        path.write_text(to_toml(raw), encoding="utf-8")
        row.count(run(["check", str(path)]), keep(path, out, f"check-{number}-{index} of {name}"))
    return row


def commands(count: int, number: int, out: Path) -> Row:
    """Scenes with changed numbers through what computes, the commands in turn, with flexlin's own limits; a few with less time."""
    row, chance = Row("commands"), random.Random(number)
    limits = ["--limit-seconds", "5"] if count < 250 else []
    put_files(out)
    for index in range(count):
        (name, raw), path = mutated(chance, 3, False), out / "scene.toml"
        command = list(COMMANDS)[index % len(COMMANDS)]
        path.write_text(to_toml(raw), encoding="utf-8")
        first, *rest = COMMANDS[command]
        trial = run([first, str(path), *rest, *limits, "--out", str(out / "results")])
        row.count(trial, f"{command} {keep(path, out, f'commands-{number}-{index} of {name}')}")
        row.left += bool(leftovers(out / "results"))
    return row


def keep(path: Path, out: Path, name: str) -> str:
    """Keep the scene of a run until the next one, under a name that says which it was."""
    (out / "last-case.toml").write_text(f"# {name}\n" + path.read_text(encoding="utf-8"), encoding="utf-8")
    return f"{name}: {path.read_text(encoding='utf-8')[:4000]!r}"


SECONDS, LATEST = 4.0, 5.0
"""What each command is given, and when it must have ended, in s."""
FACTORS = (-1.0, 0.0, 1e-3, 0.1, 0.5, 0.9, 1.1, 2.0, 5.0, 30.0, 1e4)
EVERY = (
    "list", "check", "report", "design", "simulate", "respond", "chart", "tune", "cost", "effects", "export", "predict", "identify",
)  # fmt: skip
DISTURBED = (
    ["--push", "tip 1 N 20 ms"],
    ["--push", "tip y 1 N 20 ms"],
    ["--step", "joint 1 torque 0.1 N m"],
    ["--initial", "q1_rate=5 deg/s"],
    ["--noise", "torque 0.05 N m 100 Hz"],
)


def whole_commands(count: int, number: int, out: Path) -> Row:
    """So many command lines, the commands in turn, in processes of their own: none beyond LATEST, none that fails, nothing left over."""
    row, chance = Row("whole"), random.Random(number)
    for index in range(count):
        folder, command = out / str(index), EVERY[index % len(EVERY)]
        words = [command] if command == "list" else make_line(chance, command)
        trial = run([*words, *([] if words == ["list"] else ["--out", str(folder)])])
        case = " ".join(words)
        row.count(trial, case)
        late = min(trial.seconds, trial.cpu) > LATEST  # a busy machine makes the one long, threads the other
        if late or trial.code == 1:
            row.wrong.append(f"{trial.seconds:.2f} s, exit code {trial.code}: {case}: {trial.said[-400:]}")
        row.left += bool(leftovers(folder))
    return row


def make_line(chance: random.Random, command: str) -> list[str]:
    """One command on a random scene with up to two random changes."""
    name = chance.choice(sorted(BUILT_IN))
    raw = BUILT_IN[name]
    words = [command, name, *extras(chance, command, raw)]
    words += ["--limit-seconds", f"{SECONDS:g}"]
    changes = []
    for _ in range(chance.randrange(3)):
        path, value = chance.choice(list(numbers(raw)))
        changes.append(f"{dotted(path)}={type(value)(value * chance.choice(FACTORS))!r}")
    changes += [LOG] if "--log" in words else []
    return [*words, *(["--set", *changes] if changes else [])]


def extras(chance: random.Random, command: str, raw: Raw) -> list[str]:
    """What a command takes beside the scene."""
    if command == "chart":
        axes, counts = chance.sample(list(numbers(raw)), chance.choice((1, 1, 2))), (3, 20, 200)
        return ["--over", *(f"{dotted(p)}={0.5 * x:g}:{1.5 * x:g}:{chance.choice(counts)}" for p, x in axes)]
    if command == "respond":
        return chance.choice(DISTURBED)
    if command in ("predict", "identify"):
        free = ["--free", *(dotted(path) for path, _ in chance.sample(list(numbers(raw)), chance.choice((1, 3))))]
        words = ["--log", log_file(), "--window", chance.choice(("0.2", "0.6"))]
        return words + (free if command == "identify" else [])
    if command == "simulate":
        return ["--periods", chance.choice(("0.5", "3", "100"))]
    if command == "report":
        return chance.choice(([], [], ["--effects"], ["--sensitivity"], ["--loop-margins"]))
    return []


def numbers(raw: Raw) -> Iterator[tuple[tuple, Any]]:
    """The positive numbers of a scene with their places."""
    for path in places(raw):
        value = at(raw, path)
        if isinstance(value, int | float) and not isinstance(value, bool) and value > 0 and path != ("schema",):
            yield path, value


def dotted(path: tuple) -> str:
    """A place as --set names it."""
    return ".".join(map(str, path))
