"""C source to a loaded library: compiled once, kept in a folder of the user's own, found again by what it was made of."""

import ctypes
import hashlib
import os
import platform
import shutil
import stat
import subprocess
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

from flexlin.checks import Array
from flexlin.errors import NumericalError, TimeLimit

FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-std=gnu11", "-shared", "-fPIC")
LONGEST = 120.0
"""Seconds that a compiler may take."""


@lru_cache(maxsize=1)
def find_compiler() -> str | None:
    """The C compiler of this machine; none where there is none."""
    return shutil.which("gcc") or shutil.which("cc") or shutil.which("clang")


def load_library(source: str) -> ctypes.CDLL:
    """The library of a C source, compiled where it is not in the cache.

    Raises: NumericalError where there is no compiler, or it fails.
    """
    library = cache_folder() / f"{fingerprint(source)}.so"
    if not is_written_by_user_alone(library):
        compile_source(source, library)
    return ctypes.CDLL(str(library))


@lru_cache(maxsize=8)
def find_kept_library(*paths: Path) -> ctypes.CDLL | None:
    """The library of C files, kept for later processes; none where it cannot be compiled, or would have to be by every process."""
    if find_compiler() is None or find_kept_folder() is None:
        return None
    try:
        return load_library(join_files(*paths))
    except TimeLimit:
        raise
    except (NumericalError, OSError):
        return None


def is_missing(*paths: Path) -> bool:
    """Whether the library of C files is yet to be compiled, by a compiler that is here, and can be kept."""
    folder = find_kept_folder()
    if find_compiler() is None or folder is None:
        return False
    return not is_written_by_user_alone(folder / f"{fingerprint(join_files(*paths))}.so")


def join_files(*paths: Path) -> str:
    """The text of files, one after the other."""
    return "\n".join(path.read_text(encoding="utf-8") for path in paths)


def compile_source(source: str, library: Path) -> None:
    """Compile into a folder of its own, and move the result into place when it is whole."""
    compiler = find_compiler()
    if compiler is None:
        raise NumericalError("there is no C compiler", todo="install gcc, or let NumPy do the work")
    with tempfile.TemporaryDirectory(dir=library.parent) as folder:
        text, made = Path(folder) / "kernel.c", Path(folder) / "kernel.so"
        text.write_text(source, encoding="utf-8")
        try:
            command = [compiler, *FLAGS, str(text), "-o", str(made), "-lm"]
            subprocess.run(command, check=True, capture_output=True, timeout=LONGEST, cwd=folder)
        except (OSError, subprocess.SubprocessError) as error:
            said = getattr(error, "stderr", None) or b""
            raise NumericalError(
                "the C compiler failed", got=said.decode(errors="replace")[:300] or str(error)
            ) from None
        os.replace(made, library)


def fingerprint(source: str) -> str:
    """What a library is made of, in one word: source, compiler, flags, processor."""
    parts = [source, *FLAGS, str(find_compiler()), describe_compiler(), describe_processor()]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


@lru_cache(maxsize=1)
def describe_compiler() -> str:
    """Which compiler it is: its file, and how large and how old that is. To ask it for its version would take 10 ms in every process."""
    path = os.path.realpath(str(find_compiler()))
    try:
        about = os.stat(path)
    except OSError:
        return path
    return f"{path} {about.st_size} {about.st_mtime_ns}"


@lru_cache(maxsize=1)
def describe_processor() -> str:
    """The processor's model and instruction sets: a library made for another one may not run here."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return f"{platform.machine()} {platform.processor()}"
    return "\n".join(sorted({line for line in lines if line.startswith(("model name", "flags", "Features"))}))


@lru_cache(maxsize=1)
def cache_folder() -> Path:
    """A folder that only this user can write to: the one that is kept, else a new one for this process."""
    return find_kept_folder() or Path(tempfile.mkdtemp(prefix="flexlin-"))


def find_kept_folder() -> Path | None:
    """The folder below XDG_CACHE_HOME or ~/.cache, which later processes find again; none where it cannot be written."""
    try:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        folder = base / "flexlin"
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        if base.is_absolute() and is_written_by_user_alone(folder) and os.access(folder, os.W_OK | os.X_OK):
            return folder
    except (OSError, RuntimeError):
        pass
    return None


def is_written_by_user_alone(path: Path) -> bool:
    """Whether a file or folder is there, is this user's, and can be written by nobody else."""
    try:
        about = path.lstat()
    except OSError:
        return False
    if stat.S_ISLNK(about.st_mode):
        return False
    return not hasattr(os, "getuid") or (
        about.st_uid == os.getuid() and not about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    )


def address(array: Array) -> int:
    """Where the numbers of a contiguous array stand, for functions that know what they take."""
    assert array.flags.c_contiguous
    if not array.flags.writeable or not array.size:
        return int(array.ctypes.data)
    numbers: Any = array
    return ctypes.addressof(ctypes.c_char.from_buffer(numbers))  # half the time of array.ctypes.data


def pointer(array: Array) -> ctypes.c_void_p:
    """The same, for functions that do not."""
    return ctypes.c_void_p(address(array))
