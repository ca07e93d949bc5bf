"""Mutated scenes through the commands."""

from collections.abc import Callable
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from tests.files.reader import leftovers
from tests.torture.bases import put_files
from tests.torture.rows import COMMANDS, Row, names_a_key
from tests.torture.scenes import Raw, from_schema, mutated, to_toml
from tests.torture.trial import run

BATCH = 250


def fuzz(row: Row, scenes: st.SearchStrategy, count: int, number: int, work: Callable[[str, Raw, int], None]) -> Row:
    """Do the work for so many scenes, drawn by hypothesis, which remembers what it drew: `BATCH` at a time."""
    for start in range(0, count, BATCH):
        draw_and_work(scenes, range(start, min(start + BATCH, count)), number + start, work)
    return row


def draw_and_work(scenes: st.SearchStrategy, places: range, number: int, work: Callable[[str, Raw, int], None]) -> None:
    """Do the work for one batch of scenes."""
    turn = iter(places)

    @seed(number)
    @settings(
        max_examples=len(places),
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


def check(count: int, number: int, out: Path) -> Row:
    """Mutated scenes through `flexlin check`; each refusal must name a key."""
    row = Row("check")
    put_files(out)

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
    """Scenes with changed numbers through what computes, the commands in turn, with flexlin's own limits; a few with less time."""
    row, limits = Row("commands"), ["--limit-seconds", "5"] if count < BATCH else []
    put_files(out)

    def work(name: str, raw: Raw, at: int) -> None:
        path, command = out / "scene.toml", list(COMMANDS)[at % len(COMMANDS)]
        path.write_text(to_toml(raw), encoding="utf-8")
        first, *rest = COMMANDS[command]
        trial = run([first, str(path), *rest, *limits, "--out", str(out / "results")])
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
