"""One analysis of the single link for all tests of the report."""

import pytest

import flexlin as fl
from flexlin.answers import Analysis, analyse


@pytest.fixture(scope="session")
def single_link() -> Analysis:
    return analyse(fl.load_scene("single-link", {"links.0.modes": 1, "designs": []}))
