"""Blocks of the pages that are rendered from docs/measured: what takes minutes, or is a time."""

import statistics
from typing import Any

from records import measured, not_measured
from tables import duration, table, two_digits


def when(record: dict[str, Any]) -> str:
    """Where and when a record was made."""
    return f"Measured on {record['date']}: {record['machine']}, one thread."


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
    all_exponents = (
        f"All exponents of the single link (1 mode) to 1e-8 by `fl.sweep`: {record['batch_us']:.0f} us a value, "
        f"largest error found {record['batch_error']:.1e}."
    )
    return "\n\n".join([when(record), table(head, lines), all_exponents])


def compiled_peers() -> str:
    """flexlin with its errors beside the fastest settings of peers that numba compiles; medians of a group's systems."""
    record = measured("compiled_peers")
    lines, designs = [], []
    for group in dict.fromkeys(row["group"] for row in record["rows"]):
        own = [row for row in record["rows"] if row["group"] == group and row["program"] == "flexlin"]
        if group in record["ratios"]:
            ratios = [two_digits(record["ratios"][group].get(kind, float("nan"))) for kind in ("Magnus 6", "DOP853")]
            ratios = ["" if ratio == "nan" else ratio for ratio in ratios]
            lines.append([group, duration(statistics.median(row["milliseconds"] for row in own)), *ratios])
        else:
            designs += [f"{row['case']} {duration(row['milliseconds'])}" for row in own]
    head = ["system", "flexlin, exponents with errors", "times Magnus 6", "times DOP853"]
    text = f"`fl.periodic_lqr`, random systems with two harmonics: {', '.join(designs)}."
    return "\n\n".join([when(record), table(head, lines), text])


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
    """Values of stability charts: here, and by other programs."""
    record = measured("charts_speed")
    lines = [
        [
            row["scene"],
            duration(row["compiled_us"] / 1e3),
            f"{row['distance_in_tol'] * 1e-8:.0e}",
        ]
        for row in record["rows"]
    ]
    own = record["peers_us"]["flexlin, all exponents"]
    peers = [[name, duration(us / 1e3), two_digits(us / own)] for name, us in record["peers_us"].items()]
    million = record["million"]
    text = (
        f"A million values with one mode on all cores took {million['seconds']:.0f} s by the clock, loading counted, "
        f"and {million['memory_mb']:.0f} MB; the machine's load was {million['load']:.1f} meanwhile. "
        f"The last column is the largest distance from `floquet` on a random sample."
    )
    shares = {name: share for name, share in record["sharing"].items() if not name.endswith(", s")}
    text += (
        f" Shared out, the {record['sharing']['one process, s']:.0f} s of one processor become more by "
        + ", ".join(f"{100 * share:.1f} % ({name})" for name, share in shares.items())
    )
    text += ". Of the cluster, what it takes when idle is left out."
    tables = [
        table(["scene", "a value", "distance"], lines),
        table(["1 link, 1 mode", "a value", "ratio"], peers),
    ]
    return "\n\n".join([when(record), *tables, text])


def riccati_race() -> str:
    """The periodic Riccati solver beside SciPy's integrators, at 1e-10."""
    record = measured("riccati_race")
    lines = []
    for system, times in record["times"].items():
        own = next(iter(times.values()))[0]
        lines += [
            [system, way, duration(1e3 * seconds), two_digits(seconds / own), f"{error:.1e}"]
            for way, (seconds, error) in times.items()
        ]
    return when(record) + "\n\n" + table(["system", "way", "time", "ratio", "error of X(0)"], lines)


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


def tuning_grid() -> str:
    """Tuned gains against exhaustive grids."""
    record = measured("tuning_grid")
    lines = [
        [
            f"`{row['arm']}`",
            *[f"{row[key]:.3f}" for key in ("before", "tuned", "grid", "random")],
            f"{row['seconds']:.0f} s",
        ]
        for row in record["rows"]
    ]
    head = ["arm", "before, 1/s", "tuned, 1/s", "best of the grid, 1/s", "tuned, random scenarios alone, 1/s", "took"]
    return when(record) + "\n\n" + table(head, lines)


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
