"""Taylor maps of explicit and implicit functions to any order, with their error, radius and linear range."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {
        "ImplicitMap": "flexlin.series.implicit_map",
        "Radius": "flexlin.series.radius",
        "TaylorMap": "flexlin.series.explicit",
        "c_code": "flexlin.series.unroll",
        "implicit_taylor": "flexlin.series.implicit",
        "solve_implicit": "flexlin.series.solution",
        "taylor": "flexlin.series.explicit",
    },
)
