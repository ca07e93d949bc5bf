"""The one door to the disk: a set of results stands whole or not at all, and what is read is a file of sane size.

`docs/results.md` says what a reader may rely on.
"""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {},
    within={
        "bounds": "read_text refuse_odd",
        "files.sets": "MANIFEST Results check_folder clear_left replacing results sync write_text",
    },
)
