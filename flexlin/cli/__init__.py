"""The command line."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {},
    within={
        "cli.program": "BAD_INPUT COMMANDS ended_by_signal entry main parser pass_over",
        "cli.shared": "Progress meets",
        "cli.supervised": "read_limit",
    },
)
