"""One thread for linear algebra: the matrices are small, and two noisy cores are shared; what tests share is made in one process."""

import os

import pytest

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests that use a fixture of their module run in one process (`--dist loadgroup`), so that it is made once."""
    for item in items:
        found = getattr(item, "_fixtureinfo", None)
        fixtures = found.name2fixturedefs.values() if found else ()
        if any(fixture[-1].scope == "module" for fixture in fixtures):
            item.add_marker(pytest.mark.xdist_group(item.nodeid.partition("::")[0]))
