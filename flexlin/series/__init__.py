"""Taylor maps of explicit and implicit functions to any order, with their error, radius and linear range."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {
        "series.maps": "taylor TaylorMap implicit_taylor solve_implicit ImplicitMap c_code",
        "series.equations": "Radius",
    },
)
