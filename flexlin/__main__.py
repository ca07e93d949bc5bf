"""`python -m flexlin` is the program `flexlin`."""

import signal
import sys


def main() -> None:
    """Run the program; Ctrl-C waits until the program can say that it came: Python's loader drops one that strikes in its midst."""
    signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    try:
        from flexlin.cli.program import entry

        entry()
    except KeyboardInterrupt:
        print("flexlin: interrupted; no file was left half-written", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
