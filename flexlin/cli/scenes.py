"""Commands about whole scenes: list, show, new, import, schema, check; report, chart, respond, effects, cost."""

import argparse
import shlex
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import flexlin.scene
from flexlin import analyses, files, report
from flexlin.cli.shared import Work, command, meets, print_paths, refuse_existing, say_loop, scene_command
from flexlin.cli.supervised import DONE, NO_ANSWER, OTHER_VERDICT, send_written
from flexlin.errors import ArgumentError, FlexlinError, NumericalError, TooLarge

if TYPE_CHECKING:
    from flexlin.analyses.analysis import Analysis
    from flexlin.analyses.judging import AtRest
    from flexlin.report.figures import Picture
    from flexlin.scene.links import Link

BEYOND = ": so far that linear equations may not hold; stiffen the link, or compare with the simulation"
MISTAKEN = ": no arm does; is a unit missing? Numbers are in m, kg, s and rad, others such as '1000 mm' or '30 deg' name theirs"
KINDS: tuple[Literal["step", "initial", "push", "noise"], ...] = ("step", "initial", "push", "noise")
"""Of disturbances."""


@command("list", "name the scenes that travel with flexlin")
def list_scenes(options: argparse.Namespace) -> int:
    for name, title in flexlin.scene.scenes().items():
        print(f"{name:<24} {title}")
    return DONE


@command("show", "print a scene as it stands in its file", "scene")
def show(options: argparse.Namespace) -> int:
    print(flexlin.scene.scene_text(options.scene), end="")
    return DONE


@command("new", "write a commented scene to start from", "name like")
def new(options: argparse.Namespace) -> int:
    import tomllib

    path = options.name if options.name.suffix == ".toml" else Path(f"{options.name}.toml")
    refuse_existing(path)
    data = flexlin.load_scene(options.like).model_dump(mode="json", by_alias=True, exclude_unset=True)
    data["title"] = path.stem
    data.pop("source", None)
    text = flexlin.scene.commented_scene(data)
    flexlin.parse_scene(tomllib.loads(text), str(path))
    files.write_text(path, text)
    print(f"wrote {path}, after {options.like}")
    named = shlex.quote(str(path))
    print(f"next: flexlin check {named}; flexlin report {named}")
    return DONE


@command("import", "write a scene of a robot from its URDF file", "robot file base tip")
def import_robot(options: argparse.Namespace) -> int:
    path = options.out
    refuse_existing(path)
    data = flexlin.scene.scene_tables(flexlin.scene.read_robot(options.robot), options.base, options.tip)
    scene = flexlin.parse_scene(data, str(options.robot))
    files.write_text(path, flexlin.scene.write_toml(data))
    print(f"wrote {path}: joints {', '.join(link.name for link in scene.links if link.moves)}")
    print(f"  {scene.source}")
    print("  joints stand still, rigid and without control: give [motion], [effects.joint_flexibility], [control]")
    return DONE


@command("schema", "print the JSON schema of scenes, with descriptions and units")
def schema(options: argparse.Namespace) -> int:
    import json

    print(json.dumps(flexlin.scene.scene_schema(), indent=1, ensure_ascii=False))
    return DONE


@scene_command("check", "read a scene and derive its equations", tol=False)
def check(work: Work, options: argparse.Namespace) -> int:
    with work.clock() as clock:
        from numpy import array

        scene, plant = work.scene, analyses.derive_equations(work.scene, clock).closed
        lengths = array([link.length for link in scene.links])
        rest = clock.stage("arm at rest", lambda: analyses.examine(plant, lengths))
    print(f"{scene.title}: usable")
    if scene.source:
        print(f"  source       {scene.source}")
    print(f"  coordinates  {', '.join(one.title for one in plant.coordinates)}")
    print(f"  torques on   {', '.join(plant.inputs) or 'no joint'}")
    print(f"  effects on   {', '.join(scene.effects.on()) or 'none'}")
    print(f"  period       {plant.period:.6g} s")
    if plant.motion.origin:
        print(f"  motion       {plant.motion.origin}")
    with report.units_of_scene(scene):
        for i, link in enumerate(scene.links):
            if any(link.counts.by_direction().values()):
                print(f"  link {i + 1:<8}{', '.join(describe_link(link))}")
        for name, words in () if rest is None else describe_rest(rest, set(scene.effects.on())):
            print(f"  {name:<13}{words}")
    return DONE


def describe_link(link: "Link") -> Iterator[str]:
    """The figures of a link that deflects."""
    yield say(link.mass_per_length, "kg/m")
    for direction, name in zip(flexlin.scene.DIRECTIONS, ("EI in y", "EI in z", "GJ"), strict=True):
        if link.stiffness_in(direction) is not None:
            yield f"{name} {say(link.stiffness_in(direction), 'N m^2')}"
    if link.polar_inertia is not None:
        yield f"rho I_p {say(link.polar_inertia, 'kg m')}"


def describe_rest(rest: "AtRest", effects: set[str]) -> Iterator[tuple[str, str]]:
    """What the arm does with its joints held, and the effects that are on."""
    if rest.gives_way:
        yield "at rest", "gives way under its loads even with its joints held: stiffen its links, or lessen the loads"
        return
    known = ", ".join(f"{frequency:.4g}" for frequency in rest.frequencies[:5])
    yield "at rest", f"{report.with_unit(known, 'Hz')}, its joints held where the motion begins"
    bending = rest.bending
    if bending is None:
        return
    still = "under gravity" if effects & {"gravity", "tip_force"} == {"gravity"} else "at rest"
    for i, share in enumerate(bending.largest):
        sides = ((bending.at_rest[i], still), (bending.moving[i], "along the motion"))
        said = " and ".join(f"{report.format_quantity(size, 'm')} {where}" for size, where in sides if size > 0)
        if said:
            further = BEYOND + ("" if "geometric_stiffening" in effects else ", with effects.geometric_stiffening")
            if bending.at_rest[i] > 10 * bending.lengths[i]:
                further = MISTAKEN
            beyond = further if share > analyses.SMALL_SHARE else ""
            yield f"link {i + 1}", f"bends by {said}, {100 * share:.2g} % of its length{beyond}"


def say(value: float, unit: str) -> str:
    """A value with its unit, which a scene without dimensions has not."""
    return str(report.with_unit(f"{value:.4g}", unit))


@scene_command("report", "write report.html and report.json", "require effects sensitivity margins loop_margins")
def report_scene(work: Work, options: argparse.Namespace) -> int:
    with work.clock():
        margins = {key: (low, high) for key, low, high, _ in options.margins} or None
        extras = [name for name in ("effects", "sensitivity", "loop_margins") if getattr(options, name)]
        how = work.progress, extras, margins, options.watch, send_written
        analysis, paths = report.write_report(work.scene, options.out, work.quoted, *how)
    if isinstance(analysis, FlexlinError):
        print_paths(paths)
        raise analysis
    summarize(analysis)
    print_paths(paths)
    if not meets(options.require, analysis.own.verdict, analysis.validity(analysis.own).verdict):
        return OTHER_VERDICT
    return DONE if analysis.complete else NO_ANSWER


def summarize(analysis: "Analysis") -> None:
    """Print the verdicts and what to do next."""
    with report.units_of(analysis):
        print(analysis.scene.title)
        for loop in analysis.loops:
            say_loop(loop, analysis.plant.period, analysis.validity(loop))
            if over := report.drive_line(analysis, loop):
                print(f"    {over}")
        if critical := report.describe_margins(analysis.scene, analysis.margins, analysis.problems):
            print(f"  {analysis.own.name} {critical}")
        if analysis.nearest:
            nearest = report.describe_nearest(analysis.scene, analysis.nearest)
            print(f"  {analysis.own.name} with its uncertain numbers: {nearest}")
        said = [f"- {step}" for step in report.advise(analysis)]
        print("\n".join([*said, *report.accuracy_lines(analysis.steps, "\n".join(said))]))


@scene_command("chart", "stability over one or two parameters", "over loop workers scheduler store")
def chart(work: Work, options: argparse.Namespace) -> int:
    scene, spans = work.scene, options.over
    if len(spans) > 2:
        got = ", ".join(key for key, *_ in spans)
        raise ArgumentError("a chart has one or two axes", got=f"--over {got}", expected="one or two keys")
    with work.clock(3) as clock:
        usual = 60 if len(spans) > 1 else 200
        axes = [(key, low, high, number or usual) for key, low, high, number in spans]
        how = {name: getattr(options, name) for name in ("loop", "workers", "scheduler", "store")}
        data, problem = report.compute_chart(scene, axes, clock, work.progress, **how)
        ranges = {key: (low, high) for key, low, high, _ in spans}
        data.attrs |= {"incomplete": problem} if problem else {}
        found = ([], []) if problem else report.find_boundary(scene, ranges, data, clock, options.loop)
        data.attrs["bending"] = "" if problem else report.say_bending(scene, ranges, found[0], clock)
        made = report.Chart(scene, data, *found)
        numbers = report.storable(report.chart_dataset(made))
        without = partial(report.say_without_picture, made)

        def write(pictures: "list[Picture]") -> list[Path]:
            return work.write_files("chart", {"chart.html": work.page(pictures)}, numbers)

        send_written(write(without("the program ended before")))
        try:
            draw = partial(report.draw_charts, made)
            pictures = clock.stage("figures", draw, share=analyses.DRAWING_SHARE, last=True)
        except (NumericalError, TooLarge) as error:  # the numbers stand without a picture
            pictures = without(error)
        paths = write(pictures)
    print(pictures[0].caption)
    if "repaired" in data.attrs:
        print(f"{options.store}: {data.attrs['repaired']} damaged blocks were computed again")
    work.say_accuracy()
    done = print_paths(paths)
    if problem:
        print(f"flexlin: {problem}", file=sys.stderr)
    return NO_ANSWER if problem or data.attrs.get("search") or "failed" in data["verdict"].to_numpy() else done


@scene_command(
    "respond",
    "find what a disturbance does at the worst moment of the motion",
    "step initial push noise of lasting",
)
def respond(work: Work, options: argparse.Namespace) -> int:
    asked = [(kind, getattr(options, kind)) for kind in KINDS if getattr(options, kind) is not None]
    if len(asked) != 1:
        kinds = "--step, --initial, --push or --noise"
        raise ArgumentError("one disturbance is answered at a time", got=f"{len(asked)}", expected=kinds)
    with work.clock() as clock:
        kind, words = asked[0]
        answer = analyses.answer_in_scene(work.scene, kind, words, options.of, options.lasting, clock)
    with report.units_of_scene(work.scene):
        lines, drawn = report.answer_lines(answer), report.picture_answer(answer)
    for line in lines:
        print(line)
    work.say_accuracy()
    return work.write("respond", [drawn], report.answer_record(answer))


@scene_command("effects", "find which effects and modes the scene needs", "tolerance")
def effects(work: Work, options: argparse.Namespace) -> int:
    with work.clock() as clock:
        compare = partial(flexlin.audit, work.scene, options.tolerance, work.progress, work.scene.accuracy.tol)
        result = clock.stage("audit of the effects", compare)
    print("\n".join(report.audit_lines(result)))
    texts = {"effects.json": report.to_json({"schema": 1, "title": work.scene.title, **report.audit_block(result)})}
    if result.minimal is not None:
        texts["minimal.toml"] = report.minimal_text(result, result.minimal, work.quoted)
    done = print_paths(work.write_files("effects", texts))
    return NO_ANSWER if result.problem else done


@scene_command("cost", "measure what accuracy costs in time, beside other programs (a minute)", tol=False)
def measure_cost(work: Work, options: argparse.Namespace) -> int:
    with work.clock() as clock:
        measure = partial(flexlin.cost, work.scene)
        result = clock.stage("accuracy against time", lambda: measure(seconds=clock.plan()))
    print(report.cost_table(result))
    done = work.write("cost", [report.draw_cost(result)], result.record(), report.summarise_cost(result))
    return done if result.rows else NO_ANSWER
