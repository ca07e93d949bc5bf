"""Programs from outside solve the same equations, with machine code and without a compiler."""

import shutil
from importlib import import_module

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import accuracy as own
from flexlin.errors import ArgumentError
from flexlin.linearization import parametric_loop
from flexlin.periodic import Setting

COMPILER = bool(shutil.which("gcc") or shutil.which("cc"))


@pytest.mark.slow
@pytest.mark.parametrize("compiler", [True, False])
@pytest.mark.parametrize("stiff", [True, False], ids=["BDF", "Adams"])
def test_cvodes_integrates_the_same_equations(compiler, stiff, monkeypatch):
    compiled, cvodes = import_module("outside.compiled"), import_module("outside.cvodes")
    if not compiler:
        monkeypatch.setattr("shutil.which", lambda name: None)
    overrides = {"links.0.modes": 1, "designs": [], "effects.hub.inertia": 0.02, "control.feedback.kd.0": 0.1}
    loop = parametric_loop(fl.load_scene("single-link", overrides), ["effects.payload.mass"])
    exact = own.multiply_period(loop.linearization.periodic_system(), Setting("gauss", 20, 64, ""))
    assert compiled.compile_product(loop).is_a("External") == (compiler and COMPILER)
    assert np.abs(cvodes.prepare_cvodes(loop, 1e-9, stiff=stiff)() - exact).max() < 1e-5 * np.abs(exact).max()


def test_heyoka_is_named_where_it_is_missing():
    heyoka = import_module("outside.heyoka_taylor")
    with pytest.raises(ArgumentError, match="peers"):
        heyoka.import_heyoka("no_such_module_heyoka")
