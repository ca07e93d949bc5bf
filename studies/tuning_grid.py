"""Does `fl.tune` find what an exhaustive grid over the gains finds? PD and PI loops and filters of four arms, over payloads and speeds.

The grid is laid over the same limits. Both are judged on a grid of scenarios and on random ones of the same box: the best of the grid is
the one whose worst of all is best, as sought among the gains in the order of their worst on the grid of scenarios.

    python studies/tuning_grid.py [--size small] [--out DIR]
"""

import itertools
import time

import numpy as np
from shared.running import run_study

import flexlin as fl

KP, KD, KI = ("control.feedback.kp.0", "control.feedback.kd.0", "control.feedback.ki.0")
SCENES = {
    "single-link": {"effects.payload.mass": (0.0, 0.3), "motion.frequency": (0.3, 1.2)},
    "quanser-flexible-link": {"effects.hub.inertia": (1.5e-3, 4e-3), "motion.frequency": (0.3, 1.2)},
    "flexible-joint-link": {"effects.joint_flexibility.motor_inertia": (1e-3, 4e-3), "motion.frequency": (0.3, 2.0)},
    "arm-on-carriage": {"motion.frequency": (0.5, 2.0)},
}
ONE_MODE = ("single-link", "quanser-flexible-link")
LOOPS = {"PD": (KP, KD), "PI": (KP, KI), "PD, filtered": (KP, KD)}
"""The gains that are tuned: of a PI loop the damping stays as it is."""
TOGETHER = 16
"""Gains of the grid that are judged on random scenarios at a time."""
FILTER = {"kind": "low-pass", "on": "rates", "order": 1, "cutoff": 30.0}


def load_loop(name, kind):
    """A scene with a loop of one kind, and the limits of its gains: a tenth and ten times their first values."""
    feedback = fl.load_scene(name).control.feedback
    kp, kd = feedback.kp[0], feedback.kd[0]
    own = {KP: kp, KD: kd, KI: kp}
    changes = {"links.0.modes": 1} if name in ONE_MODE else {}
    if kind == "PI":
        changes["control.feedback"] = {"kind": "pid", "kp": [kp], "kd": [kd], "ki": [kp]}
    if kind == "PD, filtered":
        changes["control.filters"] = [FILTER]
    return fl.load_scene(name, changes), {path: (0.1 * own[path], 10 * own[path]) for path in LOOPS[kind]}


def worst_growth(scene, paths, gains, scenarios):
    """The largest growth rate over scenarios (S, V) at each of the gains (G, 2), in one sweep."""
    points = np.array([(*gain, *scenario) for gain in gains for scenario in scenarios[1]])
    found = fl.sweep(scene, dict(zip((*paths, *scenarios[0]), points.T, strict=True)), tol=1e-6, workers=1)
    return found["exponents"].real.max("mode").values.reshape(len(gains), -1).max(axis=1)


def best_of_grid(scene, paths, gains, names, box, random):
    """The least of the largest growth rates over all scenarios, among gains (G, 2); a gain's worst is no less than that on the box."""
    on_box = worst_growth(scene, paths, gains, (names, box))
    order, best = np.argsort(on_box), np.inf
    for part in np.split(order, range(TOGETHER, len(order), TOGETHER)):
        if on_box[part[0]] >= best:
            break
        everywhere = worst_growth(scene, paths, [gains[i] for i in part], (names, random))
        best = min(best, float(np.maximum(everywhere, on_box[part]).min()))
    return best


def compare(name, kind, points, drawn):
    """Largest growth rates over all scenarios of the tuned gains and of the best of a grid; and of the tuned ones on random scenarios."""
    scene, limits = load_loop(name, kind)
    vary, paths = SCENES[name], list(limits)
    start = time.process_time()
    tuned = fl.tune(scene, paths, vary, limits)
    seconds = time.process_time() - start
    box = list(itertools.product(*[np.linspace(*span, 5) for span in vary.values()]))
    gains = list(itertools.product(*[np.geomspace(*limits[path], points) for path in paths]))
    rng, names, here = np.random.default_rng(1), list(vary), list(tuned.gains.values())
    random = np.column_stack([rng.uniform(*span, drawn) for span in vary.values()])
    on_box, on_random = (float(worst_growth(scene, paths, [here], (names, some))[0]) for some in (box, random))
    return {
        "tuned": max(on_box, on_random),
        "grid": best_of_grid(scene, paths, gains, names, box, random),
        "random": on_random,
        "before": tuned.before,
        "seconds": seconds,
    }


def check_all(size="full"):
    """Run the study; returns what was found for each scene."""
    points, drawn = (61, 1000) if size == "full" else (7, 20)
    few = [("flexible-joint-link", "PI")]
    cases = list(itertools.product(SCENES, LOOPS)) if size == "full" else few
    results = {}
    for case in cases:
        results[case] = compare(*case, points, drawn)
        print(
            ", ".join(case) + ": " + ", ".join(f"{key} {value:.4g}" for key, value in results[case].items()), flush=True
        )
    return results


def draw(rows, path):
    """The slowest growth rate of each arm over all scenarios: before, with the best gains of the grid, and with the tuned ones."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 0.34 * len(rows) + 1.4), layout="constrained")
    axes, heights = figure.subplots(), np.arange(len(rows))
    for k, row in enumerate(rows):
        axes.plot([row["before"], row["tuned"]], [k, k], color="#c9d4dc", zorder=1)
    for key, label, mark, colour in (
        ("before", "scene's gains", "o", "#8a8f94"),
        ("grid", "best of the grid", "s", "#a8522f"),
        ("tuned", "tuned", "D", "#22628f"),
    ):
        axes.scatter([row[key] for row in rows], heights, marker=mark, color=colour, label=label, zorder=2)
    axes.set_xscale("symlog", linthresh=0.1)
    axes.axvline(0, color="#555555", linewidth=0.8)
    axes.set_yticks(heights, [row["arm"] for row in rows])
    axes.invert_yaxis()
    axes.set(xlabel="largest growth rate over all scenarios, 1/s", title="Does tuning find what a grid finds?")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)
    figure.savefig(path)


def main(size, out):
    """Run the study and draw what it found; returns a row for each arm."""
    rows = [{"arm": ", ".join(case), **found} for case, found in check_all(size).items()]
    draw(rows, out / "tuning_grid.svg")
    return rows


if __name__ == "__main__":
    run_study(main, "one scene and few points")
