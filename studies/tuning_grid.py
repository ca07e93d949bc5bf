"""Does `fl.tune` find what an exhaustive grid over the gains finds? PD loops of three arms, over payloads and speeds.

The grid is laid over the same limits and the same scenarios' box; the tuned gains are also judged on random scenarios of that box.

    python studies/tuning_grid.py [--small]
"""

import argparse
import itertools
import time

import numpy as np

import flexlin as fl

PATHS = ("control.feedback.kp.0", "control.feedback.kd.0")
SCENES = {
    "single-link": {"effects.payload.mass": (0.0, 0.3), "motion.frequency": (0.3, 1.2)},
    "quanser-flexible-link": {"effects.hub.inertia": (1.5e-3, 4e-3), "motion.frequency": (0.3, 1.2)},
    "arm-on-carriage": {"motion.frequency": (0.5, 2.0)},
}


def worst_growth(scene, gains, scenarios):
    """The largest growth rate over scenarios (S, V) at each of the gains (G, 2), in one sweep."""
    points = np.array([(*gain, *scenario) for gain in gains for scenario in scenarios[1]])
    found = fl.sweep(scene, dict(zip((*PATHS, *scenarios[0]), points.T, strict=True)), tol=1e-6, workers=1)
    return found["exponents"].real.max("mode").values.reshape(len(gains), -1).max(axis=1)


def compare(name, vary, points, drawn):
    """Growth rates of the tuned gains and of the best of a grid, both on the same scenarios, and the largest on random ones."""
    scene = fl.load_scene(name, {"links.0.modes": 1} if name != "arm-on-carriage" else None)
    own = [fl.sensitivity(scene, [path], tol=1e-4)["value"].item() for path in PATHS]
    limits = {path: (0.1 * value, 10 * value) for path, value in zip(PATHS, own, strict=True)}
    start = time.process_time()
    tuned = fl.tune(scene, list(PATHS), vary, limits)
    seconds = time.process_time() - start
    box = list(itertools.product(*[np.linspace(*span, 5) for span in vary.values()]))
    gains = list(itertools.product(*[np.geomspace(*limits[path], points) for path in PATHS]))
    best, here = worst_growth(scene, gains, (list(vary), box)).min(), list(tuned.gains.values())
    rng = np.random.default_rng(1)
    random = np.column_stack([rng.uniform(*span, drawn) for span in vary.values()])
    return {
        "tuned": float(worst_growth(scene, [here], (list(vary), box))[0]),
        "grid": float(best),
        "random": float(worst_growth(scene, [here], (list(vary), random))[0]),
        "before": tuned.before,
        "seconds": seconds,
    }


def check_all(size="full"):
    """Run the study; returns what was found for each scene."""
    points, drawn = (61, 1000) if size == "full" else (15, 100)
    names = list(SCENES) if size == "full" else ["single-link"]
    results = {name: compare(name, SCENES[name], points, drawn) for name in names}
    for name, one in results.items():
        print(f"{name}: " + ", ".join(f"{key} {value:.4g}" for key, value in one.items()))
    return results


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--small", action="store_true", help="one scene and few points")
    options = parser.parse_args()
    check_all("small" if options.small else "full")
