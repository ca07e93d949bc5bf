"""Energies of a deflected arm against material points followed by complex steps: no frames, no moments, no chain, another quadrature."""

import numpy as np
import pytest

from flexlin.mechanics import bending_shapes

from .scenes import LINK, arm_of, random_state

MODES, PAYLOAD, GRAVITY = 2, 0.15, 9.81
LENGTH, DENSITY, STIFFNESS = LINK["length"], LINK["mass_per_length"], LINK["bending_stiffness"]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(40)
XI, MASS = (NODES + 1) / 2, WEIGHTS / 2 * DENSITY * LENGTH
SHAPES = bending_shapes(MODES)


def curve(w, end):
    """int_0^end (cos, sin)(sum_k X_k' w_k / l) l dxi by quadrature, for each end in xi: an inextensible curve, (2, ends)."""
    inner = np.multiply.outer(end, XI)
    slope = np.tensordot(w, SHAPES.values(inner.ravel(), 1).reshape(MODES, *inner.shape), 1) / LENGTH
    return LENGTH * end * (np.stack([np.cos(slope), np.sin(slope)]) @ (WEIGHTS / 2))


def points(s, stiffening):
    """World positions of the points of both links and of the payload, (2, n); s may be complex."""
    origin, angle, found = np.zeros(2, dtype=complex), 0.0, []
    tip = np.ones(1)
    for link in range(2):
        angle = angle + s[link]
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        w = s[2 + MODES * link : 2 + MODES * (link + 1)]

        def along(xi, origin=origin, turn=turn, w=w):
            straight = np.stack([LENGTH * xi, w @ SHAPES.values(xi)])
            return origin[:, None] + turn @ (curve(w, xi) if stiffening else straight)

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
    """Equal at deflections of a tenth of the length: without stiffening to rounding, with it to that of ten places."""
    effects = {"gravity": {}, "payload": {"mass": PAYLOAD}, **({"geometric_stiffening": {}} if stiffening else {})}
    arm = arm_of({}, {}, effects=effects)
    energy = arm.functions["energy"]
    s, s_dot, _ = random_state(arm, 3, elastic=1.0)
    bend = np.where(np.arange(arm.n) < 2, 0.0, 1.0)
    at, rate = np.where(bend, 0.1 * s, s), np.where(bend, 0.1 * s_dot, s_dot)
    T, V = energies(at, rate, stiffening)
    assert float(energy(at, rate, [])) == pytest.approx(T + V, rel=1e-6 if stiffening else 1e-11)
    assert float(energy(at, np.zeros(arm.n), [])) == pytest.approx(V, rel=1e-6 if stiffening else 1e-11)
