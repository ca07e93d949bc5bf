"""`python -m flexlin` is the program `flexlin`."""

from flexlin.cli.main import entry

entry()
