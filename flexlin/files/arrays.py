"""NumPy's npz files, the same bytes for the same numbers."""

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

NO_DATE = (1980, 1, 1, 0, 0, 0)
"""The first date that a zip file knows; np.savez writes the time of day."""


def write_npz(path: Path, arrays: Mapping[str, Any], compressed: bool = False) -> None:
    """Write arrays as np.savez does, without date and without pickles."""
    kind = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    with path.open("wb") as file, zipfile.ZipFile(file, "w", kind) as archive:
        for name, array in arrays.items():
            about = zipfile.ZipInfo(f"{name}.npy", NO_DATE)
            about.compress_type = kind
            with archive.open(about, "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.asarray(array), allow_pickle=False)
