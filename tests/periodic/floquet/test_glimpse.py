"""Exponents for scans: promises are kept within what verdicts leave to them, and a near verdict rests on evidence."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.answers.spectra import SceneFamily
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.glimpse import FAR, glimpse
from flexlin.periodic.floquet.result import find_reached
from tests.periodic.judge import true_errors
from tests.periodic.random_systems import draw
from tests.thinned import thin

TOL = 1e-8


def is_promised(found):
    return found.setting.method == "gauss" and np.allclose(found.errors, TOL * np.maximum(1.0, np.abs(found.exponents)))


@pytest.mark.parametrize("kind", thin(["Mathieu", "rotation", "kinks named"]))
def test_no_verdict_hangs_on_a_promise_where_the_measured_error_meets_tol(kind):
    promised = 0
    for seed in range(500, 505):
        case = draw(kind, seed)
        known, found = floquet(case.system(), TOL), glimpse(case.system(), TOL)
        if not (find_reached(known.exponents, known.errors, TOL).all() and is_promised(found)):
            continue
        errors = np.abs(true_errors(case, found.exponents, found.errors)[0])
        promise = TOL * np.maximum(1.0, np.abs(case.exponents)).max()
        assert np.all(errors <= 0.1 * FAR * promise + case.doubt.max())
        assert found.verdict == known.verdict
        promised += 1
    assert promised


def test_a_verdict_that_is_near_rests_on_evidence():
    """Damped Mathieu equations on both sides of the boundary: 2e-3 of growth over a period."""
    for damping in (0.2, 0.1975, 0.195):
        system = fl.PeriodicSystem.from_second_order(
            [[1.0]], [[damping]], lambda t: (1.0 + 0.4 * np.cos(2.0 * t))[:, None, None], np.pi
        )
        known, found = floquet(system, TOL), glimpse(system, TOL)
        assert np.array_equal(found.exponents, known.exponents)
        assert np.array_equal(found.errors, known.errors)


@pytest.mark.slow
def test_a_scan_without_evidence_finds_the_same_critical_values(monkeypatch):
    scene, limits = fl.load_scene("spatial-four-bar"), ("motion.frequency", (8.0, 16.0))
    quick = fl.critical_values(scene, *limits, samples=5, narrow=False)
    monkeypatch.setattr(SceneFamily, "scan", SceneFamily.rough)
    assert quick == fl.critical_values(scene, *limits, samples=5, narrow=False) != []
