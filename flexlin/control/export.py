"""Designs for other tools: python-control systems, C source, MATLAB, netCDF and NumPy files."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flexlin.checks import Array, check_size
from flexlin.control.designed_loop import Design
from flexlin.errors import ArgumentError
from flexlin.files import replacing
from flexlin.files.arrays import write_npz
from flexlin.periodic.system import PeriodicSystem

if TYPE_CHECKING:
    import control

PHASES = 256
"""Samples of a period in a file."""


def to_control(system: PeriodicSystem, phase: float = 0.0, outputs: Array | None = None) -> "control.StateSpace":
    """Freeze a periodic system at a phase of its motion as a python-control StateSpace.

        x' = A(phase T) x + B(phase T) u,   y = C x

    Parameters
    ----------
    system : PeriodicSystem
        The system, with n states.
    phase : float
        Part of the period, in [0, 1).
    outputs : array, shape (p, n), optional
        C; by default all states.

    Returns
    -------
    control.StateSpace
        Without direct feed-through; it has no inputs when the system has no B.

    Raises
    ------
    ArgumentError
        When the phase is not in [0, 1).

    Examples
    --------
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [-4.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> frozen = fl.control.to_control(system)
    >>> frozen.A.tolist()
    [[0.0, 1.0], [-4.0, 0.0]]
    """
    import control

    if not 0 <= phase < 1:
        raise ArgumentError("phase is out of range", got=phase, expected="a number in [0, 1)")
    t = np.array([phase * system.period])
    A = system.A(t)[0]
    B = np.zeros((system.n, 0)) if system.B is None else system.B(t)[0]
    C = np.eye(system.n) if outputs is None else np.asarray(outputs, dtype=float)
    return control.ss(A, B, C, np.zeros((len(C), B.shape[1])))


def gain_schedule(made: Design, name: str = "gain_schedule") -> "control.NonlinearIOSystem":
    """Return the state feedback u = -K(t) x as a python-control system without states.

    It is meant for `control.input_output_response`: inputs x[0..n), outputs u[0..m). The time of the response is the time of the motion.

    Parameters
    ----------
    made : Design
        The design.
    name : str
        Name of the python-control system.

    Returns
    -------
    control.NonlinearIOSystem
        The feedback.

    Examples
    --------
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> feedback = fl.control.gain_schedule(fl.control.pd_feedback(system, [0], [4.0], [2.0]))
    >>> feedback.output(0.0, [], [1.0, 0.5]).tolist()
    [-5.0]
    """
    import control

    def feedback(t: float, _: Array, x: Array, __: Any) -> Array:
        return -made.K(np.array([float(t)]))[0] @ x

    return control.nlsys(None, feedback, inputs=made.closed_loop.n, outputs=made.closed_loop.m, name=name)


def periodic_plant(system: PeriodicSystem, name: str = "plant") -> "control.NonlinearIOSystem":
    """Return the periodic system x' = A(t) x + B(t) u as a python-control system with outputs x.

    Parameters
    ----------
    system : PeriodicSystem
        The system.
    name : str
        Name of the python-control system.

    Returns
    -------
    control.NonlinearIOSystem
        The plant.

    Examples
    --------
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [-4.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> plant = fl.control.periodic_plant(system)
    >>> plant.dynamics(0.0, [1.0, 0.0], [3.0]).tolist()
    [0.0, -1.0]
    """
    import control

    def update(t: float, x: Array, u: Array, _: Any) -> Array:
        now = np.array([float(t)])
        drift = system.A(now)[0] @ x
        return drift if system.B is None else drift + system.B(now)[0] @ np.atleast_1d(u)

    def output(t: float, x: Array, u: Array, _: Any) -> Array:
        return x

    return control.nlsys(update, output, inputs=system.m, outputs=system.n, states=system.n, name=name)


def save(system: PeriodicSystem, path: str | Path, designs: tuple[Design, ...] = (), phases: int = PHASES) -> Path:
    """Write A(t), B(t) and the gains of designs over one period to a file.

    The arrays are t (N,), A (N, n, n), B (N, n, m), and K_<i>, X_<i> for each design, with `names` and `period`; the N times are
    equally spaced.

    Parameters
    ----------
    system : PeriodicSystem
        The system.
    path : str or Path
        The file. Its ending chooses the format: .npz (NumPy), .mat (MATLAB 5), .nc (netCDF 3).
    designs : tuple of Design
        Designs whose gains are written too.
    phases : int
        Times of a period.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ArgumentError
        For another ending.
    TooLarge
        When the table would not fit into memory.
    OutputError
        When the file cannot be written; one of before is still there then.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [-4.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with np.load(fl.control.save(system, f"{folder}/plant.npz", phases=8)) as content:
    ...         print(sorted(content), content["A"].shape)
    ['A', 'B', 'names', 'period', 't'] (8, 2, 2)
    """
    path = Path(path)
    with replacing(path) as temporary:
        write_system(system, temporary, designs, phases)
    return path


def write_system(system: PeriodicSystem, path: Path, designs: tuple[Design, ...], phases: int) -> None:
    """Write what `save` writes, into a set or under a temporary name."""
    numbers = system.n * (system.n + system.m) + len(designs) * system.n * (system.n + system.m)
    check_size(f"a table of {phases} times", 8 * phases * (numbers + 1), "ask for fewer phases (--points)")
    t = system.period * np.arange(phases) / phases
    arrays: dict[str, Array] = {"t": t, "A": system.A(t)}
    if system.B is not None:
        arrays["B"] = system.B(t)
    for i, made in enumerate(designs):
        arrays[f"K_{i}"] = made.K(t)
        if made.solution is not None:
            arrays[f"X_{i}"] = made.solution.X(t)
    names = [made.name for made in designs]
    writers = {".npz": _save_npz, ".mat": _save_mat, ".nc": _save_netcdf}
    if path.suffix not in writers:
        raise ArgumentError("the file's ending names no known format", got=path.name, expected=", ".join(writers))
    writers[path.suffix](path, arrays, names, system.period)


def _save_npz(path: Path, arrays: dict[str, Array], names: list[str], period: float) -> None:
    write_npz(path, {**arrays, "names": np.array(names, dtype=str), "period": np.array(period)}, compressed=True)


def _save_mat(path: Path, arrays: dict[str, Array], names: list[str], period: float) -> None:
    from scipy.io import savemat

    with path.open("wb") as file:
        savemat(file, {**arrays, "names": np.array(names, dtype=object), "period": period})


def _save_netcdf(path: Path, arrays: dict[str, Array], names: list[str], period: float) -> None:
    import xarray

    axes = {"A": ("time", "state", "state_"), "B": ("time", "state", "input")}
    axes |= {key: ("time", "input", "state") for key in arrays if key.startswith("K_")}
    axes |= {key: ("time", "state", "state_") for key in arrays if key.startswith("X_")}
    data = xarray.Dataset(
        {key: (axes[key], value) for key, value in arrays.items() if key != "t"}, {"time": arrays["t"]}
    )
    data.attrs.update(period=period, designs="; ".join(names))
    data["time"].attrs["units"] = "s"
    path.write_bytes(data.to_netcdf(engine="scipy"))
