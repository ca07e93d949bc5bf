"""What each command of the command line does: read the scene, call the library, print, write."""

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from flexlin.errors import ArgumentError

if TYPE_CHECKING:
    from flexlin.scene import Scene

DONE, FAILED, BAD_INPUT, OTHER_VERDICT = 0, 1, 2, 3
"""Exit codes."""


def loaded(options: argparse.Namespace) -> "Scene":
    """The scene with its overrides, once the output folder has been found usable."""
    from flexlin.files import check_folder
    from flexlin.scene import load_scene
    from flexlin.scene.overrides import parse_assignment

    check_folder(options.out)
    return load_scene(options.scene, dict(parse_assignment(text) for text in options.overrides))


def list_scenes(options: argparse.Namespace) -> int:
    import tomllib

    from flexlin.scene.library import builtin_scenes

    for name, path in builtin_scenes().items():
        print(f"{name:<24} {tomllib.loads(path.read_text(encoding='utf-8'))['title']}")
    return DONE


def check(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.about.linear import linearize
    from flexlin.mechanics import build_manipulator
    from flexlin.report.record import effects

    plant = linearize(build_manipulator(scene), scene.motion, scene.control)
    print(f"{scene.title}: usable")
    print(f"  coordinates  {', '.join(plant.names)}")
    print(f"  torques on   {', '.join(plant.inputs) or 'no joint'}")
    print(f"  effects on   {', '.join(effects(scene)['on']) or 'none'}")
    print(f"  period       {plant.period:.6g} s")
    return DONE


def write_coefficients(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.about.linear import linearize
    from flexlin.mechanics import build_manipulator
    from flexlin.report.tables import coefficients_dataset, write_dataset

    arm = build_manipulator(scene)
    plant, closed = linearize(arm, scene.motion), linearize(arm, scene.motion, scene.control)
    return print_paths(
        write_dataset(coefficients_dataset(scene, plant, closed, options.points), options.out, "coefficients")
    )


def report(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.report.writing import write_report

        analysis, paths = write_report(
            scene, options.out, command(options), progress, options.effects, options.sensitivity
        )
    from flexlin.report.terminal import summarize

    summarize(analysis)
    print_paths(paths)
    return OTHER_VERDICT if options.require not in (None, analysis.own.verdict) else DONE


def write_gains(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress
    from flexlin.report.terminal import loop_line, say

    if not scene.designs:
        raise ArgumentError("nothing to design", got="no [[designs]] table", expected="at least one in the scene")
    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.answers.analysis import plant_and_designs
        from flexlin.answers.clock import Clock
        from flexlin.report.tables import gains_dataset, write_dataset

        plant, loops = plant_and_designs(scene, Clock(progress))
    for loop in loops:
        say(loop_line(loop, plant.period), loop.verdict)
    made = [loop.design for loop in loops if loop.design is not None]
    print_paths(write_dataset(gains_dataset(scene, plant, made, options.points), options.out, "gains") if made else [])
    if len(made) < len(loops):
        return FAILED
    return OTHER_VERDICT if options.require and any(loop.verdict != options.require for loop in loops) else DONE


def write_simulation(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.about.linear import linearize
    from flexlin.mechanics import build_manipulator
    from flexlin.report.progress import Progress
    from flexlin.report.tables import described, write_dataset
    from flexlin.simulation import simulate

    with Progress() as progress:
        progress("nonlinear simulation")
        closed = linearize(build_manipulator(scene), scene.motion, scene.control)
        forward = None
        if options.feedforward != "scene":
            from flexlin.control import feedforward

            forward = feedforward(closed, options.feedforward)
        result = simulate(closed, options.periods, feedforward=forward)
    print(result.status)
    if options.attraction:
        from flexlin.control import linear_range
        from flexlin.simulation import region_of_attraction

        print(linear_range(closed).status)
        print(region_of_attraction(closed).status)
    data = described(
        result.dataset(), scene, closed.period, "deviations from the rigid motion as states [y; y'], tips in m"
    )
    paths = write_dataset(data, options.out, "simulation")
    if options.animate:
        from flexlin.files import write_text
        from flexlin.report.animation import animation_page

        write_text(options.out / "animation.html", animation_page(scene, closed, result, command(options)))
        paths.append(options.out / "animation.html")
    return print_paths(paths)


def audit_effects(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.answers.audit import audit
        from flexlin.files import write_text
        from flexlin.report.record import audit_block, to_json
        from flexlin.report.terminal import audit_lines, say

        result = audit(scene, options.tolerance, progress)
    for line in audit_lines(result):
        say(line)
    write_text(options.out / "effects.json", to_json({"schema": 1, "title": scene.title, **audit_block(result)}))
    return print_paths([options.out / "effects.json"])


def write_chart(options: argparse.Namespace) -> int:
    scene = loaded(options)
    spans, several = options.over, len(options.over) > 1
    if len(spans) > 2 or len({key for key, *_ in spans}) < len(spans):
        got = ", ".join(key for key, *_ in spans)
        raise ArgumentError("a chart has one or two axes", got=f"--over {got}", expected="one or two different keys")
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        import numpy as np

        from flexlin.answers.sweep import sweep
        from flexlin.files import write_text
        from flexlin.report.figures.chart import draw_chart
        from flexlin.report.page import picture_page
        from flexlin.report.tables import storable, write_dataset

        progress("exponents of all values")
        values = {key: np.linspace(low, high, number or (60 if several else 200)) for key, low, high, number in spans}
        data = sweep(scene, values, grid=several)
        picture = draw_chart(data)
    print(picture.caption)
    page = options.out / "chart.html"
    write_text(page, picture_page(scene.title, picture, command(options)))
    return print_paths([page, *write_dataset(storable(data), options.out, "chart")])


def write_cost(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        import json

        from flexlin.answers.accuracy import cost
        from flexlin.files import write_text
        from flexlin.report.figures.cost import cost_table, draw_cost
        from flexlin.report.page import picture_page

        progress("accuracy against time, stage by stage")
        result = cost(scene)
    print(cost_table(result))
    page, data = options.out / "cost.html", options.out / "cost.json"
    write_text(page, picture_page(scene.title, draw_cost(result), command(options)))
    write_text(data, json.dumps(result.record(), indent=1))
    return print_paths([page, data])


def export(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.answers.analysis import plant_and_designs
        from flexlin.answers.clock import Clock
        from flexlin.report.exports import design_folders, export_all

        design_folders([table.name for table in scene.designs])  # clashing names are refused before any work
        plant, loops = plant_and_designs(scene, Clock(progress))
        paths = export_all(plant, loops, options.out, options.points)
    for loop in loops:
        if loop.design is None:
            print(f"{loop.name}: {loop.problem}")
    print_paths(paths)
    return FAILED if any(loop.design is None for loop in loops) else DONE


def print_paths(paths: list[Path]) -> int:
    """Print where the results are; done."""
    for path in paths:
        print(f"wrote {path}")
    return DONE


def command(options: argparse.Namespace) -> str:
    """The command line that made a page, without its output folder."""
    overrides = [word for text in options.overrides for word in ("--set", text)]
    axes = [
        f"{key}={low:g}:{high:g}" + (f":{number}" if number else "")
        for key, low, high, number in getattr(options, "over", [])
    ]
    over = ["--over", *axes] if axes else []
    flags = [f"--{name}" for name in ("effects", "sensitivity", "animate") if getattr(options, name, False)]
    forward = getattr(options, "feedforward", "scene")
    flags += [] if forward == "scene" else ["--feedforward", forward]
    return shlex.join(["flexlin", options.command, options.scene, *overrides, *over, *flags])
