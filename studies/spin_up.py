"""What does geometric stiffening do when a flexible arm is spun up? Kane's manoeuvre, with and without it.

A cantilever (l = 10, EI = 1.4e4, rhoA = 1.2) is brought from rest to 6 rad/s in 15 s by a prescribed angle. Its first frequency at rest
is 3.80 rad/s: a model that leaves out the shortening of a bent link loses its stiffness at that speed and diverges.
Source: Kane, Ryan, Banerjee, J. Guidance 10 (1987) 139; Simo, Vu-Quoc, J. Sound Vib. 119 (1987) 487.

    python studies/spin_up.py [--size small] [--out DIR]
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from shared.running import run_study

import flexlin as fl
from flexlin import symbolic
from flexlin.mechanics.manipulator import Manipulator

SPIN_TIME, SPEED = 15.0, 6.0
DURATION = 30.0


def angle(t: np.ndarray) -> np.ndarray:
    """q, q', q'' (N, 3) of the prescribed spin-up."""
    ramp, wave = t < SPIN_TIME, 2 * np.pi / SPIN_TIME
    rate = SPEED / SPIN_TIME
    q = np.where(ramp, rate * (t**2 / 2 + (np.cos(wave * t) - 1) / wave**2), SPEED * t - SPEED * SPIN_TIME / 2)
    q1 = np.where(ramp, rate * (t - np.sin(wave * t) / wave), SPEED)
    q2 = np.where(ramp, rate * (1 - np.cos(wave * t)), 0.0)
    return np.stack([q, q1, q2], axis=-1)


def arm(modes: int, stiffening: bool) -> Manipulator:
    """Kane's beam as a scene."""
    raw = {
        "schema": 1,
        "title": "spin-up",
        "links": [{"length": 10.0, "mass_per_length": 1.2, "bending_stiffness": 1.4e4, "modes": modes}],
        "effects": {"geometric_stiffening": {}} if stiffening else {},
        "motion": {"kind": "rotation", "joints": [{"rate": SPEED}], "drive": "prescribed"},
    }
    return fl.build_manipulator(fl.parse_scene(raw))


@dataclass(frozen=True)
class SpinUp:
    """Times (s) and the tip's deflection across the link (m); it ends early where the deflection exceeds half the length."""

    t: np.ndarray
    tip: np.ndarray

    @property
    def lag(self) -> tuple[float, float]:
        """The largest lag of the tip and its time."""
        i = int(np.argmin(self.tip))
        return float(-self.tip[i]), float(self.t[i])


def spin_up(modes: int, stiffening: bool, duration: float) -> SpinUp:
    """Integrate the full equations of the elastic coordinates under the prescribed angle."""
    model = arm(modes, stiffening)
    equations, mass = model.functions["residual"], model.functions["M"]
    shapes = 2.0 * (-1.0) ** np.arange(modes)

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        q, q1, q2 = angle(np.array(t))
        s, s1, s2 = np.append(q, x[:modes]), np.append(q1, x[modes:]), np.append(q2, np.zeros(modes))
        left = symbolic.call_at(equations, s, s1, s2, np.zeros(0))[0][1:, 0]
        return np.append(x[modes:], -np.linalg.solve(symbolic.call_at(mass, s, np.zeros(0))[0][1:, 1:], left))

    def lost(t: float, x: np.ndarray) -> float:
        return 5.0 - abs(shapes @ x[:modes])

    lost.terminal = True
    t = np.linspace(0, duration, 601)
    run = solve_ivp(rate, (0, duration), np.zeros(2 * modes), "LSODA", t, events=lost, rtol=1e-8, atol=1e-10)
    return SpinUp(run.t, shapes @ run.y[:modes])


def draw(series: dict[str, SpinUp], path: Path) -> None:
    """Tip deflection against time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 4.5), layout="constrained")
    axes = figure.subplots()
    for (label, data), colour in zip(series.items(), ("#0072B2", "#D55E00"), strict=True):
        axes.plot(data.t, data.tip, color=colour, label=label)
    axes.axvline(SPIN_TIME, color="0.7", linewidth=0.8, linestyle="--")
    axes.axhline(0, color="0.7", linewidth=0.8)
    axes.set(
        xlabel="time in s",
        ylabel="deflection of the tip in m",
        ylim=(-1.5, 0.6),
        title="Spin-up to 6 rad/s: without geometric stiffening the deflection runs away",
    )
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path)


def main(size: str = "full", out: str | Path = "out/studies") -> dict[str, SpinUp]:
    """Run the study; returns both deflections."""
    modes, duration = (5, DURATION) if size == "full" else (4, 18.0)
    series = {
        label: spin_up(modes, on, duration) for label, on in (("with geometric stiffening", True), ("without", False))
    }
    for label, data in series.items():
        lag, time = data.lag
        end = f"lost at t = {data.t[-1]:.2f} s" if data.t[-1] < duration else f"recovers to {data.tip[-1]:+.4f} m"
        print(f"{label}: largest lag {lag:.4f} m at t = {time:.2f} s, {end}")
    draw(series, Path(out) / "spin_up.svg")
    print(f"wrote {Path(out) / 'spin_up.svg'}")
    return series


if __name__ == "__main__":
    run_study(main, "four modes, 18 s")
