"""The command line: parses, calls, prints.

Exit codes: 0 done, 2 bad input or usage, 3 a verdict other than the required one, 1 anything else.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexlin.errors import FlexlinError, InputError, OutputError, SceneError

if TYPE_CHECKING:
    from flexlin.scene import Scene

DONE, FAILED, BAD_INPUT, OTHER_VERDICT = 0, 1, 2, 3


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; an error is one message on stderr."""
    options = parser().parse_args(arguments)
    try:
        return int(options.run(options))
    except FlexlinError as error:
        print(f"flexlin: {told_where(error, options)}", file=sys.stderr)
        return BAD_INPUT if isinstance(error, InputError) else FAILED
    except KeyboardInterrupt:
        print("flexlin: interrupted; no file was left half-written", file=sys.stderr)
        return FAILED


def told_where(error: FlexlinError, options: argparse.Namespace) -> str:
    """The error's message, after the scene's name where it does not name one itself."""
    scene = getattr(options, "scene", None)
    return str(error) if scene is None or isinstance(error, (SceneError, OutputError)) else f"{scene}: {error}"


def entry() -> None:
    """The program `flexlin`: a fault of flexlin itself is told in one line too, with exit code 1."""
    sys.excepthook = tell_fault
    sys.exit(main())


def tell_fault(kind: type[BaseException], fault: BaseException, trace: Any) -> None:
    """Say in one line what went wrong inside flexlin, and where."""
    while trace.tb_next is not None:
        trace = trace.tb_next
    where = f"{Path(trace.tb_frame.f_code.co_filename).name}, line {trace.tb_lineno}"
    print(f"flexlin: a fault of flexlin, please report it: {kind.__name__} in {where}: {fault}", file=sys.stderr)


def parser() -> argparse.ArgumentParser:
    """All commands and their options."""
    top = argparse.ArgumentParser(
        prog="flexlin", description="Linearization, Floquet stability and control of light robot arms whose links bend."
    )
    top.add_argument("--version", action="version", version=version())
    commands = top.add_subparsers(metavar="COMMAND", required=True)
    commands.add_parser("list", help="name the scenes that travel with flexlin").set_defaults(run=list_scenes)
    scene = scene_options()
    verdict = argparse.ArgumentParser(add_help=False)
    verdict.add_argument("--require", choices=["stable"], help="exit with code 3 when a verdict is another one")
    commands.add_parser("check", parents=[scene], help="read a scene and derive its equations").set_defaults(run=check)
    linearize = commands.add_parser("linearize", parents=[scene], help="write the coefficients over a period")
    linearize.add_argument("--points", type=count, default=256, help="times in a period (default 256)")
    linearize.set_defaults(run=write_coefficients)
    report_parser = commands.add_parser("report", parents=[scene, verdict], help="write report.html and report.json")
    report_parser.add_argument("--effects", action="store_true", help="also tell which effects matter (some seconds)")
    report_parser.set_defaults(run=report)
    design = commands.add_parser("design", parents=[scene, verdict], help="design the scene's controllers, write gains")
    design.add_argument("--points", type=count, default=256, help="times in a period (default 256)")
    design.set_defaults(run=write_gains)
    simulate = commands.add_parser("simulate", parents=[scene], help="integrate the nonlinear equations")
    simulate.add_argument("--periods", type=float, default=5.0, help="length of the simulation (default 5)")
    simulate.set_defaults(run=write_simulation)
    effects = commands.add_parser("effects", parents=[scene], help="tell which effects and modes the scene needs")
    effects.add_argument("--tolerance", type=float, default=0.01, help="relative change that matters (default 0.01)")
    effects.set_defaults(run=audit_effects)
    return top


def scene_options() -> argparse.ArgumentParser:
    """What every command with a scene takes."""
    options = argparse.ArgumentParser(add_help=False)
    options.add_argument("scene", metavar="SCENE", help="a built-in name (see flexlin list) or a TOML file")
    options.add_argument(
        "--set", dest="overrides", metavar="KEY=VALUE", action="extend", nargs="+", default=[],
        help="override a number of the scene, such as effects.payload.mass=0.3",
    )  # fmt: skip
    options.add_argument(
        "--out", type=Path, default=Path(), metavar="DIR", help="folder for the results (default: here)"
    )
    return options


def count(text: str) -> int:
    """Read a whole number from 2 on."""
    number = int(text)
    if number < 2:
        raise argparse.ArgumentTypeError(f"got {number}, expected a whole number from 2 on")
    return number


def version() -> str:
    from flexlin import __version__

    return f"flexlin {__version__}"


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
    from flexlin.linearization import linearize
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
    from flexlin.linearization import linearize
    from flexlin.mechanics import build_manipulator
    from flexlin.report.tables import coefficients_dataset, write_dataset

    arm = build_manipulator(scene)
    plant, closed = linearize(arm, scene.motion), linearize(arm, scene.motion, scene.control)
    return told(write_dataset(coefficients_dataset(scene, plant, closed, options.points), options.out, "coefficients"))


def report(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.report.writing import write_report

        analysis, paths = write_report(scene, options.out, command(options), progress, options.effects)
    from flexlin.report.terminal import summarize

    summarize(analysis)
    told(paths)
    return OTHER_VERDICT if options.require not in (None, analysis.own.verdict) else DONE


def write_gains(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress
    from flexlin.report.terminal import loop_line, say

    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.report.analysis import design_all
        from flexlin.report.clock import Clock
        from flexlin.report.tables import gains_dataset, write_dataset

        plant, loops = design_all(scene, Clock(progress))
    for loop in loops:
        say(loop_line(loop, plant.period), loop.verdict)
    made = [loop.design for loop in loops if loop.design is not None]
    told(write_dataset(gains_dataset(scene, plant, made, options.points), options.out, "gains") if made else [])
    if len(made) < len(loops):
        return FAILED
    return OTHER_VERDICT if options.require and any(loop.verdict != options.require for loop in loops) else DONE


def write_simulation(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.linearization import linearize
    from flexlin.mechanics import build_manipulator
    from flexlin.report.progress import Progress
    from flexlin.report.tables import described, write_dataset
    from flexlin.simulation import simulate

    with Progress() as progress:
        progress("nonlinear simulation")
        closed = linearize(build_manipulator(scene), scene.motion, scene.control)
        result = simulate(closed, options.periods)
    print(result.status)
    data = described(
        result.dataset(), scene, closed.period, "deviations from the rigid motion as states [y; y'], tips in m"
    )
    return told(write_dataset(data, options.out, "simulation"))


def audit_effects(options: argparse.Namespace) -> int:
    scene = loaded(options)
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.audit import audit
        from flexlin.files import write_text
        from flexlin.report.record import audit_block, to_json
        from flexlin.report.terminal import audit_lines, say

        result = audit(scene, options.tolerance, progress)
    for line in audit_lines(result):
        say(line)
    write_text(options.out / "effects.json", to_json({"schema": 1, "title": scene.title, **audit_block(result)}))
    return told([options.out / "effects.json"])


def told(paths: list[Path]) -> int:
    """Print where the results are."""
    for path in paths:
        print(f"wrote {path}")
    return DONE


def command(options: argparse.Namespace) -> str:
    """The command line that made a report, without its output folder."""
    import shlex

    return shlex.join(
        ["flexlin", "report", options.scene, *[word for text in options.overrides for word in ("--set", text)]]
    )
