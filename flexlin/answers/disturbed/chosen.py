"""A disturbance of a loop that a scene names: its own, or that of one of its designs."""

from flexlin.about.linear import linearize
from flexlin.answers.clock import Clock
from flexlin.answers.disturbed.noise import NoiseAnswer, answer_noise
from flexlin.answers.disturbed.respond import DisturbanceAnswer, respond
from flexlin.answers.disturbed.stated import Kind, state_disturbance
from flexlin.control.catalogue import design
from flexlin.errors import ArgumentError
from flexlin.mechanics import build_manipulator
from flexlin.scene.scene import Scene

LEAST = 1e-8
"""The smallest error that is asked for: plots show three digits."""


def answer_in_scene(
    scene: Scene, kind: Kind, words: str, loop: str = "own", periods: float | None = None, clock: Clock | None = None
) -> DisturbanceAnswer | NoiseAnswer:
    """Answer a disturbance in words of the scene's own loop, or of a design by its name.

    Raises: ArgumentError for words that cannot be read, an unknown loop, or one that is not stable.
    """
    clock, asked = clock or Clock(), scene.accuracy
    tables = {table.name: table for table in scene.designs}
    if loop != "own" and loop not in tables:
        raise ArgumentError("there is no such loop", got=repr(loop), expected=" | ".join(["own", *tables]))
    tol = max(asked.tol, LEAST)
    arm = clock.stage("equations of motion", asked, lambda: build_manipulator(scene))
    closed = clock.stage("linearization", asked, lambda: linearize(arm, scene.motion, scene.control))
    stated = state_disturbance(kind, words, closed)
    law, system = closed.law, closed.periodic_system()
    if loop != "own":
        made = clock.stage(
            f"design: {loop}", asked, lambda: design(linearize(arm, scene.motion), tables[loop], asked.tol)
        )
        law, system = law.with_gain(made.K, made.controller), made.closed_loop
    if kind == "noise":
        return clock.stage("covariance", asked, lambda: answer_noise(closed, stated, system, tol))
    return clock.stage("answer", asked, lambda: respond(closed, stated, law, system, periods, tol, scene.drives))
