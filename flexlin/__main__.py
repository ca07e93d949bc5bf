"""`python -m flexlin` is the program `flexlin`."""

import sys


def main() -> None:
    """Run the program; Ctrl-C while it is being loaded is a line too."""
    try:
        from flexlin.cli.program import entry

        entry()
    except KeyboardInterrupt:
        print("flexlin: interrupted; no file was left half-written", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
