"""The page of public Python names, by the question that they answer; written when the site is built."""

from collections.abc import Iterator
from pathlib import Path

PAGE = Path(__file__).parent / "reference" / "api.md"
HEAD = """# Python

The public names, by the question that they answer. Each page has formulas, units and an example that runs.
"""
QUESTIONS = (
    (
        "Scenes and models",
        "From a scene, a URDF file or your own equations to an arm.",
        "Scene load_scene parse_scene scenes scene_from_urdf build_manipulator Manipulator",
        "",
    ),
    (
        "Motions",
        "The rigid basic motion that all is linearized about.",
        "build_motion",
        "PeriodicMotion periodic_motion",
    ),
    (
        "Linearization",
        "M, D, K, h and B along the motion; A and B of your own equations along a trajectory.",
        "linearize Linearization Trajectory",
        "linearize_about",
    ),
    (
        "Taylor maps",
        "Functions and closed loops as polynomials; the Kronecker calculus behind them.",
        "taylor implicit_taylor TaylorMap kronecker screws",
        "",
    ),
    (
        "Stability",
        "Periodic systems x' = A(t) x, with or without an arm.",
        "PeriodicSystem PeriodicStateSpace floquet FloquetResult floquet_modes forced_response respond frequency_response margins"
        " h2_norm hinf_norm invariant_zeros periodic_lyapunov",
        "sampled_floquet linear_range",
    ),
    (
        "Controllers",
        "Designs; each is judged by `floquet` afterwards.",
        "control periodic_lqr sampled_lqr sampled_estimator output_lqr tune",
        "Design design periodic_lqr averaged_lqr frozen_lqr finite_horizon_lqr horizon_system pd_feedback"
        " physical_weights with_integral_action scene_feedback Feedforward feedforward drive_load",
    ),
    (
        "Sensors and estimators",
        "",
        "",
        "Sensors scene_sensors joint_angles joint_rates bending tip_position tip_acceleration"
        " Estimator kalman_filter output_feedback",
    ),
    (
        "Many values",
        "Charts, families, and the values at which stability changes.",
        "PeriodicFamily sweep critical_values stability_boundary nearest_instability sensitivity",
        "",
    ),
    (
        "Simulation and judgement",
        "The nonlinear equations, which effects a scene calls for, and what accuracy costs.",
        "simulate audit cost",
        "",
    ),
    ("Measured logs", "The equations against a machine.", "Log read_log predict identify select_effects", ""),
    (
        "Exports and pictures",
        "",
        "plots",
        "to_control periodic_plant gain_schedule lifted_model gain_source estimator_source linearization_source save",
    ),
    ("Errors", "", "errors", ""),
)
"""Title, what it is about, names of flexlin, names of flexlin.control."""


def lists(of_flexlin: str, of_control: str) -> Iterator[str]:
    """The lists of names below one title, as directives of Sphinx."""
    for module, names in (("flexlin", of_flexlin), ("flexlin.control", of_control)):
        if names:
            yield f".. currentmodule:: {module}\n\n.. autosummary::\n   :toctree: generated\n"
            yield "\n".join(f"   {name}" for name in names.split()) + "\n"


def write_names() -> None:
    """Write the page where it is another one, so that nothing is built twice."""
    parts = [
        f"## {title}\n\n{about}\n\n```{{eval-rst}}\n" + "\n".join(lists(*names)) + "\n```\n"
        for title, about, *names in QUESTIONS
    ]
    page = "\n".join([HEAD, *parts])
    if not PAGE.exists() or PAGE.read_text(encoding="utf-8") != page:
        PAGE.write_text(page, encoding="utf-8")
