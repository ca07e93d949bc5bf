"""The description of a result, its words and curves, and the three ways to show it: in lines, as a card of a notebook, in matplotlib.

No other file of flexlin imports matplotlib.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.plots.panel import Panel, draw, find_template
from flexlin.plots.scales import write_powers

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_POINTS = 120
"""Of a curve on a card."""
COLOURS = {
    "blue": "#0072b2",
    "vermilion": "#d55e00",
    "green": "#009e73",
    "purple": "#aa4499",
    "orange": "#e69f00",
    "sky": "#56b4e9",
}
"""Of loops, methods and modes: distinguishable with every kind of colour blindness. Source: Okabe, Ito (2002), Color Universal Design;
purple from Tol (2021)."""
PAPER = {"ink": "currentColor", "faint": "#888888", "grid": "#88888855", "paper": "transparent"}
"""Colours of a picture outside a report, whose page has its own."""
SHADES = {"stable": "#00734f", "unstable": "#b03a00", "undecided": "#8a5a00"}


@dataclass(frozen=True)
class Series:
    """One curve: its name, x (N,) and y (N,), and how it is drawn: "line", "dashed" or "dots"."""

    name: str
    x: Array
    y: Array
    style: str = "line"


@dataclass(frozen=True)
class View:
    """What is shown of a result: a title, a verdict where there is one, facts in words, and curves over named axes with units."""

    title: str
    verdict: str
    facts: tuple[str, ...]
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    zero: bool = False
    """Whether x = 0 is a border that is drawn, such as that of stability."""
    equal: bool = False
    """Whether a unit has the same length on both axes."""


class Shown:
    """A result that can be looked at: a subclass says what by `_view`."""

    def _view(self) -> View:
        raise NotImplementedError

    def _drawn(self) -> View:
        """What `plot` draws, where that takes longer than words and a card may."""
        return self._view()

    def summary(self) -> str:
        """Say in a few lines what this is and what came out.

        Returns
        -------
        str
            The lines.
        """
        view = self._view()
        head = f"{view.title}: {view.verdict}" if view.verdict else view.title
        return write_powers("\n".join([head, *(f"  {fact}" for fact in view.facts)]))

    def __str__(self) -> str:
        return self.summary()

    def plot(self, ax: "Axes | None" = None, **style: Any) -> "Axes":
        """Draw into matplotlib's axes.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure when none is given.
        **style : dict
            What every line takes, such as alpha=0.5.

        Returns
        -------
        matplotlib.axes.Axes
            The axes that were drawn into.

        Raises
        ------
        ArgumentError
            When matplotlib is not installed, or `ax` is something else.
        """
        return draw_view(self._drawn(), ax, style)

    def _repr_html_(self) -> str:
        """The card of a notebook."""
        return make_card(self._view())


def make_card(view: View) -> str:
    """The view as HTML that needs nothing else."""
    shade, panel = SHADES.get(view.verdict.partition(",")[0], "inherit"), draw_small(view)
    given = {"view": view, "shade": shade, "panel": panel, "colours": COLOURS | PAPER}
    return str(find_template("card.html.j2").render(given, draw=draw, write_powers=write_powers))


def draw_small(view: View) -> Panel | None:
    """The curves as a small panel; none where there is no finite one."""
    shown = [series for series in map(thin, view.series[: len(COLOURS)]) if len(series.x)]
    if not shown:
        return None
    panel = Panel(x_label=view.x_label, y_label=view.y_label, equal=view.equal, width=380.0, height=120.0)
    for series, colour in zip(shown, COLOURS, strict=False):
        if series.style == "dots":
            panel.dots(series.x, series.y, colour, texts=[series.name] * len(series.x))
        else:
            panel.line(series.x, series.y, colour, dash="5 3" * (series.style == "dashed"))
    if view.zero:
        y = np.concatenate([series.y for series in shown])
        panel.line([0.0, 0.0], [y.min(), y.max()], "faint", dash="3 3")
    return panel


def thin(series: Series) -> Series:
    """At most MOST_POINTS of the finite points, equally spaced among them."""
    finite = np.flatnonzero(np.isfinite(series.x) & np.isfinite(series.y))
    if len(finite) > MOST_POINTS:
        finite = finite[np.linspace(0, len(finite) - 1, MOST_POINTS).astype(int)]
    return Series(series.name, np.asarray(series.x)[finite], np.asarray(series.y)[finite], series.style)


def draw_view(view: View, ax: "Axes | None", style: dict[str, Any]) -> "Axes":
    """Draw a view into axes, or into those of a new figure."""
    axes, shades = open_axes(ax), tuple(COLOURS.values())
    kinds = {"line": {}, "dashed": {"linestyle": "--"}, "dots": {"linestyle": "none", "marker": "o"}}
    for i, series in enumerate(view.series):
        kind = "dashed" if series.style == "line" and i >= len(shades) else series.style  # colours begin anew
        how: dict[str, Any] = {"color": shades[i % len(shades)], **kinds[kind], **style}
        axes.plot(series.x, series.y, label=series.name, **how)
    if view.zero:
        axes.axvline(0.0, color="0.5", linestyle=":", linewidth=1.0)
    if view.equal:
        axes.set_aspect("equal", "datalim")
    axes.set_xlabel(view.x_label)
    axes.set_ylabel(view.y_label)
    axes.set_title(f"{view.title}: {view.verdict}" if view.verdict else view.title)
    if 1 < len(view.series) <= 2 * len(shades):  # no two look alike
        axes.legend()
    return axes


def open_axes(ax: "Axes | None") -> "Axes":
    """The axes that were given, or those of a new figure.

    Raises: ArgumentError where matplotlib is missing, or what was given are no axes.
    """
    if ax is not None:
        if not hasattr(ax, "plot") or not hasattr(ax, "set_xlabel"):
            expected = "matplotlib axes, or None for a new figure"
            raise ArgumentError("ax is of another kind", got=repr(ax)[:80], expected=expected)
        return ax
    try:
        from matplotlib import pyplot
    except ImportError:
        todo = "pip install matplotlib, or read the numbers: to_xarray()"
        raise ArgumentError("drawing needs matplotlib", got="no such package", todo=todo) from None
    return pyplot.subplots(layout="constrained")[1]


AREAS = {"stable": "#cfe8dd", "undecided": "#f2e3bd", "unstable": "#f3cdb6", "failed": "#dddddd"}


@dataclass(frozen=True)
class Comparison(Shown):
    """The exponents of several loops beside each other.

    Attributes
    ----------
    results : mapping of str to FloquetResult
        What `floquet` hands back, by the loops' names.

    Examples
    --------
    >>> import flexlin as fl
    >>> found = fl.floquet(fl.PeriodicSystem([[-1.0]], 1.0))
    >>> fl.plots.Comparison({"own": found}).plot().get_xlabel()
    'growth rate in 1/s'
    """

    results: Mapping[str, Any]

    def _view(self) -> View:
        facts = [
            f"{name}: {found.verdict}, growth rate {found.exponents[0].real:.5g} ± {found.errors[0]:.0e} 1/s"
            for name, found in self.results.items()
        ]
        series = []
        for name, found in self.results.items():
            upper = found.exponents[found.exponents.imag >= 0]  # of a pair the one above
            series.append(Series(name, upper.real, upper.imag / (2 * np.pi), "dots"))
        return View("loops compared", "", tuple(facts), "growth rate in 1/s", "frequency in Hz", tuple(series), True)


def compare(results: Mapping[str, Any]) -> Comparison:
    """Put the Floquet results of several loops beside each other.

    Parameters
    ----------
    results : mapping of str to FloquetResult
        What `floquet` hands back, by the loops' names.

    Returns
    -------
    Comparison
        To be drawn by `plot`, said by `summary`, or shown in a notebook.

    Raises
    ------
    ArgumentError
        When something in it is no Floquet result.

    Examples
    --------
    >>> import flexlin as fl
    >>> loops = {f"damping {d}": fl.floquet(fl.PeriodicSystem([[0.0, 1.0], [-1.0, -d]], 1.0)) for d in (0.1, -0.1)}
    >>> print(fl.plots.compare(loops).summary().partition(" ±")[0])
    loops compared
      damping 0.1: stable, growth rate -0.05
    """
    wrong = [name for name, found in dict(results).items() if not hasattr(found, "log_multipliers")]
    if wrong or not results:
        got = ", ".join(map(repr, wrong)) or "nothing"
        raise ArgumentError("a comparison is of Floquet results", got=got, expected="a result of floquet for each name")
    return Comparison(dict(results))


def plot_chart(data: Any, ax: "Axes | None" = None) -> "Axes":
    """Draw the dataset of a sweep: the largest growth rate over one parameter, or the verdicts over two.

    Parameters
    ----------
    data : xarray.Dataset
        What `sweep` hands back, over one parameter or over a grid of two.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure when none is given.

    Returns
    -------
    matplotlib.axes.Axes
        The axes that were drawn into.

    Raises
    ------
    ArgumentError
        When the data are no sweep of one or two parameters, or matplotlib is missing.

    Examples
    --------
    >>> import flexlin as fl
    >>> data = fl.sweep(fl.load_scene("spinning-link"), {"motion.joints.0.rate": [2.0, 3.0, 4.0]}, 1e-5)
    >>> fl.plots.plot_chart(data).get_xlabel()
    'motion.joints.0.rate'
    """
    if not hasattr(data, "coords") or "verdict" not in data or data["verdict"].ndim not in (1, 2):
        expected = "what sweep hands back, over one or two parameters"
        raise ArgumentError("there is no chart of this", got=repr(data)[:80], expected=expected)
    growth = np.real(data["exponents"].values).max(axis=-1)
    names = [str(name) for name in data.coords if data[name].ndim == 1 and data[name].dims[0] in data["verdict"].dims]
    axes = open_axes(ax)
    if growth.ndim == 1:
        axes.plot(data[names[0]].values, growth, marker=".")
        axes.axhline(0.0, color="0.5", linestyle=":")
        axes.set_ylabel("largest growth rate in 1/s")
    else:
        shades = {kind: [int(shade[k : k + 2], 16) / 255 for k in (1, 3, 5)] for kind, shade in AREAS.items()}
        x, y = (data[name].values for name in data["verdict"].dims)
        colours = np.array([[shades[str(kind)] for kind in row] for row in data["verdict"].values.T])
        axes.pcolormesh(x, y, colours, shading="nearest")
        axes.contour(x, y, growth.T, levels=[0.0], colors="k", linewidths=1.0)
        names = [str(name) for name in data["verdict"].dims]
        axes.set_ylabel(names[1])
    axes.set_xlabel(names[0])
    return axes
