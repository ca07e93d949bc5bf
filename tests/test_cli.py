"""The command line: exit codes, files, and words."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray

from flexlin.cli import COMMANDS, main
from flexlin.scene import builtin_scenes
from tests.closed_arm import opened
from tests.test_stability_boundary import distances


def test_results_of_different_scenes_go_to_different_folders(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mine = tmp_path / "my arm.toml"
    mine.write_text(builtin_scenes()["spinning-link"].read_text(encoding="utf-8"), encoding="utf-8")
    for name in ("spinning-link", str(mine)):
        assert main(["linearize", name, "--points", "8"]) == 0
    assert main(["linearize", "no-such-scene"]) == 2
    assert "wrote out/my arm/coefficients.nc" in capsys.readouterr().out
    assert sorted(path.parent.name for path in tmp_path.rglob("*.npz")) == ["my arm", "spinning-link"]


def test_linearize_writes_what_the_library_samples(tmp_path):
    assert main(["linearize", "single-link", "--points", "8", "--out", str(tmp_path)]) == 0
    lin = opened("single-link")[1]
    with xarray.open_dataset(tmp_path / "coefficients.nc", engine="scipy") as data:
        t = data["time"].values
        assert np.array_equal(data["K"].values, lin.K(t))
        assert [str(name) for name in data["row"].values] == list(lin.names)
        assert data["time"].attrs["units"] == "s"
        assert json.loads(data.attrs["scene"])["links"][0]["length"] == 0.96
    with np.load(tmp_path / "coefficients.npz") as arrays:
        assert np.array_equal(arrays["M"], lin.M(t))


@pytest.mark.slow
def test_design_writes_the_gains(tmp_path, capsys):
    scene = ["design", "khang-2019", "--points", "8", "--out", str(tmp_path), "--require"]
    assert main([*scene, "linear-stable"]) == 0
    assert main([*scene, "stable"]) == 3  # its link would bend by 0.6 of its length
    assert "stable, but the linear model does not hold here" in capsys.readouterr().out
    assert main([*scene, "stable", "--set", "payload_mass=0.01", "links.0.mass_per_length=0.03"]) == 0
    assert "does not hold" not in capsys.readouterr().out
    with xarray.open_dataset(tmp_path / "gains.nc", engine="scipy") as data:
        assert data["K"].shape == (1, 8, 1, 4)


@pytest.mark.slow
def test_a_chart_over_one_parameter_finds_its_critical_values(tmp_path, capsys):
    over = ["--over", "motion.joints.0.rate=3.5000001:4.1:3", "--set", "motion.joints.0.rate=5"]
    assert main(["chart", "spinning-link", *over, "effects.gravity.acceleration=5.0", "--out", str(tmp_path)]) == 0
    with xarray.open_dataset(tmp_path / "chart.nc", engine="scipy") as data:
        assert data["rate_of_joint_1"].attrs["units"] == ""  # the scene is dimensionless
        assert data["critical_value"].values.round(4).tolist() == [3.6424, 3.9659]
    said, page = capsys.readouterr().out, (tmp_path / "chart.html").read_text()
    assert re.search("rate of joint 1: becomes unstable at 3.642.*−1.358 from the scene's own", said)
    for words in ("flexlin chart spinning-link", "=3.5000001:4.1:3<", "Campbell diagram", "rate of joint 1</text>"):
        assert words in page


@pytest.mark.slow
def test_a_chart_over_two_parameters_is_a_map(tmp_path):
    over = ["--over", "motion.joints.0.rate=2:6:5", "effects.gravity.acceleration=0:20:4"]
    assert main(["chart", "spinning-link", *over, "--out", str(tmp_path)]) == 0
    page = (tmp_path / "chart.html").read_text()
    for words in ("fill:var(--unstable)", "fill:var(--undecided)", "principal, order", "url(#hatch", "data-probe="):
        assert words in page
    with np.load(tmp_path / "chart.npz") as arrays:
        assert arrays["verdict"].shape == (5, 4)
        curve = np.stack([arrays["boundary_rate_of_joint_1"], arrays["boundary_gravity_acceleration"]], axis=1)
    assert len(curve) > 100
    assert distances(curve).max() < 4e-3


def test_export_writes_what_other_tools_read(tmp_path):
    assert main(["export", "khang-2019", "--points", "8", "--out", str(tmp_path)]) == 0
    names = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    gains = {f"{folder}/{name}" for folder in ("c-own", "c-periodic-lqr") for name in ("gain.c", "gain.h", "main.c")}
    system = {"flexlin-results.json", "load_arm.m", "system.mat", "system.nc", "system.npz"}
    assert names == gains | system | {"c/linearization.c", "c/linearization.h", "c/main.c"}
    with np.load(tmp_path / "system.npz") as arrays:
        assert (arrays["A"].shape, arrays["K_0"].shape) == ((8, 4, 4), (8, 1, 4))


def export_designs(folder: Path, *names: str) -> int:
    """Export khang-2019 with periodic designs of these names, each with another weight."""
    table = '{{name="{}", kind="periodic-lqr", state_weight=[{}, 1, 1, 1], input_weight=[0.1]}}'
    designs = [table.format(name, i) for i, name in enumerate(names, start=1)]
    changes = f"designs=[{', '.join(designs)}]"
    return main(["export", "khang-2019", "--set", changes, "--points", "8", "--out", str(folder)])


@pytest.mark.parametrize("names", [("A b", "a-B"), ("Régler 1", "r gler 1"), ("design 2", "регулятор")])
def test_designs_that_would_share_a_folder_are_refused(tmp_path, capsys, names):
    """The second gain would silently replace the first: both are named, and nothing is written."""
    assert export_designs(tmp_path / "new", *names) == 2
    message = capsys.readouterr().err
    assert all(repr(name) in message for name in names)
    assert not (tmp_path / "new").exists()


@pytest.mark.slow
def test_designs_without_latin_letters_have_folders_of_their_own(tmp_path):
    """Each folder holds the gain of its own design."""
    assert export_designs(tmp_path, "регулятор", "制御 1", "2", "×" * 300) == 0
    folders = sorted(path.name for path in tmp_path.iterdir() if path.is_dir())
    assert folders == ["c", "c-2", "c-design-1", "c-design-2", "c-design-4", "c-own"]
    assert len({(tmp_path / folder / "gain.c").read_text() for folder in folders[1:]}) == 5


def test_the_program_ends_quietly_when_nobody_reads():
    program = f"{sys.executable} -m flexlin list | true"
    assert subprocess.run(["bash", "-c", program], capture_output=True, check=False).stderr == b""


BESIDES = {"xarray", "pandas", "control", "matplotlib", "scipy.integrate"}
"""Heavy libraries that neither a verdict nor a design needs; `control` is 1.2 s, and brings matplotlib; each of SciPy's 0.2 s.

Assignments of modes to each other are left to scipy.optimize, which brings scipy.sparse."""
COMMANDS_IN_TURN = """
import sys
from flexlin.cli.program import main, run_program
main(["list"])
print(sorted({"numpy", "scipy", "casadi", *%r} & set(sys.modules)))
code = run_program()
print(sorted(%r & set(sys.modules)), code)
"""


@pytest.mark.slow
def test_no_command_loads_a_library_that_it_does_not_need_and_a_terminal_of_ascii_is_served(tmp_path):
    """`list` loads no numerical library; a report of an undecided loop with designs neither python-control nor matplotlib.

    Signs and powers of numbers became question marks: ?2.52 for -2.52 and 1.3?10? s for 1.3x10^6 s.
    """
    weights = "state_weight=[1, 1], input_weight=[10]"
    kinds = ", ".join(f'{{name="{kind}", kind="{kind}-lqr", {weights}}}' for kind in ("periodic", "frozen"))
    free = ["links.0.modes=0", "effects.gravity=off", "control={}", f"designs=[{kinds}]"]
    code = COMMANDS_IN_TURN % (BESIDES, BESIDES)
    command = [sys.executable, "-c", code, "report", "single-link", "--set", *free, "--out", str(tmp_path)]
    run = subprocess.run(command, capture_output=True, check=False, env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert run.returncode == 0, run.stderr
    assert b"Traceback" not in run.stderr
    lines = run.stdout.splitlines()
    assert [line for line in lines if line.startswith(b"[")] == [b"[]", b"[] 0"]
    zero, rate = rb"zero to within \d?(\.\d)?x10\^-\d+ 1/s", rb", -\d\.\d+ \+- \dx10\^-\d+ 1/s"
    for said in (b"undecided", b"periodic.*stable", zero, rate):
        assert any(re.search(said, line) for line in lines), said


def test_completion_knows_every_command(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--print-completion", "bash"])
    script = capsys.readouterr().out
    assert end.value.code == 0
    assert all(f"_shtab_flexlin_{name}_option_strings" in script for name in COMMANDS)
    assert subprocess.run(["bash", "-n"], input=script, text=True, check=False).returncode == 0


def test_what_to_type_next_can_be_typed(tmp_path, monkeypatch, capsys):
    """A scene's name with a space was printed without quotes, so that the printed command failed."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "my arm"]) == 0
    check, _ = capsys.readouterr().out.split("next: ")[1].split(";")
    assert main(shlex.split(check)[1:]) == 0


@pytest.mark.parametrize("name", ["check", "predict", "identify", "cost", "linearize"])
def test_a_command_that_no_tolerance_changes_says_what_it_takes(name, capsys):
    """What was left over met the usage of the program, which names no option of the command."""
    needed = {"predict": ["--log", "log.csv"], "identify": ["--log", "log.csv", "--free=links.0.length"]}
    with pytest.raises(SystemExit) as end:
        main([name, "single-link", *needed.get(name, []), "--tol", "1e-6"])
    said = capsys.readouterr().err
    assert end.value.code == 2
    assert said.startswith(f"usage: flexlin {name} ")
    assert said.endswith(f"flexlin {name}: error: unrecognized arguments: --tol 1e-6\n")
