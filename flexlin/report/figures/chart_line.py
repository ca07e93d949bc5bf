"""The growth rates of all exponents over one parameter, with the critical values."""

from collections.abc import Sequence

import numpy as np
import xarray

from flexlin.answers.critical_values import CriticalValue
from flexlin.checks import Array
from flexlin.report.wording import in_unit, is_dimensionless, without_units
from flexlin.svg import Linear, Panel, Row, Symlog, draw

WIDE = 30.0
"""Rates whose sizes span more than this are drawn on a scale of decades."""
NOISE, FLOOR = 20.0, 1e-6
"""Errors, and 1/s, below which differences of growth rates are not drawn larger."""
APART, BELOW = 0.08, 0.05
"""Of the width: labels of critical values closer than this are left out; of the height: how far below the top they stand."""


def draw_line(label: str, own: float, data: xarray.Dataset, critical: Sequence[CriticalValue], title: str) -> str:
    """All growth rates; the largest in the colour of its verdict; the unstable intervals shaded; critical values marked."""
    x = data[next(str(name) for name in data.coords)].to_numpy()
    growth, verdict = data["exponents"].real.to_numpy(), data["verdict"].to_numpy()
    scale = choose_scale(growth, data["error"].to_numpy())
    panel = Panel(
        in_unit("growth rates", "1/s"), x=Linear(float(x.min()), float(x.max())), y=scale, x_label=label
    ).zero()
    for begin, end in list_unstable(x, verdict, critical):
        low, high = limits_of(scale)
        panel.cells((np.array([begin]), np.array([end])), (np.array([low]), np.array([high])), "unstable", 0.1)
    for k in range(1, growth.shape[1]):
        panel.line(x, growth[:, k], "faint", width=0.9, opacity=0.7, label="other exponents" if k == 1 else "")
    panel.line(x, growth[:, 0], "ink", width=0.8)
    behind = "" if is_dimensionless() else " 1/s"
    for name in ("stable", "unstable", "undecided"):
        chosen = verdict == name
        if chosen.any():
            texts = [f"{a:.6g}: {b:.4g}{behind}" for a, b in zip(x[chosen], growth[chosen, 0], strict=True)]
            panel.dots(x[chosen], growth[chosen, 0], name, size=2.2, label=name, texts=texts)
    mark_critical(panel, critical, x, scale)
    mark_own(panel, own, x, scale)
    return draw([Row([panel], 300)], title)


def choose_scale(growth: Array, error: Array) -> Linear | Symlog:
    """Decades where the rates differ much, else equal steps; never finer than the errors of the rates."""
    known = growth[np.isfinite(growth)]
    noise = max(NOISE * float(np.nan_to_num(error).max(initial=0.0)), FLOOR)
    low, high = float(known.min(initial=0.0)), float(known.max(initial=0.0))
    sizes = np.abs(known[np.abs(known) > noise])
    if sizes.size and sizes.max() > WIDE * sizes.min():
        near = 10.0 ** np.floor(np.log10(max(sizes.min(), noise, sizes.max() * 1e-6)))
        return Symlog(float(near)).fitted(np.array([low, high, -near, near]))
    room = max(0.08 * (high - low), 2 * noise)
    return Linear(low - room, high + room)


def limits_of(scale: Linear | Symlog) -> tuple[float, float]:
    """Both ends of a fitted scale."""
    assert scale.low is not None
    assert scale.high is not None
    return scale.low, scale.high


def list_unstable(x: Array, verdict: Array, critical: Sequence[CriticalValue]) -> list[tuple[float, float]]:
    """The intervals of instability, from the critical values."""
    edges = [one for one in critical if not one.touching]
    begin = (
        float(x.min()) if (edges and edges[0].kind == "recovery") or (not edges and verdict[0] == "unstable") else None
    )
    found = []
    for one in edges:
        if one.kind == "onset":
            begin = one.value
        elif begin is not None:
            found.append((begin, one.value))
            begin = None
    return found if begin is None else [*found, (begin, float(x.max()))]


def mark_critical(panel: Panel, critical: Sequence[CriticalValue], x: Array, scale: Linear | Symlog) -> None:
    """A line and a diamond at each critical value, and its figure where there is room."""
    low, high = limits_of(scale)
    last = -np.inf
    for one in critical:
        panel.line([one.value, one.value], [low, high], "unstable", width=0.8, dash="3 2")
        text = f"{one.kind} at {one.value:.9g} ± {one.error:.0e}: {without_units(one.resonance)}"
        panel.dots([one.value], [0.0], "unstable", "diamond", 4.0, texts=[text])
        if one.value - last > APART * np.ptp(x):
            top = high - BELOW * (high - low) if isinstance(scale, Linear) else high
            panel.words(one.value, top, f"{one.value:.5g}", "unstable", halo=True)
            last = one.value


def mark_own(panel: Panel, own: float, x: Array, scale: Linear | Symlog) -> None:
    """The scene's own value, where it lies inside the range."""
    if x.min() <= own <= x.max():
        low, high = limits_of(scale)
        panel.line([own, own], [low, high], "blue", width=1.2, dash="6 3", label=f"the scene: {own:.4g}")
