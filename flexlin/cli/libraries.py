"""How a program runs: one thread for linear algebra, parts of NumPy that no command uses put off, memory swept rarely."""

import gc
import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
from types import ModuleType

UNUSED = frozenset({"numpy.ctypeslib", "numpy.f2py", "numpy.testing", "numpy.typing"})
"""SciPy says `from numpy import *`, which loads these: about a tenth of the time until the work begins."""


LOADING, OBJECTS = 200_000, 20_000
"""Objects that are made, and not freed, between two looks for cycles among the young ones: while libraries are loaded, and later."""
THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
"""Variables by which a user says how many threads linear algebra has."""


class DeferredFinder:
    """Finds the unused modules where they are, and has them executed when their first attribute is read."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """The module's own spec with a lazy loader; None for all others."""
        if name not in UNUSED:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader = LazyLoader(spec.loader)
        return spec


def need_one_thread() -> None:
    """Let linear algebra use one thread, unless the user says how many: with a few dozen rows threads wait for each other.

    It must be said before NumPy is loaded.
    """
    if not any(name in os.environ for name in THREADS):
        os.environ.update(dict.fromkeys(THREADS[:2], "1"))


def leave_out_plugins() -> None:
    """Keep Pydantic from looking through all installed packages for plugins, unless the user says which to leave out."""
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")


def defer_unused() -> None:
    """Put the loading of unused modules off, in this process: for a program, since a library leaves the import system alone."""
    if not any(isinstance(finder, DeferredFinder) for finder in sys.meta_path):
        sys.meta_path.insert(0, DeferredFinder())


def collect_rarely() -> None:
    """Put off looking for cycles of dead objects while libraries are loaded: they make many objects, and all stay."""
    gc.set_threshold(LOADING, 20, 20)


def keep_loaded() -> None:
    """Never look again at what was loaded, and for cycles a thirtieth as often as Python does, in a program that put it off."""
    if gc.get_threshold()[0] == LOADING:
        gc.freeze()
        gc.set_threshold(OBJECTS, 20, 20)
