"""What is installed is what was locked, and what is built is the same each time."""

import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LOCKS = sorted((ROOT / "requirements").glob("*.txt"))


@pytest.mark.parametrize("lock", LOCKS, ids=lambda path: path.stem)
def test_every_locked_package_has_its_hashes(lock):
    """Every requirement is pinned, and followed by SHA-256 sums and nothing else."""
    text = re.sub(r"^#.*\n", "", lock.read_text(encoding="utf-8"), flags=re.MULTILINE).replace("\\\n", " ")
    lines = [line for line in text.splitlines() if line.strip()]
    assert len(lines) >= 30
    for line in lines:
        pin, *hashes = re.split(r"\s+--hash=", line.strip())
        assert re.fullmatch(r"[\w.-]+==[\w.]+( ; [^#]+)?", pin), pin
        assert hashes, pin
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", one) for one in hashes), pin


def test_locks_agree_and_make_installs_nothing_else():
    """One version of a package in all locks; pip is called with --require-hashes, or for flexlin itself without network needs."""
    pins: dict[str, str] = {}
    for lock in LOCKS:
        text = lock.read_text(encoding="utf-8")
        for name, marker in re.findall(r"^([\w.-]+==[\w.]+)( ;[^\\\n]+)?", text, flags=re.MULTILINE):
            assert pins.setdefault(name.partition("==")[0] + marker.strip(), name) == name, lock.name
    calls = [line for line in (ROOT / "Makefile").read_text(encoding="utf-8").splitlines() if "$(PIP) " in line]
    assert len(calls) >= 4
    allowed = "--require-hashes -r requirements/|--no-deps --no-build-isolation"
    assert all(re.search(allowed, call) and "pip install" not in call for call in calls)


def build_wheel(tree: Path, age: int = 0, **environment: str) -> subprocess.CompletedProcess:
    """Build a wheel beside sources that are copied into a new folder, all Python files of that age."""
    pytest.importorskip("hatchling")
    tree.mkdir(parents=True)
    for part in ("flexlin", "models"):
        shutil.copytree(ROOT / part, tree / part, ignore=shutil.ignore_patterns("__pycache__", "built"))
    for part in ("pyproject.toml", "README.md", "LICENSE", "CMakeLists.txt", "hatch_build.py"):
        shutil.copy(ROOT / part, tree)
    for path in tree.rglob("*.py"):
        os.utime(path, (age, age))
    (tree / "flexlin" / "__init__.py").chmod(0o600 if age else 0o644)
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tree.parent)]
    return subprocess.run(build, cwd=tree, env={**os.environ, **environment}, capture_output=True, text=True)


@pytest.mark.slow
def test_the_wheel_has_the_same_bytes_each_time_and_serves_every_python(tmp_path):
    """From two places, at two times, with other rights on the files: one wheel, whose library no C source travels with."""
    small = "-DSIZES=2:1 -DLEVELS= -DCMAKE_BUILD_TYPE=None"  # all of it would take a minute
    for age in (0, 10_000):
        build = build_wheel(tmp_path / f"{age}" / "tree", age, CMAKE_ARGS=small)
        assert build.returncode == 0, build.stderr
    one, other = tmp_path.glob("*/*.whl")
    assert one.name == other.name
    assert one.name.startswith("flexlin-0.2.0-py3-none-")
    assert one.read_bytes() == other.read_bytes()
    assert one.stat().st_size > 100_000
    names = zipfile.ZipFile(one).namelist()
    assert {"flexlin/models/single-link.toml", "flexlin/_core/built/baseline.so"} <= set(names)
    assert not [name for name in names if re.search(r"_core.*(\.[ch]$|sanitized)", name)]


@pytest.mark.slow
def test_without_a_compiler_the_sources_say_so_in_a_sentence(tmp_path):
    build = build_wheel(tmp_path / "tree", CC=str(tmp_path / "cc"))
    assert build.returncode == 1
    said = "there is no C compiler: install gcc or clang, or a wheel of flexlin."
    assert build.stderr.splitlines()[-1].endswith(said)
