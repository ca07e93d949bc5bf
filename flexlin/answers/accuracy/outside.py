"""The same transition matrices by the programs that people use today."""

from collections.abc import Iterator
from functools import partial
from importlib.util import find_spec

from flexlin.about.free import parametric_loop
from flexlin.answers.accuracy.result import Row
from flexlin.answers.accuracy.trial import Trial, compare_arrays, measure_trials
from flexlin.answers.peers import HeyokaTransitions, prepare_cvodes, prepare_rate, prepare_scipy
from flexlin.checks import Array
from flexlin.scene.scene import Scene

TOLS = (1e-5, 1e-7, 1e-9, 1e-11, 1e-13)
RADAU_TOLS, HEYOKA_TOLS = (1e-4, 1e-6, 1e-8), (1e-6, 1e-12)
HEYOKA_EQUATIONS = 200
"""heyoka compiles so many equations in some seconds."""


def measure_outside_methods(scene: Scene, exact: Array) -> tuple[list[Row], list[str]]:
    """SciPy's DOP853, LSODA and Radau, CasADi's cvodes and heyoka at several tolerances; notes on what is missing.

    Their right-hand sides are machine code where there is a C compiler; set-up and compilation are left out.
    """
    loop = parametric_loop(scene, ())
    if loop.linearization.controller is not None:
        return [], [
            "programs from outside have no rows: the loop has integrals or filters, and is no system of second order"
        ]
    rate, p = prepare_rate(loop, loop.nominal), loop.nominal
    notes = [] if find_spec("heyoka") else ["heyoka is not installed (pip install 'flexlin[peers]'), so it has no row"]
    if len(exact) ** 2 > HEYOKA_EQUATIONS:
        notes = [f"heyoka has no row: it would compile {len(exact) ** 2} equations, which takes long"]

    def trials() -> Iterator[Trial]:
        for method in ("DOP853", "LSODA"):
            for tol in TOLS:
                yield Trial(
                    f"SciPy {method}", f"tol {tol:.0e}", prepare_scipy(loop, method, tol, rate=rate), outside=True
                )
        for tol in TOLS:
            yield Trial("CasADi cvodes", f"tol {tol:.0e}", prepare_cvodes(loop, tol), outside=True)
        for tol in HEYOKA_TOLS if not notes else ():
            flow = HeyokaTransitions(loop, tol, compact=True)
            yield Trial("heyoka", f"tol {tol:.0e}", partial(flow, p), outside=True)
        for tol in RADAU_TOLS:
            yield Trial("SciPy Radau", f"tol {tol:.0e}", prepare_scipy(loop, "Radau", tol, rate=rate), outside=True)

    return measure_trials("transition matrices", trials(), lambda P: compare_arrays(P, exact)), notes
