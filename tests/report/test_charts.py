"""What charts are made of: contours, scales that do not enlarge rounding, frequencies without ambiguity, plain names."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.answers.campbell import unfold_frequencies
from flexlin.answers.margins import choose_margins, find_margin
from flexlin.report.figures.chart import choose_scale, limits_of
from flexlin.report.figures.chart_map import trace_contour
from flexlin.report.margins import describe_margins, record_margin
from flexlin.scene.names import label_number


def test_a_contour_of_a_cone_is_a_circle():
    x, y = np.linspace(-1, 1, 41), np.linspace(-2, 2, 61)
    along, up = trace_contour(x, y, np.hypot(*np.meshgrid(x, y, indexing="ij")), 0.7)
    known = np.isfinite(along)
    assert np.allclose(np.hypot(along[known], up[known]), 0.7, atol=2e-3)
    length = np.hypot(np.diff(along), np.diff(up))
    assert np.nansum(length) == pytest.approx(2 * np.pi * 0.7, rel=1e-3)


def test_rounding_is_not_enlarged():
    noise = 1e-14 * np.random.default_rng(0).standard_normal((50, 2))
    low, high = limits_of(choose_scale(noise, np.full(50, 1e-12)))
    assert high - low > 1e-6


def test_frequencies_follow_the_mode_through_its_tongues():
    """Without gravity the link has one frequency, sqrt(k11 + (G - 1) W^2); weak gravity hardly moves it, but its exponent jumps."""
    scene = fl.load_scene("spinning-link", {"effects.gravity.acceleration": 0.5})
    rates = np.linspace(0.6, 5.0, 60)
    data = fl.sweep(scene, {"motion.joints.0.rate": rates})
    found = unfold_frequencies(scene, "motion.joints.0.rate", data)
    assert found is not None
    exact = np.sqrt(12.362363368 + 0.193336374 * rates**2)
    assert np.abs(found["frequency"].values - exact[:, None]).max() < 0.01
    assert np.allclose(found["motion"], rates)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("motion.frequency", "motion frequency in Hz"),
        ("effects.payload.mass", "payload mass in kg"),
        ("links.0.bending_stiffness", "bending stiffness of link 1 in N m²"),
        ("motion.joints.0.amplitude", "amplitude of joint 1 in rad"),
        ("control.feedback.kp.0", "stiffness of the feedback of joint 1 in N m/rad"),
        ("effects.modal_damping.ratio", "modal damping ratio"),
    ],
)
def test_numbers_have_plain_names_with_units(path, words):
    assert label_number(fl.load_scene("single-link"), path) == words


@pytest.mark.slow
def test_margins_say_where_the_verdict_changes_and_where_it_does_not():
    scene = fl.load_scene("khang-2019")
    chosen = {"motion.frequency": (0.5, 3.0), "parameters.payload_mass": (0.05, 0.2)}
    margins = tuple(find_margin(scene, path, limits, 9) for path, limits in chosen.items())
    assert describe_margins(scene, margins) == (
        "becomes unstable at a motion frequency of 2.476 Hz (now 0.5); keeps its verdict for a payload mass from 0.05 to 0.2 kg"
    )
    (critical,) = record_margin(margins[0])["critical"]
    assert critical["kind"] == "onset"
    assert critical["value"] == pytest.approx(2.4760282, abs=1e-6)
    assert choose_margins(scene) == {"motion.frequency": (0.125, 4.0), "parameters.payload_mass": (0.025, 0.8)}
