"""Finished blocks kept in a Zarr store while a sweep runs, so that an interrupted one goes on where it stopped."""

import hashlib
import json
import os
import shutil
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import flexlin
from flexlin.about.family import PeriodicFamily
from flexlin.answers.sweep.found import LONGEST, VERDICTS, Found
from flexlin.answers.sweep.job import Job
from flexlin.errors import ArgumentError, OutputError
from flexlin.scene.revised import raw_tables

PLAIN = ("error", "period", "one_by_one")
MAKER = "made_by"


class Store:
    """A Zarr group with one entry for each value of a sweep, block by block; `done` is written last.

    A store is a flat list of values with their parameters; the N-dimensional result is what `sweep` returns.
    Raises: OutputError where it cannot be read or written; ArgumentError where another sweep made it, with what differs.
    """

    def __init__(self, path: str | Path, job: Job):
        if find_spec("zarr") is None:
            raise ArgumentError("Zarr is not installed", got="no module zarr", todo="pip install flexlin[cluster]")
        self.path, maker = Path(path), describe(job)
        try:
            if not self.path.exists():
                create(self.path, job, maker)
            self._group = open_group(self.path)
            known = self._group.attrs.get(MAKER)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise OutputError(f"{path} cannot be used as a store", got=str(error)[:200]) from None
        refuse_other(str(path), known, maker)
        self._read(job)

    def _read(self, job: Job) -> None:
        """Take over the blocks that are done."""
        done = self._group["done"][:]
        if not done.any():
            return
        found = job.found
        for name in PLAIN:
            getattr(found, name)[done] = self._group[name][:][done]
        found.verdict[done] = self._group["verdict"][:][done]
        found.exponents[done] = (self._group["exponents_re"][:] + 0.0)[done]
        found.exponents.imag[done] = self._group["exponents_im"][:][done]
        found.reason[done] = [bytes(text).rstrip(b"\0").decode() for text in self._group["reason"][:][done]]
        job.done[:] = done

    def __call__(self, start: int, block: Found) -> None:
        """Write a finished block."""
        where = slice(start, start + len(block.error))
        try:
            for name in PLAIN:
                self._group[name][where] = getattr(block, name)
            self._group["verdict"][where] = block.verdict
            self._group["exponents_re"][where] = block.exponents.real
            self._group["exponents_im"][where] = block.exponents.imag
            if (block.reason != "").any():
                self._group["reason"][where] = encode(block.reason)
            self._group["done"][where] = True
        except OSError as error:
            raise OutputError(f"{self.path} cannot be written", got=error.strerror or str(error)) from None


def open_group(path: Path) -> Any:
    """The store for reading and writing."""
    import zarr

    return zarr.open_group(str(path), mode="r+")


def create(path: Path, job: Job, maker: dict[str, str]) -> None:
    """Make an empty store under another name, and move it into place when it is whole."""
    V, n = job.found.exponents.shape
    flat, states = ("value",), ("value", "mode")
    import xarray as xr

    data = xr.Dataset(
        {
            "exponents_re": (states, np.zeros((V, n)), {"units": "1/s"}),
            "exponents_im": (states, np.zeros((V, n)), {"units": "1/s"}),
            "error": (flat, np.zeros(V), {"units": "1/s"}),
            "period": (flat, np.zeros(V), {"units": "s"}),
            "one_by_one": (flat, np.zeros(V, dtype=bool)),
            "verdict": (flat, np.zeros(V, dtype=np.int8), {"flag_meanings": " ".join(VERDICTS)}),
            "reason": (("value", "byte"), np.zeros((V, LONGEST), dtype=np.uint8)),
            "done": (flat, np.zeros(V, dtype=bool)),
            **{name: (flat, job.points[:, i]) for i, name in enumerate(job.axes)},
        },
        attrs={"title": job.scene.title, MAKER: maker},
    )
    chunks = {name: {"chunks": (job.work.block, *array.shape[1:])} for name, array in data.variables.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        data.to_zarr(temporary, mode="w", encoding=chunks, consolidated=False)
        os.rename(temporary, path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def describe(job: Job) -> dict[str, str]:
    """All that decides the numbers of a sweep: two sweeps with the same description have the same results, bit for bit."""
    values = {
        f"values of {name}": f"{len(axis)} from {axis[0]} to {axis[-1]} ({digest(axis.tobytes())})"
        for name, axis in job.axes.items()
    }
    return {
        "version of flexlin": flexlin.__version__,
        "scene": job.scene.text
        if isinstance(job.scene, PeriodicFamily)
        else json.dumps(raw_tables(job.scene), sort_keys=True),
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
            todo = "give another name, or remove the store"
            raise ArgumentError(f"{path} was made with another {key}", got=got, expected=expected, todo=todo)


def shorten(text: str, other: str) -> str:
    """The text from a little before the place where it differs from the other."""
    same = next((i for i, (a, b) in enumerate(zip(text, other, strict=False)) if a != b), min(len(text), len(other)))
    return text[max(0, same - 40) : same + 60]


def encode(reasons: Any) -> Any:
    """Texts as bytes (V, LONGEST), cut where a character ends."""
    table = np.zeros((len(reasons), LONGEST), dtype=np.uint8)
    for i in np.flatnonzero(reasons != ""):
        data = reasons[i].encode()[:LONGEST].decode(errors="ignore").encode()
        table[i, : len(data)] = np.frombuffer(data, dtype=np.uint8)
    return table
