"""A set of results is one thing: whatever kills the writer, at whatever step, a reader finds the old set or the new one."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from flexlin import files as switching
from flexlin.errors import OutputError
from flexlin.files import results
from tests.files.reader import contents, interrupt, leftovers, standing
from tests.thinned import thin


class Death(BaseException):
    """The process is gone: nothing that it tries afterwards has any effect."""


STEPS = ("rename", "replace", "link", "unlink", "rmdir", "mkdir", "utime")


@contextmanager
def dying(at: int) -> Iterator[list[str]]:
    """Let the call `at` to the operating system, and all after it, fail as if the process were dead; gives the calls that were made."""
    made: list[str] = []

    def mortal(name: str, step: Callable) -> Callable:
        def run(*arguments, **options):
            if len(made) >= at:
                raise Death
            made.append(name)
            return step(*arguments, **options)

        return run

    with pytest.MonkeyPatch.context() as patch:
        for name in STEPS:
            patch.setattr(os, name, mortal(name, getattr(os, name)))
        patch.setattr(switching, "exchange", mortal("exchange", switching.exchange))
        yield made


def write(folder: Path, mark: str, name: str = "export", more: tuple[str, ...] = ()) -> None:
    """A set with files in folders, all of which say `mark`."""
    with results(folder, name) as made:
        for path in (f"{name}.html", f"{name}.json", f"c-{name}/gain.c", f"c-{name}/main.c", *more):
            (made / path).parent.mkdir(exist_ok=True)
            (made / path).write_text(f"{mark} in {path}")


def mark_of(folder: Path, name: str = "export") -> str | None:
    """What the files of a set say; None where they do not say the same."""
    found = standing(folder, name)
    marks = None if found is None else {content.decode().partition(" ")[0] for content in found.values()} or {"nothing"}
    return marks.pop() if marks is not None and len(marks) == 1 else None


def one_set(folder: Path) -> None:
    write(folder, "old", more=("dropped/x.c",))


def two_sets(folder: Path) -> None:
    one_set(folder)
    write(folder, "other", "chart")


def foreign(folder: Path) -> None:
    two_sets(folder)
    (folder / "thesis.tex").write_text("mine")


def older(folder: Path) -> None:
    """Results of before there were manifests."""
    folder.mkdir()
    (folder / "export.html").write_text("before")


PLACES = [lambda folder: None, one_set, two_sets, foreign, older]


@pytest.fixture(autouse=True)
def no_disk(monkeypatch):
    """Waiting for the disk is no part of these tests."""
    monkeypatch.setattr(os, "fsync", lambda handle: None)


@pytest.mark.slow
@pytest.mark.parametrize("prepare", thin(PLACES[::-1], 2))
def test_a_writer_killed_at_any_step_leaves_one_whole_set(prepare, tmp_path):
    """In a folder of flexlin's own the files agree at every moment; beside foreign files the manifest says when they do not."""
    at, died = 0, True
    while died:
        folder = tmp_path / f"{at}" / "out"
        folder.parent.mkdir()
        prepare(folder)
        before, mixed, died = mark_of(folder), 0, True
        with suppress(Death), dying(at):
            write(folder, "new")
            died = False
        found = mark_of(folder)
        if prepare is foreign:
            mixed = len(list(folder.parent.glob(".out.*.whole/set/flexlin-results.json")))
            assert (folder / "thesis.tex").read_text() == "mine"
        assert found in (before, "new") or mixed == 1
        if prepare in (two_sets, foreign):
            assert mark_of(folder, "chart") == "other"
        write(folder, "last", "cost")
        assert leftovers(folder) == []
        assert mark_of(folder) == "new" if mixed or not died else mark_of(folder) in (before, "new")
        assert mark_of(folder, "cost") == "last"
        if mark_of(folder) == "new":
            assert not (folder / "dropped").exists(), "what the old set had beyond the new one goes with it"
        at += 1
    assert at >= 10


@pytest.mark.parametrize("prepare", PLACES)
def test_a_failure_while_the_set_is_made_changes_nothing(prepare, tmp_path):
    folder = tmp_path / "out"
    prepare(folder)
    before = contents(tmp_path)
    with pytest.raises(KeyboardInterrupt), results(folder, "export") as made:
        interrupt(made / "export.html")
    assert contents(tmp_path) == before
    assert leftovers(folder) == []


def test_an_interrupt_between_two_moves_lets_them_be_finished(tmp_path, monkeypatch):
    folder, replace, calls = tmp_path / "out", os.replace, []
    foreign(folder)

    def interrupted(one: Path, other: Path) -> None:
        calls.append(other)
        if len(calls) == 2:
            raise KeyboardInterrupt
        replace(one, other)

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write(folder, "new")
    assert mark_of(folder) == "new"
    assert leftovers(folder) == []


def test_the_folder_that_one_works_in_stays_the_same(tmp_path, monkeypatch):
    folder = tmp_path / "out"
    one_set(folder)
    monkeypatch.chdir(folder)
    write(Path(), "new")
    assert Path("export.html").read_text().startswith("new")
    assert mark_of(folder) == "new"
    assert leftovers(folder) == []


def test_files_of_others_stay_whatever_the_manifest_says(tmp_path):
    """A manifest is no key to other folders, and a file that somebody has changed is his."""
    folder = tmp_path / "out"
    one_set(folder)
    (tmp_path / "precious").write_text("dropped")
    text = (folder / "flexlin-results.json").read_text()
    (folder / "flexlin-results.json").write_text(text.replace("dropped/x.c", "../precious"))
    write(folder, "new")
    assert (tmp_path / "precious").read_text() == "dropped"
    one_set(folder)
    (folder / "dropped" / "x.c").write_text("improved")
    write(folder, "new")
    assert (folder / "dropped" / "x.c").read_text() == "improved"
    wrong = '{"format": 1, "sets": {"a": 3}}', '{"format": 1, "sets": {"a": {"sha256": {"x": 3}}}}'
    for broken in ("", "[]", *wrong, "[" * 9999):
        (folder / "flexlin-results.json").write_text(broken)
        write(folder, "new")
        assert mark_of(folder) == "new"


def test_a_folder_in_the_place_of_a_file_is_refused_before_anything_moves(tmp_path):
    folder = tmp_path / "out"
    one_set(folder)
    (folder / "chart.html").mkdir()
    with pytest.raises(OutputError, match=r"chart\.html cannot be written; got a folder, expected a file"):
        write(folder, "new", "chart")
    assert mark_of(folder) == "old"
    assert mark_of(folder, "chart") == "nothing"
    (folder / "c-cost").write_text("a file")
    with pytest.raises(OutputError, match="c-cost cannot be written; got a file, expected a folder"):
        write(folder, "new", "cost")
    assert leftovers(folder) == []
