"""Finished blocks kept in a folder while a sweep runs, so that an interrupted one goes on where it stopped."""

import hashlib
import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

import flexlin
from flexlin.analyses.sweep.found import Found
from flexlin.analyses.sweep.job import Job
from flexlin.bounds import LARGEST_TABLE, read_text
from flexlin.errors import ArgumentError, OutputError
from flexlin.files import refuse_odd, replacing, write_text
from flexlin.linearization.family import PeriodicFamily
from flexlin.scene.loading import raw_tables

QUESTION = "sweep.json"
"""The file that says which sweep the blocks are of."""
REMOVE = "give another name, or remove the store"


class Store:
    """A folder with one npz file for each finished block of a sweep.

    A file is written whole or not at all, under the checksums of its format, with the first value of its block and a fingerprint of the
    question that it answers: what was changed or exchanged since is computed again. `repaired` counts such blocks.
    Raises: OutputError where it cannot be read or written; ArgumentError where another sweep made it, with what differs.
    """

    def __init__(self, path: str | Path, job: Job):
        self.path, made_by = Path(path), describe(job)
        self._question, self.repaired = digest(json.dumps(made_by, sort_keys=True).encode()), 0
        try:
            if not self.path.exists() or all(one.name.startswith(".") for one in self.path.iterdir()):
                write_text(self.path / QUESTION, json.dumps(made_by, indent=1))
            known = json.loads(read_text(self.path / QUESTION, LARGEST_TABLE))
        except (OSError, ValueError, RecursionError) as error:
            got = f"{QUESTION}: {getattr(error, 'strerror', None) or error}"
            raise OutputError(f"{path} cannot be used as a store", got=got, todo=REMOVE) from None
        refuse_other(str(path), known, made_by)
        for start, stop in job.blocks:
            if self._file(start).exists():
                self._take(job, start, stop)

    def _file(self, start: int) -> Path:
        return self.path / f"block-{start:08}.npz"

    def _take(self, job: Job, start: int, stop: int) -> None:
        """Take over a block that is whole."""
        try:
            refuse_odd(self._file(start).stat(), LARGEST_TABLE)
            with self._file(start).open("rb") as file, np.load(file) as kept:
                same = (str(kept["question"]), int(kept["start"])) == (self._question, start)
                block = Found(**{one.name: kept[one.name] for one in fields(Found)})
            if not same or len(block.verdict) != stop - start:
                raise ValueError
            job.found.place(start, block)
        except Exception:  # whatever the reader of a damaged file meets
            self.repaired += 1

    def __call__(self, start: int, found: Found) -> None:
        """Write a finished block."""
        arrays = {**vars(found), "reason": found.reason.astype(str)}
        with replacing(self._file(start)) as temporary:
            np.savez(temporary, question=self._question, start=start, **arrays)


def describe(job: Job) -> dict[str, str]:
    """All that decides the numbers of a sweep: two sweeps with the same description have the same results, bit for bit."""
    values = {
        f"values of {name}": f"{len(axis)} from {axis[0]} to {axis[-1]} ({digest(axis.tobytes())})"
        for name, axis in job.axes.items()
    }
    if isinstance(job.scene, PeriodicFamily):
        text = job.scene.text
    else:  # limits change no number, tol stands below
        text = json.dumps({**raw_tables(job.scene), "accuracy": None}, sort_keys=True)
    return {
        "version of flexlin": flexlin.__version__,
        "scene": text,
        **values,
        "shape": str(job.shape),
        "loop": job.loop,
        "tol": repr(job.tol),
        "route": f"{job.work.route}, {job.work.segments} segments, blocks of {job.work.block}",
    }


def digest(data: bytes) -> str:
    """A fingerprint."""
    return hashlib.sha256(data).hexdigest()[:8]


def refuse_other(path: str, known: Any, maker: dict[str, str]) -> None:
    """Raise where a store was made by another sweep, saying what differs."""
    if not isinstance(known, dict):
        raise ArgumentError(f"{path} is no store of a sweep", got="no description of one", todo="give another name")
    for key in {**maker, **known}:
        now = maker.get(key, "none")
        if known.get(key) != now:
            got, expected = shorten(str(known.get(key)), now), shorten(now, str(known.get(key)))
            raise ArgumentError(
                f"{path} was made by a sweep that differs in the {key}", got=got, expected=expected, todo=REMOVE
            )


def shorten(text: str, other: str) -> str:
    """The text from a little before the place where it differs from the other."""
    same = next((i for i, (a, b) in enumerate(zip(text, other, strict=False)) if a != b), min(len(text), len(other)))
    return text[max(0, same - 40) : same + 60]
