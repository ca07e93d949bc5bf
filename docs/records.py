"""Studies run in full, and what they found kept in docs/measured with its date and its kind of machine."""

import json
import os
import platform
import sys
import tempfile
from dataclasses import asdict
from datetime import date
from importlib import import_module
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
MEASURED, STUDIES = DOCS / "measured", DOCS.parent / "studies"
sys.path[:0] = [str(DOCS.parent), str(STUDIES)]


def measured(name: str) -> dict[str, Any]:
    """What a study found when it was last run in full."""
    return json.loads((MEASURED / f"{name}.json").read_text(encoding="utf-8"))


def not_measured(row: dict[str, Any]) -> dict[str, Any]:
    """A row of a record with its gaps as numbers that are none."""
    return {key: float("nan") if value is None else value for key, value in row.items()}


def measure_cost_of_accuracy(out: str) -> dict[str, Any]:
    return import_module("cost_of_accuracy").main("full", out)


def measure_taylor_cost(out: str) -> dict[str, Any]:
    return {"rows": [asdict(cost) for cost in import_module("taylor_cost").main("full")]}


def measure_taylor_variables(out: str) -> dict[str, Any]:
    return {"rows": [asdict(cost) for cost in import_module("taylor_variables").main("full")]}


def measure_riccati_race(out: str) -> dict[str, Any]:
    return {"times": import_module("riccati_race").main("full", out)}


def measure_own_error(out: str) -> dict[str, Any]:
    found = import_module("own_error").main("medium", out)
    rows = [{k: None if v != v else v for k, v in row.items()} for row in found["rows"]]
    return {"part": "One eighth of the systems of each kind.", "rows": rows}


def measure_scaling(out: str) -> dict[str, Any]:
    found = import_module("scaling").main("sizes", out)
    rows = [{k: None if v != v else v for k, v in asdict(cost).items()} for cost in found["costs"]]
    return {"rows": rows, "exponents": {name: power for name, power in found["exponents"].items() if power == power}}


def measure_torture(out: str) -> dict[str, Any]:
    rows = import_module("torture").main("full", out)["rows"]
    return {"rows": [{**row, "wrong": []} for row in rows]}


def measure_charts_speed(out: str) -> dict[str, Any]:
    return import_module("charts_speed").main("full", out)


def measure_tuning_grid(out: str) -> dict[str, Any]:
    return {"rows": import_module("tuning_grid").main("full", Path(out))}


def measure_compiled_peers(out: str) -> dict[str, Any]:
    return import_module("compiled_peers").main("full", out)


def measure_simulation_race(out: str) -> dict[str, Any]:
    return import_module("simulation_race").main("full", out)


MEASURES = {
    "charts_speed": measure_charts_speed,
    "compiled_peers": measure_compiled_peers,
    "cost_of_accuracy": measure_cost_of_accuracy,
    "taylor_cost": measure_taylor_cost,
    "taylor_variables": measure_taylor_variables,
    "riccati_race": measure_riccati_race,
    "own_error": measure_own_error,
    "scaling": measure_scaling,
    "simulation_race": measure_simulation_race,
    "torture": measure_torture,
    "tuning_grid": measure_tuning_grid,
}


def measure(name: str) -> None:
    """Run a study in full and keep what it found."""
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # before NumPy is loaded
    with tempfile.TemporaryDirectory() as out:
        found = MEASURES[name](out)
    machine = f"{os.cpu_count()} cores, {platform.machine()}, {platform.system()}, shared with other work"
    record = {"date": date.today().isoformat(), "machine": machine, **found}
    (MEASURED / f"{name}.json").write_text(json.dumps(record, indent=1, allow_nan=False) + "\n", encoding="utf-8")
