"""What does a fit add to the data sheet of a real two-link arm, and does its closed loop ring as the log does?

Windows of 2 s of two logs of Quanser's 2-DOF Serial Flexible Link are predicted from the measured currents, with the data sheet's
numbers and with the fitted ones that ship. Then each third of a log is predicted by numbers that `flexlin.identify` finds in the other
two; which effects the arm has, and where the search begins, was found from whole logs. Then exponents of the arm whose joints stick,
as they do between moves, by all of a log and without each third, stand beside frequency and decay of the strain that both logs show there.
Source of the logs, thinned to 100 Hz: github.com/basta/quanser-2-dof-serial-flexible-link, commit 48ab0ce; MIT licence, see logs/LICENSE.

    python studies/measured_machine.py [--size small] [--out DIR]
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import curve_fit
from shared.running import run_study

import flexlin as fl
from flexlin.scene import revise_scene

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
WEIGHED = {
    "effects.payload.mass.1": 0.157,
    "effects.joint_flexibility.motor_inertia.1": 0.002575,
    "effects.viscous_friction.exponent.1": 1.0,
}
"""The data sheet's masses and plain viscous friction of joint 2, for numbers that whole logs moved, and that parts of one do not know."""
FREE = [
    *(f"links.{k}.bending_stiffness" for k in (0, 1)),
    *(f"effects.{name}.{k}" for name in ("viscous_friction.coefficient", "coulomb_friction.torque") for k in (0, 1)),
    "effects.viscous_friction.exponent.0",
    "effects.gravity.acceleration",
    *(f"log.{name}.{what}" for name in ("inputs.axis_1", "inputs.axis_2") for what in ("gain", "offset")),
    *(f"log.{name}.{what}" for name in ("outputs.gauge_1", "outputs.gauge_2") for what in ("gain", "offset")),
]
"""What is fitted to parts of a log."""
ALSO_FREE = {
    "quanser-two-link": ["effects.tip_force.force.1"],
    "quanser-two-link-factory": [
        "log.inputs.crosstalk.gain",
        *(f"effects.coulomb_friction.static.{k}" for k in (0, 1)),
    ],
}


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


def leave_out(
    name: str, thirds: Iterable[int] = range(3), free: list[str] | None = None
) -> tuple[dict[str, dict[str, float]], dict[str, tuple[float, float]]]:
    """The fit of each column in percent in thirds of a log, each by numbers fitted to the others, and in all these thirds together.

    Beside it the ring of the arm with these numbers.
    """
    file, begin, _ = MACHINES[name]
    start = fl.load_scene(name, WEIGHED)
    whole = fl.read_log(LOGS / file, start)
    log = whole.part(begin, whole.time[-1])
    edges, found, rings = np.linspace(log.time[0], log.time[-1], 4), {}, {}
    for third in thirds:
        out = (log.time >= edges[third]) & (log.time <= edges[third + 1])
        fitted = fl.identify(start, rows_of(log, ~out), free or [*FREE, *ALSO_FREE[name]])
        found[f"third {third + 1}"] = fl.predict(fitted.scene, rows_of(log, out))
        rings[f"third {third + 1}"] = predict_ring(fitted.scene)
    together = {}
    for column in next(iter(found.values())).fit:
        measured, made = (
            np.concatenate([group[column] for group in groups])
            for groups in ([one.measured for one in found.values()], [one.outputs for one in found.values()])
        )
        together[column] = float(
            100 * (1 - np.linalg.norm(measured - made) / np.linalg.norm(measured - measured.mean()))
        )
    return {**{third: one.fit for third, one in found.items()}, "together": together}, rings


def rows_of(log: fl.Log, rows: np.ndarray) -> fl.Log:
    """Some rows of a log; where others were between them it has a gap."""
    groups = ({name: values[rows] for name, values in group.items()} for group in (log.inputs, log.outputs))
    return fl.Log(log.time[rows], *groups, log.columns, log.source)


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


def predict_ring(scene: fl.Scene) -> tuple[float, float]:
    """Frequency (Hz) and rate of decay (1/s) of the slowest mode that swings, of the loop at rest, where friction holds the joints."""
    still = [{"amplitude": 0.0}, {"amplitude": 0.0}]
    scene = revise_scene(scene, {"motion.joints": still})
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
            draw(predictions, Path(out) / "measured_machine.svg")
        small = {"thirds": [2], "free": ["links.0.bending_stiffness", "log.outputs.gauge_1.gain"]}
        left, rings = leave_out(name) if size == "full" else leave_out(name, **small)
        for third, fit in left.items():
            print(f"  left out, {third}: " + ", ".join(f"{column} {value:.1f} %" for column, value in fit.items()))
        rows[name]["left out"] = left["together"]
        for third, (frequency, rate) in rings.items():
            print(f"  ring without {third}: {frequency:.3f} Hz, {rate:.3f} 1/s")
        measured, predicted = np.array(measure_ring(name)), predict_ring(fl.load_scene(name))
        for k, what in enumerate(("frequency in Hz", "decay in 1/s")):
            one = measured[:, k]
            spread = f"{one.mean():.3f} ± {one.std(ddof=1):.3f} in {len(one)} rests"
            print(f"  ring, {what}: predicted {predicted[k]:.3f}, measured {spread}")
    return rows


if __name__ == "__main__":
    run_study(main, "the first 2 s of each log")
