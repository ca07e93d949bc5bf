"""Systems at the boundary of stability, wrong periods, and settings fixed by hand."""

from dataclasses import replace

import numpy as np
from scipy.special import mathieu_a, mathieu_b

from tests.periodic.cases import draw, kind, known, tol_of
from tests.periodic.chains import TWO_PI, Real
from tests.periodic.jumping_systems import panelled, steady
from tests.periodic.systems import oscillator
from tests.periodic.transformed_systems import transformed
from tests.periodic.truths import eigenvalues


@kind("Mathieu", 300)
def mathieu_somewhere(rng):
    """x'' + 2 z x' + (a - 2 q cos 2t) x = 0: anywhere, on a tongue's edge, or 10^-16 to 10^-2 beside it."""
    q, order = float(10 ** rng.uniform(-3, 0.7)), int(rng.integers(1, 6))
    edge = float(mathieu_a(order, q) if rng.random() < 0.5 else mathieu_b(order, q))
    a = float(rng.choice([rng.uniform(-0.5, 20), edge, edge + rng.choice([-1, 1]) * 10 ** rng.uniform(-16, -2)]))
    damping, period = float(rng.choice([0.0, 0.0, 0.01])), float(np.pi)

    def extended(t):
        return oscillator(Real(a) - 2 * Real(q) * np.cos(TWO_PI / Real(period) * t), 2 * damping)

    return panelled(extended, period, 4 + abs(a) ** 0.5 + q, tol_of(rng), undamped=damping == 0)


@kind("Krein", 200)
def krein(rng):
    """y'' + 2 s J y' - k y = 0 at, and beside, the collision s^2 = k; A is constant, its eigenvalues are those of the doubles."""
    k, period = 10 ** rng.uniform(-0.5, 1), float(10 ** rng.uniform(-0.3, 1))
    spin = k**0.5 * (1 + rng.choice([0.0, -1.0, 1.0]) * 10 ** rng.uniform(-16, -2))
    J = np.array([[0, 1.0], [-1, 0]])
    matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [k * np.eye(2), -2 * spin * J]])
    return known(steady(matrix), period, eigenvalues(matrix), tol_of(rng), undamped=True)


@kind("undamped oscillators", 300)
def undamped(rng):
    """x' = J S(t) x with S symmetric: exponents in pairs (lambda, -lambda)."""
    n, period = int(rng.integers(1, 4)), float(10 ** rng.uniform(-0.3, 0.7))
    S0, S1 = (M + M.T for M in np.round(rng.standard_normal((2, 2 * n, 2 * n)) * 0.5, 3))
    S0 = S0 + np.diag(np.round(rng.uniform(1, 5, 2 * n), 2))
    J = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])

    def extended(t):
        return (J @ S0).astype(Real) + Real(0.3) * (J @ S1) * np.cos(TWO_PI * t / Real(period))[:, None, None]

    return panelled(extended, period, np.abs(S0).sum() + 7 / period, tol_of(rng), undamped=True)


@kind("wrong period", 200)
def wrong_period(rng):
    """A smooth system whose period is given with three digits, or as a part of the true one: it must be refused."""
    case = transformed(rng, "rotation", largest=4)
    rounded = float(f"{case.period:.3g}") / case.period
    off = float(rng.choice([0.5, 0.9, rounded, 1 + 10 ** rng.uniform(-3, -0.3)]))
    off = 0.75 if abs(off - 1) < 1e-5 else off
    return replace(case, period=case.period * off, refuse=True)


FIXED = ["rotation", "mixed", "reparametrised", "multipliers 1e-300 to 1e300", "kinks not named", "jumps not named"]
FIXED += ["pulses", "Mathieu", "non-normal constant", "stiff"]
ORDERS = {"gauss": (2, 4, 8, 12, 20), "gauss of low order": (4, 6), "radau": (3, 5, 9)}


@kind("fixed settings", 1000)
def fixed_settings(rng):
    """Cases of the other kinds with method, order and segments fixed: the claim must hold, or the question be refused."""
    method = str(rng.choice(list(ORDERS)))
    options = {"method": method.split()[0], "segments": int(rng.choice([1, 2, 5, 20, 100]))}
    if rng.random() < 0.5:
        options["order"] = int(rng.choice(ORDERS[method]))
    options = {"segments": 1} if rng.random() < 0.2 else options
    return replace(draw(str(rng.choice(FIXED)), int(rng.integers(2**31))), options=options)
