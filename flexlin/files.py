"""The one door to the disk for results: a set of files, or a single one, appears whole or not at all.

A staged set takes the place of the old one in one rename where the folder is flexlin's own, else file by file. A move that was cut off is
gone on with by whoever comes next; folders that a killed program left are taken away. `flexlin-results.json` says which files belong to
which set, with their checksums. `docs/results.md` says what a reader may rely on.
"""

import ctypes
import fcntl
import hashlib
import json
import os
import secrets
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from flexlin.bounds import LARGEST_MANIFEST, printable, read_text
from flexlin.errors import OutputError

MANIFEST = "flexlin-results.json"
FORMAT = 1
Files = Mapping[str, str]
"""Names below the folder, parted by /, and their SHA-256."""
WRITER_SECONDS = 60.0
"""Seconds that a writer waits for another one, which holds a place only while it renames."""
MARK, PART, WHOLE = ".flexlin-", ".part", ".whole"
"""`.NAME.flexlin-UNIQUE.part` is being written; `.whole` holds a whole set, whose files are on their way to their places."""
INNER = "set"
"""The folder in it that has the files; the outer one is held by its writer."""
NAME_BYTES = 120
"""Bytes of a name that are kept; the marks need room beside it."""


@dataclass(frozen=True)
class Manifest:
    """The sets of a folder by name; no file belongs to two."""

    sets: Mapping[str, Files] = field(default_factory=dict)

    @property
    def files(self) -> dict[str, str]:
        """All files of all sets."""
        return {name: digest for files in self.sets.values() for name, digest in files.items()}

    def having(self, name: str, files: Files) -> "Manifest":
        """The manifest with a set in the place of what bore its name; files of other sets that it replaces become its own."""
        kept = {one: {path: has[path] for path in has if path not in files} for one, has in self.sets.items()}
        return Manifest({**{one: has for one, has in kept.items() if has and one != name}, name: files})

    def write(self, folder: Path) -> None:
        """Write it into a folder; it can be checked with sha256sum."""
        sets = {name: {"sha256": dict(sorted(files.items()))} for name, files in sorted(self.sets.items())}
        text = json.dumps({"format": FORMAT, "sets": sets}, indent=1)
        (folder / MANIFEST).write_text(text + "\n", encoding="utf-8")


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a folder; an empty one where there is none, or none that flexlin could have written."""
    try:
        data = json.loads(read_text(folder / MANIFEST, LARGEST_MANIFEST))
        known = Manifest({str(name): dict(one["sha256"]) for name, one in data["sets"].items()})
        sane = all(isinstance(digest, str) and stays_below(path) for path, digest in known.files.items())
        return known if sane and data["format"] == FORMAT else Manifest()
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return Manifest()


def stays_below(name: str) -> bool:
    """Whether a name of a manifest leads to a place below its folder, whoever wrote it."""
    path = PurePosixPath(name)
    return bool(path.parts) and not path.is_absolute() and ".." not in path.parts and not set("\\:\0") & set(name)


def files_below(folder: Path) -> dict[str, Path]:
    """All that is no folder below a folder, by its name parted by /; the manifest is left out."""
    found = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if not is_folder(path)}
    found.pop(MANIFEST, None)
    return found


def is_folder(path: Path) -> bool:
    """Whether it is a folder and no link to one."""
    return path.is_dir() and not path.is_symlink()


def has_digest(path: Path, digest: str | None) -> bool:
    """Whether a regular file has this content."""
    return path.is_file() and not path.is_symlink() and digest_of(path) == digest


def digest_of(path: Path) -> str:
    """The SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sync(path: Path) -> None:
    """Have a file, or the entries of a folder, on the disk before anything else is done.

    Raises: OSError, also where the disk is full only now.
    """
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def exchange(one: Path, other: Path) -> bool:
    """Let two folders change their names in one step; False where the system or the file system has no such step.

    Source: renameat2(2) of Linux with AT_FDCWD = -100 and RENAME_EXCHANGE = 2.
    """
    rename = getattr(ctypes.CDLL(None), "renameat2", None)
    return rename is not None and rename(-100, os.fsencode(one), -100, os.fsencode(other), 2) == 0


@contextmanager
def held(folder: Path, seconds: float = 0.0) -> Iterator[None]:
    """Mark a folder as in use, among threads and processes, until the block or its process ends; nothing where that cannot be marked.

    Raises: OSError where somebody else holds it, and does not let go for so many seconds.
    """
    handle, until = None, time.monotonic() + seconds
    try:
        while handle is None:
            try:
                handle = os.open(folder, os.O_RDONLY)
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                assert handle is not None
                os.close(handle)
                handle = None
                if time.monotonic() > until:
                    raise OSError(f"another program has held {folder} for {seconds:g} s") from None
                time.sleep(0.005)
            except OSError:  # a file system without locks
                break
        yield
    finally:
        if handle is not None:
            os.close(handle)


def alone(folder: Path) -> AbstractContextManager[None]:
    """Be the only writer of flexlin's in a folder. Raises: OSError where another one does not let go."""
    return held(folder, WRITER_SECONDS)


def prefix_for(name: str) -> str:
    """How the staging folders of a file or folder of this name begin."""
    raw = os.fsencode(name)
    return f".{name if len(raw) <= NAME_BYTES else hashlib.sha256(raw).hexdigest()[:32]}{MARK}"


def staged(place: Path, name: str, ending: str) -> list[Path]:
    """This user's staging folders for `name` in a place, in the order of their names: what others put there is none of ours."""
    prefix = prefix_for(name)
    try:
        found = [one for one in place.iterdir() if one.name.startswith(prefix) and one.name.endswith(ending)]
        return sorted(one for one in found if is_folder(one) and one.lstat().st_uid == os.geteuid())
    except OSError:
        return []


@contextmanager
def staging(place: Path, target: Path) -> Iterator[Path]:
    """Give a new folder in `place` in which results for `target` are made; it is gone when the block ends, however it ends.

    What killed programs left for the same target is taken away first. The name is unique among threads and processes, and the folder is
    held as long as it is written to, so that nobody else takes it for left behind.
    """
    with ExitStack() as until_written:
        with alone(place):
            take_away_left(place, target)
            folder = place / f"{prefix_for(target.name)}{os.getpid()}-{secrets.token_hex(6)}{PART}"
            folder.mkdir()
            until_written.enter_context(held(folder))
        until_written.callback(discard, folder, target)
        (folder / INNER).mkdir()
        yield folder / INNER


def take_away_left(place: Path, target: Path) -> None:
    """Take away what killed programs left in a place for a target, to which nobody writes any more; the place is held."""
    for left in staged(place, target.name, PART):
        with suppress(OSError), held(left):  # unless somebody writes to it
            discard(left, target)


def discard(folder: Path, target: Path) -> None:
    """Take a staging folder away. Where it is the old folder of results, whatever came into it from elsewhere moves on to the new one."""
    inner = folder / INNER
    manifest = read_manifest(inner)
    if manifest.sets:
        known = {MANIFEST, *(name.partition("/")[0] for name in manifest.files)}
        with suppress(FileNotFoundError):  # somebody else is at it
            for entry in inner.iterdir():
                if entry.name not in known and not os.path.lexists(target / entry.name):
                    os.rename(entry, target / entry.name)
    shutil.rmtree(folder, ignore_errors=True)


def switch(stage: Path, target: Path, name: str) -> None:
    """Let the staged files be the set `name` of the folder `target`.

    The set that a reader finds changes in one rename: of the whole folder where it is new, or where only flexlin writes to it; else of the
    staging folder, whose files then move to their places. Whoever comes next goes on with moves that were cut off.
    Raises: OutputError where a folder stands in the place of a file; OSError.
    """
    files = {path: digest_of(file) for path, file in files_below(stage).items()}
    for path in (*stage.rglob("*"), stage):
        sync(path)
    with alone(target.parent):
        finish(target)
        refuse_clashes(files, target)
        manifest = read_manifest(target).having(name, files)
        if not switch_folder(stage, target, manifest, name):
            switch_files(stage, target, manifest)
        sync(target.parent)


def switch_folder(stage: Path, target: Path, manifest: Manifest, name: str) -> bool:
    """Let the staging folder be the target, or change places with it; False where that cannot be done, and then nothing has changed."""
    new = not target.exists()
    ours = new or (holds_only_results(target, manifest, manifest.sets[name]) and not may_be_missed(target))
    if target in stage.parents or not ours:
        return False
    try:
        for path in manifest.files.keys() - manifest.sets[name].keys():
            if (target / path).exists():
                (stage / path).parent.mkdir(parents=True, exist_ok=True)
                os.link(target / path, stage / path)
    except OSError:  # a file system without second names
        return False
    manifest.write(stage)
    sync(stage / MANIFEST)
    sync_folders(stage, manifest.files)
    if new:
        os.rename(stage, target)
        return True
    shutil.copystat(target, stage)
    os.utime(stage)
    return exchange(stage, target)


def holds_only_results(target: Path, manifest: Manifest, staged_files: Files) -> bool:
    """Whether nothing but results of flexlin's stands in a folder, as they were written or about to be replaced."""
    old = read_manifest(target).files
    tops = {path.partition("/")[0] for path in (MANIFEST, *old, *staged_files)}
    if not tops.issuperset(os.listdir(target)):
        return False

    def fits(path: str, file: Path) -> bool:
        carried = path in old and path in manifest.files and not file.is_symlink()
        return path in staged_files or carried or has_digest(file, old.get(path))

    return all(fits(path, file) for path, file in files_below(target).items())


def may_be_missed(folder: Path) -> bool:
    """Whether something hangs on the folder itself: a process that works in it, a disk, other owners."""
    try:
        here, about = Path.cwd(), folder.stat()
    except OSError:
        return True
    owned = about.st_uid == os.geteuid() and about.st_gid == folder.parent.stat().st_gid
    return folder in (here, *here.parents) or os.path.ismount(folder) or not owned


def switch_files(stage: Path, target: Path, manifest: Manifest) -> None:
    """Declare the staging folder whole in one rename, then move its files to their places."""
    manifest.write(stage)
    sync(stage / MANIFEST)
    sync(stage)
    sync(stage.parent)
    os.rename(stage.parent, stage.parent.with_suffix(WHOLE))
    sync(stage.parent.parent)
    try:
        finish(target)
    except BaseException:  # an interrupt in the middle must not leave half of it
        finish(target)
        raise


def finish(target: Path) -> None:
    """Move the files of sets that are whole to their places, the manifest last; what the old set had beyond them goes."""
    for whole in (path for place in (target.parent, target) for path in staged(place, target.name, WHOLE)):
        stage = whole / INNER
        manifest, old = read_manifest(stage), read_manifest(target).files
        if manifest.sets:
            for path, digest in manifest.files.items():
                if has_digest(stage / path, digest):  # what is not new has stayed in its place
                    (target / path).parent.mkdir(parents=True, exist_ok=True)
                    os.replace(stage / path, target / path)
            for path in old.keys() - manifest.files.keys():
                remove(target, path, old[path])
            sync_folders(target, manifest.files)
            os.replace(stage / MANIFEST, target / MANIFEST)
            sync(target)
        os.rename(whole, whole.with_suffix(PART))
        shutil.rmtree(whole.with_suffix(PART), ignore_errors=True)


def remove(target: Path, path: str, digest: str) -> None:
    """Take away a file of the old set that nobody has changed since, and its folders where they are empty now."""
    file = target / path
    folders = [parent for parent in file.parents if target in parent.parents]
    if any(folder.is_symlink() for folder in folders):
        return
    if has_digest(file, digest):
        file.unlink()
    for folder in folders:
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()


def sync_folders(folder: Path, files: Files) -> None:
    """Have the folders that hold files of a set on the disk."""
    for parent in {(folder / path).parent for path in files} | {folder}:
        if parent.is_dir():
            sync(parent)


def refuse_clashes(files: Files, target: Path) -> None:
    """Refuse a folder in the place of a file, and a file in the place of a folder, before anything is moved."""
    for place in (target / path for path in (MANIFEST, *files)):
        for at in (place, *place.parents[: len(place.parts) - len(target.parts)]):
            if is_folder(at) if at == place else at.exists() and not at.is_dir():
                got, expected = ("a folder", "a file") if at == place else ("a file", "a folder")
                raise OutputError(f"{at} cannot be written", got=got, expected=f"{expected}, or nothing, of that name")


@dataclass(frozen=True)
class Results:
    """A set in the making: `stage` is where its files are written; `folder` is where they will stand."""

    folder: Path
    stage: Path

    def __truediv__(self, name: str) -> Path:
        """Where a file of the set is written."""
        return self.stage / name

    def placed(self, *names: str) -> list[Path]:
        """Where files of the set will stand."""
        return [self.folder / name for name in names]


@contextmanager
def results(folder: Path, name: str) -> Iterator[Results]:
    """Let the block write a set of results into an empty folder; when it ends well the set stands in `folder`, else nothing has changed.

    A reader finds the old set or the new one: `docs/results.md`. Of several writers the last whole set stands.
    Parameters: name: of the set; what bore it before is replaced.
    Raises: OutputError where the folder or its files cannot be written.
    """
    try:
        target = folder.resolve()
        target.parent.mkdir(parents=True, exist_ok=True)
        with staging(place_for(target), target) as stage:
            yield Results(folder, stage)
            switch(stage, target, name)
    except OSError as error:
        raise OutputError(f"{folder} cannot be written", got=error.strerror or str(error)) from None


def place_for(target: Path) -> Path:
    """Where results for a folder are made: beside it, so that one rename is enough; inside it where that cannot be, or may be missed."""
    beside = target.parent
    if not target.exists():
        return beside
    one_device = beside.stat().st_dev == target.stat().st_dev
    return beside if one_device and os.access(beside, os.W_OK | os.X_OK) and not may_be_missed(target) else target


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a path of the same name elsewhere; when the block ends well the file that it wrote becomes `path`, else it vanishes.

    Raises: OutputError when the folder cannot be made or the file not be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with staging(path.parent, path) as stage:
            yield stage / path.name
            sync(stage / path.name)
            with alone(path.parent):
                os.replace(stage / path.name, path)
            sync(path.parent)
    except OSError as error:
        raise OutputError(f"{path} cannot be written", got=error.strerror or str(error)) from None


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def clear_left(path: Path) -> None:
    """Take away what killed programs left beside a file, where that can be done."""
    with suppress(OSError), alone(path.parent):
        take_away_left(path.parent, path)


def check_folder(folder: Path) -> None:
    """Refuse a folder that cannot be made or written to, before any work is done; nothing is created.

    Raises: OutputError.
    """
    try:
        existing = folder.resolve()
        while not existing.exists() and existing != existing.parent:
            existing = existing.parent
    except (OSError, RuntimeError, ValueError) as error:  # a name that is too long, a loop of links, a zero in a name
        got = getattr(error, "strerror", None) or ("a loop of links" if isinstance(error, RuntimeError) else str(error))
    else:
        if existing.is_dir() and os.access(existing, os.W_OK | os.X_OK):
            return
        got = f"{existing} without permission to write" if existing.is_dir() else f"{existing}, a file"
    raise OutputError(f"{printable(folder)} cannot be the output folder", got=got, expected="a folder of yours")
