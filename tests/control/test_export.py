"""Exports: what another tool reads is what flexlin computed."""

import re
import shutil
import subprocess

import control
import numpy as np
import pytest
import scipy.io
import xarray

import flexlin as fl
from flexlin.control import gain_schedule, gain_source, linearization_source, periodic_lqr, periodic_plant, save
from flexlin.control.export.files import Labels, matlab_script
from flexlin.errors import ArgumentError
from tests.closed_arm import opened
from tests.control.test_c_controllers import COMPILER, needs_compiler
from tests.periodic.dense import at, integrate

OCTAVE = shutil.which("octave-cli")


@pytest.fixture(scope="module")
def lin():
    return opened()[1]


@pytest.fixture(scope="module")
def made(lin):
    return periodic_lqr(lin.periodic_system(), np.diag([1.0, 1.0, 1.0, 0.01, 0.01, 0.01]), 10 * np.eye(1), tol=1e-8)


def test_gain_schedule_runs_in_python_control(made):
    """A slow periodic plant under its own schedule, against the transition of the closed loop."""

    stiffness = lambda t: (1 + 0.5 * np.cos(t))[:, None, None]  # noqa: E731
    system = fl.PeriodicSystem.from_second_order(np.eye(1), 0.1 * np.eye(1), stiffness, 2 * np.pi, np.eye(1))
    design = periodic_lqr(system, np.eye(2), np.eye(1))
    loop = control.feedback(periodic_plant(system), gain_schedule(design), 1)
    t, x0, exactly = np.linspace(0, 2 * np.pi, 21), np.array([1.0, -0.5]), {"rtol": 1e-9, "atol": 1e-11}
    response = control.input_output_response(loop, t, np.zeros((loop.ninputs, 21)), x0, solve_ivp_kwargs=exactly)
    known = integrate(lambda t, x: at(design.closed_loop.A, t) @ x, x0, t)
    assert np.abs(response.outputs.T[:, :2] - known).max() < 1e-7


@pytest.mark.parametrize("ending", ["npz", "mat", "nc"])
def test_files_hold_the_same_numbers(lin, made, tmp_path, ending):
    system = lin.periodic_system()
    path = save(system, tmp_path / f"arm.{ending}", (made,), phases=16)
    t = lin.period * np.arange(16) / 16
    if ending == "npz":
        data = np.load(path)
    elif ending == "mat":
        found = scipy.io.loadmat(path)
        assert found["A"].shape == (system.n, system.n, 16)  # MATLAB's order: rows, columns, then time
        one = found["designs"].ravel()[0]
        assert str(one["name"][0]) == made.name
        data = {key: np.moveaxis(found[key], -1, 0) for key in "AB"}
        data |= {f"{key}_0": np.moveaxis(one[key], -1, 0) for key in "KX"}
    else:
        with xarray.open_dataset(path, engine="scipy") as opened:
            data = {key: opened[key].values for key in opened.variables}
            assert all("long_name" in opened[key].attrs and "units" in opened[key].attrs for key in "AB")
            assert opened["K_0"].attrs["design"] == made.name
            assert opened["time"].attrs["units"] == opened.attrs["period_units"] == "s"
    for name, exact in {"A": system.A, "B": system.B, "K_0": made.K, "X_0": made.X}.items():
        np.testing.assert_array_equal(data[name], exact(t))
    with pytest.raises(ArgumentError, match="ending"):
        save(system, tmp_path / "arm.txt")


def test_the_matlab_script_reads_what_the_file_holds(lin, made, tmp_path):
    script = matlab_script(save(lin.periodic_system(), tmp_path / "system.mat", (made,), 8, lin), 1).read_text()
    data, asked = scipy.io.loadmat(tmp_path / "system.mat"), set(re.findall(r"data\.(\w+)", script))
    assert {"A", "B", "t", "states", "state_units", "inputs", "designs"} <= asked <= set(data)
    assert set(re.findall(r"data\.designs\(i\)\.(\w+)", script)) <= set(data["designs"].dtype.names)
    assert [str(name[0]) for name in data["states"].ravel()] == list(Labels.of(lin).states)
    assert (script.count("function "), script.count("\nend\n")) >= (2, 2)
    assert "'system.mat'" in script


@pytest.mark.slow
@pytest.mark.skipif(OCTAVE is None, reason="no Octave, which runs MATLAB's scripts")
def test_the_matlab_script_gives_the_loop_between_samples(lin, made, tmp_path):
    matlab_script(save(lin.periodic_system(), tmp_path / "arm.mat", (made,), lin=lin), designs=1)
    line = f"cd('{tmp_path}'); arm = load_arm(); K = arm.gain{{1}}; t = {lin.period + 0.123}; printf('%.15g ', arm.A(t) - arm.B(t) * K(t));"
    text = subprocess.run([OCTAVE, "--quiet", "--eval", line], capture_output=True, text=True, check=True).stdout
    right = made.closed_loop.A(np.array([0.123]))[0]
    found = np.array(text.split(), dtype=float).reshape(right.shape, order="F")
    np.testing.assert_allclose(found, right, atol=1e-6 * np.abs(right).max())


def run_compiled(files, phase):
    """Compile the C sources with their main, run it at a phase, and read its named outputs."""
    program, sources = files[0].parent / "program", [file for file in files if file.suffix == ".c"]
    subprocess.run([COMPILER, "-O1", *sources, "-lm", "-o", program], check=True)
    text = subprocess.run([program, repr(phase)], capture_output=True, text=True, check=True).stdout
    return {line.split()[0]: np.array(line.split()[1:], dtype=float) for line in text.splitlines()}


@needs_compiler
def test_compiled_programs_print_what_python_computes(lin, made, tmp_path):
    exact = lin.sample(np.array([0.37 * lin.period]))
    found = run_compiled(linearization_source(lin, tmp_path), 0.37)
    for name in ("M", "D", "K", "h", "B", "tau"):
        np.testing.assert_allclose(found[name], getattr(exact, name)[0].T.ravel(), rtol=1e-13, atol=1e-13)
    layout = (tmp_path / "linearization.h").read_text().partition("*/")[0]
    for word in (*(f"{name} ({lin.n} x " for name in "MhB"), *lin.names, f"i + {lin.n} * j"):
        assert word in layout
    gain = made.K(np.array([0.999 * lin.period]))[0].T.ravel()
    found = run_compiled(gain_source(made, lin.period, tmp_path), 0.999)["K"]
    np.testing.assert_allclose(found, gain, rtol=1e-6, atol=1e-7 * np.abs(gain).max())


def test_python_control_systems_bear_the_arms_names(lin):
    labels, t = Labels.of(lin), np.array([0.2 * lin.period])
    frozen = fl.control.to_control(lin, 0.2, np.eye(6)[:1], ["encoder"])
    assert isinstance(frozen, control.StateSpace)
    np.testing.assert_array_equal(frozen.A, lin.A(t)[0])
    np.testing.assert_array_equal(frozen.B, lin.input_matrix(t)[0])
    assert [frozen.state_labels, frozen.input_labels, frozen.output_labels] == [[*labels.states], ["q1"], ["encoder"]]
    assert periodic_plant(lin).state_labels == ["q1", "w11", "w12", "q1_rate", "w11_rate", "w12_rate"]


def test_what_python_control_cannot_take_is_refused(lin):
    """Errors of NumPy's, python-control's and Python's own came through."""
    for outputs in (np.eye(3), np.nan, 1j, [], [["a"] * 6]):
        with pytest.raises(ArgumentError, match=r"^outputs "):
            fl.control.to_control(lin, 0.2, outputs)
    with pytest.raises(ArgumentError, match="outputs"):
        fl.control.to_control(lin, 0.2, np.eye(6), ["encoder"])
    with pytest.raises(ArgumentError, match="phase"):
        fl.control.to_control(lin, 1.0)
    with pytest.raises(ArgumentError, match="tol is not positive; got -1"):
        fl.control.lifted_model(lin, lin.period / 4, tol=-1.0)
