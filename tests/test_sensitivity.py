"""Derivatives of exponents, against Richardson's differences of scenes built anew and a closed form."""

import numpy as np
import pytest

import flexlin as fl
from flexlin import sensitivity
from flexlin.analyses import choose_paths
from flexlin.scene import get_value, replace_value

from .closed_arm import control_loop


@pytest.fixture(scope="module")
def scene():
    overrides = {"links.0.modes": 1, "designs": [], "effects.hub.inertia": 0.01, "control.feedback.kd.0": 0.1}
    return fl.load_scene("single-link", overrides)


PATHS = (
    *("effects.payload.mass", "links.0.bending_stiffness", "links.0.length", "motion.frequency"),
    *("motion.joints.0.amplitude", "control.feedback.kp.0", "control.feedback.kd.0"),
)


def exponents(scene):
    return fl.floquet(control_loop(scene).periodic_system(), 1e-12).exponents


def richardson(scene, path):
    """d exponents / d parameter by central differences of two steps, extrapolated to order 4."""
    value, centre = get_value(scene, path), exponents(scene)

    def slope(step):
        ends = (exponents(replace_value(scene, path, value + sign * step)) for sign in (1, -1))
        plus, minus = (end[np.abs(centre[:, None] - end).argmin(axis=1)] for end in ends)
        return (plus - minus) / (2 * step)

    return (4 * slope(1e-3 * value) - slope(2e-3 * value)) / 3


@pytest.mark.slow
@pytest.mark.parametrize("path", PATHS)
def test_against_differences_of_scenes_built_anew(scene, path):
    """Also what one percent more of the number does to the growth rates."""
    result = sensitivity(scene, [path])
    exact = richardson(scene, path)
    assert np.abs(result.derivative.values[0] - exact).max() <= 1e-6 * np.abs(exact).max()
    change = exact.real * get_value(scene, path) / 100
    assert np.abs(result.percent.values[0] - change).max() <= 1e-6 * np.abs(change).max() + 1e-9


def test_a_spinning_link_without_gravity_in_closed_form():
    """x'' + 2 zeta w x' + (w^2 - W^2) x = 0 has the exponents -zeta w +- i sqrt(w^2 - W^2 - zeta^2 w^2), w^2 proportional to EI."""
    motion = {"kind": "rotation", "drive": "prescribed", "joints": [{"rate": 3.0}]}
    bare = {"links.0.modes": 1, "designs": [], "control": {}, "effects": {"modal_damping": {"ratio": 0.02}}}
    scene = fl.load_scene("single-link", {**bare, "motion": motion})
    link = scene.links[0]
    square = 1.87510407**4 * link.bending_stiffness / link.mass_per_length / link.length**4
    paths = ["effects.modal_damping.ratio", "links.0.bending_stiffness"]
    by_ratio, by_stiffness = sensitivity(scene, paths).derivative.values
    assert np.allclose(by_ratio.real, -np.sqrt(square), rtol=1e-7)
    imaginary = np.sqrt(square - 3.0**2 - 0.02**2 * square)
    expected = square * (1 - 0.02**2) / link.bending_stiffness / (2 * imaginary)
    assert np.allclose(np.abs(by_stiffness.imag), expected, rtol=1e-6)


def test_every_number_of_the_scene_by_default(scene):
    result = sensitivity(scene)
    assert set(result.parameter.values) == set(choose_paths(scene))
    assert "effects.gravity.acceleration" in result.parameter.values
    assert np.isfinite(result.derivative.values).all()


def test_small_chunks_give_the_same_derivatives(scene, monkeypatch):
    paths = ["effects.payload.mass", "motion.frequency"]
    whole = sensitivity(scene, paths)
    monkeypatch.setattr("flexlin.analyses.sensitivity.CHUNK_BYTES", 20_000)
    assert np.allclose(sensitivity(scene, paths).derivative, whole.derivative, rtol=1e-12)
