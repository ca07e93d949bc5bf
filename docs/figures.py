"""Writes what the pages of docs/ show in figures, so that no number in them is typed by hand.

A block between `<!-- generated: NAME -->` and `<!-- end -->` is the output of one function below. Cheap blocks are computed anew; those
that take minutes, or are times, are rendered from docs/measured/NAME.json, which bears its date and its kind of machine.

    python docs/figures.py                    write all blocks anew
    python docs/figures.py --check            say which blocks differ, exit code 1 if one does
    python docs/figures.py --measure NAME ... run studies in full and keep their results in docs/measured (minutes, needs flexlin[peers])
    python docs/figures.py --pictures         draw the small pictures of docs/studies.md
"""

import argparse
import ast
import json
import os
import platform
import re
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict
from datetime import date
from importlib import import_module
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
ROOT = DOCS.parent
MEASURED, PICTURES, STUDIES = DOCS / "measured", DOCS / "pictures", ROOT / "studies"
BLOCK = re.compile(r"(<!-- generated: ([\w-]+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)
WIDTH = 540
"""Of a small picture, in pixels."""
sys.path[:0] = [str(ROOT), str(STUDIES), str(DOCS)]


def table(head: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def measured(name: str) -> dict[str, Any]:
    """What a study found when it was last run in full."""
    return json.loads((MEASURED / f"{name}.json").read_text(encoding="utf-8"))


def when(record: dict[str, Any]) -> str:
    """Where and when a record was made."""
    return f"Measured on {record['date']}: {record['machine']}, one thread."


def duration(milliseconds: float) -> str:
    """A time in words, with two digits."""
    unit, scale = ("us", 1e3) if milliseconds < 0.1 else ("ms", 1.0) if milliseconds < 1000 else ("s", 1e-3)
    return f"{two_digits(scale * milliseconds)} {unit}"


def two_digits(value: float) -> str:
    """A number rounded to two digits, without an exponent where it is large."""
    return f"{float(f'{value:.2g}'):.10g}"


def hard_cases() -> str:
    """Every hard case, computed anew (half a minute)."""
    return import_module("tests.periodic.hard_cases").table()


def cost_of_accuracy() -> str:
    """Programs beside each other: time, and its ratio to that of all exponents with their errors here."""
    record = measured("cost_of_accuracy")
    rows = record["rows"]
    modes = sorted({row["modes"] for row in rows})
    single = [row for row in rows if "batch" not in row["program"]]
    own = {row["modes"]: row["milliseconds"] for row in single if row["program"] == "flexlin, all exponents"}
    lines = []
    for program in dict.fromkeys(row["program"] for row in single):
        line = [program]
        for mode in modes:
            row = next(row for row in single if (row["program"], row["modes"]) == (program, mode))
            short = "" if row["reached"] else f", only {row['error']:.1e}"
            line += [duration(row["milliseconds"]) + short, two_digits(row["milliseconds"] / own[mode])]
        lines.append(line)
    head = ["program", *[cell for mode in modes for cell in (f"{mode} mode{'s' * (mode > 1)}", "ratio")]]
    batches = [
        [row["program"], str(row["modes"]), duration(row["milliseconds"]), f"{row['error']:.1e}"]
        for row in rows
        if "batch" in row["program"]
    ]
    all_exponents = (
        f"All exponents of the single link (1 mode) to 1e-8 by `fl.sweep`: {record['batch_us']:.0f} us a value, "
        f"largest error found {record['batch_error']:.1e}."
    )
    return "\n\n".join(
        [when(record), table(head, lines), table(["batch", "modes", "time a value", "error"], batches), all_exponents]
    )


def taylor_cost() -> str:
    """Routes to the Taylor polynomial of a closed loop, at order 5 and at order 8."""
    record = measured("taylor_cost")
    by_route: dict[str, dict[int, dict[str, Any]]] = {}
    for row in record["rows"]:
        by_route.setdefault(row["route"], {})[row["order"]] = row
    own = by_route["series, casadi.Function"][5]["evaluate"]
    lines = []
    for route, orders in by_route.items():
        cells = [duration(1e3 * orders[k]["evaluate"]) if k in orders else "-" for k in (5, 8)]
        ratio = two_digits(orders[5]["evaluate"] / own) if 5 in orders else "-"
        lines.append([route, cells[0], ratio, cells[1]])
    return when(record) + "\n\n" + table(["route", "order 5", "ratio", "order 8"], lines)


def taylor_variables() -> str:
    """The tip of an arm of twelve joints, beside daceypy."""
    record = measured("taylor_variables")
    lines = [
        [
            row["tool"],
            str(row["order"]),
            duration(1e3 * row["expand"]),
            duration(1e3 * row["evaluate"]),
            f"{row['bytes'] / 1e6:.0f} MB",
            f"{row['error']:.0e}",
        ]
        for row in record["rows"]
    ]
    return when(record) + "\n\n" + table(["tool", "order", "expand", "evaluate", "memory", "error in m"], lines)


def charts_speed() -> str:
    """Values of stability charts: by C, by NumPy, and by other programs."""
    record = measured("charts_speed")
    lines = [
        [
            row["scene"],
            duration(row["compiled_us"] / 1e3),
            two_digits(row["numpy_us"] / row["compiled_us"]),
            f"{row['distance_in_tol'] * 1e-8:.0e}",
        ]
        for row in record["rows"]
    ]
    own = record["peers_us"]["flexlin, all exponents"]
    peers = [[name, duration(us / 1e3), two_digits(us / own)] for name, us in record["peers_us"].items()]
    million = record["million"]
    compiling = max(row["compile_s"] for row in record["rows"])
    text = (
        f"A million values with one mode on all cores took {million['seconds']:.0f} s by the clock, compiler and start of the processes "
        f"counted, and {million['memory_mb']:.0f} MB, while {million['load']:.0f} processes wanted the processors. Compiling took "
        f"{compiling:.0f} s at the most. The last column is the largest distance from `floquet` on a random sample."
    )
    tables = [
        table(["scene", "a value in C", "NumPy takes times", "distance"], lines),
        table(["1 link, 1 mode", "a value", "ratio"], peers),
    ]
    return "\n\n".join([when(record), *tables, text])


def riccati_race() -> str:
    """The periodic Riccati solver beside SciPy's integrators, at 1e-10."""
    record = measured("riccati_race")
    own = next(iter(record["times"].values()))[0]
    lines = [
        [way, duration(1e3 * seconds), two_digits(seconds / own), f"{error:.1e}"]
        for way, (seconds, error) in record["times"].items()
    ]
    return when(record) + "\n\n" + table(["way", "time", "ratio", "error of X(0)"], lines)


def own_error() -> str:
    """The claimed errors of exponents before a jury of random systems."""
    record = measured("own_error")
    lines = []
    for row in map(not_measured, record["rows"]):
        judged = [f"{row['worst']:.2g}", f"{row['overestimate']:.2g}"] if row["exponents"] else ["", ""]
        counts = ("cases", "refused", "undecided", "wrong", "exponents", "missed", "missed3")
        lines.append([row["kind"], *[str(row[key]) for key in counts], *judged])
    head = [
        "kind",
        "systems",
        "refused",
        "undecided",
        "wrong verdicts",
        "exponents",
        "missed",
        "by more than 3",
        "worst true / claimed",
    ]
    return f"{when(record)} {record['part']}\n\n" + table([*head, "median claimed / true"], lines)


def scaling() -> str:
    """How equations grow with the number of coordinates."""
    record = measured("scaling")
    lines = [[name, f"{power:.2f}"] for name, power in record["exponents"].items()]
    largest = max(record["rows"], key=lambda row: row["coordinates"])
    text = (
        f"The largest chain, {largest['links']} links with {largest['modes']} modes each ({largest['coordinates']} coordinates), "
        f"is built in {duration(1e3 * largest['build'])} and linearized in {duration(1e3 * largest['linearize'])}."
    )
    return f"{when(record)} {text}\n\n" + table(["quantity", "grows with this power of the coordinates"], lines)


def tracking() -> str:
    """What remains of the tip's error under each kind of feedforward, computed anew."""
    import flexlin as fl
    from flexlin import control

    scene = fl.load_scene("single-link")
    loop = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    fed = {
        "rigid": "torque of the rigid arm",
        "joint-exact": "torque that keeps the joint exactly on its path",
        "tip-exact": "torque and joint motion that keep each link's end on its line",
    }
    rows = [
        [f"`{kind}`", what, f"{1e3 * control.feedforward(loop, kind).tip_error:.2g} mm"] for kind, what in fed.items()
    ]
    return table(["kind", "fed forward", "what remains on the shipped link at 0.5 Hz"], rows)


def second_frequency(shapes: str, modes: int) -> float:
    """Of the arm of De Luca and Siciliano at rest, stretched out, joints locked, undamped, in rad/s."""
    import numpy as np
    from scipy.linalg import eigh

    import flexlin as fl

    rest = {"kind": "harmonic", "frequency": 1.0, "drive": "prescribed", "joints": [{"amplitude": 0.0}] * 2}
    scene = fl.load_scene(
        "de-luca-siciliano-1991",
        {
            **{f"links.{i}.{key}": value for i in (0, 1) for key, value in (("modes", modes), ("mode_shapes", shapes))},
            "motion": rest,
            "control": {},
            "effects.modal_damping": "off",
        },
    )
    c = fl.linearize(fl.build_manipulator(scene), scene.motion).sample(np.zeros(1))
    return float(np.sqrt(eigh(c.K[0], c.M[0], eigvals_only=True)[1]))


def mode_shapes() -> str:
    """How far the second frequency of a loaded two-link arm is off, by shapes and their number."""
    exact = second_frequency("clamped-loaded", 12)
    rows = [
        [
            str(modes),
            *[f"{second_frequency(shapes, modes) / exact - 1:.1e}" for shapes in ("clamped-free", "clamped-loaded")],
        ]
        for modes in (2, 4, 8)
    ]
    return table(["modes a link", "`clamped-free`", "`clamped-loaded`"], rows)


def studies() -> str:
    """Every study with the question that it asks, and its picture."""
    rows = []
    for path in sorted(STUDIES.glob("*.py")):
        question = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").splitlines()[0]
        picture = f"![{path.stem}](pictures/{path.stem}.png)" if (PICTURES / f"{path.stem}.png").exists() else ""
        rows.append([f"[`{path.stem}`](../studies/{path.name})", question, picture])
    return table(["study", "question", "its picture, of the small run"], rows)


def licences() -> str:
    """The packages that flexlin stands on, with the licence that each states."""
    return table(["package", "licence", "needed"], import_module("licences").rows())


def torture() -> str:
    """What the torture found in full."""
    record = measured("torture")
    lines = [
        [
            row["part"],
            str(row["runs"]),
            *[str(row[key]) for key in ("answered", "uncaught", "keyless", "mixed", "left")],
            f"{row['slowest']:.1f}",
            f"{row['largest'] / 2**20:.0f}" if row["largest"] else "-",
        ]
        for row in record["rows"]
    ]
    head = [
        "part",
        "runs",
        "answered",
        "uncaught",
        "without a key",
        "mixed or half",
        "left over",
        "slowest, s",
        "most memory, MiB",
    ]
    return when(record) + "\n\n" + table(head, lines)


BLOCKS: dict[str, Callable[[], str]] = {
    "hard-cases": hard_cases,
    "cost-of-accuracy": cost_of_accuracy,
    "taylor-cost": taylor_cost,
    "taylor-variables": taylor_variables,
    "charts-speed": charts_speed,
    "riccati-race": riccati_race,
    "own-error": own_error,
    "scaling": scaling,
    "tracking": tracking,
    "mode-shapes": mode_shapes,
    "studies": studies,
    "licences": licences,
    "torture": torture,
}


def rendered(text: str, only: set[str] | None = None) -> str:
    """A page with its blocks (those of these names) made anew."""

    def fresh(match: re.Match[str]) -> str:
        name = match[2]
        return match[0] if only is not None and name not in only else f"{match[1]}{BLOCKS[name]()}\n{match[4]}"

    return BLOCK.sub(fresh, text)


def measure_cost_of_accuracy(out: str) -> dict[str, Any]:
    return import_module("cost_of_accuracy").main("full", out)


def measure_taylor_cost(out: str) -> dict[str, Any]:
    return {"rows": [asdict(cost) for cost in import_module("taylor_cost").main("full")]}


def measure_taylor_variables(out: str) -> dict[str, Any]:
    return {"rows": [asdict(cost) for cost in import_module("taylor_variables").main("full")]}


def measure_riccati_race(out: str) -> dict[str, Any]:
    return {"times": import_module("lqr_designs").race()}


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
    return import_module("charts_speed").run("full", out)


MEASURES = {
    "charts_speed": measure_charts_speed,
    "cost_of_accuracy": measure_cost_of_accuracy,
    "taylor_cost": measure_taylor_cost,
    "taylor_variables": measure_taylor_variables,
    "riccati_race": measure_riccati_race,
    "own_error": measure_own_error,
    "scaling": measure_scaling,
    "torture": measure_torture,
}


def measure(name: str) -> None:
    """Run a study in full and keep what it found."""
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # before NumPy is loaded
    with tempfile.TemporaryDirectory() as out:
        found = MEASURES[name](out)
    machine = f"{os.cpu_count()} cores, {platform.machine()}, {platform.system()}, shared with other work"
    record = {"date": date.today().isoformat(), "machine": machine, **found}
    (MEASURED / f"{name}.json").write_text(json.dumps(record, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def not_measured(row: dict[str, Any]) -> dict[str, Any]:
    """A row of a record with its gaps as numbers that are none."""
    return {key: float("nan") if value is None else value for key, value in row.items()}


RECORDED: dict[str, Callable[[Any, dict[str, Any], Path], None]] = {
    "cost_of_accuracy": lambda study, record, out: study.draw(
        [study.Row(**row) for row in record["rows"]], out / "x.svg"
    ),
    "taylor_cost": lambda study, record, out: study.draw([study.Cost(**row) for row in record["rows"]], out),
    "taylor_variables": lambda study, record, out: study.draw([study.Cost(**row) for row in record["rows"]], out),
    "scaling": lambda study, record, out: study.draw(
        [study.Cost(**not_measured(row)) for row in record["rows"]],
        {"floquet": float("nan"), **record["exponents"]},
        out / "x.svg",
    ),
}


def draw_pictures(names: list[str]) -> None:
    """Draw each study's small run as a small PNG, studies of cost and size from their records."""
    from matplotlib.figure import Figure

    save = Figure.savefig
    for name in names:

        def keep(figure: Any, path: Path, name: str = name, **_: Any) -> None:
            save(
                figure,
                PICTURES / f"{name}.png",
                dpi=WIDTH / figure.get_figwidth(),
                pil_kwargs={"optimize": True},
                metadata={},
            )

        Figure.savefig = keep
        try:
            study = import_module(name)
            with tempfile.TemporaryDirectory() as out:
                if name in RECORDED:
                    RECORDED[name](study, measured(name), Path(out))
                else:
                    study.main("small", Path(out))
        finally:
            Figure.savefig = save


def main(arguments: list[str] | None = None) -> int:
    """Write, check, measure or draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--measure", nargs="+", choices=MEASURES, default=[])
    parser.add_argument("--pictures", nargs="*", choices=[path.stem for path in STUDIES.glob("*.py")])
    options = parser.parse_args(arguments)
    for name in options.measure:
        measure(name)
    if options.pictures is not None:
        draw_pictures(options.pictures or sorted(path.stem for path in STUDIES.glob("*.py")))
        return 0
    stale = []
    for page in sorted(DOCS.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        fresh = rendered(text)
        if fresh != text:
            stale.append(page.name)
            if not options.check:
                page.write_text(fresh, encoding="utf-8")
    print(f"{'differ' if options.check else 'written'}: {', '.join(stale) or 'none'}")
    return int(options.check and bool(stale))


if __name__ == "__main__":
    sys.exit(main())
