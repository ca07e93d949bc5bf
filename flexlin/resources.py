"""What a run may take where nobody says otherwise, and what memory a process holds. No library is loaded."""

import os

SECONDS, BYTES = 60.0, 7e8
"""The usual limits: wall time in s, and memory beside the libraries."""


def read_resident(process: int | str = "self") -> int:
    """Bytes of memory that a process holds; 0 where the system does not say."""
    try:
        with open(f"/proc/{process}/statm", "rb") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 0
