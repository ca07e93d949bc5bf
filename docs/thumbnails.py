"""The pictures of docs/studies.md: of each study's full run, of its record where it is of cost, of a small run where that takes hours."""

import tempfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from records import DOCS, measured, not_measured

PICTURES = DOCS / "pictures"
WIDTH, COLOURS = 1080, 256
"""Of a picture: pixels across, and shades that it is reduced to."""
LONG = ("own_error",)
"""Studies whose full run takes more than some minutes."""


RECORDED: dict[str, Callable[[Any, dict[str, Any], Path], None]] = {
    "cost_of_accuracy": lambda study, record, out: study.draw(
        [study.Row(**row) for row in record["rows"]], out / "x.svg"
    ),
    "compiled_peers": lambda study, record, out: study.draw(record["ratios"], out / "x.svg"),
    "riccati_race": lambda study, record, out: study.draw(record["times"], out / "x.svg"),
    "simulation_race": lambda study, record, out: study.draw(
        [study.Row(**row) for row in record["rows"]], out / "x.svg"
    ),
    "tuning_grid": lambda study, record, out: study.draw(record["rows"], out / "x.svg"),
    "torture": lambda study, record, out: study.draw([study.Row(**row) for row in record["rows"]], out / "x.svg"),
    "charts_speed": lambda study, record, out: study.draw(record, out),
    "taylor_cost": lambda study, record, out: study.draw([study.Cost(**row) for row in record["rows"]], out),
    "taylor_variables": lambda study, record, out: study.draw([study.Cost(**row) for row in record["rows"]], out),
    "scaling": lambda study, record, out: study.draw(
        [study.Cost(**not_measured(row)) for row in record["rows"]],
        {"floquet": float("nan"), **record["exponents"]},
        out / "x.svg",
    ),
}


def draw_pictures(names: list[str]) -> None:
    """Draw each study as a PNG."""
    from matplotlib.figure import Figure
    from PIL import Image

    save = Figure.savefig
    for name in names:

        def keep(figure: Any, path: Path, name: str = name, **_: Any) -> None:
            place = PICTURES / f"{name}.png"
            save(figure, place, dpi=WIDTH / figure.get_figwidth(), metadata={})
            Image.open(place).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(place, optimize=True)

        Figure.savefig = keep
        try:
            study = import_module(name)
            with tempfile.TemporaryDirectory() as out:
                if name in RECORDED:
                    RECORDED[name](study, measured(name), Path(out))
                else:
                    study.main("small" if name in LONG else "full", Path(out))
        finally:
            Figure.savefig = save
