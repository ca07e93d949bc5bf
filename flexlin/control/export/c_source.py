"""C source of a controller, with its gain and feedforward; of an estimator; and of the linearization, by CasADi's code generator."""

import errno
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import casadi as ca
import numpy as np

import flexlin
from flexlin.arguments import checked
from flexlin.checks import Array, c_name, positive
from flexlin.control.designed_loop import Design
from flexlin.control.estimator import Estimator
from flexlin.control.export.files import Labels
from flexlin.control.export.templates import fill_in
from flexlin.control.sampled import SampledGain
from flexlin.errors import ArgumentError
from flexlin.files import results
from flexlin.linearization.law import Law
from flexlin.linearization.linearization import Linearization
from flexlin.motion import SymbolicMotion
from flexlin.periodic.coefficient_series.matrix import Series
from flexlin.periodic.coefficient_series.resolve import resolve
from flexlin.periodic.coefficient_series.sampling import stratified
from flexlin.periodic.coefficients import Combined, MatrixFunction
from flexlin.periodic.interpolation import ChebyshevPanels, FourierSeries
from flexlin.periodic.system import PeriodicSystem, corners_of
from flexlin.precision import EPS, SAFETY

ROUNDING = SAFETY * EPS
"""What the sums in C lose by rounding, against the largest value."""


@dataclass(frozen=True, eq=False)
class CSeries:
    """A C function `static void name(double phase, double *out)`, entries row by row.

    source: its text; error: the largest deviation from the function that it stands for, relative to the largest value; layout: in words.
    """

    source: str
    error: float
    layout: str


def write_series(name: str, f: MatrixFunction, period: float, breaks: tuple[float, ...]) -> CSeries:
    """Write a function of time (N,) -> (N, rows, columns) as C; times in s, breaks in [0, T), 0 among them where it does not repeat."""
    edges = np.unique([0.0, *breaks, period])
    series = series_of(f, edges, bool(breaks))
    t = (edges[:-1, None] + np.diff(edges)[:, None] * stratified(499)).ravel()
    wanted = f(t)
    error = ROUNDING + float(np.abs(series(t) - wanted).max() / (np.abs(wanted).max() or 1.0))
    source, layout = write_fourier(name, series) if isinstance(series, FourierSeries) else write_panels(name, series)
    if isinstance(f, SampledGain):
        layout = f"that of the nearest of {len(f.gains)} samples; take it at a sample, and hold the torque to the next"
    return CSeries(source, error, layout)


def series_of(f: MatrixFunction, edges: Array, ends: bool) -> Series:
    """A function of time as the series that it is, or resolved into one, between the edges if it ends there."""
    if isinstance(f, SampledGain):
        return f.series
    if isinstance(f, FourierSeries | ChebyshevPanels):
        return f
    return resolve(f, float(edges[-1]), edges[:-1].tolist() if ends else [], complete=True, repeats=not ends).series


def write_fourier(name: str, series: FourierSeries) -> tuple[str, str]:
    """The text, and the layout in words."""
    H, flat = series.degree, series.coefficients.reshape(len(series.coefficients), -1)
    rows = [flat[0]] + [row for k in range(1, H + 1) for row in (flat[k], flat[H + k])]
    words = {"name": name, "rows": len(rows), "size": flat.shape[1], "table": table(rows), "harmonics": H}
    return fill_in("fourier_series.c.in", words), f"Fourier series of {H} harmonics: mean, then cosine and sine of each"


def write_panels(name: str, series: ChebyshevPanels) -> tuple[str, str]:
    """The text, and the layout in words."""
    c = series.coefficients
    flat = c.reshape(*c.shape[:2], -1)
    phases = numbers(series.edges / series.period)
    blocks = ",\n".join(f"  {{\n{table(list(panel))}\n  }}" for panel in flat)
    sizes = {"panels": len(flat), "degrees": flat.shape[1], "size": flat.shape[2], "edge_count": len(flat) + 1}
    source = fill_in("chebyshev_panels.c.in", {"name": name, "edges": phases, "table": blocks, **sizes})
    return source, f"Chebyshev series of degree {flat.shape[1] - 1} on {len(flat)} panels"


def table(rows: list[Array]) -> str:
    """Rows of numbers, each in braces."""
    return ",\n".join(f"    {{{numbers(row)}}}" for row in rows)


def numbers(row: Array) -> str:
    """Numbers that C reads back without loss."""
    return ", ".join(repr(float(value)) for value in row)


WITHIN = {True: "phase - floor(phase)", False: "phase < 0.0 ? 0.0 : phase > 1.0 ? 1.0 : phase"}
BEYOND = {True: "any number, taken modulo 1", False: "held at 0 before the motion and at 1 after it"}
"""What becomes of a phase outside [0, 1], for periodic and for one-way motions."""


@checked
def gain_source(
    made: Design,
    period: float,
    folder: str | Path,
    name: str = "gain",
    *,
    lin: Linearization | None = None,
    law: Law | None = None,
) -> list[Path]:
    """Write C source of a controller: the torque of a state at a phase of the motion.

        torque = -K(phase) state,     or with feedforward  forward(phase) - K(phase) (state - reference(phase))

    The files are <name>.h, which says layout, units and order, <name>.c, and main.c, a program `main PHASE` that prints K column by
    column. They need nothing but a C99 compiler and libm:  cc <name>.c main.c -lm

    Parameters
    ----------
    made : Design
        The design whose gain is written, of n states and m inputs.
    period : float
        Period of the motion, in s.
    folder : str or Path
        Where the files go, as one set with their checksums; it is made when it does not exist.
    name : str
        Name of the function and of its files.
    lin : Linearization, optional
        The arm: it gives states and inputs their names and units, and its law the feedforward.
    law : Law, optional
        Another feedforward, such as `feedforward(lin, "tip-exact").law`; its gain is not used.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    ArgumentError
        When the arm does not fit the design or has no input.
    OutputError
        When the folder cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> made = fl.control.pd_feedback(system, [0], [4.0], [2.0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     print([path.name for path in fl.control.gain_source(made, system.period, folder)])
    ['gain.c', 'gain.h', 'main.c']
    """
    with results(Path(folder), c_name(name)) as files:
        return files.placed(*write_gain(made, positive("period", period), files.stage, lin, law, name))


def write_gain(
    made: Design, period: float, folder: Path, lin: Linearization | None, law: Law | None = None, name: str = "gain"
) -> list[str]:
    """Write `gain_source` into a folder of a set; returns the names of the files."""
    m, n = made.K(np.zeros(1)).shape[1:]
    if m == 0:
        raise ArgumentError(
            "the design has no input, so there is no gain to write", got=f"K of 0 x {n}", expected="a driven arm"
        )
    chosen, as_columns = law or (made.law if lin is None else lin.law), partial(np.expand_dims, axis=2)
    fed, held = (Combined(as_columns, (part,)) for part in (chosen.forward, chosen.reference))
    parts = write_parts({"K_of": made.K, "forward_of": fed, "reference_of": held}, made.closed_loop, lin, period)
    words = {
        **words_of(name, Labels.fitting(lin, n, m, made.controller), parts, lin, period), "size": n * m,
        "title": f"The design “{made.name}”".replace("*/", "* /").replace("/*", "/ *").replace("\\", "/"), "forward": chosen.feedforward,
        "layout": parts[0].layout, "error": f"{parts[0].error:.1e}", "torques": f"{parts[1].error:.1e}",
        "arm": n if made.controller is None else n - made.controller.states, **words_of_integrals(made, name, n),
    }  # fmt: skip
    return write_c(folder, {f"{name}.c": "gain.c.in", f"{name}.h": "gain.h.in", "main.c": "gain_main.c.in"}, words)


@checked
def estimator_source(
    estimator: Estimator,
    folder: str | Path,
    name: str = "estimator",
    *,
    lin: Linearization | None = None,
    measurements: Sequence[str] = (),
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
    lin : Linearization, optional
        The arm, which gives states and inputs their names and units.
    measurements : sequence of str
        Names and units of the p measurements.

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
        return files.placed(*write_estimator(estimator, files.stage, lin, measurements, name))


def write_estimator(
    estimator: Estimator, folder: Path, lin: Linearization | None, measurements: Sequence[str], name: str = "estimator"
) -> list[str]:
    """Write `estimator_source` into a folder of a set; returns the names of the files."""
    system, p = estimator.system, estimator.L(0.0).shape[1]
    seen = tuple(measurements) or tuple(f"y{i + 1}" for i in range(p))
    if len(seen) != p:
        raise ArgumentError("names do not fit the measurements", got=len(seen), expected=str(p))
    functions: dict[str, MatrixFunction] = {"A_of": estimator.closed_loop.A, "L_of": estimator.L}
    functions |= {} if system.B is None else {"B_of": system.B}
    parts = write_parts(functions, system, lin, system.period)
    words = {
        **words_of(name, Labels.fitting(lin, system.n, system.m), parts, lin, system.period),
        "p": p,
        "sensors": listed(seen, ("",) * p),
        "error": f"{max(part.error for part in parts):.1e}",
        "read_B": "B_of(within(phase), B);" if system.B is not None else "",
    }
    return write_c(folder, {f"{name}.c": "estimator.c.in", f"{name}.h": "estimator.h.in"}, words)


def is_once(lin: Linearization | None) -> bool:
    """Whether the motion of an arm, if there is one, ends."""
    return lin is not None and not lin.motion.periodic


def write_parts(
    functions: dict[str, MatrixFunction], system: PeriodicSystem, lin: Linearization | None, period: float
) -> list[CSeries]:
    """Functions of time as C, with the corners of a system and the ends of a motion that is no period."""
    breaks = (*corners_of(system), *([0.0] if is_once(lin) else []))
    return [write_series(title, f, period, breaks) for title, f in functions.items()]


def words_of(
    name: str, labels: Labels, parts: list[CSeries], lin: Linearization | None, period: float
) -> dict[str, object]:
    """What the texts of gains and estimators are both filled in with."""
    return {
        "name": name, "guard": name.upper(), "n": len(labels.states), "m": len(labels.inputs), "period": repr(float(period)),
        "version": flexlin.__version__, "states": listed(labels.states, labels.state_units),
        "inputs": listed(labels.inputs, labels.input_units),
        "series": "\n".join([fill_in("add.c.in", {}), *(part.source for part in parts)]),
        "within": WITHIN[not is_once(lin)], "beyond": BEYOND[not is_once(lin)],
    }  # fmt: skip


def words_of_integrals(made: Design, name: str, n: int) -> dict[str, str]:
    """What a controller's own states add to its source; nothing where it has none."""
    if made.controller is None:
        return {"integrals": "", "declared": "", "rates": ""}
    k, unwinding = made.controller.states, made.controller.unwinding
    sizes = {"name": name, "k": k, "n": n, "m": unwinding.shape[1]}
    text = f"{name}_rates(phase, state, rates)"
    words = {
        "integrals": fill_in("gain_integrals.c.in", {**sizes, "rows": write_rows(made.controller.rates)}),
        "declared": f"void {name}_rates(double phase, const double *state, double *rates);\n",
        "rates": f"\n   {text:<38}rates of the last {k} states, which the caller integrates",
    }
    if unwinding.any():
        text = f"{name}_unwind(missing, rates)"
        words["integrals"] += fill_in("gain_unwinding.c.in", {**sizes, "rows": write_rows(unwinding)})
        words["declared"] += f"void {name}_unwind(const double *missing, double *rates);\n"
        words["rates"] += f"\n   {text:<38}adds to the rates what a drive at its limit changes, missing = asked - given"
    return {**words, "rates": words["rates"] + "\n"}


def write_rows(matrix: Array) -> str:
    """The rows of a matrix as an initializer in C, to the last bit."""
    return ",\n".join(f"    {numbers(row)}" for row in matrix)


def listed(names: tuple[str, ...], units: tuple[str, ...]) -> str:
    """Names and units, one a line, with their places."""
    return "\n".join(
        f"     [{i}] {name}, {unit or 'no unit given'}" for i, (name, unit) in enumerate(zip(names, units, strict=True))
    )


def write_c(folder: Path, templates: dict[str, str], words: dict[str, object]) -> list[str]:
    """Fill in the templates and write them as files of the folder; returns their names."""
    folder.mkdir(parents=True, exist_ok=True)
    for file, template in templates.items():
        (folder / file).write_text(fill_in(template, words), encoding="utf-8")
    return list(templates)


LAST = '} /* extern "C" */\n#endif\n'
"""The last lines of the files that CasADi writes."""


@checked
def linearization_source(lin: Linearization, folder: str | Path, name: str = "linearization") -> list[Path]:
    """Write C source that evaluates M_L, D_L, K_L, h_L, B_L and the rigid torque at a phase of the motion.

    The files are <name>.c and <name>.h by CasADi, and main.c, a program `main PHASE` that prints the matrices column by column. They
    need nothing but a C99 compiler and libm:  cc <name>.c main.c -lm

    Parameters
    ----------
    lin : Linearization
        Of a motion that is given by a formula.
    folder : str or Path
        Where the files go, as one set with their checksums; it is made when it does not exist.
    name : str
        Name of the function and of its files.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    ArgumentError
        For a motion that is given by numbers, such as a table.
    OutputError
        When the folder cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     print([path.name for path in fl.control.linearization_source(lin, folder)])
    ['linearization.c', 'linearization.h', 'main.c']
    """
    with results(Path(folder), c_name(name)) as made:
        return made.placed(*write_linearization(lin, made.stage, name))


def write_linearization(lin: Linearization, folder: Path, name: str = "linearization") -> list[str]:
    """Write `linearization_source` into a folder of a set; returns the names of the files."""
    if not isinstance(lin.motion, SymbolicMotion):
        raise ArgumentError("a motion given by numbers has no formula to write", expected="another kind of motion")
    if lin.controller is not None:
        raise ArgumentError(
            "a loop with integrals or filters is no system of second order, so its coefficients are not all of it",
            got=f"states {', '.join(lin.controller.names)} of [control.feedback] ki or [[control.filters]]",
            expected="the arm without its loop: fl.linearize(arm, motion)",
            todo="write the loop beside it: fl.control.gain_source(fl.control.scene_feedback(loop), ...)",
        )
    folder.mkdir(parents=True, exist_ok=True)
    function, parameters = lin.coefficients, lin.arm.parameters.values.tolist()
    inputs, names = function.mx_in(), [f"{name}.c", f"{name}.h"]
    generator = ca.CodeGenerator(names[0], {"with_header": True})
    generator.add(ca.Function(name, inputs, function.call(inputs), function.name_in(), function.name_out()))
    with tempfile.TemporaryDirectory() as place:  # CasADi takes only names in UTF-8
        generator.generate(f"{place}/")
        for file, head in zip(names, ("", describe_layout(lin, name)), strict=True):
            source = Path(place, file).read_text(encoding="utf-8")
            if not source.endswith(LAST):  # CasADi says nothing when the disk is full
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            (folder / file).write_text(head + source, encoding="utf-8")
    words = {
        "name": name,
        "inputs": 1 + max(1, len(parameters)),
        "outputs": sum(function.numel_out(i) for i in range(function.n_out())),
        "parameters": ", ".join(map(repr, parameters)) or "0",
        "count": len(parameters),
    }
    return names + write_c(folder, {"main.c": "linearization_main.c.in"}, words)


def describe_layout(lin: Linearization, name: str) -> str:
    """The comment at the head of the header: what goes in and comes out, in which order and units."""
    labels, function = Labels.of(lin), lin.coefficients
    coordinates = zip(labels.states[: lin.n], labels.state_units, strict=False)
    inputs = zip(labels.inputs, labels.input_units, strict=True)
    shapes = [
        f"{function.name_out(i)} ({function.size1_out(i)} x {function.size2_out(i)})" for i in range(function.n_out())
    ]
    entry = (
        f"entry (i, j) of an {lin.n} x {lin.n} matrix is out[k][i + {lin.n} * j]" if lin.n > 1 else "one number each"
    )
    words = {
        "name": name,
        "version": flexlin.__version__,
        "period": repr(lin.period),
        "coordinates": "".join(f"\n     y[{i}] {label} in {unit}" for i, (label, unit) in enumerate(coordinates)),
        "inputs": "".join(f"\n     u[{i}] at {label} in {unit}" for i, (label, unit) in enumerate(inputs)) or " none",
        "outputs": ", ".join(shapes),
        "parameters": ", ".join(lin.arm.parameters.paths) or "none",
        "entry": entry,
    }
    return fill_in("linearization_layout.h.in", words)
