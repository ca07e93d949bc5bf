"""Controllers for a periodic linear system: each design the same interface, each closed loop ready for Floquet's verdict."""

from flexlin.control.about_motion import linearize_about
from flexlin.control.averaged import averaged_lqr
from flexlin.control.catalogue import design
from flexlin.control.design import Design
from flexlin.control.estimator import Estimator, kalman_filter, output_feedback
from flexlin.control.finite_horizon import finite_horizon_lqr
from flexlin.control.frozen import frozen_lqr
from flexlin.control.pd import pd_feedback
from flexlin.control.periodic import periodic_lqr
from flexlin.control.periodic_motion import PeriodicMotion, periodic_motion
from flexlin.control.tracking import Feedforward, feedforward

__all__ = [
    "Design",
    "Estimator",
    "Feedforward",
    "PeriodicMotion",
    "averaged_lqr",
    "design",
    "feedforward",
    "finite_horizon_lqr",
    "frozen_lqr",
    "kalman_filter",
    "linearize_about",
    "output_feedback",
    "pd_feedback",
    "periodic_lqr",
    "periodic_motion",
]
