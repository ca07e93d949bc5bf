"""Several loops in one picture, and a chart of stability."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.plots.view import Series, Shown, View, open_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHADES = {"stable": "#cfe8dd", "undecided": "#f2e3bd", "unstable": "#f3cdb6", "failed": "#dddddd"}


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
        series = [Series(name, *exponent_places(found), "dots") for name, found in self.results.items()]
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
    wrong = [
        name
        for name, found in dict(results).items()
        if not hasattr(found, "exponents") or not hasattr(found, "verdict")
    ]
    if wrong or not results:
        got = ", ".join(map(repr, wrong)) or "nothing"
        raise ArgumentError("a comparison is of Floquet results", got=got, expected="a result of floquet for each name")
    return Comparison(dict(results))


def exponent_places(found: Any) -> tuple[Array, Array]:
    """Growth rates in 1/s and frequencies in Hz of a Floquet result; of a pair the one above."""
    upper = found.exponents[found.exponents.imag >= 0]
    return upper.real, upper.imag / (2 * np.pi)


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
        raise ArgumentError(
            "there is no chart of this",
            got=repr(data)[:80],
            expected="what sweep hands back, over one or two parameters",
        )
    growth = np.real(data["exponents"].values).max(axis=-1)
    names = [str(name) for name in data.coords if data[name].ndim == 1 and data[name].dims[0] in data["verdict"].dims]
    axes = open_axes(ax)
    if growth.ndim == 1:
        axes.plot(data[names[0]].values, growth, marker=".")
        axes.axhline(0.0, color="0.5", linestyle=":")
        axes.set_ylabel("largest growth rate in 1/s")
    else:
        shades = {kind: [int(shade[k : k + 2], 16) / 255 for k in (1, 3, 5)] for kind, shade in SHADES.items()}
        x, y = (data[name].values for name in data["verdict"].dims)
        colours = np.array([[shades[str(kind)] for kind in row] for row in data["verdict"].values.T])
        axes.pcolormesh(x, y, colours, shading="nearest")
        axes.contour(x, y, growth.T, levels=[0.0], colors="k", linewidths=1.0)
        names = [str(name) for name in data["verdict"].dims]
        axes.set_ylabel(names[1])
    axes.set_xlabel(names[0])
    return axes
