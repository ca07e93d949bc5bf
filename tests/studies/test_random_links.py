"""The study of random links, small: every claim covers the true error. Times are printed, never tested."""

import pytest


@pytest.mark.slow
def test_random_links(study, tmp_path):
    rows = study("random_links").compare_all(size="small", out=tmp_path)
    assert [row.modes for row in rows] == [1]
    assert all(row.miss <= 1 for row in rows)
    assert (tmp_path / "random_links.json").exists()
