"""`python -m flexlin` is the program `flexlin`."""

from flexlin.cli import entry

entry()
