"""Energies of a deflected arm against material points followed by complex steps: no frames, no moments, no chain."""

import numpy as np
import pytest

from flexlin.mechanics.beam import clamped_free

from .scenes import LINK, arm_of, random_state

MODES, PAYLOAD, GRAVITY = 2, 0.15, 9.81
LENGTH, DENSITY, STIFFNESS = LINK["length"], LINK["mass_per_length"], LINK["bending_stiffness"]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(40)
XI, MASS = (NODES + 1) / 2, WEIGHTS / 2 * DENSITY * LENGTH
SHAPES = clamped_free(MODES)


def shortening(w, end):
    """u = -1/2 int_0^end X'^2 / l by quadrature, for each end in xi."""
    inner = np.multiply.outer(end, XI)
    slope = np.tensordot(w, SHAPES.values(inner.ravel(), 1).reshape(MODES, *inner.shape), 1)
    return -(slope**2 @ (WEIGHTS / 2)) * end / (2 * LENGTH)


def points(s, stiffening):
    """World positions of the points of both links and of the payload, (2, n); s may be complex."""
    origin, angle, found = np.zeros(2, dtype=complex), 0.0, []
    tip = np.ones(1)
    for link in range(2):
        angle = angle + s[link]
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        w = s[2 + MODES * link : 2 + MODES * (link + 1)]

        def along(xi, origin=origin, turn=turn, w=w):
            u = shortening(w, xi) if stiffening else 0.0
            return origin[:, None] + turn @ np.stack([LENGTH * xi + u, w @ SHAPES.values(xi)])

        found.append(along(XI))
        origin, angle = along(tip)[:, 0], angle + (w @ SHAPES.values(tip, 1))[0] / LENGTH
    return np.hstack([*found, origin[:, None]])


def energies(s, s_dot, stiffening):
    """T and V from the points; rates by a complex step, exact to rounding."""
    masses = np.concatenate([MASS, MASS, [PAYLOAD]])
    step = 1e-30
    moved = points(s + 1j * step * s_dot, stiffening)
    T = (np.imag(moved) / step) ** 2 @ masses / 2
    w = s[2:].reshape(2, MODES)
    bending = STIFFNESS / LENGTH**3 / 2 * np.sum(w**2 * SHAPES.beta**4)
    return T.sum(), GRAVITY * np.real(moved)[1] @ masses + bending


@pytest.mark.parametrize("stiffening", [True, False])
def test_energies_of_a_deflected_arm(stiffening):
    """Without stiffening equal to rounding. With it V is equal and T differs in the third order of w: u' w and u'^2 are left out."""
    effects = {"gravity": {}, "payload": {"mass": PAYLOAD}, **({"geometric_stiffening": {}} if stiffening else {})}
    arm = arm_of({}, {}, effects=effects)
    energy = arm.functions["energy"]
    s, s_dot, _ = random_state(arm, 3, elastic=1.0)
    bend = np.where(np.arange(arm.n) < 2, 0.0, 1.0)
    differences = []
    for size in (4e-3, 2e-3, 1e-3):
        at, rate = np.where(bend, size * s, s), np.where(bend, size * s_dot, s_dot)
        T, V = energies(at, rate, stiffening)
        differences.append(float(energy(at, rate, [])) - (T + V))
        potential = float(energy(at, np.zeros(arm.n), []))
        assert potential == pytest.approx(V, rel=1e-11)
    if stiffening:
        np.testing.assert_allclose(np.diff(np.log2(np.abs(differences))), -3, atol=0.2)
        assert abs(differences[-1]) < 1e-5 * T
    else:
        np.testing.assert_allclose(differences, 0, atol=1e-11 * (abs(T) + abs(V)))
