"""A damaged store never gives a number that the whole one does not hold: a block is computed again, or the store refused; an incomplete one
goes on, and one that is none is refused."""

import gc
import json
import os
import shutil
import socket
from unittest.mock import Mock

import casadi as ca
import numpy as np
import pytest
import xarray

import flexlin as fl
from flexlin.analyses import compute_here
from flexlin.cli import main
from flexlin.errors import ArgumentError, OutputError
from tests.thinned import thin

pytest.importorskip("zarr")
SCENE = fl.load_scene("single-link", {"links.0.modes": 1, "designs": [], "control": {}})
VALUES = {"effects.payload.mass": np.linspace(0.0, 0.3, 200)}


def sweep_into(store):
    return fl.sweep(SCENE, VALUES, store=store, workers=1)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    path = tmp_path_factory.mktemp("store") / "chart.zarr"
    return path, sweep_into(path)


@pytest.fixture
def store(kept, tmp_path):
    """A copy of the whole store, to be damaged."""
    return shutil.copytree(kept[0], tmp_path / "c.zarr")


def damage(path, kind, rng):
    """Damage one file of a store, chosen at random."""
    files = sorted(file for file in path.rglob("[0-9]*" if kind == "exchanged" else "*") if file.is_file())
    file, other = (files[k] for k in rng.choice(len(files), 2, replace=False))
    data = file.read_bytes()
    if kind == "missing":
        file.unlink()
    elif kind == "exchanged":
        file.write_bytes(other.read_bytes())
        other.write_bytes(data)
    elif kind == "truncated":
        file.write_bytes(data[: int(rng.integers(len(data) + 1))])
    elif kind == "random":
        file.write_bytes(rng.bytes(len(data)))
    elif kind == "endless":
        file.unlink()
        os.mkfifo(file) if rng.integers(2) else file.symlink_to("/dev/zero")
    elif kind == "huge":
        os.truncate(file, 10**8)
    elif kind == "folder":
        file.unlink()
        file.mkdir()
    elif data:
        k = int(rng.integers(len(data)))
        file.write_bytes(data[:k] + bytes([data[k] ^ (1 << int(rng.integers(8)))]) + data[k + 1 :])


KINDS = ["missing", "exchanged", "truncated", "random", "one bit", "endless", "huge", "folder"]


def assert_same(found, whole):
    """To the last bit."""
    for name in whole.variables:
        np.testing.assert_array_equal(found[name].values, whole[name].values)
        if whole[name].dtype.kind == "c":
            assert np.array_equal(np.signbit(found[name].values.imag), np.signbit(whole[name].values.imag))


def sweep_over(store, kept):
    """A sweep over a damaged store gives, and leaves to other programs, what the whole one held, or is refused by the store's name."""
    path, whole = kept
    try:
        found, message = sweep_into(store), ""
    except (OutputError, ArgumentError) as error:
        found, message = whole, str(error)
    assert_same(found, whole)
    if message:
        assert str(store) in message
    else:
        assert_same(*(xarray.open_zarr(place, consolidated=False) for place in (store, path)))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", thin(range(6), 4))
def test_damage_is_computed_again_or_refused(store, kept, kind, seed):
    damage(store, kind, np.random.default_rng(1000 * seed + len(kind)))
    sweep_over(store, kept)


@pytest.mark.parametrize("seed", thin(range(6), 2))
def test_several_damages_at_once_too(store, kept, seed, capfd):
    """And nothing is printed by the libraries that meet them."""
    rng = np.random.default_rng(seed)
    for kind in rng.choice(KINDS, int(rng.integers(2, 7))):
        damage(store, kind, rng)
    sweep_over(store, kept)
    gc.collect()
    assert capfd.readouterr() == ("", "")


def test_a_lost_block_is_told(store):
    (store / "error" / "c" / "0").unlink()
    assert sweep_into(store).attrs["repaired"] == 1
    assert "repaired" not in sweep_into(store).attrs


def test_a_store_of_a_family_holds_each_number_under_its_name_and_why_a_value_is_undecided(tmp_path):
    """In whatever order they are asked for."""
    t, a, b = (ca.SX.sym(name) for name in "tab")
    family = fl.PeriodicFamily(ca.blockcat([[0, 1], [-a, -b * (1 + 0.1 * ca.cos(t))]]), t, [a, b], 2 * np.pi)
    values = {"b": [0.2, 0.0, 0.1], "a": [1.1, 2.1, 3.1]}
    found, again = (fl.sweep(family, values, store=tmp_path / "c.zarr", workers=1) for _ in range(2))
    kept = xarray.open_zarr(tmp_path / "c.zarr", consolidated=False)
    for name, numbers in values.items():
        assert kept[name].values.tolist() == found[name].values.tolist() == numbers
    assert_same(again, found)
    assert [reason[:27] for reason in again["reason"].values] == ["", "the growth rate is zero to ", ""]


@pytest.mark.parametrize("name", ["error", "period", "mode", "checksum"])
def test_a_number_with_the_name_of_a_result_is_refused(name):
    family = fl.PeriodicFamily(ca.diag(ca.SX([-1, -2])), ca.SX.sym("t"), [ca.SX.sym(name)], 1.0)
    with pytest.raises(ArgumentError, match=name):
        fl.sweep(family, {name: [1.0, 2.0]})


CHANGES = {
    "a scale": ("error", lambda of: of["attributes"].update(scale_factor=2.0)),
    "a unit": ("exponents_re", lambda of: of["attributes"].update(units="1/min")),
    "the names of verdicts": ("verdict", lambda of: of["attributes"].update(flag_meanings="stable stable stable")),
    "the dimensions": ("exponents_im", lambda of: of.update(dimension_names=["mode", "value"])),
    "the number of an array that is left empty": ("period", lambda of: of.update(fill_value=7.0)),
    "the title": ("", lambda of: of["attributes"].update(title="another arm")),
    "a second list of arrays": ("", lambda of: of.update(consolidated_metadata={"kind": "inline", "metadata": {}})),
}


@pytest.mark.parametrize("change", CHANGES)
def test_metadata_by_which_others_read_the_numbers_stand_as_they_were_made(store, change):
    """Zarr gives the same numbers, so the checksums of blocks hold; xarray would scale or name them otherwise."""
    array, edit = CHANGES[change]
    file = store / array / "zarr.json"
    metadata = json.loads(file.read_text())
    edit(metadata)
    file.write_text(json.dumps(metadata))
    with pytest.raises(OutputError, match=f"damaged metadata.*of {array or 'the whole'}") as found:
        sweep_into(store)
    assert str(store) in str(found.value)


def test_clusters_and_stores_that_are_not_there_are_refused(monkeypatch, tmp_path):
    monkeypatch.setattr("flexlin.analyses.sweep.sharing.SCHEDULER_SECONDS", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        closed = taken.getsockname()[1]
    (tmp_path / "c.zarr").write_text("no store")
    for given, words in (
        ({"client": "nowhere:1"}, "no scheduler answers"),
        ({"client": "nowhere:port"}, "no scheduler answers"),
        ({"client": f"tcp://127.0.0.1:{closed}"}, "no scheduler answers"),
        ({"client": 3}, "another kind"),
        ({"workers": 0}, "whole number"),
        ({"store": tmp_path / "c.zarr"}, "c.zarr"),
    ):
        with pytest.raises((ArgumentError, OutputError), match=words):
            fl.sweep(SCENE, {"effects.payload.mass": [0.1]}, **given)


def test_an_incomplete_chart_goes_on_with_more_time(tmp_path, capsys, monkeypatch):
    """Limits change no number, so the command may be given again with others, as its message advises."""
    words = ["chart", "single-link", "--over", "effects.payload.mass=0:0.3:200", "--store", str(tmp_path / "c.zarr")]
    words += ["--set", "links.0.modes=1", "designs=[]", "control={}", "--out", str(tmp_path / "out")]

    def interrupted(job):
        yield next(compute_here(job))
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("flexlin.report.charts.choose_crew", lambda *_: interrupted)
        assert main(words) == 4
        told = capsys.readouterr()
        for text in (*told, (tmp_path / "out" / "chart.html").read_text(encoding="utf-8")):
            assert "is not complete: interrupted, with 96 of 200 values" in text
            assert f"the same command goes on from {tmp_path / 'c.zarr'}" in text
        assert "no answer" not in told.out
        patch.setattr("flexlin.report.charts.compute_chart", Mock(side_effect=KeyboardInterrupt))
        assert main(words) == 1
        assert f"goes on from {tmp_path / 'c.zarr'}" in capsys.readouterr().err
    assert main([*words, "--limit-seconds", "500", "--limit-memory", "9e8"]) == 0
    said = capsys.readouterr().err
    assert "--store" in (tmp_path / "out" / "chart.html").read_text(encoding="utf-8")
    assert "values are there already" in said
    assert "differs" not in said
