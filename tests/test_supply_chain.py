"""What is installed is what was locked, and what is built is the same each time."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LOCKS = sorted((ROOT / "requirements").glob("*.txt"))


@pytest.mark.parametrize("lock", LOCKS, ids=lambda path: path.stem)
def test_every_locked_package_has_its_hashes(lock: Path) -> None:
    """Every requirement is pinned, and followed by SHA-256 sums and nothing else."""
    text = re.sub(r"^#.*\n", "", lock.read_text(encoding="utf-8"), flags=re.MULTILINE).replace("\\\n", " ")
    lines = [line for line in text.splitlines() if line.strip()]
    assert len(lines) > 30
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


def test_the_wheel_has_the_same_bytes_each_time(tmp_path: Path) -> None:
    """From two places, at two times, with other rights on the files: one wheel."""
    pytest.importorskip("hatchling")
    wheels = []
    for name, age in (("one", 10_000), ("two", 1_000_000)):
        tree = tmp_path / name / "tree"
        tree.mkdir(parents=True)
        for part in ("flexlin", "models"):
            shutil.copytree(ROOT / part, tree / part, ignore=shutil.ignore_patterns("__pycache__", "*.so"))
        for part in ("pyproject.toml", "README.md", "LICENSE", "CMakeLists.txt", "hatch_build.py"):
            shutil.copy(ROOT / part, tree)
        for path in tree.rglob("*.py"):
            os.utime(path, (age, age))
        (tree / "flexlin" / "__init__.py").chmod(0o600 if name == "one" else 0o644)
        build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path / name)]
        subprocess.run(build, cwd=tree, check=True, capture_output=True)
        (wheel,) = (tmp_path / name).glob("*.whl")
        wheels.append(wheel.read_bytes())
    assert len(wheels[0]) > 100_000
    assert wheels[0] == wheels[1]
