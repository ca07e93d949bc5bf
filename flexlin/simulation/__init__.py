"""The full nonlinear closed loop: the judge of every linear answer."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {
        "Attraction": "flexlin.simulation.attraction",
        "Drive": "flexlin.simulation.drive",
        "NonlinearLoop": "flexlin.simulation.loop",
        "Simulation": "flexlin.simulation.result",
        "check_duration": "flexlin.simulation.run",
        "predict": "flexlin.simulation.prediction",
        "region_of_attraction": "flexlin.simulation.attraction",
        "simulate": "flexlin.simulation.run",
        "tip_positions": "flexlin.control.tracking",
    },
)
