"""C source of an estimator: its rate, and a step of it between two samples."""

from collections.abc import Sequence
from pathlib import Path

import flexlin
from flexlin.arguments import checked
from flexlin.checks import c_name
from flexlin.control.estimator import Estimator
from flexlin.control.export.c_gain import BEYOND, WITHIN, listed, write_c
from flexlin.control.export.c_series import SAMPLES, Form, write_series
from flexlin.control.export.files import Labels
from flexlin.control.export.templates import fill_in
from flexlin.errors import ArgumentError
from flexlin.files import results
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.system import MatrixFunction, corners_of


@checked
def estimator_source(
    estimator: Estimator,
    folder: str | Path,
    name: str = "estimator",
    samples: int = SAMPLES,
    *,
    lin: Linearization | None = None,
    measurements: Sequence[str] = (),
    form: Form = "series",
) -> list[Path]:
    """Write C source of an estimator: its rate and a step between two samples.

        x_e' = (A - L C) x_e + B u + L measurement

    The files <name>.h, which says order and units, and <name>.c need nothing but a C99 compiler and libm.

    Parameters
    ----------
    estimator : Estimator
        The estimator, of n states, m inputs and p measurements.
    folder : str or Path
        Where the files go, as one set with their checksums; it is made when it does not exist.
    name : str
        Beginning of the names of the functions, and name of the files.
    samples : int
        Samples of a period when the form is "sampled".
    lin : Linearization, optional
        The arm, which gives states and inputs their names and units.
    measurements : sequence of str
        Names and units of the p measurements.
    form : {"series", "sampled"}
        As for `gain_source`.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    ArgumentError
        When the arm or the names do not fit the estimator.
    OutputError
        When the folder cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> estimator = fl.control.kalman_filter(system, [[1.0, 0.0]], np.eye(2), np.eye(1))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     print([path.name for path in fl.control.estimator_source(estimator, folder)])
    ['estimator.c', 'estimator.h']
    """
    with results(Path(folder), c_name(name)) as files:
        return files.placed(*write_estimator(estimator, files.stage, name, samples, lin, measurements, form))


def write_estimator(
    estimator: Estimator,
    folder: Path,
    name: str = "estimator",
    samples: int = SAMPLES,
    lin: Linearization | None = None,
    measurements: Sequence[str] = (),
    form: Form = "series",
) -> list[str]:
    """Write `estimator_source` into a folder of a set; returns the names of the files."""
    system = estimator.system
    labels, p = Labels.fitting(lin, system.n, system.m), estimator.L(0.0).shape[1]
    seen = tuple(measurements) or tuple(f"y{i + 1}" for i in range(p))
    if len(seen) != p:
        raise ArgumentError("names do not fit the measurements", got=len(seen), expected=str(p))
    once = lin is not None and not lin.motion.periodic
    functions: dict[str, MatrixFunction] = {"A_of": estimator.closed_loop.A, "L_of": estimator.L}
    if system.B is not None:
        functions["B_of"] = system.B
    breaks = (*corners_of(system), *([0.0] if once else []))
    parts = [write_series(key, f, system.period, breaks, form, samples) for key, f in functions.items()]
    words = {
        "name": name, "guard": name.upper(), "n": system.n, "m": system.m, "p": p, "period": repr(float(system.period)),
        "version": flexlin.__version__, "states": listed(labels.states, labels.state_units),
        "inputs": listed(labels.inputs, labels.input_units), "sensors": listed(seen, ("",) * p),
        "series": "\n".join([fill_in("add.c.in", {}), *(part.source for part in parts)]),
        "error": f"{max(part.error for part in parts):.1e}",
        "read_B": "B_of(within(phase), B);" if system.B is not None else "",
        "within": WITHIN[not once], "beyond": BEYOND[not once],
    }  # fmt: skip
    return write_c(folder, {f"{name}.c": "estimator.c.in", f"{name}.h": "estimator.h.in"}, words)
