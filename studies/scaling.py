"""How do build time, instructions and evaluation grow with links and modes?

Chains of equal links with gravity, payload, stiffening and damping, swinging under PD control: seconds to build the equations and to
linearize them, instructions of the residual and of (M, D, K, h), microseconds to evaluate these at one time, as flexlin does it
and compiled as C, seconds for Floquet's verdict. The fitted exponents say how each grows with the number of coordinates.

    python studies/scaling.py [--size small] [--out DIR]
"""

import argparse
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import perf_counter

import casadi as ca
import numpy as np

import flexlin as fl
from flexlin import symbolic
from flexlin.errors import FlexlinError

SIZES = {
    "full": (range(1, 11), (0, 1, 2, 3, 5), 12),
    "sizes": (range(1, 11), (0, 1, 2, 3, 5), 0),  # neither compiled nor judged
    "small": (range(1, 4), (0, 1), 2),
}
"""Numbers of links, numbers of modes a link, the largest number of coordinates whose Floquet time is taken; twice that for C."""
POINTS = 256
LINK = {"length": 0.5, "mass_per_length": 0.3, "bending_stiffness": 20.0}
EFFECTS = {"gravity": {}, "payload": {"mass": 0.1}, "geometric_stiffening": {}, "modal_damping": {"ratio": 0.02}}


@dataclass(frozen=True)
class Cost:
    """One chain; seconds and microseconds are the best of several runs, not a number where none was taken."""

    links: int
    modes: int
    coordinates: int
    residual: int
    coefficients: int
    build: float
    linearize: float
    evaluate: float
    compiled: float
    floquet: float


def scene_of(links: int, modes: int) -> fl.Scene:
    """Equal links under joint control, each joint swinging a little."""
    joints = [{"mean": 0.3 if i == 0 else 0.5, "amplitude": 0.2, "phase": float(i)} for i in range(links)]
    heavy = [2.0 * (links - i) ** 2 for i in range(links)]
    return fl.parse_scene(
        {
            "schema": 1,
            "title": f"{links} links, {modes} modes",
            "links": [{**LINK, "modes": modes}] * links,
            "effects": EFFECTS | {"hub": {"inertia": [0.05] * links}},
            "motion": {"kind": "harmonic", "frequency": 0.5, "joints": joints},
            "control": {"feedback": {"kind": "pd", "kp": [20 * h for h in heavy], "kd": heavy}},
        }
    )


def best(call: Callable[[], object], repeats: int = 3) -> float:
    """The shortest of several runs, in seconds."""
    times = []
    for _ in range(repeats):
        start = perf_counter()
        call()
        times.append(perf_counter() - start)
    return min(times)


def compiled(function: ca.Function, folder: Path) -> ca.Function | None:
    """The function as C, compiled with optimization; None where there is no C compiler."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        return None
    own = tempfile.mkdtemp(dir=folder)  # a library of the same path would be loaded once and for all
    code = ca.CodeGenerator(f"{function.name()}.c")
    code.add(function)
    source, library = code.generate(f"{own}/"), f"{own}/{function.name()}.so"
    subprocess.run([compiler, "-O2", "-shared", "-fPIC", source, "-o", library], check=True)
    return ca.external(function.name(), library)


def cost_of(links: int, modes: int, largest: int, folder: Path) -> Cost:
    """Take the times and sizes of one chain."""
    scene = scene_of(links, modes)
    build = best(lambda: fl.build_manipulator(scene), 2)
    arm = fl.build_manipulator(scene)
    linearize = best(lambda: fl.linearize(arm, scene.motion, scene.control), 2)
    lin = fl.linearize(arm, scene.motion, scene.control)
    phases, p = np.linspace(0, 1, POINTS)[:, None], np.zeros((POINTS, 0))
    fast = compiled(lin.coefficients, folder) if lin.n <= 2 * largest else None

    def microseconds(function: ca.Function | None) -> float:
        if function is None:
            return float("nan")
        symbolic.evaluate(function, phases, p)
        return 1e6 * best(lambda: symbolic.evaluate(function, phases, p), 5) / POINTS

    return Cost(
        links,
        modes,
        arm.n,
        arm.functions["residual"].n_instructions(),
        lin.coefficients.n_instructions(),
        build,
        linearize,
        microseconds(lin.coefficients),
        microseconds(fast),
        floquet_seconds(lin) if lin.n <= largest else float("nan"),
    )


def floquet_seconds(lin: fl.Linearization) -> float:
    """Seconds for a verdict at 1e-6; not a number when it needs too many segments."""
    start = perf_counter()
    try:
        fl.floquet(replace(lin).periodic_system(), 1e-6, max_segments=5000)
    except FlexlinError as error:
        print(f"    no Floquet time: {error}")
        return float("nan")
    return perf_counter() - start


def costs(size: str) -> Iterator[Cost]:
    """All chains of the study, printed as they come."""
    links, modes, largest = SIZES[size]
    with tempfile.TemporaryDirectory() as folder:
        for m in modes:
            for n in links:
                cost = cost_of(n, m, largest, Path(folder))
                print("  ".join(f"{k} {v:.3g}" for k, v in asdict(cost).items()))
                yield cost


def exponent(costs: list[Cost], quantity: str) -> float:
    """The power of the number of coordinates with which a quantity grows, fitted over chains of three coordinates or more."""
    rows = [(c.coordinates, getattr(c, quantity)) for c in costs if c.coordinates >= 3 and getattr(c, quantity) > 0]
    if len({n for n, _ in rows}) < 2:
        return float("nan")
    n, values = np.array(rows).T
    return float(np.polyfit(np.log(n), np.log(values), 1)[0])


def draw(costs: list[Cost], exponents: dict[str, float], path: Path) -> None:
    """Each quantity against coordinates, one line for each number of modes."""
    from matplotlib.figure import Figure

    labels = {
        "residual": "instructions of the residual",
        "coefficients": "instructions of (M, D, K, h)",
        "build": "build in s",
        "evaluate": "one evaluation in µs (dashed: compiled)",
        "linearize": "linearize in s",
        "floquet": "Floquet's verdict in s",
    }
    figure = Figure(figsize=(11, 6.5), layout="constrained")
    for axes, (name, label) in zip(figure.subplots(2, 3).ravel(), labels.items(), strict=True):
        if np.isnan(exponents[name]):
            axes.set_axis_off()
            continue
        for k, modes in enumerate(sorted({c.modes for c in costs})):
            chain = [c for c in costs if c.modes == modes]
            n = [c.coordinates for c in chain]
            axes.loglog(n, [getattr(c, name) for c in chain], "o-", markersize=3, color=f"C{k}", label=f"{modes} modes")
            if name == "evaluate":
                axes.loglog(n, [c.compiled for c in chain], "--", color=f"C{k}")
        axes.set(xlabel="coordinates", title=f"{label}\npower {exponents[name]:.2f}")
        axes.spines[["top", "right"]].set_visible(False)
    figure.axes[0].legend(frameon=False)
    figure.savefig(path)


def main(size: str = "full", out: str | Path = "out/studies") -> dict[str, object]:
    """Run the study; returns the costs and the fitted exponents."""
    rows = list(costs(size))
    names = ("residual", "coefficients", "build", "linearize", "evaluate", "floquet")
    exponents = {name: exponent(rows, name) for name in names}
    for name, power in exponents.items():
        print(f"{name} grows with the power {power:.2f} of the coordinates")
    Path(out).mkdir(parents=True, exist_ok=True)
    draw(rows, exponents, Path(out) / "scaling.svg")
    return {"costs": rows, "exponents": exponents}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--size", choices=SIZES, default="full")
    parser.add_argument("--out", default="out/studies")
    arguments = parser.parse_args()
    main(arguments.size, arguments.out)
