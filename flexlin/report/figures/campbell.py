"""The Campbell diagram: frequencies over one parameter, with the multiples of the motion's frequency and the instabilities."""

import numpy as np
import xarray

from flexlin.checks import Array
from flexlin.periodic.assignment import assign
from flexlin.report.figures.style import SERIES, Picture
from flexlin.report.wording import in_unit, is_dimensionless
from flexlin.svg import Linear, Panel, Row, draw

TITLE = "Campbell diagram"
MOST = 12
"""Multiples of the motion's frequency that are drawn."""
APART = 0.03
"""Of the sides: labels of multiples closer than this are left out."""
NOISE = 1e-6
"""Growth, in 1/s, above which an exponent is marked as unstable."""


def draw_campbell(label: str, data: xarray.Dataset, error: float) -> Picture:
    """Frequencies in Hz, unstable ones marked; whole multiples of the motion's frequency as lines, halves dashed."""
    x, motion = data["value"].to_numpy(), data["motion"].to_numpy() / (2 * np.pi)
    frequency, growth = data["frequency"].to_numpy() / (2 * np.pi), data["growth"].to_numpy()
    shown = np.isfinite(frequency) & (frequency > 0)
    top = 1.08 * float(frequency[shown].max(initial=float(np.nanmax(motion))))
    panel = Panel(
        in_unit("frequencies", "Hz"), x=Linear(float(x.min()), float(x.max())), y=Linear(0.0, top), x_label=label
    )
    labelled = np.inf
    for k in range(1, 2 * MOST + 1):
        multiple = np.where(k * motion / 2 <= top, k * motion / 2, np.nan)
        if np.isfinite(multiple).any():
            panel.line(x, multiple, "faint", width=0.7 if k % 2 == 0 else 0.5, dash="" if k % 2 == 0 else "2 3")
            last = int(np.flatnonzero(np.isfinite(multiple))[-1])
            at = float(x[last] / np.ptp(x) + multiple[last] / top)
            if abs(at - labelled) > APART:
                text, labelled = f"{k // 2}" if k % 2 == 0 else f"{k}/2", at
                panel.words(float(x[last]), float(multiple[last]), text, anchor="end", halo=True)
    ordered = follow_lines(np.sort(frequency, axis=1)[:, ::2])
    for i in range(ordered.shape[1]):
        panel.line(x, ordered[:, i], SERIES[i % len(SERIES)], width=1.6)
    unstable = (growth > max(error, NOISE)) & np.isfinite(frequency)
    row, mode = np.nonzero(unstable)
    if len(row):
        cycle, rate = ("", "") if is_dimensionless() else (" Hz", " 1/s")
        pairs = zip(frequency[row, mode], growth[row, mode], strict=True)
        texts = [f"frequency {f:.4g}{cycle} grows by {g:.3g}{rate}" for f, g in pairs]
        panel.dots(x[row], frequency[row, mode], "unstable", size=3.0, label="unstable", texts=texts)
    return Picture("campbell", TITLE, write_caption(), draw([Row([panel], 320)], TITLE))


def follow_lines(values: Array) -> Array:
    """Values (V, k) with each row in the order in which the lines through the rows before go on: lines that cross go straight on."""
    found, known = values.copy(), np.flatnonzero(np.isfinite(values).all(axis=1))
    for k, row in enumerate(known[1:], start=1):
        last, before = found[known[k - 1]], found[known[max(k - 2, 0)]]
        cost = np.abs(2 * last[:, None] - before[:, None] - values[row])
        found[row] = values[row][assign(cost)]
    return found


def write_caption() -> str:
    """How to read the diagram."""
    return (
        "Frequencies of the Floquet modes, each taken near the mode of the averaged equations that it comes from. Thin lines: multiples of "
        "the motion's frequency, halves dashed; a mode that meets k/2 of it may resonate (order k), two modes where their sum or "
        "difference meets a multiple."
    )
