"""A damaged store never gives a number that the whole one does not hold: a block is computed again, or the store refused; an incomplete one
goes on, and one that is none is refused."""

import os
import shutil
import socket
import tracemalloc
from unittest.mock import Mock

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import compute_here
from flexlin.cli import main
from flexlin.errors import ArgumentError, OutputError
from tests.thinned import thin

SCENE = fl.load_scene("single-link", {"links.0.modes": 1, "designs": [], "control": {}})
VALUES = {"effects.payload.mass": np.linspace(0.0, 0.3, 200)}


def sweep_into(store):
    return fl.sweep(SCENE, VALUES, store=store, workers=1)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    path = tmp_path_factory.mktemp("store") / "chart"
    return path, sweep_into(path)


@pytest.fixture
def store(kept, tmp_path):
    """A copy of the whole store, to be damaged."""
    return shutil.copytree(kept[0], tmp_path / "c")


def damage(path, kind, rng):
    """Damage one file of a store, chosen at random."""
    files = sorted(file for file in path.iterdir() if file.is_file())
    if not files:
        return
    file, other = (files[k] for k in rng.integers(len(files), size=2))
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


@pytest.mark.parametrize("kind", [*KINDS, "several"])
@pytest.mark.parametrize("seed", thin(range(6), 4))
def test_damage_is_computed_again_or_refused(store, kept, kind, seed, capfd):
    """A sweep over a damaged store gives what the whole one held, or is refused by the store's name; no library prints anything."""
    rng, (_, whole) = np.random.default_rng(1000 * seed + len(kind)), kept
    for one in rng.choice(KINDS, int(rng.integers(2, 7))) if kind == "several" else [kind]:
        damage(store, one, rng)
    try:
        found, message = sweep_into(store), ""
    except (OutputError, ArgumentError) as error:
        found, message = whole, str(error)
    assert_same(found, whole)
    assert not message or str(store) in message
    assert capfd.readouterr() == ("", "")


def test_blocks_of_another_place_or_sweep_are_told(store, kept, tmp_path):
    """Each is whole by the checksums of its file; and one of 200 kB that would unpack to 200 MB is not unpacked."""
    fl.sweep(SCENE, VALUES, tol=1e-7, store=tmp_path / "other", workers=1)
    blocks, others = (sorted(path.glob("block*")) for path in (store, tmp_path / "other"))
    shutil.copy(blocks[0], blocks[1])
    shutil.copy(others[2], blocks[2])
    np.savez_compressed(blocks[0], **{**np.load(blocks[0]), "verdict": np.zeros(2 * 10**8, np.int8)})
    tracemalloc.start()
    found = sweep_into(store)
    assert (found.attrs.pop("repaired"), tracemalloc.get_traced_memory()[1] < 1.2e8) == (3, True)
    tracemalloc.stop()
    assert_same(found, kept[1])
    assert "repaired" not in sweep_into(store).attrs


def test_a_store_of_a_family_holds_why_a_value_is_undecided(tmp_path):
    t, a, b = (ca.SX.sym(name) for name in "tab")
    family = fl.PeriodicFamily(ca.blockcat([[0, 1], [-a, -b * (1 + 0.1 * ca.cos(t))]]), t, [a, b], 2 * np.pi)
    values = {"b": [0.2, 0.0, 0.1], "a": [1.1, 2.1, 3.1]}
    found, again = (fl.sweep(family, values, store=tmp_path / "c", workers=1) for _ in range(2))
    assert_same(again, found)
    assert [reason[:27] for reason in again["reason"].values] == ["", "the growth rate is zero to ", ""]


@pytest.mark.parametrize("name", ["error", "period", "mode"])
def test_a_number_with_the_name_of_a_result_is_refused(name):
    family = fl.PeriodicFamily(ca.diag(ca.SX([-1, -2])), ca.SX.sym("t"), [ca.SX.sym(name)], 1.0)
    with pytest.raises(ArgumentError, match=name):
        fl.sweep(family, {name: [1.0, 2.0]})


def test_clusters_and_stores_that_are_not_there_are_refused(monkeypatch, tmp_path):
    monkeypatch.setattr("flexlin.analyses.sweep.sharing.SCHEDULER_SECONDS", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        closed = taken.getsockname()[1]
    (tmp_path / "c").write_text("no store")
    for given, words in (
        ({"client": "nowhere:1"}, "no scheduler answers"),
        ({"client": "nowhere:port"}, "no scheduler answers"),
        ({"client": f"tcp://127.0.0.1:{closed}"}, "no scheduler answers"),
        ({"client": 3}, "another kind"),
        ({"workers": 0}, "whole number"),
        ({"store": tmp_path / "c"}, str(tmp_path / "c")),
    ):
        with pytest.raises((ArgumentError, OutputError), match=words):
            fl.sweep(SCENE, {"effects.payload.mass": [0.1]}, **given)


def test_an_incomplete_chart_goes_on_with_more_time(tmp_path, capsys, monkeypatch):
    """Limits change no number, so the command may be given again with others, as its message advises."""
    words = ["chart", "single-link", "--over", "effects.payload.mass=0:0.3:200", "--store", str(tmp_path / "c")]
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
            assert f"the same command goes on from {tmp_path / 'c'}" in text
        assert "no answer" not in told.out
        patch.setattr("flexlin.report.charts.compute_chart", Mock(side_effect=KeyboardInterrupt))
        assert main(words) == 1
        assert f"goes on from {tmp_path / 'c'}" in capsys.readouterr().err
    assert main([*words, "--limit-seconds", "500", "--limit-memory", "9e8"]) == 0
    said = capsys.readouterr().err
    assert "--store" in (tmp_path / "out" / "chart.html").read_text(encoding="utf-8")
    assert "values are there already" in said
    assert "differs" not in said
