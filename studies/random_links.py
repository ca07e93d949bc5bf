"""How much faster than one transition matrix by DOP853 is the whole of `fl.floquet`, on links that nobody chose?

Single links with a PD loop whose length, mass, stiffness, damping, payload, gains, amplitude and frequency are drawn at random, with 1, 3
and 6 modes: all exponents with their errors to 1e-10, the resolution of the coefficients included, beside SciPy's DOP853 with a compiled
right-hand side at the largest of its tolerances that reaches 1e-10. The least CPU time of several runs that take turns, on one thread.
Exponents are held against those that segments find at 1e-12.

    OMP_NUM_THREADS=1 python studies/random_links.py [--size small|full] [--seed 0] [--out DIR]
"""

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from time import process_time

import numpy as np
from outside.compiled import compile_product

import flexlin as fl
from flexlin.about.free import ParametricLoop, parametric_loop
from flexlin.answers.accuracy.scipy_methods import prepare_rate, prepare_scipy
from flexlin.checks import Array
from flexlin.periodic.circle import match_logs
from flexlin.periodic.product.balancing import multiply_scaled
from flexlin.periodic.transition.setting import Setting, factor_period

ACCURACY = 1e-10
ASKED = {1: 15.0, 3: 20.0, 6: 40.0}
"""How many times faster it should be, by the number of modes."""
TOLS = (1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)
LONG = 0.3
"""Seconds from which a run of DOP853 is repeated once only."""
ENDS = {
    "links.0.length": (0.4, 1.6),
    "links.0.mass_per_length": (0.08, 0.8),
    "links.0.bending_stiffness": (1.0, 60.0),
    "effects.payload.mass": (0.005, 0.3),
    "effects.modal_damping.ratio": (0.002, 0.05),
    "motion.frequency": (0.15, 5.0),
    "motion.joints.0.amplitude": (0.1, 1.2),
    "control.feedback.kp.0": (1.0, 30.0),
    "control.feedback.kd.0": (0.1, 3.0),
}
"""What is drawn, evenly in its logarithm, between these ends."""


@dataclass(frozen=True)
class Row:
    """One link: milliseconds here and by DOP853 at its tolerance, how, and the largest of true error / claim."""

    modes: int
    number: int
    here: float
    dop853: float
    tol: float
    setting: str
    miss: float

    @property
    def ratio(self) -> float:
        return self.dop853 / self.here


def draw_link(modes: int, seed: tuple[int, ...]) -> ParametricLoop:
    """A random link and its loop."""
    rng = np.random.default_rng(seed)
    drawn = {path: float(np.exp(rng.uniform(*np.log(ends)))) for path, ends in ENDS.items()}
    scene = fl.load_scene("single-link", {"links.0.modes": modes, "designs": [], **drawn})
    return parametric_loop(scene, ["effects.payload.mass"])


def new_system(lin: fl.Linearization) -> fl.PeriodicSystem:
    """The system of a linearization, not resolved yet."""
    known = lin.periodic_system()
    return fl.PeriodicSystem(
        known.A, known.period, known.B, known.breaks, known.second_order, known.features, known.complete
    )


def timed(run: Callable[[], object]) -> float:
    start = process_time()
    run()
    return process_time() - start


def prepare_peer(loop: ParametricLoop) -> tuple[Callable[[], Array], float]:
    """DOP853 at the largest tolerance that reaches ACCURACY of the largest entry, or at the smallest."""
    P, log_scale = multiply_scaled(
        factor_period(loop.linearization.periodic_system(), Setting("gauss", 20, 1200, ""))[1]
    )
    exact, rate = P * np.exp(log_scale), prepare_rate(compile_product(loop), loop.nominal)
    for tol in TOLS:
        run = prepare_scipy(loop, "DOP853", tol, rate=rate)
        if np.abs(run() - exact).max() <= ACCURACY * np.abs(exact).max():
            break
    return run, tol


def compare(modes: int, number: int, seed: int, rounds: int) -> Row:
    """Both on one link, in turns."""
    loop = draw_link(modes, (seed, modes, number))
    lin = loop.linearization
    peer, tol = prepare_peer(loop)
    found = fl.floquet(new_system(lin), ACCURACY)
    exact = fl.floquet(new_system(lin), 0.01 * ACCURACY, method="gauss")
    partner, apart = match_logs(found.log_multipliers, exact.log_multipliers)
    miss = float((apart / lin.period / (found.errors + exact.errors[partner])).max())
    here, theirs = [], [timed(peer)]
    for _ in range(2 if theirs[0] > LONG else rounds):
        systems = [new_system(lin) for _ in range(4)]
        here += [timed(partial(fl.floquet, system, ACCURACY)) for system in systems]
        theirs.append(timed(peer))
    return Row(modes, number, 1e3 * min(here), 1e3 * min(theirs), tol, found.setting.method, miss)


def compare_all(size: str = "full", seed: int = 0, out: str | Path = "out/studies") -> list[Row]:
    """Run the study, print a line for each link and how many hold, write random_links.json."""
    count, rounds, rows = (20, 6, []) if size == "full" else (1, 1, [])
    for modes in ASKED if size == "full" else (1,):
        mine = []
        for number in range(count):
            mine.append(row := compare(modes, number, seed, rounds))
            peer = f"DOP853 {row.dop853:8.1f} ms at {row.tol:.0e}: {row.ratio:7.1f} times"
            note = "" if row.ratio >= ASKED[modes] else "  less than asked"
            print(
                f"{modes} modes  link {number:3d} {row.here:8.2f} ms by {row.setting}, {peer}, true error / claim {row.miss:.2f}{note}"
            )
        ratios = np.sort([row.ratio for row in mine])
        held = int((ratios >= ASKED[modes]).sum())
        print(
            f"{modes} modes: {held} of {count} at least {ASKED[modes]:.0f} times; least {ratios[0]:.1f}, median {np.median(ratios):.0f}"
        )
        rows += mine
    Path(out).mkdir(parents=True, exist_ok=True)
    (Path(out) / "random_links.json").write_text(json.dumps([asdict(row) for row in rows], indent=1))
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", choices=("small", "full"), default="full")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="out/studies", help="folder for the record")
    options = parser.parse_args()
    compare_all(options.size, options.seed, options.out)
