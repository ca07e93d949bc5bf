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
def test_every_locked_package_has_its_hashes(lock: Path) -> None:
    """Every requirement is pinned, and followed by SHA-256 sums and nothing else."""
    text = re.sub(r"^#.*\n", "", lock.read_text(encoding="utf-8"), flags=re.MULTILINE).replace("\\\n", " ")
    lines = [line for line in text.splitlines() if line.strip()]
    assert len(lines) >= 30
    for line in lines:
        pin, *hashes = re.split(r"\s+--hash=", line.strip())
        assert re.fullmatch(r"[\w.-]+==[\w.]+( ; [^#]+)?", pin), pin
        assert hashes, pin
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", one) for one in hashes), pin


def test_locks_agree_and_make_installs_nothing_else() -> None:
    """One version of a package in all locks; pip is called with --require-hashes, or for flexlin itself without network needs."""
    pins: dict[str, str] = {}
    for lock in LOCKS:
        for name, version in re.findall(
            r"^([\w.-]+==[\w.]+)( ;[^\\\n]+)?", lock.read_text(encoding="utf-8"), flags=re.MULTILINE
        ):
            key = name.partition("==")[0] + version.strip()
            assert pins.setdefault(key, name) == name, lock.name
    calls = [line for line in (ROOT / "Makefile").read_text(encoding="utf-8").splitlines() if "$(PIP) " in line]
    assert len(calls) >= 4
    assert all(
        "--require-hashes -r requirements/" in call or "--no-deps --no-build-isolation" in call for call in calls
    )
    assert "pip install" not in "".join(calls)


def copy_sources(tree: Path) -> None:
    """What a wheel is built from, into a new folder."""
    tree.mkdir(parents=True)
    for part in ("flexlin", "models"):
        shutil.copytree(ROOT / part, tree / part, ignore=shutil.ignore_patterns("__pycache__", "built"))
    for part in ("pyproject.toml", "README.md", "LICENSE", "CMakeLists.txt", "hatch_build.py"):
        shutil.copy(ROOT / part, tree)


def build_wheel(tree: Path, **environment: str) -> subprocess.CompletedProcess:
    """Build a wheel beside the sources."""
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tree.parent)]
    return subprocess.run(build, cwd=tree, env={**os.environ, **environment}, capture_output=True, text=True)


@pytest.mark.slow
def test_the_wheel_has_the_same_bytes_each_time_and_serves_every_python(tmp_path: Path) -> None:
    """From two places, at two times, with other rights on the files: one wheel, whose library no C source travels with."""
    pytest.importorskip("hatchling")
    wheels = []
    for name, age in (("one", 10_000), ("two", 1_000_000)):
        tree = tmp_path / name / "tree"
        copy_sources(tree)
        for path in tree.rglob("*.py"):
            os.utime(path, (age, age))
        (tree / "flexlin" / "__init__.py").chmod(0o600 if name == "one" else 0o644)
        build = build_wheel(
            tree, CMAKE_ARGS="-DSIZES=2:1 -DLEVELS= -DCMAKE_BUILD_TYPE=None"
        )  # all of it would take a minute
        assert build.returncode == 0, build.stderr
        (wheel,) = (tmp_path / name).glob("*.whl")
        assert wheel.name.startswith("flexlin-0.2.0-py3-none-")
        wheels.append(wheel.read_bytes())
    assert len(wheels[0]) > 100_000
    assert wheels[0] == wheels[1]
    names = zipfile.ZipFile(wheel).namelist()
    assert "flexlin/models/single-link.toml" in names
    assert "flexlin/_core/built/baseline.so" in names
    assert not [name for name in names if "_core" in name and (name.endswith((".c", ".h")) or "sanitized" in name)]


@pytest.mark.slow
def test_without_a_compiler_the_sources_say_so_in_a_sentence(tmp_path: Path) -> None:
    pytest.importorskip("hatchling")
    copy_sources(tmp_path / "tree")
    build = build_wheel(tmp_path / "tree", CC=str(tmp_path / "cc"))
    assert build.returncode == 1
    assert build.stderr.splitlines()[-1].endswith(
        "there is no C compiler: install gcc or clang, or a wheel of flexlin."
    )
