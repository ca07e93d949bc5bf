"""The scaling study, small: sizes and their growth; no time is judged here."""

import casadi as ca
import numpy as np
import pytest


def test_scaling(study, tmp_path, monkeypatch):
    module = study("scaling")
    monkeypatch.setattr(module, "compiled", lambda function, folder: None)
    result = module.main("small", tmp_path)
    sizes = [(c.links, c.modes, c.coordinates) for c in result["costs"]]
    assert sizes == [(1, 0, 1), (2, 0, 2), (3, 0, 3), (1, 1, 2), (2, 1, 4), (3, 1, 6)]
    square = [module.Cost(0, 0, n, 7 * n**2, *[1] * 6) for n in (3, 5, 9)]
    assert module.exponent(square, "residual") == pytest.approx(2)
    assert np.isfinite(result["costs"][3].floquet)
    assert (tmp_path / "scaling.svg").stat().st_size > 1000


def test_compiled_code_gives_the_same_numbers(study, tmp_path):
    x = ca.SX.sym("x", 2)
    function = ca.Function("f", [x], [ca.sin(x) * x[0]])
    fast = study("scaling").compiled(function, tmp_path)
    if fast is not None:
        np.testing.assert_array_equal(np.array(fast([0.3, 0.7])), np.array(function([0.3, 0.7])))
