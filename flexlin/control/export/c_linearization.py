"""C source of the linearization through CasADi's code generator, with a small program around it."""

import errno
import os
import tempfile
from pathlib import Path

import casadi as ca

import flexlin
from flexlin.arguments import checked
from flexlin.checks import c_name
from flexlin.control.export.c_controller import write_c
from flexlin.control.export.files import Labels
from flexlin.control.export.templates import fill_in
from flexlin.errors import ArgumentError
from flexlin.files import results
from flexlin.linearization.linearization import Linearization
from flexlin.motion import SymbolicMotion

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
