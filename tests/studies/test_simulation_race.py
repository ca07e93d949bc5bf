"""The study of simulation against SciPy, small: every program reaches the same motion. Times are printed, never tested."""

import pytest


@pytest.mark.slow
def test_simulation_race(study, tmp_path, pictures):
    data = study("simulation_race").main(size="small", out=tmp_path)
    by_program = {(row["program"], row["tol"]): row["error"] for row in data["rows"]}
    assert by_program[("flexlin, with its error", 1e-4)] < 1e-4
    theirs = {error for (program, tol), error in by_program.items() if program.startswith("LSODA") and tol == 1e-12}
    assert max(theirs) < 1e-8  # LSODA's error is some 100 times its tolerance here
    (own,) = data["compared"]
    assert set(own["peers"]) == {program for program, _ in by_program if program.startswith("LSODA")}
    assert set(pictures.curves("simulation_race.svg")) == {program for program, _ in by_program}
