"""What a result looks like: figures as data, drawn as SVG or by matplotlib, cards of notebooks, and words."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {"plots.view": "Comparison compare plot_chart"},
    within={
        "plots.panel": "SMALL_FONT Mark Panel draw measure_text",
        "plots.scales": "Linear Logarithmic Symlog",
        "plots.view": "MOST_POINTS Series Shown View make_card",
    },
)
