"""Do the calculus and the chain give the printed equations of Khang, Dat, Tuan (2019)? And what does their model leave out?

First the linearization (65)-(67) is carried out in Kronecker layout on the paper's own matrices, with every constant a symbol, and held
against (68)-(71) as printed. Then the arm turns in a vertical plane, faster and faster, with and without geometric stiffening.

    python studies/khang_2019.py [--size small] [--out DIR]
"""

from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
from shared.running import run_study

import flexlin as fl
from flexlin.kronecker import derivative

CONSTANTS = ("J1", "m_E", "m_OE", "l", "rhoA", "EI", "g", "X_l", "C1", "D1", "m11", "k11")
FIRST_FREQUENCY = 1.8751040687119612**2 * np.sqrt(2.0 / 0.3)
"""First clamped frequency of the turning link, in rad/s: EI = 2 N m^2, rhoA = 0.3 kg/m, l = 1 m."""


def symbolic_linearization() -> tuple[dict[str, ca.SX], dict[str, ca.SX], ca.SX]:
    """M_L, D_L, K_L, h_L by the Kronecker formulas (64)-(67) and as printed in (68)-(71), with the vector of all symbols."""
    c = {name: ca.SX.sym(name) for name in CONSTANTS}
    s, v, a = (ca.SX.sym(name, 2) for name in ("s", "s_dot", "s_ddot"))
    tau, q, w = ca.SX.sym("tau"), s[0], s[1]
    Bw = c["rhoA"] * c["m11"] + c["m_E"] * c["X_l"] ** 2
    pull = (c["rhoA"] * c["C1"] + c["m_E"] * c["X_l"]) * c["g"]
    coupling = c["rhoA"] * c["D1"] + c["m_E"] * c["l"] * c["X_l"]
    rigid = c["J1"] + c["m_E"] * c["l"] ** 2 + c["m_OE"] * c["l"] ** 2 / 3
    weight = (c["m_E"] * c["l"] + c["m_OE"] * c["l"] / 2) * c["g"]
    M = ca.vertcat(ca.horzcat(rigid + Bw * w**2, coupling), ca.horzcat(coupling, Bw))
    C = ca.vertcat(ca.horzcat(Bw * w * v[1], Bw * w * v[0]), ca.horzcat(-Bw * w * v[0], 0))
    g = ca.vertcat(weight * ca.cos(q) - pull * w * ca.sin(q), pull * ca.cos(q) + c["EI"] * c["k11"] * w)

    by_rate, by_acceleration = ca.kron(v, ca.DM.eye(2)), ca.kron(a, ca.DM.eye(2))
    derived = {
        "M_L": M,
        "D_L": C + derivative(C, v) @ by_rate,
        "K_L": derivative(M, s) @ by_acceleration + derivative(C, s) @ by_rate + derivative(g, s),
        "h_L": ca.vertcat(tau, 0) - (g + M @ a + C @ v),
    }
    elastic = ca.vertcat(w, v[1], a[1])
    derived = {name: ca.substitute([value], [elastic], [ca.SX.zeros(3)])[0] for name, value in derived.items()}
    k12 = -c["m_E"] * c["g"] * c["X_l"] * ca.sin(q) - c["rhoA"] * c["g"] * ca.sin(q) * c["C1"]
    k22 = -c["m_E"] * v[0] ** 2 * c["X_l"] ** 2 - c["rhoA"] * v[0] ** 2 * c["m11"] + c["EI"] * c["k11"]
    printed = {
        "M_L": ca.vertcat(ca.horzcat(rigid, coupling), ca.horzcat(coupling, Bw)),
        "D_L": ca.SX.zeros(2, 2),
        "K_L": ca.vertcat(ca.horzcat(-weight * ca.sin(q), k12), ca.horzcat(k12, k22)),
        "h_L": ca.vertcat(tau - rigid * a[0] - weight * ca.cos(q), -coupling * a[0] - pull * ca.cos(q)),
    }
    return derived, printed, ca.vertcat(*c.values(), s, v, a, tau)


def largest_difference(derived: dict[str, ca.SX], printed: dict[str, ca.SX], symbols: ca.SX, points: int) -> float:
    """The largest difference of any entry at random values of all symbols: an identity holds to rounding everywhere."""
    gaps = [ca.norm_inf(ca.vec(ca.densify(derived[name] - printed[name]))) for name in derived]
    gap = ca.Function("gap", [symbols], [ca.mmax(ca.vertcat(*gaps))])
    values = np.random.default_rng(2019).uniform(0.1, 2.0, (points, symbols.numel()))
    return max(float(gap(value)) for value in values)


@dataclass(frozen=True)
class SpeedSeries:
    """Speeds over the first clamped frequency, with K_L(2,2), the largest real part of the exponents (1/s) and the verdict."""

    ratio: np.ndarray
    stiffness: np.ndarray
    margin: np.ndarray
    verdicts: tuple[str, ...]


def speed_series(ratios: np.ndarray, stiffening: bool) -> SpeedSeries:
    """Turn the paper's arm at constant rates under its PD loop."""
    effects = {"hub": {"inertia": 0.05}, "gravity": {}, "modal_damping": {"ratio": 0.01}}
    raw = {
        "schema": 1,
        "title": "turning link",
        "links": [{"length": 1.0, "mass_per_length": 0.3, "bending_stiffness": 2.0, "modes": 1}],
        "effects": effects | ({"geometric_stiffening": {}} if stiffening else {}),
        "motion": {"kind": "rotation", "joints": [{"rate": 1.0}]},
        "control": {"feedback": {"kind": "pd", "kp": [20.0], "kd": [3.0]}},
    }
    rows = []
    for ratio in ratios:
        scene = fl.parse_scene(raw, overrides={"motion.joints.0.rate": float(ratio * FIRST_FREQUENCY)})
        lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
        result = fl.floquet(lin.periodic_system())
        stiffness = lin.K(np.linspace(0, lin.period, 64, endpoint=False))[:, 1, 1].mean()
        rows.append((stiffness, result.exponents.real.max(), result.verdict))
    stiffness, margin, verdicts = zip(*rows, strict=True)
    return SpeedSeries(ratios, np.array(stiffness), np.array(margin), verdicts)


def draw(series: dict[str, SpeedSeries], path: Path) -> None:
    """K_L(2,2) and the stability margin against speed."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 7), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    for (label, data), colour in zip(series.items(), ("#0072B2", "#D55E00"), strict=True):
        upper.plot(data.ratio, data.stiffness, color=colour, label=label)
        lower.plot(data.ratio, data.margin, color=colour, label=label)
        for verdict, marker in (("unstable", "x"), ("undecided", "o")):
            at = [i for i, found in enumerate(data.verdicts) if found == verdict]
            if at:
                lower.plot(
                    data.ratio[at], data.margin[at], marker, color=colour, markersize=4, label=f"{label}: {verdict}"
                )
    upper.set(ylabel="mean of $K_L(2,2)$ in N/m", title="The paper's model softens with speed; a real link stiffens")
    lower.set(xlabel="rate of turn / first clamped frequency", ylabel="largest real part of the exponents in 1/s")
    for axes in (upper, lower):
        axes.axhline(0.0, color="0.6", linewidth=0.8)
        axes.legend(frameon=False)
        axes.spines[["top", "right"]].set_visible(False)
    lower.set_yscale("symlog", linthresh=0.1)
    figure.savefig(path)


def main(size: str = "full", out: str | Path = "out/studies") -> dict[str, object]:
    """Run the study; returns the difference to (68)-(71) and both series."""
    derived, printed, symbols = symbolic_linearization()
    difference = largest_difference(derived, printed, symbols, 200 if size == "full" else 20)
    for name, value in derived.items():
        print(f"{name} = {value}")
    print(f"largest difference to (68)-(71) as printed: {difference:.1e}")
    ratios = np.linspace(0.05, 1.6, 63 if size == "full" else 8)
    series = {
        "paper's model": speed_series(ratios, stiffening=False),
        "with geometric stiffening": speed_series(ratios, stiffening=True),
    }
    for label, data in series.items():
        lost = [ratio for ratio, verdict in zip(ratios, data.verdicts, strict=True) if verdict == "unstable"]
        print(f"{label}: " + (f"unstable from {lost[0]:.3f} of the first frequency on" if lost else "never unstable"))
    draw(series, Path(out) / "khang_2019.svg")
    return {"difference": difference, "series": series}


if __name__ == "__main__":
    run_study(main, "few points")
