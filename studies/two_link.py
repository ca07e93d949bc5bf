"""What does a second flexible link bring, on the arm of De Luca and Siciliano (1991)?

One link never exercises dM/ds s'' in K_L (67): its M_L does not depend on the angle. On two links it does. The study prints the shapes'
frequencies beside the paper's, follows the coupled frequencies over the elbow's angle, and lets the arm swing faster and faster under
weakly damped joint control: with the whole K_L, without dM/ds s'', and without geometric stiffening, each with Floquet's margin.

    python studies/two_link.py [--size small] [--out DIR]
"""

from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
from scipy.linalg import eigh
from shared.running import run_study

import flexlin as fl
from flexlin.errors import FlexlinError
from flexlin.kronecker import derivative
from flexlin.mechanics.link_shapes import make_shapes

SIZES = {"full": (61, np.linspace(0.1, 1.5, 71)), "small": (5, np.array([0.3, 0.6]))}
"""Elbow angles, and frequencies of the motion in Hz."""
PRINTED = ((0.48, 1.80), (2.18, 15.91))
SCENE = "de-luca-siciliano-1991"
GAINS = {"kind": "pd", "kp": [1.0, 0.5], "kd": [0.02, 0.01]}
WIDE = [{"amplitude": 0.4}, {"mean": 0.5, "amplitude": 0.4, "phase": 1.5707963}]
WEAK = {"links.0.modes": 1, "links.1.modes": 1, "control.feedback": GAINS, "motion.joints": WIDE}
"""The sweep takes one mode a link, for the second ones do not move the margin, and weakly damped joints, so that resonance shows."""


def shape_frequencies(scene: fl.Scene) -> np.ndarray:
    """Frequencies in Hz of each link's shapes, (links, modes)."""
    return np.array(
        [
            make_shapes(scene, i).beta ** 2 * np.sqrt(link.bending_stiffness / (link.mass_per_length * link.length**4))
            for i, link in enumerate(scene.links)
        ]
    ) / (2 * np.pi)


def coupled_frequencies(arm: fl.Manipulator, elbow: np.ndarray) -> np.ndarray:
    """Frequencies in Hz of the arm with both joints free, (angles, modes), without the two that are zero."""
    function = ca.Function("MK", [arm.s], [arm.M, ca.densify(ca.jacobian(arm.g, arm.s))])
    rows = []
    for angle in elbow:
        s = np.zeros(arm.n)
        s[1] = angle
        M, K = (np.array(x) for x in function(s))
        rows.append(np.sqrt(np.abs(eigh(K, M, eigvals_only=True)))[arm.joints :])
    return np.array(rows) / (2 * np.pi)


@dataclass(frozen=True)
class Sweep:
    """Frequencies of the motion in Hz, with Floquet's margin in 1/s and its error; not a number where it is not known."""

    frequency: np.ndarray
    margin: np.ndarray
    error: np.ndarray


def sweep(frequencies: np.ndarray, overrides: dict[str, object], inertial_term: bool = True) -> Sweep:
    """The scene's own loop, swinging at each frequency; `inertial_term` keeps dM/ds (s'' (x) E) in K_L."""
    rows = []
    for frequency in frequencies:
        scene = fl.load_scene(SCENE, {**WEAK, **overrides, "motion.frequency": float(frequency)})
        arm = fl.build_manipulator(scene)
        lin = fl.linearize(arm, scene.motion, scene.control)
        system = lin.periodic_system() if inertial_term else without_inertial_term(arm, lin)
        try:
            result = fl.floquet(system, 1e-7)
            rows.append((result.exponents[0].real, result.errors[0]))
        except FlexlinError as error:
            print(f"  {frequency:.3f} Hz: {error}")
            rows.append((np.nan, np.nan))
    margin, error = np.array(rows).T
    return Sweep(frequencies, margin, error)


def without_inertial_term(arm: fl.Manipulator, lin: fl.Linearization) -> fl.PeriodicSystem:
    """The system of a tool that forgets the first term of (67)."""
    term = derivative(arm.M, arm.s) @ ca.kron(arm.s_ddot, ca.DM.eye(arm.n))
    function = ca.Function("term", [arm.s, arm.s_ddot], [ca.densify(term)])

    def stiffness(t: np.ndarray) -> np.ndarray:
        q, _, acceleration = lin.motion.sample(t)
        E = arm.reference.full()
        left_out, *_ = fl.symbolic.evaluate(function, q @ E.T, acceleration @ E.T)
        return lin.K(t) - left_out

    return fl.PeriodicSystem.from_second_order(lin.M, lin.D, stiffness, lin.period)


def draw(elbow: np.ndarray, coupled: np.ndarray, sweeps: dict[str, Sweep], path: Path) -> None:
    """Coupled frequencies over the elbow's angle; margins over the motion's frequency."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.semilogy(np.degrees(elbow), coupled)
    left.set(xlabel="elbow angle in degrees", ylabel="Hz", title="Coupled frequencies, joints free")
    for (label, data), style in zip(sweeps.items(), ("-", "--", ":"), strict=True):
        right.plot(data.frequency, data.margin, style, label=label)
    right.axhline(0.0, color="0.6", linewidth=0.8)
    right.set(
        xlabel="frequency of the motion in Hz",
        ylabel="largest growth rate in 1/s",
        title="Stability of the own loop",
    )
    right.legend(frameon=False)
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path)


def main(size: str = "full", out: str | Path = "out/studies") -> dict[str, object]:
    """Run the study; returns the shapes' frequencies, the coupled ones, and the three sweeps."""
    angles, frequencies = SIZES[size]
    scene = fl.load_scene(SCENE)
    shapes = shape_frequencies(scene)
    for link, (own, printed) in enumerate(zip(shapes, PRINTED, strict=True), start=1):
        print(f"link {link}: shapes at {own.round(4)} Hz, printed {printed}")
    elbow = np.linspace(0, np.pi, angles)
    coupled = coupled_frequencies(fl.build_manipulator(scene), elbow)
    print(f"coupled, joints free: from {coupled.min(axis=0).round(3)} to {coupled.max(axis=0).round(3)} Hz")
    sweeps = {
        "whole $K_L$": sweep(frequencies, {}),
        "without $dM/ds\\,s''$": sweep(frequencies, {}, inertial_term=False),
        "without geometric stiffening": sweep(frequencies, {"effects.geometric_stiffening": "off"}),
    }
    for label, data in sweeps.items():
        unstable = data.frequency[data.margin > data.error]
        print(f"{label}: " + (f"unstable from {unstable[0]:.3f} Hz" if len(unstable) else "never unstable"))
    draw(elbow, coupled, sweeps, Path(out) / "two_link.svg")
    return {"shapes": shapes, "coupled": coupled, "sweeps": sweeps}


if __name__ == "__main__":
    run_study(main, sizes=SIZES)
