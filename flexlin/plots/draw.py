"""Views in matplotlib: axes in, axes out. No other file of flexlin imports matplotlib."""

from typing import TYPE_CHECKING, Any

from flexlin.errors import ArgumentError
from flexlin.plots.card import COLOURS
from flexlin.plots.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FEW = 12
"""Curves that a legend names."""


def draw_view(view: View, ax: "Axes | None", style: dict[str, Any]) -> "Axes":
    """Draw a view into axes, or into those of a new figure."""
    axes = open_axes(ax)
    kinds = {"line": {}, "dashed": {"linestyle": "--"}, "dots": {"linestyle": "none", "marker": "o"}}
    for i, series in enumerate(view.series):
        how: dict[str, Any] = {"color": COLOURS[i % len(COLOURS)], **kinds[series.style], **style}
        axes.plot(series.x, series.y, label=series.name, **how)
    if view.zero:
        axes.axvline(0.0, color="0.5", linestyle=":", linewidth=1.0)
    axes.set_xlabel(view.x_label)
    axes.set_ylabel(view.y_label)
    axes.set_title(f"{view.title}: {view.verdict}" if view.verdict else view.title)
    if 1 < len(view.series) <= FEW:
        axes.legend()
    return axes


def open_axes(ax: "Axes | None") -> "Axes":
    """The axes that were given, or those of a new figure.

    Raises: ArgumentError where matplotlib is missing, or what was given are no axes.
    """
    if ax is not None:
        if not hasattr(ax, "plot") or not hasattr(ax, "set_xlabel"):
            raise ArgumentError(
                "ax is of another kind", got=repr(ax)[:80], expected="matplotlib axes, or None for a new figure"
            )
        return ax
    try:
        from matplotlib import pyplot
    except ImportError:
        raise ArgumentError(
            "drawing needs matplotlib",
            got="no such package",
            todo="pip install 'flexlin[plot]', or read the numbers: to_xarray()",
        ) from None
    return pyplot.subplots()[1]
