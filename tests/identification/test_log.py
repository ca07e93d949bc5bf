"""Logs: what is read, what is said of what is missing, and broken ones."""

import io
import json

import numpy as np
import pandas
import pytest
import xarray

import flexlin as fl
from flexlin.cli import main
from tests.torture.inputs import boast

T = np.arange(200) * 0.005
TABLE = {
    "time": "ms",
    "second": 0.001,
    "inputs": {"q1": {"column": "current_A", "gain": 8.9}},
    "outputs": {"q1": {"column": "angle_rad"}},
}
SCENE = fl.load_scene("single-link", {"log": TABLE})
STIFF = fl.load_scene("single-link", {"links.0.modes": 0, "designs": []})
COLUMNS = {"ms": 1000 * T, "current_A": np.sin(T), "angle_rad": np.cos(T), "other": T}


FRAME, DATASET = pandas.DataFrame(COLUMNS), xarray.Dataset({k: ("row", v) for k, v in COLUMNS.items()})


def pack(columns):
    """The bytes of an .npz."""
    made = io.BytesIO()
    np.savez(made, **columns, allow_pickle=True)
    return made.getvalue()


KINDS = {
    "log.csv": FRAME.to_csv(index=False).encode(),
    "log.npz": pack(COLUMNS),
    "log.nc": bytes(DATASET.to_netcdf(engine="scipy")),
    "frame": FRAME,
    "dataset": DATASET,
    "columns": COLUMNS,
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_file_and_table_is_read_alike(kind, tmp_path):
    given = KINDS[kind]
    if isinstance(given, bytes):
        (tmp_path / kind).write_bytes(given)
        given = tmp_path / kind
    log = fl.read_log(given, SCENE)
    assert np.allclose(log.time, T)
    assert log.step == pytest.approx(0.005)
    assert np.allclose(log.inputs["q1"], np.sin(T))
    assert np.allclose(log.outputs["q1"], np.cos(T))
    assert log.columns == {"q1": "angle_rad"}


def test_parts_and_every_tenth_row():
    log = fl.read_log(COLUMNS, SCENE)
    assert log.part(0.1, 0.6).time[[0, -1]] == pytest.approx([0.1, 0.6])
    assert len(log.thinned(10).time) == 20
    assert sorted(log.to_xarray()) == ["q1", "q1_input"]


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        (COLUMNS | {"ms": 1000 * np.r_[T[:7], T[6], T[8:]]}, "increase; got 0.03 s before 0.03 s in rows 7 and 8"),
        ({"ms": T, "current_A": T}, "lacks columns.*expected angle_rad"),
        ({k: v[:10] for k, v in COLUMNS.items()}, "too short; got 10 samples, expected 20"),
        (COLUMNS | {"angle_rad": np.full(200, np.nan)}, "q1 has no reading"),
        (COLUMNS | {"angle_rad": np.array([*"ab"] * 100)}, "angle_rad is not numeric; got 'a' in row 1"),
        (COLUMNS | {"current_A": np.where(T[3] == T, np.inf, T)}, "current_A is not numeric; got .inf. in row 4"),
        (COLUMNS | {"angle_rad": 1e160 * T}, r"angle_rad is not numeric; got '5\.0*4?e.157' in row 2"),
        (COLUMNS | {"ms": np.where(T[3] == T, np.nan, T)}, "time is not finite"),
        (COLUMNS | {"angle_rad": T[:-1]}, "wrong shape"),
        (COLUMNS | {"angle_rad": T + 1j}, r"angle_rad is not numeric; got '1j' in row 1"),
        (None, "this is no log; got None, expected the name of a file, or columns by name"),
    ],
)
def test_broken_logs_are_refused_in_words(columns, said):
    with pytest.raises(fl.errors.ArgumentError, match=said):
        fl.read_log(columns, SCENE)


LINES = FRAME.to_csv(index=False).splitlines()
TWICE = LINES[0].replace("other", "angle_rad")
ORDER = "parted by semicolons or tabs, not by commas"
FILES = [
    ([TWICE, *LINES[1:]], "cannot be read.*several columns named angle_rad"),
    (["", "# a note", TWICE.replace(",", ", "), *LINES[1:]], "cannot be read.*several columns named angle_rad"),
    ([LINES[0], *(line + ",7" for line in LINES[1:])], "cannot be read.*header"),
    ([*LINES[:50], LINES[50] + ",7", *LINES[51:]], "cannot be read.*Expected 4 fields in line 51, saw 5"),
    ([line.replace(",", ";") for line in LINES], f"cannot be read.*{ORDER}"),
    ([line.replace(",", "\t") for line in LINES], f"cannot be read.*{ORDER}"),
    (["ms" + ",q" * 50_000, "0," * 50_000 + "0"], "cannot be read.*50000 columns"),
    ([""], "No columns"),
    (["ms,current_A,angle_rad"], "too short; got 0 samples"),
    (["ms,current_A,angle_rad", "s,A,rad"], "ms is not numeric; got 's' in row 1"),
    ("ms,current_A,angle_rad\n".encode("utf-16"), "got bytes that are no text in UTF-8, expected a CSV file in UTF-8"),
    (boast(10**12, ("ms", "current_A", "angle_rad")), "cannot be read.*less than it says"),
    (pack(COLUMNS | {"current_A": np.array([{}] * len(T), dtype=object)}), "cannot be read.*objects"),
]


@pytest.mark.parametrize(("content", "said"), FILES)
def test_files_that_hold_no_log_are_refused(content, said, tmp_path):
    """Pandas takes the first of two columns, and the first cell of longer rows for their name: all others shift; it takes time by the
    square of columns of one name. NumPy asks for the memory that the head of an array states.
    """
    data = content if isinstance(content, bytes) else "\n".join(content).encode()
    path = tmp_path / ("log.npz" if data.startswith(b"PK") else "log.csv")
    path.write_bytes(data)
    with pytest.raises(fl.errors.ArgumentError, match=said):
        fl.read_log(path, SCENE)


def test_rows_that_end_in_a_comma_are_read(tmp_path):
    (tmp_path / "log.csv").write_text("\n".join([LINES[0], *(line + "," for line in LINES[1:])]))
    assert np.array_equal(fl.read_log(tmp_path / "log.csv", SCENE).outputs["q1"], np.cos(T))


@pytest.mark.parametrize("second", [1.0, 1e25])
def test_windows_of_fewer_than_twenty_samples_are_refused(second):
    log = fl.Log(T * second, {"q1": T}, {"q1": T})
    with pytest.raises(fl.errors.ArgumentError, match=r"windows of the log are too short; got 0\.09 s"):
        fl.predict(SCENE, log, window=0.09)


def test_times_that_are_no_seconds_are_told():
    """Times in ms were answered with windows that are too short, and nothing else."""
    said = "say second = 0.001"
    log = fl.Log(1000 * T, {"q1": T}, {"q1": T})
    assert said in log.notes[0]
    with pytest.raises(fl.errors.ArgumentError, match=f"windows of the log are too short.*{said}"):
        fl.predict(SCENE, log)
    assert said not in " ".join(fl.Log(T, {"q1": T}, {"q1": T}).notes)


@pytest.mark.parametrize("readings", [1e-100 * T, 1e-300 * T, 0.3 + 1e-12 * T])
def test_what_no_sensor_resolves_is_constant(readings):
    """Residuals over a deviation of 1e-100 overflowed, and a column that only rounding moved had the largest weight of all."""
    log = fl.Log(T[:60], {"q1": np.sin(9 * T[:60])}, {"q1": readings[:60], "tip.y": T[:60]})
    with np.errstate(all="raise"):
        found = fl.identify(STIFF, log, ["effects.payload.mass"], starts=1)
    assert np.isnan(found.fit["q1"])
    assert "; q1 is constant, so nothing can be learnt from it" in found.status


def test_readings_in_memory_are_checked_as_those_of_files():
    for given, said in (([1e160] * 200, "'1e.160' in row 1"), ([[1], [2, 3]] * 100, r"'\[1\]'")):
        with pytest.raises(fl.errors.ArgumentError, match=f"q1 is not numeric; got {said}"):
            fl.Log(T, {"q1": T}, {"q1": given})


def test_a_log_without_a_stretch_that_is_long_enough_says_what_is_missing():
    log = fl.Log(T, {"q1": np.where(np.arange(200) % 10, T, np.nan)}, {"q1": T})
    with pytest.raises(fl.errors.ArgumentError, match=r"20 readings of the input q1 are missing.*fill short gaps"):
        fl.predict(SCENE, log)


def test_what_is_fitted_over_all_of_a_window_is_no_prediction():
    log = fl.Log(T, {"q1": T}, {"q1": T})
    assert "nothing is predicted but what was fitted" in fl.predict(STIFF, log, window=0.15).status
    assert "nothing is predicted" not in fl.predict(STIFF, log).status


def test_ten_million_samples_are_refused_before_anything_is_done():
    time = np.arange(10**7, dtype=float)
    with pytest.raises(fl.errors.TooLarge, match="too many samples; got 10000000, expected 2000000"):
        fl.Log(time, {"q1": time}, {"q1": time})


def test_what_is_odd_is_said():
    log = fl.Log(np.r_[T[:60], T[90:]], {"q1": np.ones(170)}, {"r1": np.r_[np.nan, T[:169]]})
    assert log.notes == (
        "1 gap, the longest of 0.155 s at 0.295 s: no prediction goes over one, so log that part again if it matters",
        "q1 is constant, so nothing can be learnt from it",
        "1 readings of r1 are missing and are not used",
    )
    assert [one.stop - one.start for one in log.stretches] == [60, 110]


def test_what_is_odd_of_an_input_is_said_beside_an_output_of_its_name():
    """Both groups were joined by name, so that nothing was said of the input."""
    log = fl.Log(T, {"q1": np.r_[np.nan, np.ones(199)], "q2": 0 * T}, {"q1": np.cos(T)})
    assert log.notes == (
        "1 readings of the input q1 are missing and are not used",
        "the input q1 is constant, so nothing can be learnt from it",
        "q2 is constant, so nothing can be learnt from it",
    )


def test_a_gauge_whose_bias_is_taken_reads_nothing_at_first():
    gauge = {"column": "gauge", "sensor": "strain", "link": 0}
    scene = fl.load_scene("single-link", {"log": TABLE | {"outputs": {"base": gauge, "q1": {"column": "angle_rad"}}}})
    rest = np.where(T < 0.5, 0.0, 1.0)
    log = fl.read_log(COLUMNS | {"gauge": rest * T, "angle_rad": rest * T}, scene)
    assert np.isnan(log.outputs["base"]).tolist() == (T < 0.5).tolist()
    assert np.isfinite(log.outputs["q1"]).all()  # an encoder at rest repeats itself
    assert np.isfinite(fl.read_log(COLUMNS | {"gauge": 0 * T}, scene).outputs["base"]).all()


def test_files_that_are_none_and_scenes_without_a_table(tmp_path):
    for name, said in (("nothing.csv", "No such file"), (".", "no regular file"), ("a\0b", "null byte")):
        with pytest.raises(fl.errors.ArgumentError, match=f"cannot be read.*{said}"):
            fl.read_log(tmp_path / name, SCENE)
    with pytest.raises(fl.errors.ArgumentError, match="does not say what the columns"):
        fl.read_log(COLUMNS, fl.load_scene("single-link"))
    with pytest.raises(fl.errors.ArgumentError, match="no inputs"):
        fl.Log(T, {}, {"q1": T})


@pytest.mark.slow
def test_the_command_writes_the_fit_of_each_column(tmp_path, capsys):
    path, out = tmp_path / "log.csv", tmp_path / "out"
    FRAME.to_csv(path, index=False)
    table = 'log={time="ms",second=0.001,inputs={q1={column="current_A"}},outputs={q1={column="angle_rad"}}}'
    words = ["single-link", "--set", table, "links.0.modes=1", "--log", str(path), "--window", "0.5"]
    assert main(["predict", *words, "--out", str(out)]) == 0
    found = json.loads((out / "predict.json").read_text())
    assert list(found["fit"]) == ["angle_rad"]
    assert len(found["starts"]) == 2
    assert "angle_rad" in (out / "predict.html").read_text()
    assert "angle_rad: fit" in capsys.readouterr().out
