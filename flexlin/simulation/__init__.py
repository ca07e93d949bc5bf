"""The full nonlinear closed loop: the judge of every linear answer."""

from flexlin.control.tracking import tip_positions
from flexlin.simulation.attraction import Attraction, region_of_attraction
from flexlin.simulation.drive import Drive
from flexlin.simulation.loop import NonlinearLoop
from flexlin.simulation.prediction import predict
from flexlin.simulation.result import Simulation
from flexlin.simulation.run import check_duration, simulate

__all__ = [
    "Attraction",
    "Drive",
    "NonlinearLoop",
    "Simulation",
    "check_duration",
    "predict",
    "region_of_attraction",
    "simulate",
    "tip_positions",
]
