"""Draws docs/house.svg: the rooms of flexlin, their sizes, and who imports whom, read from the code and from the import contract.

The build of the site draws it; `python docs/draw_house.py` does so alone.
"""

import ast
import re
import textwrap
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from html import escape
from pathlib import Path

DOCS = Path(__file__).parent
ROOT = DOCS.parent
PACKAGE, PICTURE = ROOT / "flexlin", DOCS / "house.svg"
WIDTH, MARGIN, TOP, ROW, HEIGHT = 1160, 40, 92, 108, 62
"""Pixels: of the picture, its margin, the first row's top, from row to row, of a room."""
CENTRES = {
    "cli": 600, "report": 400, "analyses": 560, "simulation": 760, "control": 900, "linearization": 600,
    "motion": 400, "mechanics": 230, "scene": 150, "series": 400, "kronecker": 560, "periodic": 905,
}  # fmt: skip
"""Where each room stands across; its row is its layer in the import contract."""
COLOURS = {"bridge": "#5b6b3a", "above": "#4a4a55", "symbolic": "#a8522f", "numeric": "#22628f", "ground": "#6b6257"}
WINGS = {
    **dict.fromkeys(["motion", "mechanics", "scene", "series"], "symbolic"),
    **dict.fromkeys(["kronecker", "periodic"], "numeric"),
    "linearization": "bridge",
}


def is_package(name: str) -> bool:
    """Whether it is a folder of modules; a folder of before, with nothing but compiled files in it, is none."""
    return (PACKAGE / name / "__init__.py").exists()


GROUND = tuple(
    name
    for name in (
        *("symbolic", "program", "plots", "_core", "lazy", "files"),
        *("arguments", "checks", "bounds", "errors", "precision", "summary", "resources", "context"),
    )
    if is_package(name) or (PACKAGE / name).with_suffix(".py").exists()
)
"""What nearly every room stands on: drawn as the ground, without arrows."""
WING_WIDTH, DEEPER = 430, 170
"""Pixels: of the numeric wing, whose rooms are shown one by one, and by which its row is higher than the others."""


@dataclass(frozen=True)
class Room:
    """A box: left, top, width, height, and what is written in it."""

    name: str
    x: float
    y: float
    w: float
    h: float
    colour: str

    @property
    def middle(self) -> float:
        return self.x + self.w / 2


def files_of(name: str) -> list[Path]:
    """All files of a package or module, given as a path with slashes."""
    folder = PACKAGE / name
    return sorted(folder.rglob("*.py")) if is_package(name) else [folder.with_suffix(".py")]


def size_of(name: str) -> tuple[int, int]:
    """Lines and files of a room."""
    files = files_of(name)
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files), len(files)


def purpose_of(name: str) -> str:
    """The first line of a room's docstring."""
    first = PACKAGE / name / "__init__.py" if is_package(name) else files_of(name)[0]
    return (ast.get_docstring(ast.parse(first.read_text(encoding="utf-8"))) or "").split("\n")[0]


def layers(name: str) -> list[list[str]]:
    """The rows of an import contract, from above."""
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    contract = next(one for one in tools["importlinter"]["contracts"] if one["name"] == name)
    return [[word.removeprefix("flexlin.") for word in re.findall(r"[\w.]+", row)] for row in contract["layers"]]


@cache
def imported(path: Path) -> tuple[str, ...]:
    """The modules of flexlin that a file imports, once for each import statement."""
    return tuple(list_imports(path))


def list_imports(path: Path) -> Iterator[str]:
    """The same, one after the other."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module == "flexlin":
            yield from (f"flexlin.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or ""


def arrows(rooms: list[str], prefix: str = "") -> Counter[tuple[str, str]]:
    """How many import statements lead from one room to another."""
    found: Counter[tuple[str, str]] = Counter()
    for source in rooms:
        for path in files_of(prefix + source):
            for module in imported(path):
                target = module.removeprefix(f"flexlin.{prefix.replace('/', '.')}").split(".")[0]
                if module.startswith(f"flexlin.{prefix.replace('/', '.')}") and target in rooms and target != source:
                    found[source, target] += 1
    return found


def house() -> tuple[dict[str, Room], int]:
    """The rooms above the ground with their places, and the number of rows."""
    rows = [row for row in layers("imports point downward only") if not set(row) <= set(GROUND)]
    rooms = {}
    for i, row in enumerate(rows):
        for name in row:
            width = WING_WIDTH if name == "periodic" else 145 + 1.6 * size_of(name)[0] ** 0.5
            y, height = TOP + i * ROW, float(HEIGHT)
            if name == "periodic":
                height += 2 * ROW + DEEPER
                y -= 2 * ROW
            colour = COLOURS[WINGS.get(name, "above")]
            rooms[name] = Room(name, CENTRES.get(name, 600) - width / 2, y, width, height, colour)
    return rooms, len(rows)


def port(room: Room, others: list[str], other: str, rooms: dict[str, Room]) -> float:
    """Where along a room's edge the line to another room begins: lines leave in the order of their ends."""
    ordered = sorted(others, key=lambda name: (rooms[name].middle, name))
    return room.x + room.w * (ordered.index(other) + 1) / (len(ordered) + 1)


def lines(rooms: dict[str, Room], found: Counter[tuple[str, str]]) -> Iterator[str]:
    """A curve for each pair of rooms, as wide as the imports are many; pale where a way through other rooms exists."""
    for (source, target), count in sorted(found.items(), key=lambda item: (item[1], item[0])):
        a, b = rooms[source], rooms[target]
        x0 = port(a, [t for s, t in found if s == source], target, rooms)
        x1 = port(b, [s for s, t in found if t == target], source, rooms)
        y0, y1 = a.y + a.h, b.y - 6
        reach = max(28.0, 0.45 * (y1 - y0))
        opacity = 0.25 if around(source, target, found) else 0.75
        yield (
            f'<path d="M{x0:.1f} {y0:.1f} C{x0:.1f} {y0 + reach:.1f} {x1:.1f} {y1 - reach:.1f} {x1:.1f} {y1:.1f}" '
            f'stroke="{b.colour}" stroke-width="{0.8 + 0.6 * count**0.5:.2f}" stroke-opacity="{opacity}" '
            f'marker-end="url(#tip-{b.colour[1:]})">'
            f"<title>{source} imports {target} {count} times</title></path>"
        )


def around(source: str, target: str, found: Counter[tuple[str, str]]) -> bool:
    """Whether the target is reached through another room as well."""
    between = [t for s, t in found if s == source and t != target]
    return any((room, target) in found or around(room, target, found) for room in between)


def box(room: Room, path: str, words: int = 2, title: int = 15) -> Iterator[str]:
    """A room with its name, its size and its purpose."""
    count, files = size_of(path)
    yield f"<g><title>{escape(purpose_of(path))} ({files} file{'s' * (files > 1)})</title>"
    yield (
        f'<rect x="{room.x:.1f}" y="{room.y:.1f}" width="{room.w:.1f}" height="{room.h:.1f}" rx="7" fill="#fffdf8" '
        f'stroke="{room.colour}" stroke-width="1.6"/>'
    )
    yield (
        f'<text x="{room.x + (10 if room.w > 100 else 6):.1f}" y="{room.y + title + 5:.1f}" class="name" font-size="{title}" '
        f'fill="{room.colour}">{room.name}</text>'
    )
    if room.w > 100:
        yield f'<text x="{room.x + room.w - 9:.1f}" y="{room.y + title + 4:.1f}" class="size" text-anchor="end">{count} lines</text>'
    text = purpose_of(path).rstrip(".") if words else ""
    for i, line in enumerate(textwrap.wrap(text, int((room.w - 16) / 5.9), max_lines=words or 1, placeholder=" …")):
        yield f'<text x="{room.x + 10:.1f}" y="{room.y + title + 21 + 13 * i:.1f}" class="purpose">{escape(line)}</text>'
    yield "</g>"


def wing(periodic: Room) -> Iterator[str]:
    """The rooms inside the numeric wing, row by row as its own contract has them."""
    rows = layers("inside the numeric wing")
    top, bottom = periodic.y + 58, periodic.y + periodic.h - 6
    step = (bottom - top) / len(rows)
    for i, row in enumerate(rows):
        width = (periodic.w - 20 - 8 * (len(row) - 1)) / len(row)
        for k, name in enumerate(row):
            room = Room(name, periodic.x + 10 + k * (width + 8), top + i * step, width, step - 5, periodic.colour)
            yield from box(room, f"periodic/{name}", 0, 12 if width > 100 else 10)


def ground(y: float) -> Iterator[str]:
    """The ground: what nearly every room stands on."""
    width = (WIDTH - 2 * MARGIN - 8 * (len(GROUND) - 1)) / len(GROUND)
    for k, name in enumerate(GROUND):
        yield from box(Room(name, MARGIN + k * (width + 8), y, width, HEIGHT, COLOURS["ground"]), name, title=12)


def picture() -> str:
    """The whole picture as SVG."""
    rooms, count = house()
    found = arrows(list(rooms))
    floor = TOP + count * ROW + DEEPER + 4
    height = floor + HEIGHT + 44
    tips = "".join(
        f'<marker id="tip-{c[1:]}" viewBox="0 0 8 8" refX="2" refY="4" markerWidth="9" markerHeight="9" '
        f'markerUnits="userSpaceOnUse" orient="auto"><path d="M0 0L8 4L0 8z" fill="{c}"/></marker>'
        for c in sorted(set(COLOURS.values()))
    )
    total, files = size_of("")
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:.0f}" role="img" '
        'aria-label="The rooms of flexlin and the imports between them">',
        "<style>text{font-family:DejaVu Sans,Helvetica,Arial,sans-serif}.name{font-weight:600}"
        ".size{font-size:10px;fill:#8a8378}.purpose{font-size:10.5px;fill:#3d3a35}.wing{font-size:12px;fill:#8a8378}</style>",
        f"<defs>{tips}</defs>",
        f'<rect width="{WIDTH}" height="{height:.0f}" fill="#faf6ec"/>',
        f'<text x="{MARGIN}" y="42" class="name" font-size="24" fill="#2d2a26">flexlin, room by room</text>',
        f'<text x="{MARGIN}" y="64" class="wing">{total} lines in {files} files. An arrow: imports; wider where there are more, '
        "pale where there is a way through other rooms too. All point down; lint-imports holds it.</text>",
        f'<g fill="none">{"".join(lines(rooms, found))}</g>',
        *[part for name, room in rooms.items() for part in box(room, name)],
        *wing(rooms["periodic"]),
        f'<path d="M{MARGIN} {floor - 14:.1f}H{WIDTH - MARGIN}" stroke="{COLOURS["ground"]}" stroke-width="3"/>',
        *ground(floor),
        f'<text x="{MARGIN}" y="{floor + HEIGHT + 24:.1f}" class="wing">the ground: nearly every room stands on it '
        "(its arrows are left out)</text>",
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def draw() -> None:
    """Write the picture beside the pages."""
    PICTURE.write_text(picture(), encoding="utf-8")


if __name__ == "__main__":
    draw()
