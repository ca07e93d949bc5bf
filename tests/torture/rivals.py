"""Two programs that write to one place without end, and a reader."""

import hashlib
import json
import os
import subprocess
import sys
import time
from pathlib import Path

from tests.files.reader import leftovers
from tests.torture.rows import Row


def writers(count: int, number: int, out: Path) -> Row:
    """Two programs that write C source to one place without end, and a reader who opens the folder and reads its files."""
    row, folder = Row("writers"), out / "shared"
    code = (
        "import sys, numpy as np, flexlin as fl\n"
        "from flexlin.control import gain_source, pd_feedback\n"
        "system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])\n"
        "made = pd_feedback(system, [0], [float(sys.argv[2])], [2.0])\n"
        "while True: gain_source(made, 1.0, sys.argv[1], samples=int(sys.argv[3]))\n"
    )
    one = [sys.executable, "-c", code, str(folder)]
    both = [subprocess.Popen([*one, "4", "16"]), subprocess.Popen([*one, "5", "32"])]
    try:
        while row.runs < count and all(process.poll() is None for process in both):
            parts = read_together(folder, ("gain.c", "gain.h", "main.c", "flexlin-results.json"))
            if parts is None:
                time.sleep(0.001)
                continue
            row.runs += 1
            row.answered += 1
            if not agree(parts):
                row.mixed += 1
    finally:
        for process in both:
            process.terminate()
            process.wait()
    row.uncaught = count - row.runs
    with_gain = [sys.executable, "-c", code.replace("while True: ", ""), str(folder), "4", "16"]
    subprocess.run(with_gain, check=True)
    row.left = len(leftovers(folder))
    return row


def read_together(folder: Path, names: tuple[str, ...]) -> dict[str, bytes] | None:
    """Files of one moment: the folder is opened first; None where it is being taken away."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except FileNotFoundError:
        return None
    try:
        files = [os.open(name, os.O_RDONLY, dir_fd=handle) for name in names]
    except FileNotFoundError:
        return None
    finally:
        os.close(handle)
    found = {}
    for name, file in zip(names, files, strict=True):
        with open(file, "rb") as opened:
            found[name] = opened.read()
    return found


def agree(parts: dict[str, bytes]) -> bool:
    """Whether the files have the checksums of the manifest that was read with them."""
    stated = json.loads(parts["flexlin-results.json"])["sets"]["gain"]["sha256"]
    return all(hashlib.sha256(parts[name]).hexdigest() == digest for name, digest in stated.items())
