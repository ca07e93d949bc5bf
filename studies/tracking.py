"""How far is the tip off its path, for each kind of feedforward and speed? The linear answer beside the nonlinear one.

The shipped single link swings under its own PD loop. Fed forward are the torque of the rigid arm, the torque that keeps the joint
exactly on its path, or the torque and joint motion that keep the tip on its path (stable inversion of a plant that is not of minimum
phase).

    python studies/tracking.py [--size small] [--scene NAME] [--out DIR]
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from shared.running import run_study

import flexlin as fl
from flexlin.control.tracking import KINDS, feedforward
from flexlin.simulation import Simulation, simulate

COLOURS = {"rigid": "#D55E00", "joint-exact": "#0072B2", "tip-exact": "#009E73"}


@dataclass(frozen=True)
class Tracking:
    """For each kind: largest tip errors (m) in the settled nonlinear simulation and by the linear equations, against frequency (Hz)."""

    frequencies: np.ndarray
    nonlinear: dict[str, np.ndarray]
    linear: dict[str, np.ndarray]
    gain: np.ndarray


def run(scene_name: str, frequency: float, kind: str, periods: float) -> tuple[Simulation, float]:
    """Simulate one kind of feedforward at one speed; with the linear tip error."""
    scene = fl.load_scene(scene_name, {"motion.frequency": float(frequency)})
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    made = feedforward(lin, kind)
    return simulate(lin, periods, feedforward=made, tol=1e-7), made.linear_tip_error


def settled(result: Simulation) -> np.ndarray:
    """The tip error (m) over the last period, 128 points and the next."""
    return np.linalg.norm(result.tip - result.tip_rigid, axis=1)[-129:]


def compare(scene_name: str, frequencies: np.ndarray, periods: float) -> tuple[Tracking, dict[str, Simulation]]:
    """All kinds at all speeds; and the simulations at the scene's own speed, the middle of them."""
    nonlinear, linear = ({kind: np.empty(len(frequencies)) for kind in KINDS} for _ in range(2))
    shown = {}
    for i, frequency in enumerate(frequencies):
        for kind in KINDS:
            result, predicted = run(scene_name, frequency, kind, periods)
            nonlinear[kind][i], linear[kind][i] = settled(result).max(), predicted
            if i == len(frequencies) // 2:
                shown[kind] = result
    return Tracking(frequencies, nonlinear, linear, nonlinear["rigid"] / nonlinear["tip-exact"]), shown


def draw(data: Tracking, shown: dict[str, Simulation], path: Path) -> None:
    """Tip error over the last period at one speed, and the largest against speed."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 8), layout="constrained")
    upper, lower = figure.subplots(2, 1)
    for kind, result in shown.items():
        t = result.t[-129:] - result.t[-129]
        upper.semilogy(t / t[-1], 1e3 * settled(result), color=COLOURS[kind], label=kind)
        lower.semilogy(
            data.frequencies, 1e3 * data.nonlinear[kind], "o-", color=COLOURS[kind], label=f"{kind}, nonlinear"
        )
        lower.semilogy(
            data.frequencies, 1e3 * data.linear[kind], "--", color=COLOURS[kind], label=f"{kind}, linear", linewidth=1
        )
    middle = len(data.frequencies) // 2
    upper.set(
        xlabel="phase of the motion",
        ylabel="distance of the tip from its path in mm",
        title=f"At {data.frequencies[middle]:g} Hz the tip-exact feedforward is {data.gain[middle]:.0f} times closer",
    )
    lower.set(xlabel="frequency of the motion in Hz", ylabel="largest distance in mm")
    for axes in (upper, lower):
        axes.legend(frameon=False, ncols=2, fontsize="small")
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path)


def main(size: str = "full", out: str | Path = "out/studies", scene: str = "single-link") -> dict[str, object]:
    """Run the study; returns the tip errors."""
    own = fl.load_scene(scene).motion.frequency
    factors = np.array([0.25, 0.5, 1.0, 1.5, 2.0]) if size == "full" else np.array([1.0])
    data, shown = compare(scene, own * factors, 3 if size == "full" else 2)
    print("frequency in Hz   " + "".join(f"{kind:>24}" for kind in KINDS) + "   rigid / tip-exact")
    for i, frequency in enumerate(data.frequencies):
        cells = "".join(f"{1e3 * data.nonlinear[k][i]:>12.4g} ({1e3 * data.linear[k][i]:>6.4g}) mm" for k in KINDS)
        print(f"{frequency:>15.4g}   {cells}   {data.gain[i]:>10.1f}")
    print("largest tip error of the settled nonlinear loop (in brackets by the linear equations)")
    draw(data, shown, Path(out) / "tracking.svg")
    return {"data": data}


if __name__ == "__main__":
    run_study(main, "one speed only", scene={"default": "single-link", "help": "name or path of the scene"})
