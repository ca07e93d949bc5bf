"""Taylor maps of explicit and implicit functions to any order, with their error, radius and linear range."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {
        "series.explicit": "taylor TaylorMap",
        "series.implicit": "implicit_taylor solve_implicit ImplicitMap c_code",
        "series.equations": "Radius",
    },
)
