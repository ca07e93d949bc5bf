"""What does a fit add to the data sheet of a real two-link arm, and does its closed loop ring as the log does?

Windows of 2 s of two logs of Quanser's 2-DOF Serial Flexible Link are predicted from the measured currents, with the data sheet's
numbers and with the fitted ones that ship. Then exponents of the arm whose joints stick, as they do between moves, stand beside
frequency and decay of the strain that both logs show there; windows that the currents drive have nearly the measured frequency.
Source of the logs, thinned to 100 Hz: github.com/basta/quanser-2-dof-serial-flexible-link, commit 48ab0ce; MIT licence, see logs/LICENSE.

    python studies/measured_machine.py [--size small] [--out DIR]
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import curve_fit

import flexlin as fl

LOGS = Path(__file__).parent / "logs"
MACHINES = {
    "quanser-two-link": ("two_link_lqr.csv", 0.0, [(1.5, 2.8), (6.4, 7.8)]),
    "quanser-two-link-factory": ("two_link_full_feedback.csv", 1.5, [(3.4, 5.0), (8.5, 10.0), (13.6, 15.0)]),
}
"""The log of each scene, when its sensors begin to read, and the times between moves, in s."""
SHEET = {
    "links.0.bending_stiffness": 39.96 * 0.202 / 3,
    "links.1.bending_stiffness": 6.858 * 0.20185 / 3,
    "effects.hub": {"inertia": [7.3616e-4, 4.4455e-4], "radius": [0.05, 0.001]},
    "effects.joint_flexibility": {"stiffness": [0, 0], "motor_inertia": [0.0628, 0.002575]},
    "effects.viscous_friction": {"coefficient": [4.0, 1.5]},
    "effects.coulomb_friction": "off",
    "effects.gravity": "off",
    "log.inputs.axis_1": {"column": "current_1_A", "gain": 8.925},
    "log.inputs.axis_2": {"column": "current_2_A", "gain": 0.87},
    "log.outputs.gauge_1": {"column": "deflection_1_rad", "sensor": "strain", "link": 0, "gain": 3 / 0.202},
    "log.outputs.gauge_2": {"column": "deflection_2_rad", "sensor": "strain", "link": 1, "gain": 3 / 0.20185},
}
"""The maker's configuration file; strips as cantilevers, k = 3 EI / l."""


def predict(name: str, seconds: float | None = None) -> dict[str, Any]:
    """What the data sheet's numbers predict of a log, and what the fitted ones do."""
    file, begin, _ = MACHINES[name]
    found = {}
    for label, numbers in (("data sheet", SHEET), ("fitted", {})):
        scene = fl.load_scene(name, numbers)
        log = fl.read_log(LOGS / file, scene)
        end = log.time[-1] if seconds is None else begin + seconds
        found[label] = fl.predict(scene, log.part(begin, end))
    return found


def compare(name: str, seconds: float | None = None) -> dict[str, dict[str, float]]:
    """The fit of each column in percent, with the data sheet's numbers and with the fitted ones."""
    return {label: found.fit for label, found in predict(name, seconds).items()}


def measure_ring(name: str) -> list[tuple[float, float]]:
    """Frequency (Hz) and rate of decay (1/s) of gauge 1 in each rest: an offset and a decaying sine, by least squares."""
    file, _, rests = MACHINES[name]
    log = fl.read_log(LOGS / file, fl.load_scene(name))

    def ring(
        t: np.ndarray, offset: float, drift: float, cosine: float, sine: float, rate: float, frequency: float
    ) -> np.ndarray:
        wave = 2 * np.pi * frequency * t
        swing = cosine * np.cos(wave) + sine * np.sin(wave)
        return np.asarray(offset + drift * t + np.exp(-rate * t) * swing)

    found = []
    for begin, end in rests:
        inside = (log.time >= begin) & (log.time <= end)
        t, value = log.time[inside] - begin, log.outputs["gauge_1"][inside]
        size = np.ptp(value) / 2
        best = min(
            (curve_fit(ring, t, value, [value.mean(), 0.0, size * c, size * s, 0.3, 1.9], maxfev=20_000) for c, s in
             ((1, 0), (-1, 0), (0, 1), (0, -1))),
            key=lambda one: float(np.sum((ring(t, *one[0]) - value) ** 2)),
        )  # fmt: skip
        found.append((float(best[0][5]), float(best[0][4])))
    return found


def predict_ring(name: str) -> tuple[float, float]:
    """Frequency (Hz) and rate of decay (1/s) of the slowest mode that swings, of the loop at rest, where friction holds the joints."""
    still = [{"amplitude": 0.0}, {"amplitude": 0.0}]
    scene = fl.load_scene(name, {"motion.joints": still})
    system = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control).periodic_system()
    values = np.linalg.eigvals(system.A(np.zeros(1))[0])
    slowest = min(values[values.imag > 1.0], key=lambda value: value.imag)
    return float(slowest.imag / (2 * np.pi)), float(-slowest.real)


def draw(predictions: dict[str, Any], path: Path) -> None:
    """Joint and gauge of the second link over time: measured, by the data sheet, fitted."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 5), layout="constrained")
    axes = figure.subplots(2, 1, sharex=True)
    for cell, column, label in zip(
        axes, ("joint_2_rad", "deflection_2_rad"), ("joint 2 in rad", "deflection 2 in rad"), strict=True
    ):
        for made, found in predictions.items():
            cell.plot(found.time, found.outputs[column], label=f"{made}: {found.fit[column]:.0f} %", linewidth=1.2)
        cell.plot(found.time, found.measured[column], "k", label="measured", linewidth=0.8)
        cell.set_ylabel(label)
        cell.legend(loc="upper left", bbox_to_anchor=(1, 1), frameon=False, fontsize="small")
    axes[1].set_xlabel("time in s; a new window every 2 s")
    figure.suptitle("A two-link flexible arm, predicted from its measured currents")
    figure.savefig(path)


def main(size: str = "full", out: str | Path = "out/studies") -> dict[str, Any]:
    """Run the study, print and draw it; returns fits and rings by machine."""
    rows: dict[str, Any] = {}
    for name in MACHINES:
        predictions = predict(name, None if size == "full" else 2.0)
        rows[name] = {label: found.fit for label, found in predictions.items()}
        for label, fit in rows[name].items():
            print(f"{name}, {label}: " + ", ".join(f"{column} {value:.1f} %" for column, value in fit.items()))
        if len(rows) == 1:
            Path(out).mkdir(parents=True, exist_ok=True)
            draw(predictions, Path(out) / "measured_machine.svg")
        for made, rings in (("predicted", [predict_ring(name)]), ("measured", measure_ring(name))):
            for frequency, rate in rings:
                print(f"  ring: {made} {frequency:.3f} Hz, decay {rate:.3f} 1/s")
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", choices=("full", "small"), default="full", help="small: the first 2 s of each log")
    parser.add_argument("--out", default="out/studies", help="folder for the picture")
    options = parser.parse_args()
    main(options.size, options.out)
