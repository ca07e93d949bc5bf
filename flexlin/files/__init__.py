"""The one door to the disk: a set of results stands whole or not at all, and what is read is a file of sane size.

`docs/results.md` says what a reader may rely on.
"""

from flexlin.files.manifest import MANIFEST, read_text, refuse_odd, sync
from flexlin.files.switch import Results, check_folder, clear_left, replacing, results, write_text

__all__ = [
    "MANIFEST",
    "Results",
    "check_folder",
    "clear_left",
    "read_text",
    "refuse_odd",
    "replacing",
    "results",
    "sync",
    "write_text",
]
