"""Which design survives which speed and payload?

The shipped single link carries more and swings faster. Every design is made for the light, slow arm it was tuned on (robustness) and
for each arm anew (performance), and Floquet judges each loop. What the periodic Riccati equation behind them costs: `riccati_race.py`.

    python studies/lqr_designs.py [--size small] [--out DIR]
"""

from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
from shared.running import run_study

import flexlin as fl
from flexlin.control import averaged_lqr, frozen_lqr, periodic_lqr

R = np.array([[100.0]])
AMPLITUDE = 1.2
"""Swing of the joint in rad: from hanging almost down to standing almost up, where gravity helps and hinders."""
DESIGNS = {"averaged": averaged_lqr, "frozen": frozen_lqr, "periodic": periodic_lqr}


@dataclass(frozen=True)
class Survival:
    """Largest real part of the exponents (1/s) for each design over payloads (rows) and frequencies (columns)."""

    payloads: np.ndarray
    frequencies: np.ndarray
    own: dict[str, np.ndarray]
    kept: dict[str, np.ndarray]


def weigh(system: fl.PeriodicSystem) -> np.ndarray:
    """Q: deflections and angles weigh 1, their rates 0.01."""
    return np.diag(np.repeat([1.0, 0.01], system.n // 2))


def linearized(payload: float, frequency: float, modes: int = 2) -> fl.Linearization:
    """The linear equations of the arm without a loop."""
    scene = loaded(payload, modes, frequency)
    return fl.linearize(built(payload, modes), scene.motion)


def loaded(payload: float, modes: int, frequency: float = 1.0) -> fl.Scene:
    """The shipped single link with another payload, as many modes, and a wide swing."""
    changes = {
        "effects.payload.mass": float(payload),
        "motion.frequency": float(frequency),
        "motion.joints.0.amplitude": AMPLITUDE,
        "links.0.modes": modes,
        "designs": [],
    }
    return fl.load_scene("single-link", changes)


@cache
def built(payload: float, modes: int) -> fl.Manipulator:
    """The arm, which serves for every speed."""
    return fl.build_manipulator(loaded(payload, modes))


def plant(payload: float, frequency: float, modes: int = 2) -> fl.PeriodicSystem:
    """The arm without a loop."""
    return linearized(payload, frequency, modes).periodic_system()


def survival(payloads: np.ndarray, frequencies: np.ndarray, modes: int = 2, phases: int = 16) -> Survival:
    """Judge designs made for each arm, and designs of the first arm kept (their gains follow the phase); `phases` of the frozen one."""
    designs = {**DESIGNS, "frozen": partial(frozen_lqr, phases=phases)}
    shape = (len(payloads), len(frequencies))
    own, kept = ({name: np.empty(shape) for name in DESIGNS} for _ in range(2))
    first = {}
    for i, payload in enumerate(payloads):
        for j, frequency in enumerate(frequencies):
            system, stretch = plant(payload, frequency, modes), frequency / frequencies[0]
            for name, make in designs.items():
                made = make(system, weigh(system), R)
                own[name][i, j] = growth(made.closed_loop)
                gain = first.setdefault(name, made).K
                kept[name][i, j] = growth(system.feedback(lambda t, k=gain, s=stretch: k(t * s)))
    return Survival(payloads, frequencies, own, kept)


def growth(loop: fl.PeriodicSystem) -> float:
    """The largest real part of the exponents."""
    return float(fl.floquet(loop, tol=1e-6).exponents.real.max())


def draw(data: Survival, path: Path) -> None:
    """Growth rate of each design over payload and frequency."""
    from matplotlib.colors import SymLogNorm
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.6, 5.4), layout="constrained")
    axes = figure.subplots(2, len(DESIGNS), sharex=True, sharey=True)
    norm = SymLogNorm(0.1, vmin=-3, vmax=3)
    for row, (label, part) in zip(
        axes, (("made for each arm", data.own), ("kept from the first arm", data.kept)), strict=True
    ):
        for cell, name in zip(row, DESIGNS, strict=True):
            shown = cell.pcolormesh(data.frequencies, 1e3 * data.payloads, part[name], cmap="RdBu_r", norm=norm)
            if np.any(part[name] > 0) and np.any(part[name] < 0):
                cell.contour(data.frequencies, 1e3 * data.payloads, part[name], [0.0], colors="k")
            cell.set_title(f"{name},\n{label}", fontsize="small")
            cell.set_ylim(*1e3 * data.payloads[[0, -1]])
        row[0].set_ylabel("payload in g")
    for cell in axes[-1]:
        cell.set(xlabel="frequency in Hz", xscale="log")
        cell.set_xticks([0.2, 0.5, 1.0, 2.0], ["0.2", "0.5", "1", "2"])
        cell.set_xticks([], minor=True)
        cell.set_xlim(*data.frequencies[[0, -1]])
    figure.colorbar(shown, ax=axes, label="growth rate in 1/s")
    figure.suptitle("Which loop survives (blue: stable)")
    figure.savefig(path)


def main(size: str = "full", out: str | Path = "out/studies") -> dict[str, object]:
    """Run the study; returns growth rates."""
    full = size == "full"
    frequencies = np.geomspace(0.2, 3.0, 9) if full else np.array([0.5, 3.0])
    data = survival(np.linspace(0.03, 0.5, 6 if full else 2), frequencies, *((2, 16) if full else (1, 4)))
    print(
        f"{'design':>10} {'made for each arm':>24} {'kept from the first':>24}   (stable cases of {data.own['frozen'].size})"
    )
    for name in DESIGNS:
        print(f"{name:>10} {int((data.own[name] < 0).sum()):>24} {int((data.kept[name] < 0).sum()):>24}")
    draw(data, Path(out) / "lqr_designs.svg")
    return {"survival": data}


if __name__ == "__main__":
    run_study(main, "few cases and phases, one mode, a looser tolerance")
