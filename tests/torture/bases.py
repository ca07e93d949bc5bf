"""Scenes to change: the built-in ones, and more for what these do not show; with the files that stand beside a scene."""

import math
import tomllib
from copy import deepcopy
from pathlib import Path
from typing import Any

from flexlin.scene import builtin_scenes

Raw = dict[str, Any]
BUILT_IN = {name: tomllib.loads(path.read_text(encoding="utf-8")) for name, path in builtin_scenes().items()}


def sampled_cycle(rows: int = 64) -> str:
    """A motion table of one joint."""
    lines = [f"{2.0 * k / rows!r},{0.4 * math.sin(2 * math.pi * k / rows)!r}" for k in range(rows + 1)]
    return "t,q1\n" + "\n".join(lines) + "\n"


def measured(rows: int = 60) -> str:
    """A log of one joint: its torque, its angle, and the tip's place."""
    times = [0.01 * k for k in range(rows)]
    return "t,u,angle,x\n" + "".join(f"{t!r},{math.sin(9 * t)!r},{0.1 * math.cos(5 * t)!r},{t * t!r}\n" for t in times)


def of_table() -> Raw:
    """A motion that stands in a file."""
    return {**deepcopy(BUILT_IN["single-link"]), "motion": {"kind": "table", "file": "cycle.csv"}}


def of_series() -> Raw:
    """A Fourier series, judged about the elastic motion too, with tip-exact feedforward."""
    raw = deepcopy(BUILT_IN["single-link"])
    joints = [{"mean": 0.1, "cos": [0.2, 0.05], "sin": [0.1]}]
    raw["motion"] = {"kind": "fourier", "period": 2.0, "joints": joints}
    raw["control"] |= {"about": "elastic", "feedforward": "tip-exact"}
    return raw


def of_one_way() -> Raw:
    """A motion that ends, with a design over its horizon."""
    raw = deepcopy(BUILT_IN["pick-and-place"])
    raw["motion"]["course"] = "one-way"
    weights = {"joints": "0.5 deg", "rates": "5 deg/s", "deflection": "8 mm", "input": "3 N m"}
    raw["designs"] = [{"name": "to the end", "kind": "finite-horizon-lqr", "weights": weights}]
    return raw


def of_designs() -> Raw:
    """Every kind of design, an estimator, drives, and a sampled loop."""
    raw = deepcopy(BUILT_IN["single-link"])
    kinds = ("periodic", "frozen", "averaged")
    weights = deepcopy(raw["designs"][0]["weights"])
    raw["designs"] = [{"name": f"{kind} Ω", "kind": f"{kind}-lqr", "weights": weights} for kind in kinds]
    raw["designs"][0]["estimator"] = {"encoders": "0.02 deg", "tip": "1 mm", "torque": "10 mN m"}
    raw["control"] |= {"sampling": {"period": 0.004, "delay": 0.001}, "saturation": {"torque": [2.0]}}
    raw["drives"] = {"torque": {"peak": "12 N m", "continuous": "5 N m"}, "speed": "180 deg/s"}
    return raw


BASES: dict[str, Raw] = {
    **BUILT_IN,
    "table": of_table(),
    "series": of_series(),
    "one-way": of_one_way(),
    "designs": of_designs(),
}
"""Scenes that are changed, by name."""
URDF = builtin_scenes()["manutec-r3"].with_suffix(".urdf").read_text(encoding="utf-8")
FILES = {
    "cycle.csv": sampled_cycle(),
    "log.csv": measured(),
    "manutec-r3.urdf": URDF,
    "words.csv": "t,q1\n0,secret\n1,2\n",
    "nan.csv": "t,q1\n0,nan\n1,inf\n2,0\n",
    "back.csv": "t,q1\n0,0\n2,1\n1,0\n",
    "wide.csv": "t" + ",q" * 3000 + "\n" + "0," * 3000 + "0\n",
    "none.csv": "",
    "half.urdf": URDF[: len(URDF) // 2],
    "nested.urdf": "<robot name='x'>" + "<link>" * 5000 + "</link>" * 5000 + "</robot>",
}
"""What stands beside a scene, whole and broken."""


def put_files(folder: Path) -> None:
    """Put the files beside the scenes of a folder, and a folder of that kind of name."""
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "folder.csv").mkdir(exist_ok=True)
