"""What each command of the command line does: read the scene, call the library, print, write."""

import argparse
import math
import shlex
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from flexlin.errors import ArgumentError

if TYPE_CHECKING:
    from flexlin.scene import Scene

DONE, FAILED, BAD_INPUT, OTHER_VERDICT = 0, 1, 2, 3
"""Exit codes."""
ACCURACY = {"tol": "tol", "limit_seconds": "seconds", "limit_memory": "memory"}
"""Options that stand for a key of the scene's table [accuracy]."""


def loaded(options: argparse.Namespace) -> "Scene":
    """The scene with its overrides, once the output folder has been found usable."""
    from flexlin.files import check_folder
    from flexlin.scene import load_scene
    from flexlin.scene.overrides import parse_assignment

    check_folder(options.out)
    overrides = dict(parse_assignment(text) for text in options.overrides)
    asked = {f"accuracy.{key}": getattr(options, name, None) for name, key in ACCURACY.items()}
    overrides |= {key: value for key, value in asked.items() if value is not None}
    return load_scene(options.scene, overrides)


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
    from flexlin.answers.clock import Clock
    from flexlin.mechanics import build_manipulator
    from flexlin.report.tables import coefficients_dataset, write_dataset

    clock, asked = Clock(), scene.accuracy
    arm = clock.stage("equations of motion", asked, lambda: build_manipulator(scene))
    plant, closed = (linearize(arm, scene.motion, control) for control in (None, scene.control))
    data = clock.stage("coefficients", asked, lambda: coefficients_dataset(scene, plant, closed, options.points))
    return print_paths(write_dataset(data, options.out, "coefficients"))


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
    if analysis.own.floquet is None:
        return FAILED
    return OTHER_VERDICT if options.require not in (None, analysis.own.verdict) else DONE


def write_gains(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress
    from flexlin.report.terminal import accuracy_lines, say, say_loop

    if not scene.designs:
        raise ArgumentError("nothing to design", got="no [[designs]] table", expected="at least one in the scene")
    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.answers.analysis import plant_and_designs
        from flexlin.answers.clock import Clock
        from flexlin.report.tables import check_gains, gains_dataset, write_dataset

        check_gains(scene, options.points)
        clock = Clock(progress)
        plant, loops = plant_and_designs(scene, clock)
    for loop in loops:
        say_loop(loop, plant.period)
    for line in accuracy_lines(tuple(clock.steps)):
        say(line)
    made = [loop.design for loop in loops if loop.design is not None]
    print_paths(write_dataset(gains_dataset(scene, plant, made, options.points), options.out, "gains") if made else [])
    if len(made) < len(loops):
        return FAILED
    return OTHER_VERDICT if options.require and any(loop.verdict != options.require for loop in loops) else DONE


def write_simulation(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.about.linear import linearize
    from flexlin.answers.clock import Clock
    from flexlin.mechanics import build_manipulator
    from flexlin.report.progress import Progress
    from flexlin.report.tables import described, write_dataset
    from flexlin.report.terminal import accuracy_lines, say
    from flexlin.simulation import check_duration, simulate

    asked, tol, said = scene.accuracy, scene.accuracy.tol, list[str]()
    with Progress() as progress:
        clock = Clock(progress)
        arm = clock.stage("equations of motion", asked, lambda: build_manipulator(scene))
        closed = linearize(arm, scene.motion, scene.control)
        clock.stage("size of the result", asked, lambda: check_duration(closed, options.periods))
        forward = None
        if options.feedforward != "scene":
            from flexlin.control import feedforward

            forward = clock.stage("feedforward", asked, lambda: feedforward(closed, options.feedforward, tol))
        result = clock.stage(
            "nonlinear simulation",
            asked,
            lambda: simulate(closed, options.periods, feedforward=forward, tol=tol),
            lambda found: max(found.error, found.linear_error),
        )
        if options.attraction:
            from flexlin.control import linear_range
            from flexlin.simulation import region_of_attraction

            said.append(
                clock.stage("range of the linear equations", asked, lambda: linear_range(closed, tol=tol)).status
            )
            said.append(
                clock.stage("region of attraction", asked, lambda: region_of_attraction(closed, tol=tol)).status
            )
    for line in (result.status, *said, *accuracy_lines(tuple(clock.steps))):
        say(line)
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
        from flexlin.answers.clock import Clock
        from flexlin.files import write_text
        from flexlin.report.record import audit_block, to_json
        from flexlin.report.terminal import audit_lines, say

        work = partial(audit, scene, options.tolerance, progress, scene.accuracy.tol)
        result = Clock(progress).stage("audit of the effects", scene.accuracy, work)
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

        from flexlin.answers.clock import Clock
        from flexlin.answers.sweep import check_values, sweep, worst_error
        from flexlin.files import write_text
        from flexlin.report.figures.chart import draw_chart
        from flexlin.report.page import picture_page
        from flexlin.report.tables import storable, write_dataset
        from flexlin.report.terminal import accuracy_lines

        clock, counts = Clock(progress), [number or (60 if several else 200) for *_, number in spans]
        clock.stage("size of the result", scene.accuracy, lambda: check_values(math.prod(counts)))
        values = {key: np.linspace(low, high, n) for (key, low, high, _), n in zip(spans, counts, strict=True)}
        work = partial(sweep, scene, values, scene.accuracy.tol, grid=several)
        data = clock.stage("exponents of all values", scene.accuracy, work, worst_error)
        picture = draw_chart(data)
    print(picture.caption)
    for line in accuracy_lines(tuple(clock.steps)):
        print(line)
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
        from flexlin.report.tables import check_gains
        from flexlin.report.terminal import accuracy_lines

        design_folders([table.name for table in scene.designs])  # clashing names are refused before any work
        check_gains(scene, options.points)
        clock = Clock(progress)
        plant, loops = plant_and_designs(scene, clock)
        paths = clock.stage("files", scene.accuracy, lambda: export_all(plant, loops, options.out, options.points))
    for line in accuracy_lines(tuple(clock.steps)):
        print(line)
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
    for name in ACCURACY:
        value = getattr(options, name, None)
        flags += [] if value is None else [f"--{name.replace('_', '-')}", f"{value:g}"]
    return shlex.join(["flexlin", options.command, options.scene, *overrides, *over, *flags])
