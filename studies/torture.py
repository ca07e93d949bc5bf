"""Is anything lost, endless or let in? Mutated scenes, kills, full disks, several writers, little memory, misuse.

Scenes are drawn from the JSON schema, or are built-in ones with some places changed; each run is a process of its own. A run
is uncaught when an exception or a signal ends it; without a key when it refuses a scene and names none of its keys. After a kill or on
a full disk a reader who knows nothing but docs/results.md looks for sets that are mixed or half, and for leftovers after the next run.

    OMP_NUM_THREADS=1 python studies/torture.py [--size small|full] [--part NAME ...] [--seed 0] [--out DIR]
"""

import json
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

from shared.running import run_study

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # scenes, trials and reader live with the tests

from tests.torture.accidents import disks, kills, lone_files, memory, writers
from tests.torture.fuzzing import check, commands, whole_commands
from tests.torture.inputs import inputs
from tests.torture.misuse import misuse
from tests.torture.trial import Row

SIZES = {
    "small": {
        "check": 3,
        "commands": 1,
        "whole": 5,
        "inputs": 150,
        "kills": 2,
        "files": 2,
        "disks": 1,
        "writers": 8,
        "memory": 1,
        "misuse": 1,
    },
    "full": {
        "check": 10_000,
        "commands": 500,
        "whole": 300,
        "inputs": 10_000,
        "kills": 200,
        "files": 60,
        "disks": 50,
        "writers": 1000,
        "memory": 40,
        "misuse": 22,
    },
}
PARTS = {
    "check": check,
    "commands": commands,
    "whole": whole_commands,
    "inputs": inputs,
    "kills": kills,
    "files": lone_files,
    "disks": disks,
    "writers": writers,
    "memory": memory,
    "misuse": misuse,
}


def draw(rows: list[Row], path: Path) -> None:
    """Runs of each part, and what went wrong."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 3.4), layout="constrained")
    axes = figure.add_subplot(title="Runs, and what should not be among them", xlabel="number of runs")
    names = [row.part for row in rows]
    bad = [row.uncaught + row.keyless + row.mixed + row.left for row in rows]
    axes.barh(names, [row.runs for row in rows], color="0.8", label="runs")
    axes.barh(names, bad, color="tab:red", label="uncaught, without a key, mixed or left over")
    axes.set_xscale("symlog", linthresh=1.0)
    axes.invert_yaxis()
    figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=8)
    figure.savefig(path)


def main(size: str, out: Path | str, parts: tuple[str, ...] = tuple(PARTS), number: int = 0) -> dict:
    """Run the parts; print and keep what they found."""
    place = Path(out)
    print("part        runs answered uncaught keyless mixed left  slowest  largest (s, MiB)")
    rows = []
    for part in parts:
        with tempfile.TemporaryDirectory(dir=place) as folder:
            try:
                rows.append(PARTS[part](SIZES[size][part], number, Path(folder)))
            except PermissionError as error:  # who may not mount a disk cannot fill one
                print(f"{part}: {error}")
                continue
        print(rows[-1].line(), flush=True)
        (place / f"torture-{part}-{number}.json").write_text(json.dumps(asdict(rows[-1]), indent=1), encoding="utf-8")
    draw(rows, place / "torture.svg")
    return {"rows": [asdict(row) for row in rows]}


if __name__ == "__main__":
    found = run_study(
        main,
        sizes=SIZES,
        part={"nargs": "+", "choices": PARTS, "default": tuple(PARTS), "dest": "parts"},
        seed={"type": int, "default": 0, "dest": "number"},
    )
    sys.exit(any(row["wrong"] for row in found["rows"]))
