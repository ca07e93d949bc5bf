"""The study of claimed errors, small: no claim is missed by more than its factor, no verdict is wrong."""

import pytest


@pytest.mark.slow
def test_own_error(study, tmp_path):
    module = study("own_error")
    result = module.main("small", tmp_path, workers=1)
    rows, total = result["rows"], result["total"]
    assert [row["kind"] for row in rows] == list(module.COUNTS)
    assert sum(row["cases"] for row in rows) >= len(rows)
    assert sum(row["crashed"] for row in rows) == 0
    assert sum(row["wrong"] for row in rows) == 0
    assert total.missed3 == 0
    assert total.missed <= 1
    assert total.answered > 0.8 * total.cases
    assert (tmp_path / "own_error.json").stat().st_size > 1000


def test_the_table_counts_what_the_judge_found(study):
    module = study("own_error")
    found = [
        module.Outcome(2, 1e-9, (0.5, 4.0), (2.0, 10.0), verdict="stable", wrong="stable, growth is 1", seconds=0.1),
        module.Outcome(2, 1e-9, (1.5,), (6.0,), hidden=1, verdict="undecided", seconds=0.2),
        module.Outcome(2, 1e-9, refusal="TooManySegments", seconds=0.3),
        module.Outcome(2, 1e-9, crash="ValueError: no", seconds=0.4),
    ]
    row = module.summed("some", found)
    assert (row.cases, row.answered, row.refused, row.crashed, row.wrong) == (4, 2, 1, 1, 1)
    assert (row.exponents, row.missed, row.missed3, row.worst, row.overestimate) == (3, 2, 1, 4.0, 6.0)
    assert row.undecided == 1
    lines = module.findings("some", 1, found)
    assert len(lines) == 3
    assert "1000001: n = 2" in lines[1]
