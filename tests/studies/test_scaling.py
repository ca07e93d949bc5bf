"""The scaling study, small: sizes and their growth; no time is judged here."""

import shutil

import casadi as ca
import numpy as np
import pytest

from flexlin import symbolic


@pytest.mark.slow
def test_scaling(study, pictures, tmp_path, monkeypatch):
    module = study("scaling")
    monkeypatch.setattr(module, "compiled", lambda function, folder: None)
    result = module.main("small", tmp_path)
    sizes = [(c.links, c.modes, c.coordinates) for c in result["costs"]]
    assert sizes == [(1, 0, 1), (2, 0, 2), (3, 0, 3), (1, 1, 2), (2, 1, 4), (3, 1, 6)]
    square = [module.Cost(0, 0, n, 7 * n**2, *[1] * 6) for n in (3, 5, 9)]
    assert module.exponent(square, "residual") == pytest.approx(2)
    assert np.isfinite(result["costs"][3].floquet)
    drawn = pictures.curves("scaling.svg", 0)
    assert drawn["1 modes"].T.tolist() == [[c.coordinates, c.residual] for c in result["costs"] if c.modes == 1]


@pytest.mark.skipif(not (shutil.which("gcc") or shutil.which("cc")), reason="no C compiler")
def test_compiled_code_gives_the_same_numbers(study, tmp_path):
    """Compiled twice under one name: the second call must not get the first library. Often enough called for a tape of its own."""
    x, points = ca.SX.sym("x", 2), np.linspace(0.1, 0.9, 8000).reshape(-1, 2)
    for expression in (ca.sin(x) * x[0], ca.cos(x) + x[1]):
        function = ca.Function("f", [x], [expression])
        fast = study("scaling").compiled(function, tmp_path)
        np.testing.assert_allclose(
            symbolic.evaluate(fast, points)[0], symbolic.evaluate(function, points)[0], rtol=1e-15
        )


def test_without_a_compiler_nothing_is_compiled(study, tmp_path, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda name: None)
    x = ca.SX.sym("x")
    assert study("scaling").compiled(ca.Function("f", [x], [x]), tmp_path) is None
    assert not list(tmp_path.iterdir())
