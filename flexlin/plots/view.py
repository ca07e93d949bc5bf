"""The description of a result: its words and curves. It is made of numbers alone, so that every room may use it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from flexlin.checks import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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


class Shown:
    """A result that can be looked at: a subclass says what by `_view`."""

    def _view(self) -> View:
        raise NotImplementedError

    def summary(self) -> str:
        """Say in a few lines what this is and what came out.

        Returns
        -------
        str
            The lines.
        """
        view = self._view()
        head = f"{view.title}: {view.verdict}" if view.verdict else view.title
        return "\n".join([head, *(f"  {fact}" for fact in view.facts)])

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
        from flexlin.plots.draw import draw_view

        return draw_view(self._view(), ax, style)

    def _repr_html_(self) -> str:
        """The card of a notebook."""
        from flexlin.plots.card import make_card

        return make_card(self._view())
