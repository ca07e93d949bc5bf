"""Straight-line code: the same map as the numbers, at the point it was made for and at others, and as C."""

import ctypes
import shutil
import subprocess

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import flexlin as fl
from flexlin.mechanics import five_bar
from flexlin.series import c_code, solve_implicit
from flexlin.series.jets import binary, unary
from tests.memory import at_most

from .test_explicit import OPERATIONS, X

LOOP = five_bar(0.25, (0.3, 0.5), (0.35, 0.45))
S0 = LOOP.close([2.2, -1.7, 0.9, 1.4, 0.1, 0.5], (4, 5))


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
def test_c_code(tmp_path):
    c, du = LOOP.taylor(S0, (4, 5), 3), np.array([0.03, -0.02])
    (tmp_path / "taylor.c").write_text(c_code(c.moving))
    subprocess.run(["gcc", "-O1", "-fPIC", "-shared", "taylor.c", "-o", "taylor.so", "-lm"], cwd=tmp_path, check=True)
    compiled = ca.external("taylor", str(tmp_path / "taylor.so"))
    assert_allclose(compiled(c.u0, c.v0, du).full()[:, 0], c(du), rtol=1e-12)
    assert ctypes.CDLL(str(tmp_path / "taylor.so")).taylor_n_in() == 3


def test_six_variables_at_order_5_stay_small():
    rng = np.random.default_rng(2)
    u, v = ca.SX.sym("u", 6), ca.SX.sym("v", 6)
    A, B, v0 = 0.3 * rng.normal(size=(6, 6)), rng.normal(size=(6, 6)), rng.normal(size=6)
    f = v + A @ (ca.sin(B @ v) * ca.cos(v)) - u
    u0 = v0 + A @ (np.sin(B @ v0) * np.cos(v0))
    with at_most(200e6):
        c = fl.implicit_taylor(f, u, v, u0, v0, 5)
    du = 0.01 * np.array([1, -1, 0.5, 0.3, -0.8, 0.4])
    missed = np.linalg.norm(c(du) - c.refined(du))
    assert missed < 1e-6
    assert c.error(du) == pytest.approx(missed, rel=0.2)
    assert_allclose(c.moving(c.u0, c.v0, du).full()[:, 0], c(du), rtol=1e-12)
    assert_allclose(c.function()(du).full()[:, 0], c(du), rtol=1e-13)
    assert c.moving.n_instructions() < 5000  # of one variable, at order 5: 3,600


ORDER = 6
U, V = X[0], X[1]
HERE, THERE = 0.3, 0.38
"""Where a map is made, and where its moving form is asked."""


def equation(name):
    """v + 0.2 phi(u, v) - 0.7 u - 0.2: v(u) is curved through phi alone, and so is what phi is taken of."""
    return V + 0.2 * OPERATIONS[name] - 0.7 * U - 0.2


def map_of(name, u):
    f = equation(name)
    return fl.implicit_taylor(f, U, V, [u], solve_implicit(f, U, V, [u], [0.2]), ORDER)


def test_every_elementary_operation_is_among_them():
    """An operation added to the engine without a case here is found out."""
    used = set()
    for name in OPERATIONS:
        function = ca.Function("f", [X], [equation(name)])
        used |= {function.instruction_id(k) for k in range(function.n_instructions())}
    assert (set(unary) | set(binary)) - used <= {ca.OP_ASSIGN}  # CasADi writes no plain copies into SX functions


@pytest.mark.parametrize("name", OPERATIONS)
def test_moving_form_is_the_map_of_its_point(name):
    """The same polynomial, at the point where it was made and at another: a coefficient gone stale shows from order 3 on."""
    c, there = map_of(name, HERE), map_of(name, THERE)
    for known in (c, there):
        for du in (0.1, -0.3, 1.0):
            assert_allclose(c.moving(known.u0, known.v0, du).full()[:, 0], known([du]), rtol=1e-11)
