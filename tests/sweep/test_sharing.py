"""The same chart by one process, by two, by a cluster that loses a worker, and in pieces: equal to the last bit."""

import os
import signal
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import Store, compute_here, prepare_job, share_among_processes, share_on_cluster
from flexlin.errors import ArgumentError
from flexlin.scene import revise_scene
from tests.sweep.test_damaged_store import assert_same

pytestmark = pytest.mark.slow
distributed = pytest.importorskip("distributed")
SCENE = fl.load_scene("single-link", {"links.0.modes": 1, "designs": []})
VALUES = {"effects.payload.mass": np.linspace(0.0, 0.3, 36), "control.feedback.kp.0": np.linspace(0.0, 6.0, 20)}
"""So many that there are several blocks."""
FEW = {"effects.payload.mass": [0.1, 0.2]}


@pytest.fixture(scope="module")
def whole():
    data = fl.sweep(SCENE, VALUES, grid=True, workers=1)
    assert data["exponents"].shape == (36, 20, 4)
    return data


def make_job(values=VALUES):
    return prepare_job(SCENE, values, 1e-8, True, "own")


class Deadly:
    """Work that ends the process which does it, so many times: as often as there are files to remove."""

    def __init__(self, work, folder, times):
        self.work, self.folder = work, folder
        self.segments, self.block, self.route = work.segments, work.block, work.route
        for k in range(times):
            (folder / str(k)).touch()

    def compute(self, points):
        for file in sorted(Path(self.folder).iterdir()):
            with suppress(FileNotFoundError):  # where another process has taken it
                file.unlink()
                os.kill(os.getpid(), signal.SIGKILL)
        return self.work.compute(points)


def test_two_processes_and_one_that_dies(whole, tmp_path):
    job = make_job()
    assert len(job.blocks) > 5
    job.work = Deadly(job.work, tmp_path, 1)
    job.run(partial(share_among_processes, workers=2))
    assert_same(job.dataset(), whole)


def test_values_found_one_by_one_do_not_depend_on_those_before():
    scene, values = fl.load_scene("spatial-arm", {"designs": []}), {"effects.payload.mass": np.linspace(0.2, 3.0, 12)}
    assert_same(*(fl.sweep(scene, values, workers=count) for count in (1, 2)))


def test_a_block_that_kills_every_process_is_marked(tmp_path, monkeypatch):
    monkeypatch.setattr("flexlin.analyses.sweep.sharing.BLOCK_ATTEMPTS", 1)
    job = make_job(FEW)
    job.work = Deadly(job.work, tmp_path, 5)
    job.run(partial(share_among_processes, workers=1))
    assert set(job.dataset()["verdict"].values) == {"failed"}
    assert "ended" in job.dataset()["reason"].values[0]


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_that_loses_a_worker(whole):
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        job, killed = make_job(), []

        def kill_one(start, block):
            if not killed:
                killed.extend(client.run(os.getpid).values())
                os.kill(killed[0], signal.SIGKILL)

        job.watchers.append(kill_one)
        job.run(partial(share_on_cluster, client=client))
        assert killed
    assert_same(job.dataset(), whole)


def test_a_sweep_interrupted_again_and_again_ends_as_an_undisturbed_one(whole, tmp_path):
    path, rng, left = tmp_path / "chart", np.random.default_rng(3), []
    for _ in range(20):
        job = make_job()
        Store(path, job)
        left.append(len(job.blocks))
        countdown = iter(range(int(rng.integers(0, 3)), -1, -1))

        def stop(start, block, countdown=countdown):
            if next(countdown) == 0:
                raise KeyboardInterrupt

        job.watchers.insert(int(rng.integers(0, 2)), stop)  # before or after the block is written
        with suppress(KeyboardInterrupt):
            job.run(compute_here)
            break
    assert len(left) > 4
    assert left == sorted(left, reverse=True)
    assert_same(fl.sweep(SCENE, VALUES, grid=True, store=path), whole)


def test_a_store_of_another_sweep_is_refused_with_what_differs(tmp_path, monkeypatch):
    own = {"scene": SCENE, "values": FEW, "store": tmp_path / "c"}
    fl.sweep(**own)
    for what, change in (
        ("scene", {"scene": revise_scene(SCENE, {"effects.hub.inertia": 1.0})}),
        ("values of effects.payload.mass", {"values": {"effects.payload.mass": [0.1, 0.3]}}),
        ("loop", {"loop": "open"}),
        ("tol", {"tol": 1e-7}),
        ("version of flexlin", {}),
    ):
        monkeypatch.setattr("flexlin.__version__", fl.__version__ if change else "9.9")
        with pytest.raises(ArgumentError, match=f"differs in the {what}"):
            fl.sweep(**own | change)
