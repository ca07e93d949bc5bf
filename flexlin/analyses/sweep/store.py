"""Finished blocks kept in a Zarr store while a sweep runs, so that an interrupted one goes on where it stopped."""

import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import flexlin
from flexlin.analyses.sweep.found import REASON_LENGTH, VERDICTS, Found
from flexlin.analyses.sweep.job import Job, lay_out
from flexlin.bounds import LARGEST_MANIFEST
from flexlin.checks import Array
from flexlin.errors import ArgumentError, OutputError
from flexlin.files import read_text, refuse_odd, sync
from flexlin.linearization.family import PeriodicFamily
from flexlin.scene.loading import raw_tables

NUMBERS = ("error", "period", "one_by_one", "verdict", "exponents_re", "exponents_im", "reason")
MAKER, METADATA, FILE = "made_by", "metadata", "zarr.json"
"""Attributes of a store: the question that it answers, and a fingerprint of each array's metadata; the file where they stand."""


class Store:
    """A Zarr group with one entry for each value of a sweep, block by block; a block's checksum is written last.

    The checksum is that of the block's numbers, of its place, and of the question that they answer: what was lost, changed or exchanged
    since is computed again. `repaired` counts such blocks. Metadata, by which others read the numbers, must stand as they were made.
    A store is a flat list of values with their parameters; the N-dimensional result is what `sweep` returns.
    Raises: OutputError where it cannot be read or written; ArgumentError where another sweep made it, with what differs.
    """

    def __init__(self, path: str | Path, job: Job):
        if find_spec("zarr") is None:
            raise ArgumentError("Zarr is not installed", got="no module zarr", todo="pip install flexlin[cluster]")
        self.path, maker, names = Path(path), describe(job), [*NUMBERS, "checksum", *job.axes]
        self._question, self._size = json.dumps(maker, sort_keys=True).encode(), job.work.block
        self.repaired = 0
        try:
            if not self.path.exists():
                create(self.path, job, maker)
            refuse_odd_files(self.path, job)
            root = json.loads(read_text(self.path / FILE, LARGEST_MANIFEST))
            known, metadata = dict(root["attributes"]), fingerprint(self.path, names)
            self._arrays = open_arrays(self.path, names)
        except Exception as error:  # damaged metadata raises what its parser meets
            raise OutputError(f"{path} cannot be used as a store", got=describe_fault(error), todo=REMOVE) from None
        refuse_other(str(path), known.get(MAKER), maker)
        attributes = {"title": job.scene.title, MAKER: maker, METADATA: metadata}
        if known != attributes or root.get("consolidated_metadata"):
            raise OutputError(f"{path} has damaged metadata", got=find_changed(known, metadata), todo=REMOVE)
        self._place_values(job)
        self._read(job)

    def _place_values(self, job: Job) -> None:
        """Write what varies anew where it is not what was asked."""
        for name, values in list_values(job).items():
            try:
                whole = np.array_equal(self._arrays[name][:], values)
            except Exception:  # whatever the decoder of a damaged chunk meets
                whole = False
            if not whole:
                self._write(name, 0, values, len(values))
                self.repaired += 1

    def _read(self, job: Job) -> None:
        """Take over the blocks that are done and whole."""
        for start, stop in job.blocks:
            try:
                kept = bytes(self._arrays["checksum"][start // self._size])
                block = {name: self._arrays[name][start:stop] for name in NUMBERS} if any(kept) else None
            except Exception:  # whatever the decoder of a damaged block meets
                block, kept = None, b"damaged"
            if block is not None and self._seal(start, block) == kept:
                job.found.place(start, unpack(block))
            else:
                self.repaired += any(kept)

    def _seal(self, start: int, block: dict[str, Array]) -> bytes:
        """The checksum of a block."""
        sealed = hashlib.sha256(self._question + str(start).encode())
        for name in NUMBERS:
            sealed.update(np.ascontiguousarray(block[name]).tobytes())
        return sealed.digest()

    def __call__(self, start: int, found: Found) -> None:
        """Write a finished block, and bring it to disk before its checksum says that it is there."""
        block = pack(found)
        for name in NUMBERS:
            self._write(name, start, block[name], self._size)
        seal = np.frombuffer(self._seal(start, block), dtype=np.uint8)
        self._write("checksum", start // self._size, seal[None], 1)

    def _write(self, name: str, start: int, numbers: Array, rows: int) -> None:
        """Write a chunk of so many rows, and wait until it is on the disk."""
        chunk = self.path / name / "c" / str(start // rows)
        try:
            self._arrays[name][start : start + len(numbers)] = numbers
            sync(chunk if numbers.ndim == 1 else chunk / "0")
        except OSError as error:
            got, todo = error.strerror or str(error), "make room there, or give another name"
            raise OutputError(f"{self.path} cannot be written", got=got, todo=todo) from None


REMOVE = "give another name, or remove the store"


def describe_fault(error: Exception) -> str:
    """What a library met, in one short line."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:200]


def pack(found: Found) -> dict[str, Array]:
    """A block as the arrays of the store."""
    plain = {name: getattr(found, name) for name in ("error", "period", "one_by_one", "verdict")}
    parts = {"exponents_re": found.exponents.real, "exponents_im": found.exponents.imag}
    return {**plain, **parts, "reason": encode(found.reason)}


def unpack(block: dict[str, Array]) -> Found:
    """The arrays of the store as a block."""
    exponents = block["exponents_re"].astype(complex)
    exponents.imag = block["exponents_im"]
    return Found(
        exponents, block["error"], block["verdict"], block["period"], block["one_by_one"], decode(block["reason"])
    )


def refuse_odd_files(path: Path, job: Job) -> None:
    """Refuse what is not to be read: pipes and devices, which may never end, and what is larger than any file of a store.

    Raises: OSError.
    """
    n, lengths = job.found.exponents.shape[1], [len(axis) for axis in list_values(job).values()]
    largest = max(16 * n, REASON_LENGTH) * job.work.block + 8 * max(lengths) + LARGEST_MANIFEST
    for file in path.rglob("*"):
        with suppress(FileNotFoundError):  # what another writer has just renamed
            if not file.is_dir():
                refuse_odd(file.stat(), largest)


def open_arrays(path: Path, names: list[str]) -> dict[str, Any]:
    """The arrays for reading and writing, as far as they are there.

    One after another: Zarr opens several at once, and prints a trace of each fault but the first.
    """
    import zarr

    with zarr.config.set({"array.write_empty_chunks": True}):  # so that -0.0 comes back as it was
        group = zarr.open_group(str(path), mode="r+", use_consolidated=False)
        return {name: group[name] for name in names if name in group}


def fingerprint(path: Path, names: Iterable[str]) -> dict[str, str]:
    """Of each array's metadata: shape, blocks, codecs, dimensions, units."""
    files = {name: path / name / FILE for name in names}
    return {
        name: digest(read_text(file, LARGEST_MANIFEST).encode()) if file.exists() else "none"
        for name, file in files.items()
    }


def find_changed(known: dict[str, Any], metadata: dict[str, str]) -> str:
    """Which metadata are not those that the store was made with."""
    made = known.get(METADATA)
    changed = [name for name in metadata if not isinstance(made, dict) or made.get(name) != metadata[name]]
    return f"another {FILE} of {', '.join(changed) or 'the whole'} than it was made with"


def layout(job: Job) -> dict[str, Array]:
    """The arrays of an empty store, whose first axis is that of the values; of the checksums, that of the blocks."""
    V, n = job.found.exponents.shape
    empty = pack(Found.empty(V, n))
    blocks = -(-V // job.work.block)
    return {**empty, "checksum": np.zeros((blocks, 32), dtype=np.uint8), **list_values(job)}


def list_values(job: Job) -> dict[str, Array]:
    """What varies, each number by itself for all values."""
    points = lay_out(job.axes, job.dims != ("value",))[0]
    return {name: np.ascontiguousarray(points[:, i]) for i, name in enumerate(job.axes)}


def create(path: Path, job: Job, maker: dict[str, str]) -> None:
    """Make an empty store under another name, and move it into place when it is whole."""
    import xarray as xr
    import zarr

    units = {"error": "1/s", "exponents_re": "1/s", "exponents_im": "1/s", "period": "s"}
    second = {"exponents_re": "mode", "exponents_im": "mode", "reason": "byte", "checksum": "sha256"}
    variables, empty = {}, layout(job)
    for name, array in empty.items():
        dims = ("block" if name == "checksum" else "value", second.get(name, ""))[: array.ndim]
        variables[name] = (dims, array, {"units": units[name]} if name in units else {})
    variables["verdict"][2]["flag_meanings"] = " ".join(VERDICTS)
    data = xr.Dataset(variables, attrs={"title": job.scene.title, MAKER: maker})
    rows = {"checksum": 1, **dict.fromkeys(NUMBERS, job.work.block)}  # what varies is written once
    encoding = {name: {"chunks": (rows.get(name, len(array)), *array.shape[1:])} for name, array in empty.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        data.to_zarr(temporary, mode="w", encoding=encoding, consolidated=False)
        zarr.open_group(temporary, mode="r+").attrs[METADATA] = fingerprint(Path(temporary), variables)
        os.rename(temporary, path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


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


def encode(reasons: Any) -> Any:
    """Texts as bytes (V, REASON_LENGTH), cut where a character ends."""
    cut = [text.encode()[:REASON_LENGTH].decode(errors="ignore").encode() for text in reasons]
    return np.array(cut, dtype=f"S{REASON_LENGTH}").view(np.uint8).reshape(-1, REASON_LENGTH)


def decode(table: Any) -> Any:
    """Bytes (V, REASON_LENGTH) as texts."""
    return np.array([bytes(row).rstrip(b"\0").decode() for row in table], dtype=object)
