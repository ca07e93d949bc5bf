"""The table of commands. A new one is a function under `command`, in the file of what it is about."""

from flexlin.cli.commands import loops, questions, scenes
from flexlin.cli.shared import Command

COMMANDS: dict[str, Command] = {
    found.name: found
    for module in (scenes, questions, loops)
    for found in vars(module).values()
    if isinstance(found, Command)
}
