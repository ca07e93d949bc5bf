"""Commands about loops, controllers and measured logs: linearize, design, simulate, tune, export, predict, identify."""

import argparse
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING

import flexlin.scene
from flexlin import analyses, control, report, simulation
from flexlin.cli.shared import SEARCH_SECONDS, Work, meets, print_paths, say_loop, scene_command
from flexlin.cli.supervised import DONE, NO_ANSWER, OTHER_VERDICT, send_written
from flexlin.errors import ArgumentError

if TYPE_CHECKING:
    from flexlin.scene.scene import Scene


@scene_command("linearize", "write the coefficients over a period", "points", tol=False)
def linearize_scene(work: Work, options: argparse.Namespace) -> int:
    with work.clock() as clock:
        made = analyses.derive_equations(work.scene, clock)
        sample = partial(report.coefficients_dataset, work.scene, made.plant, made.closed, options.points)
        data = clock.stage("coefficients", sample)
    return print_paths(work.write_files("coefficients", {}, data))


@scene_command("design", "design the scene's controllers, write their gains", "require points")
def design(work: Work, options: argparse.Namespace) -> int:
    scene = work.scene
    if not scene.designs:
        raise ArgumentError("nothing to design", got="no [[designs]] table", expected="at least one in the scene")
    with work.clock(3 + 3 * len(scene.designs)) as clock:
        report.check_gains(scene, options.points)
        plant, loops = analyses.plant_and_designs(scene, clock)
    models = [analyses.judge_model(analyses.arm_length(plant), loop.steady) for loop in loops]
    for loop, model in zip(loops, models, strict=True):
        say_loop(loop, plant.period, model)
        if model.verdict == "invalid":
            print(f"    {report.reason(model)}")
    work.say_accuracy()
    made = [loop.design for loop in loops if loop.design is not None]
    if made:
        print_paths(work.write_files("gains", {}, report.gains_dataset(scene, plant, made, options.points)))
    if any(loop.verdict == "failed" for loop in loops):
        return NO_ANSWER
    met = all(meets(options.require, loop.verdict, model.verdict) for loop, model in zip(loops, models, strict=True))
    return DONE if met else OTHER_VERDICT


@scene_command(
    "simulate", "integrate the nonlinear equations beside the linear ones", "periods feedforward attraction animate"
)
def simulate_loop(work: Work, options: argparse.Namespace) -> int:
    scene, tol, said = work.scene, work.scene.accuracy.tol, list[str | None]()
    with work.clock(4 + 2 * options.attraction + options.animate) as clock:
        closed = analyses.derive_equations(scene, clock).closed
        clock.stage("size of the result", lambda: simulation.check_duration(closed, options.periods))
        forward = None
        if options.feedforward != "scene":
            forward = clock.stage("feedforward", lambda: control.feedforward(closed, options.feedforward, tol))
        simulate = partial(simulation.simulate, closed, options.periods, feedforward=forward, tol=tol)
        result = clock.stage("nonlinear simulation", simulate, analyses.simulation_error)
        words = "deviations from the rigid motion as states [y; y'], tips in m"
        data = report.described(result.to_xarray(), scene, closed.period, words)
        send_written(paths := work.write_files("simulation", {}, data))
        further = {
            "range of the linear equations": lambda: control.linear_range(closed, tol=tol).status,
            "region of attraction": lambda: simulation.region_of_attraction(closed, tol=tol).status,
        }
        for name, find in further.items() if options.attraction else ():
            said += clock.attempt(name, find)
        if options.animate:
            draw = partial(report.animation_page, scene, closed, result, work.quoted)
            page, problem = clock.attempt("animation", draw)
            said.append(problem)
            if page is not None:
                paths = work.write_files("simulation", {"animation.html": page}, data)
    for line in filter(None, (result.status, result.sticking, *said)):
        print(line)
    work.say_accuracy()
    done = print_paths(paths)
    return NO_ANSWER if clock.failures else done


@scene_command("tune", "find the gains that decay fastest in all scenarios", "vary gain", usual=SEARCH_SECONDS)
def tune_gains(work: Work, options: argparse.Namespace) -> int:
    with work.clock() as clock:
        limits, vary = ({key: (low, high) for key, low, high, _ in asked} for asked in (options.gain, options.vary))
        tune = partial(flexlin.tune, work.scene, list(limits) or None, vary, limits, tol=work.scene.accuracy.tol)
        found = clock.stage("tune the gains", lambda: tune(seconds=clock.plan()))
    print(f"{work.scene.title}: {found.status}")
    for path, value in found.gains.items():
        print(f"  {path} = {report.with_unit_of(work.scene, path, f'{value:.6g}')}")
    for one in found.active[:6]:
        at = ((path, report.with_unit_of(work.scene, path, f"{value:.4g}")) for path, value in one.scenario.items())
        place = " at " * bool(one.scenario) + ", ".join(f"{path} = {value}" for path, value in at)
        exponent = report.with_unit(f"{one.exponent.real:.6g} {one.exponent.imag:+.6g}i", "1/s")
        print(f"  active: {exponent}{place}")
    assert found.scene is not None
    return print_paths(work.write_files("tune", {"tuned.toml": scene_text(found.scene)}))


def scene_text(scene: "Scene") -> str:
    """A scene as TOML."""
    return str(flexlin.scene.write_toml(flexlin.scene.raw_tables(scene)))


@scene_command("export", "write system and designs for other tools: npz, MATLAB, netCDF, C", "points")
def export(work: Work, options: argparse.Namespace) -> int:
    scene = work.scene
    with work.clock(4 + 3 * len(scene.designs)) as clock:
        report.design_folders([table.name for table in scene.designs])  # clashing names are refused before any work
        report.check_gains(scene, options.points)
        plant, loops = analyses.plant_and_designs(scene, clock)
        write = partial(report.export_all, plant, loops, options.out, options.points, scene)
        paths = clock.stage("files", write, last=True)
    work.say_accuracy()
    for loop in loops:
        if loop.design is None:
            print(f"{loop.name}: {loop.problem}")
    print_paths(paths)
    return NO_ANSWER if any(loop.verdict == "failed" for loop in loops) else DONE


@scene_command("predict", "predict a measured log, without fitting anything to it", "log window", tol=False)
def predict_log(work: Work, options: argparse.Namespace) -> int:
    with work.clock() as clock:
        scene = work.scene
        log = clock.stage("read the log", partial(flexlin.read_log, options.log, scene))
        found = clock.stage("predict the log", partial(flexlin.predict, scene, log, options.window))
    print(found.summary())
    record = {"log": log.source, "window": options.window, **report.record_fields(found, "fit starts status")}
    return work.write("predict", [report.draw_prediction(found)], record)


@scene_command(
    "identify",
    "find numbers of the scene, with their errors, from a measured log",
    "log free window hold_back log_effects",
    usual=SEARCH_SECONDS,
    tol=False,
)
def identify_numbers(work: Work, options: argparse.Namespace) -> int:
    with work.clock() as clock:
        scene = work.scene
        log = clock.stage("read the log", partial(flexlin.read_log, options.log, scene))
        asked = {"free": options.free, "window": options.window, "hold_back": options.hold_back}
        if options.log_effects is None:
            selected, fit = None, partial(flexlin.identify, scene, log, **asked)
            found = clock.stage("fit the log", lambda: fit(seconds=clock.plan()))
        else:
            select = partial(flexlin.select_effects, scene, log, effects=options.log_effects or None, **asked)
            selected = clock.stage("effects of the log", lambda: select(seconds=clock.plan()))
            found = selected.identification
    print((selected or found).summary())
    fields = "values errors unknown correlations fit noise settled status"
    record = {"log": log.source, **report.record_fields(found, fields)}
    lines = report.say_numbers(scene, found)
    if selected:
        record["effects"] = report.record_fields(selected, "effects status") | {
            "trials": list(map(asdict, selected.trials))
        }
        lines = [selected.status, *map(str, selected.trials), *lines]
    pictures = [report.draw_prediction(found.prediction), report.draw_errors(found.prediction)]
    fitted = {"fitted.toml": scene_text(found.scene)}
    done = work.write("identify", pictures, record, lines, fitted)
    judged = selected is None or not any(trial.problem for trial in selected.trials)
    return done if found.settled and judged else NO_ANSWER
