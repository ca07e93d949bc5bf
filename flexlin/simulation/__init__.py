"""The full nonlinear closed loop: the judge of every linear answer."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {
        "control.tracking": "tip_positions",
        "simulation.attraction": "Attraction region_of_attraction",
        "simulation.modes": "Drive",
        "simulation.loop": "NonlinearLoop",
        "simulation.collocation": "predict",
        "simulation.result": "Simulation",
        "simulation.run": "check_duration simulate",
    },
    within={"simulation.events": "Events"},
)
