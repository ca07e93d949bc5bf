"""One thread for linear algebra: the matrices are small, and two noisy cores are shared; what tests share is made in one process."""

import os
import re
from functools import cache
from pathlib import Path

import pytest

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")


@cache
def find_group(file: Path) -> str:
    """Which tests share a process: those of files with one xdist_group, or of a file with a fixture of its own; empty where none do."""
    text = file.read_text(encoding="utf-8")
    named = re.search(r'^pytestmark = pytest\.mark\.xdist_group\("(.+)"\)$', text, flags=re.MULTILINE)
    return named[1] if named else str(file) * ('@pytest.fixture(scope="module")' in text)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object | None:
    """A scheduler of `--dist loadgroup`: that of pytest-xdist 3.8 sees no group, for pytest 9.2 lets no plugin change a test's name."""
    if config.getvalue("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadScopeScheduling

    quick = config.getoption("markexpr").startswith("not slow")  # no file takes long, and few units cost little

    class Groups(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.partition("::")[0]
            return find_group(config.rootpath / file) or (file if quick else nodeid)

    return Groups(config, log)
