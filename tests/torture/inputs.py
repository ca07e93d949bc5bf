"""Whatever is read, damaged in this process: scenes, robots, tables, logs, --set, plain data, lists of results, certificates.

Each is read, or refused by a typed error in a line or two, soon and without much memory.
"""

import io
import json
import random
import resource
import time
import warnings
import zipfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray

import flexlin as fl
from flexlin.analyses import time_limit
from flexlin.errors import FlexlinError
from flexlin.files import read_manifest
from flexlin.motion import build_motion
from flexlin.scene import parse_assignment
from studies.check_certificate import holds
from tests.torture import scenes
from tests.torture.scenes import BUILT_IN, FILES, at, places, to_toml
from tests.torture.trial import Row

LATEST, LARGEST = 10.0, 2**28
"""Seconds and bytes that reading one input may take."""
LOG = {"inputs": {"q1": {"column": "u"}}, "outputs": {"q1": {"column": "angle"}, "tip.x": {"column": "x"}}}
TOKENS = (
    b"1e999", b"-1e31", b"nan", b"0x" + b"f" * 400, b"9" * 5000, b"1_0", b"-", b"=", b"#", b",,,,", b"a.b.c.d", b"[" * 2000, b"[[links]]",
    b"<link>", b"<!DOCTYPE x>", b"&amp;", b"]]>", b"''", b'"""', b"\0", b"\xff\xfe", b"\xe2\x80\xae", b"\r\n",
)  # fmt: skip


def damaged(chance: random.Random, data: bytes) -> bytes:
    """Data with one to four damages: bits, pieces, words and numbers that should not be there."""
    for _ in range(chance.randrange(1, 5)):
        k, m = sorted(chance.randrange(len(data) + 1) for _ in range(2))
        piece = chance.choice(
            (
                data[:k],
                data[:k] + data[m:],
                data[:m] + data[k:m] * chance.choice((1, 3, 50)) + data[m:],
                data[:k] + chance.choice(TOKENS) + data[k:],
                data[:k] + chance.choice(TOKENS) + data[min(k + 4, len(data)) :],
                data[:k] + bytes([chance.randrange(256)]) + data[k + 1 :],
                data[:k] + chance.randbytes(chance.randrange(1, 40)) + data[k:],
            )
        )
        data = piece[: 2**20]
    return data


def changed(chance: random.Random, raw: Any, path: tuple) -> Any:
    """Plain data with nonsense at a place."""
    holder = at(raw, path[:-1])
    value = chance.choice([*scenes.NONSENSE, *scenes.EXTREME, *scenes.TEXTS])
    holder[path[-1]] = json.loads(json.dumps(value, default=str))
    return raw


def put(chance: random.Random, path: Path, data: bytes) -> Path:
    """Write damaged data."""
    path.write_bytes(damaged(chance, data))
    return path


def scene_text(chance: random.Random, folder: Path) -> Callable[[], Any]:
    """The bytes of a scene file."""
    name = chance.choice(sorted(BUILT_IN))
    return partial(fl.load_scene, put(chance, folder / "scene.toml", to_toml(BUILT_IN[name]).encode()))


def robot(chance: random.Random, folder: Path) -> Callable[[], Any]:
    """The bytes of a URDF file."""
    return partial(fl.scene_from_urdf, put(chance, folder / "robot.urdf", scenes.URDF.encode()))


def table(chance: random.Random, folder: Path) -> Callable[[], Any]:
    """The bytes of a table of a motion."""
    put(chance, folder / "cycle.csv", scenes.sampled_cycle(chance.choice((8, 64))).encode())
    raw = {**BUILT_IN["single-link"], "motion": {"kind": "table", "file": "cycle.csv"}}
    return lambda: build_motion(fl.parse_scene(raw, folder=folder).motion, 1)


def assignment(chance: random.Random, folder: Path) -> Callable[[], Any]:
    """A word behind --set."""
    name = chance.choice(sorted(BUILT_IN))
    path = ".".join(map(str, chance.choice(list(places(BUILT_IN[name])))))
    odd = "[1, 2", "{a=1}", "off", "'x'", "1 m", "1979-05-27", [1.0] * 300
    text = f"{path}={chance.choice([*scenes.EXTREME, *scenes.TEXTS, *odd])}".encode()
    text = damaged(chance, text) if chance.random() < 0.7 else text
    return lambda: fl.load_scene(name, dict([parse_assignment(text.decode(errors="replace"))]))


def plain_data(chance: random.Random, folder: Path) -> Callable[[], Any]:
    """The tables of a scene as JSON gives them."""
    raw = json.loads(json.dumps(BUILT_IN[chance.choice(sorted(BUILT_IN))], default=str))
    for _ in range(chance.randrange(1, 4)):
        raw = changed(chance, raw, chance.choice(list(places(raw))))
    return partial(fl.parse_scene, raw, folder=folder)


def log(chance: random.Random, folder: Path) -> Callable[[], Any]:
    """The bytes of a log: CSV, npz, netCDF."""
    suffix = chance.choice(("csv", "npz", "nc", "h5"))
    path = put(chance, folder / f"log.{suffix}", chance.choice(log_files()[suffix]))
    scene = fl.load_scene("single-link", {"log": LOG})
    return partial(fl.read_log, path, scene)


@cache
def log_files() -> dict[str, list[bytes]]:
    """Logs of each kind, whole and hostile."""
    t = np.arange(60) * 0.01
    columns = {"t": t, "u": np.sin(t), "angle": np.cos(t), "x": t**2}
    plain, packed, objects = io.BytesIO(), io.BytesIO(), io.BytesIO()
    np.savez(plain, **columns)
    np.savez_compressed(packed, **columns, other=np.ones((3, 4)))
    np.savez(objects, **{**columns, "u": np.array([{"a": 1}] * 60, dtype=object)}, allow_pickle=True)
    data = xarray.Dataset({name: ("row", column) for name, column in columns.items()})
    npz = [plain.getvalue(), packed.getvalue(), objects.getvalue(), boast(10**12), boast(10**7), bomb()]
    netcdf = [bytes(data.to_netcdf(engine="scipy"))]
    csv = [FILES[f"{name}.csv"].encode() for name in ("log", "nan", "wide")]
    return {"csv": csv, "npz": npz, "nc": netcdf, "h5": netcdf}


def header(rows: int) -> bytes:
    """Of an array in an .npz."""
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (rows,)})
    return head.getvalue()


def boast(rows: int, names: tuple[str, ...] = ("t", "u", "angle", "x")) -> bytes:
    """An .npz whose arrays say that they are longer than they are."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for name in names:
            archive.writestr(f"{name}.npy", header(rows) + b"\0" * 64)
    return made.getvalue()


def bomb() -> bytes:
    """An .npz of some hundred kilobytes that unpacks to gigabytes."""
    made, rows = io.BytesIO(), 2**26
    with (
        zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("t.npy", "w", force_zip64=True) as entry,
    ):
        entry.write(header(rows))
        for _ in range(8 * rows // 2**22):
            entry.write(b"\0" * 2**22)
    return made.getvalue()


def results_list(chance: random.Random, folder: Path) -> Callable[[], Any]:
    """The list of results in a folder."""
    text = json.dumps({"format": 1, "sets": {"report": {"sha256": {"report.html": "0" * 64, "../x": "1"}}}})
    put(chance, folder / "flexlin-results.json", text.encode())
    return partial(read_manifest, folder)


@cache
def certificate() -> dict[str, Any]:
    """A certificate that holds."""
    return fl.floquet(fl.PeriodicSystem([[0.0, 1.0], [-1.0, -0.2]], 1.0)).certificate().record()


def proof(chance: random.Random, folder: Path) -> Callable[[], Any]:
    """The certificate of a report: one that was changed proves nothing."""
    raw = changed(chance, json.loads(json.dumps(certificate())), chance.choice(list(places(certificate()))))

    def work() -> None:
        assert raw == certificate() or not holds(raw), "a changed certificate holds"

    return work


KINDS = (scene_text, robot, table, assignment, plain_data, log, results_list, proof)
OFTEN = (6, 6, 5, 6, 6, 6, 2, 2)
"""How many of 39 inputs are of each kind."""


def inputs(count: int, number: int, out: Path) -> Row:
    """So many damaged inputs, each read in this process."""
    row, chance = Row("inputs"), random.Random(number)
    scenes.put_files(out)
    for index in range(count):
        kind = chance.choices(KINDS, OFTEN)[0]
        work = kind(chance, out)
        row.runs += 1
        if fault := read_once(row, work):
            row.blame("uncaught", f"{kind.__name__} {index}: {fault}")
    return row


def read_once(row: Row, work: Callable[[], Any]) -> str:
    """Read one input; what was wrong with it, if anything was."""
    start, before = time.process_time(), most_memory()
    try:
        with warnings.catch_warnings(), time_limit("the input", 3 * LATEST):
            warnings.simplefilter("ignore")
            work()
        row.answered += 1
    except FlexlinError as error:
        if not str(error).strip():
            return "an error without words"
    except Exception as error:
        return f"{type(error).__name__}: {error}"[:500]
    finally:
        seconds, memory = time.process_time() - start, most_memory() - before
        row.slowest, row.largest = max(row.slowest, seconds), max(row.largest, memory)
    return f"{seconds:.1f} s, {memory / 2**20:.0f} MiB" if seconds > LATEST or memory > LARGEST else ""


def most_memory() -> int:
    """The most bytes that this process has held."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
