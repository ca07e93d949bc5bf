"""Floquet exponents of all loops, and the natural frequencies that the arm would have if it were frozen along its motion."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexlin.checks import Array
from flexlin.linearization import Linearization
from flexlin.report.analysis import Analysis
from flexlin.report.figures.style import BLUE, FAINT, INK, SHADE, canvas, loop_colour, time_axis

MARKERS = "os^Dvp*X"


def draw_exponents(a: Analysis) -> tuple[Figure, str, str]:
    """The complex plane on the left, frozen frequencies over the period on the right."""
    figure, axes = canvas(1, 2, 2.9, width_ratios=[1.35, 1])
    plane(axes[0, 0], a)
    frozen(axes[0, 1], a)
    return (
        figure,
        "Exponents and frequencies",
        (
            "Left: Floquet exponents by growth rate and frequency; left of the line a mode decays. Frequencies are known up to "
            f"multiples of 1/T = {1 / a.plant.period:.4g} Hz and shown up to half of that. Right: the natural frequencies it would "
            "have if its coefficients were frozen at each time, which tell what physical mode to think of."
        ),
    )


def plane(axes: Axes, a: Analysis) -> None:
    """Growth rate, on a scale that is linear near zero and logarithmic beyond, against frequency."""
    known = [(loop, i) for i, loop in enumerate(a.loops) if loop.floquet is not None]
    every = np.concatenate([loop.floquet.exponents for loop, _ in known if loop.floquet is not None])
    sizes = np.abs(every.real)[np.abs(every.real) > 1e-6 * max(1e-3, np.abs(every.real).max())]
    near = float(10 ** np.floor(np.log10(sizes.min()))) if sizes.size else 1.0
    axes.set_xscale("symlog", linthresh=near)
    axes.axvline(0.0, color=INK, lw=1.0)
    for loop, i in known:
        assert loop.floquet is not None
        upper = loop.floquet.exponents[loop.floquet.exponents.imag >= -1e-12]
        axes.plot(
            upper.real, np.abs(upper.imag) / (2 * np.pi), MARKERS[i % len(MARKERS)], ms=6, mew=0.7, mec=INK, alpha=0.85,
            color=loop_colour(loop, i), label=loop.name, clip_on=False,
        )  # fmt: skip
    half = 0.5 / a.plant.period
    axes.axhspan(0.0, half, color=SHADE, lw=0, zorder=0)
    axes.set_ylim(-0.05 * half, 1.08 * half)
    axes.set_xlabel("growth rate in 1/s")
    axes.set_ylabel("frequency in Hz, modulo 1/T")
    axes.legend(
        loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=min(4, len(known)), columnspacing=1.0, handletextpad=0.2
    )


def frozen(axes: Axes, a: Analysis) -> None:
    """Frequencies of the eigenvalues of A(t) over the period: open loop and own loop."""
    curves = [(a.plant, FAINT, "open loop")]
    if len(a.loops) > 1 and a.own is not a.loops[0]:
        curves.append((a.closed, BLUE, a.own.name))
    t = a.t[::4]
    for linearization, colour, label in curves:
        frequencies = frozen_frequencies(linearization, t)
        axes.plot(t, frequencies, color=colour, lw=1.3)
        axes.plot([], [], color=colour, label=label)
    axes.set_yscale("symlog", linthresh=0.1)
    axes.set_ylim(bottom=0.0)
    axes.set_title("frozen natural frequencies in Hz")
    axes.legend(loc="best")
    time_axis(axes, a.plant.period)


def frozen_frequencies(linearization: Linearization, t: Array) -> Array:
    """|Im| / 2 pi of the eigenvalues of A(t), (N, n) in Hz, one of each pair."""
    values = np.linalg.eigvals(linearization.periodic_system().A(t))
    return np.sort(np.abs(values.imag), axis=1)[:, ::2] / (2 * np.pi)
