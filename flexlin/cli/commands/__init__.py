"""One file for each command: PURPOSE, the options that it TAKES, and `run`, which reads the scene, calls the library, prints and writes."""

from types import ModuleType

from flexlin.cli.commands import (
    chart,
    check,
    cost,
    design,
    effects,
    export,
    identify,
    import_robot,
    linearize,
    list_scenes,
    new,
    predict,
    report,
    respond,
    schema,
    show,
    simulate,
    tune,
)

COMMANDS: dict[str, ModuleType] = {
    "list": list_scenes,
    "show": show,
    "new": new,
    "import": import_robot,
    "schema": schema,
    "check": check,
    "report": report,
    "linearize": linearize,
    "design": design,
    "simulate": simulate,
    "respond": respond,
    "effects": effects,
    "chart": chart,
    "cost": cost,
    "tune": tune,
    "predict": predict,
    "identify": identify,
    "export": export,
}
