"""What does accuracy cost, here and with the tools that people use today?

The single link with its PD loop, 1, 3 and 6 modes, to 1e-10, on one thread: all Floquet exponents with their errors, the resolution of the
coefficients included; and the transition matrix of one period alone, here and by SciPy, CasADi's cvodes and heyoka, whose right-hand sides
are compiled. Every program gets the cheapest of its own settings that reaches the accuracy against a common reference, its set-up left out
except where compilation is counted; the least CPU time of several runs.
Then many values: microseconds a value for all exponents to 1e-8.
"""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import reduce
from importlib.util import find_spec
from pathlib import Path
from time import process_time

import numpy as np
from outside.compiled import compile_product
from outside.cvodes import prepare_cvodes
from outside.heyoka_taylor import HeyokaTransitions, import_heyoka
from outside.scipy_ode import prepare_scipy
from shared.running import least_time, run_study

import flexlin as fl
from flexlin import sweep
from flexlin.analyses.accuracy.result import compare_exponents
from flexlin.analyses.accuracy.scipy_methods import FastRate
from flexlin.checks import Array
from flexlin.linearization.free import ParametricLoop, parametric_loop
from flexlin.periodic.transition.choose_segments import Setting, factor_period

HEYOKA = find_spec("heyoka") is not None
ACCURACY = 1e-10
MODES = (1, 3, 6)
PATH = "effects.payload.mass"
WHOLE, FACTORS = "flexlin, all exponents", "flexlin, transition matrix"
ORDERS, SEGMENTS = (12, 14, 16, 18, 20), (8, 10, 12, 16, 24, 32, 48, 64, 96, 160, 240)
FULL_MODE = 70
"""Equations up to which heyoka's full mode is tried: it compiles in half a minute there."""
SCAN = 3
"""Repetitions while the cheapest setting is sought."""
TOLS = (1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14)


@dataclass(frozen=True)
class Row:
    """One program at the setting that was cheapest; reached: whether it met the accuracy."""

    modes: int
    program: str
    setting: str
    error: float
    milliseconds: float
    reached: bool


def transition(system: fl.PeriodicSystem, setting: Setting) -> Array:
    """Transition matrix of one period, from the resolved coefficients on."""
    return reduce(lambda P, F: F @ P, factor_period(system, setting))


def cheapest(
    modes: int,
    program: str,
    families: list[dict[str, Callable[[], Array]]],
    error: Callable[[Array], float],
    repetitions: int,
) -> Row:
    """The fastest setting that reaches the accuracy, or the most accurate one where none does.

    Each family goes from coarse to fine and is left at its first setting that reaches the accuracy.
    """
    rows = []
    for family in families:
        for name, run in family.items():
            try:
                result, time = least_time(run, 1 + SCAN)
            except RuntimeError:  # an outside integrator gives up at this tolerance
                continue
            rows.append((error(result), time, name, run))
            if rows[-1][0] <= ACCURACY:
                break
    good = [row for row in rows if row[0] <= ACCURACY]
    best = min(good, key=lambda row: row[1]) if good else min(rows, key=lambda row: row[0])
    time = least_time(best[3], 1 + repetitions)[1]
    return Row(modes, program, best[2], best[0], 1e3 * min(time, best[1]), bool(good))


def one_run(modes: int, repetitions: int, tols: tuple[float, ...]) -> list[Row]:
    """All programs on one loop: all exponents here, then one transition matrix by each."""
    loop = parametric_loop(scene(modes), [PATH])
    system = loop.linearization.periodic_system()
    exact = transition(system, Setting("gauss", 20, 1200, "reference"))

    def error(P: Array) -> float:
        return float(np.abs(P - exact).max() / np.abs(exact).max())

    def here(order: int) -> dict[str, Callable[[], Array]]:
        return {
            f"gauss {order} on {k}": lambda k=k: transition(system, Setting("gauss", order, k, "")) for k in SEGMENTS
        }

    rate = FastRate(compile_product(loop), loop.nominal)
    programs = {
        FACTORS: [here(order) for order in ORDERS],
        **{
            f"SciPy {method}": [{f"tol {t:.0e}": prepare_scipy(loop, method, t, rate=rate) for t in tols}]
            for method in ("DOP853", "LSODA")
        },
        "CasADi cvodes": [
            {f"{name}, tol {t:.0e}": prepare_cvodes(loop, t, stiff=name == "BDF") for t in tols}
            for name in ("Adams", "BDF")
        ],
    }
    rows = [cheapest(modes, name, families, error, repetitions) for name, families in programs.items()]
    theirs = by_heyoka(modes, loop, error, repetitions) if HEYOKA else []
    return [all_exponents(modes, loop, repetitions), *rows, *theirs]


def all_exponents(modes: int, loop: ParametricLoop, repetitions: int) -> Row:
    """`fl.floquet` at ACCURACY on a new system each time, so that its coefficients are resolved each time; its set-up left out."""
    lin = loop.linearization
    systems = [new_system(lin) for _ in range(1 + 3 * repetitions)]
    found, time = least_time(lambda: fl.floquet(systems.pop(), ACCURACY), 1 + 3 * repetitions)
    exact = fl.floquet(loop.linearization.periodic_system(), 0.01 * ACCURACY).exponents
    setting = found.setting
    name = f"{setting.method} {setting.order} on {setting.segments}" if setting.segments > 1 else setting.method
    error = compare_exponents(found.exponents, exact, loop.linearization.period)
    return Row(modes, WHOLE, name, error, 1e3 * time, error <= ACCURACY)


def new_system(lin: fl.Linearization) -> fl.PeriodicSystem:
    """The system of a linearization, not resolved yet."""
    known = lin.periodic_system()
    return fl.PeriodicSystem(
        known.A, known.period, known.B, known.breaks, known.second_order, known.features, known.complete
    )


def by_heyoka(modes: int, loop: ParametricLoop, error: Callable[[Array], float], repetitions: int) -> list[Row]:
    """The faster of heyoka's two modes alone, and the one that is cheaper with its compilation.

    Its full mode takes minutes to compile where there are many equations: there it is left out.
    """
    tries = []
    for compact in (True, False) if (2 * loop.linearization.n) ** 2 <= FULL_MODE else (True,):
        forget_compiled_code()
        start = process_time()
        flow = HeyokaTransitions(loop, 1e-9 if modes == 1 else 1e-11, compact=compact)
        compiling = 1e3 * (process_time() - start)
        settings = {"compact mode" if compact else "full mode": lambda flow=flow: flow(loop.nominal)}
        tries.append((cheapest(modes, "heyoka, evaluation alone", [settings], error, repetitions), compiling))
    alone = min(tries, key=lambda each: each[0].milliseconds)[0]
    row, compiling = min(tries, key=lambda each: each[0].milliseconds + each[1])
    whole = replace(row, program="heyoka with compilation", milliseconds=row.milliseconds + compiling)
    return [alone, whole]


def forget_compiled_code() -> None:
    """Let heyoka compile, not read what an earlier run left on the disk."""
    state = import_heyoka().llvm_state
    state.set_diskcache_enabled(False)
    state.clear_memcache()


def exponents_batch(values: int) -> tuple[float, float, int]:
    """All exponents of the single link with 1 mode to 1e-8: microseconds a value, largest error, and how many went one by one."""
    masses = np.linspace(0.01, 0.2, values)
    start = process_time()
    result = sweep(scene(1), {PATH: masses}, 1e-8)
    time = 1e6 * (process_time() - start) / values
    apart = 0.0
    for i in np.linspace(0, values - 1, 9).astype(int):
        loop = parametric_loop(scene(1), [PATH])
        exact = fl.floquet(loop.at(masses[i : i + 1]).periodic_system(), 1e-11).exponents
        distance = np.abs(result.exponents.values[i][:, None] - exact).min(axis=1)
        apart = max(apart, float((distance / np.maximum(1.0, np.abs(exact))).max()))
    return time, apart, int(result.attrs["one_by_one"])


def draw(rows: list[Row], path: Path) -> None:
    """Time of one transition matrix for each program, modes side by side; pale where the accuracy is not reached."""
    from matplotlib.figure import Figure

    programs = list(dict.fromkeys(row.program for row in rows))
    modes = sorted({row.modes for row in rows})
    figure = Figure(figsize=(8, 4), layout="constrained")
    axes = figure.subplots()
    for k, mode in enumerate(modes):
        mine = [row for row in rows if row.modes == mode and row.program in programs]
        places = [programs.index(row.program) + 0.8 * (k + 0.5) / len(modes) - 0.4 for row in mine]
        bars = axes.barh(
            places, [row.milliseconds for row in mine], 0.7 / len(modes), color=f"C{k}", label=f"modes: {mode}"
        )
        for bar, row in zip(bars, mine, strict=True):
            bar.set_alpha(1.0 if row.reached else 0.4)
    axes.set_yticks(range(len(programs)), programs)
    axes.invert_yaxis()
    axes.set(
        xscale="log",
        xlabel="CPU time in ms",
        title=f"All exponents, or one transition matrix, to {ACCURACY:.0e} (pale: not reached)",
    )
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path)


def scene(modes: int) -> fl.Scene:
    return fl.load_scene("single-link", {"links.0.modes": modes, "designs": []})


def main(size: str = "full", out: str | Path = "out/studies") -> dict[str, object]:
    """Run the study, print the ratios, write cost_of_accuracy.json; returns rows and ratios."""
    full = size == "full"
    if not HEYOKA:
        print('heyoka is not installed and left out; pip install "flexlin[peers]" brings it')
    rows: list[Row] = []
    ratios: dict[str, float] = {}
    for modes in MODES if full else (1,):
        found = one_run(modes, 9 if full else 1, TOLS if full else TOLS[2:4])
        own = found[0].milliseconds
        for row in found:
            note = "" if row.reached else f"  (does not reach {ACCURACY:.0e})"
            print(f"{modes} modes  {row.program:26s} {row.setting:18s} {row.error:8.1e} {row.milliseconds:10.3f} ms"
                  f" {row.milliseconds / own:9.1f} x{note}")  # fmt: skip
            ratios[f"{row.program}, {modes} modes"] = row.milliseconds / own
        rows += found
    time, apart, alone = exponents_batch(10_000 if full else 200)
    print(f"all exponents to 1e-8: {time:.0f} us a value, largest error found {apart:.1e}, {alone} one by one")
    draw(rows, Path(out) / "cost_of_accuracy.svg")
    data = {"rows": [asdict(row) for row in rows], "ratios": ratios, "batch_us": time, "batch_error": apart}
    (Path(out) / "cost_of_accuracy.json").write_text(json.dumps(data, indent=1))
    return data


if __name__ == "__main__":
    run_study(main, "one mode, few values")
