"""What a result looks like: one description, drawn by matplotlib, as a card in a notebook, or said in words."""

from flexlin.plots.comparison import Comparison, compare, plot_chart

__all__ = ["Comparison", "compare", "plot_chart"]
