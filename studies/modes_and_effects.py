"""How many modes, and which effects, does an arm need for a wanted accuracy, and what do they cost?

Each arm is taken with more modes than needed and with shear and rotary inertia on top of its own effects: that is the truth of this study.
Then modes are taken away one by one, and effects one at a time: error of the slowest frequencies, of the tip's excursion in the periodic
response and of the stability margin, beside the time to evaluate the coefficients.

    python studies/modes_and_effects.py [--size small] [--out DIR]
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from shared.running import run_study

import flexlin as fl
from flexlin.analyses.audit import Measure, measure
from flexlin.analyses.audit.versions import read_scale
from flexlin.scene.effects import known_effects

SIZES = {
    "full": {"single-link": (1, 2, 3, 4, 6, 10), "pick-and-place": (1, 2, 3, 5)},
    "small": {"single-link": (1, 2, 4)},
}
"""The arms, and numbers of modes a link; the last is the truth."""
BEYOND = ("rotary_inertia", "shear")


@dataclass(frozen=True)
class Row:
    """One version of an arm: relative errors of frequencies (joints + 1 slowest), of the tip's excursion and of the margin."""

    arm: str
    version: str
    frequency: float
    tip: float
    margin: float
    instructions: int
    microseconds: float


def with_modes(scene: fl.Scene, modes: int) -> fl.Scene:
    """The scene with this many modes on every link that bends."""
    links = tuple(link.model_copy(update={"modes": modes if link.modes else 0}) for link in scene.links)
    return scene.model_copy(update={"links": links})


def with_effects(scene: fl.Scene, **tables: object) -> fl.Scene:
    """The scene with these effects changed."""
    return scene.model_copy(update={"effects": scene.effects.model_copy(update=tables)})


def compared(arm: str, version: str, scene: fl.Scene, truth: Measure) -> Row:
    """Measure a version and hold it against the truth."""
    found, count = measure(scene), len(scene.links) + 1
    common = min(count, len(found.frequencies))
    frequency = np.max(np.abs(found.frequencies[:common] / truth.frequencies[:common] - 1))
    return Row(
        arm,
        version,
        float(frequency),
        abs(found.tip_error / truth.tip_error - 1),
        abs(found.margin / truth.margin - 1),
        found.instructions,
        found.microseconds,
    )


def rows_of(arm: str, modes: tuple[int, ...]) -> list[Row]:
    """All versions of one arm."""
    own = fl.load_scene(arm)
    scale, known = read_scale(own), known_effects()
    full = with_effects(own, **{name: known[name].tried_with(scale) for name in BEYOND})
    *fewer, most = modes
    truth = measure(with_modes(full, most))
    rows = [compared(arm, f"{m} modes", with_modes(full, m), truth) for m in fewer]
    enough = with_modes(full, fewer[-1])
    return rows + [
        compared(arm, f"without {name}", with_effects(enough, **{name: None}), truth)
        for name in full.effects.on()
        if name != "hub"
    ]


def table(rows: list[Row]) -> str:
    """The rows as text."""
    head = f"{'arm':16s}{'version':34s}{'frequency':>11s}{'tip':>11s}{'margin':>11s}{'instr.':>8s}{'µs':>7s}"
    lines = [
        f"{r.arm:16s}{r.version:34s}{r.frequency:11.1e}{r.tip:11.1e}{r.margin:11.1e}{r.instructions:8d}{r.microseconds:7.2f}"
        for r in rows
    ]
    return "\n".join([head, *lines])


def draw(rows: list[Row], path: Path) -> None:
    """Error of frequencies and of the tip against work (instructions, for times are noisy), modes as lines, effects as marked points."""
    from matplotlib.figure import Figure

    arms = list(dict.fromkeys(row.arm for row in rows))
    figure = Figure(figsize=(7.2, 3.6 * len(arms)), layout="constrained")
    for axes, arm in zip(np.atleast_1d(figure.subplots(len(arms))), arms, strict=True):
        for quantity, colour in (("frequency", "#0072B2"), ("tip", "#D55E00")):
            versions = [row for row in rows if row.arm == arm]
            modes = [row for row in versions if row.version.endswith("modes")]
            axes.semilogy(
                [r.instructions for r in modes],
                [getattr(r, quantity) for r in modes],
                "o-",
                color=colour,
                label=f"{quantity}: modes {modes[0].version.split()[0]} to {modes[-1].version.split()[0]}",
            )
        effects = [row for row in versions if row.version.startswith("without")]
        worst = [max(r.frequency, r.tip) for r in effects]
        axes.semilogy([r.instructions for r in effects], worst, "kx", label="without one effect (the larger error)")
        for place, (height, row) in enumerate(sorted(zip(worst, effects, strict=True), key=lambda pair: -pair[0])):
            axes.annotate(
                row.version.removeprefix("without "),
                (row.instructions, height),
                fontsize="small",
                xytext=(1.03, 0.95 - 0.09 * place),
                textcoords="axes fraction",
                verticalalignment="center",
                arrowprops={"arrowstyle": "-", "color": "0.7", "linewidth": 0.6},
            )
        axes.set(xlabel="instructions of M, D, K, h (times in the table)", ylabel="relative error", title=arm)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(loc="lower left", frameon=False, fontsize="small")
    figure.savefig(path)


def main(size: str = "full", out: str | Path = "out/studies") -> list[Row]:
    """Run the study; returns all rows."""
    rows = [row for arm, modes in SIZES[size].items() for row in rows_of(arm, modes)]
    print(table(rows))
    draw(rows, Path(out) / "modes_and_effects.svg")
    return rows


if __name__ == "__main__":
    run_study(main, sizes=SIZES)
