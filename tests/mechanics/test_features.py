"""Narrow features, of friction and of loops near their dead points: times and widths by closed form, and no verdict steps over one."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import flexlin as fl
from flexlin.linearization import parametric_loop
from flexlin.mechanics import CoulombFriction
from flexlin.motion import build_motion, read_table_motion
from flexlin.scene import TableMotion
from tests.closed_arm import control_loop, opened
from tests.thinned import thin

from .scenes import linear, plain_scene, swinging

J, TORQUE, DAMPING, AMPLITUDE = 0.4 * 0.5**3 / 3, 0.02, 0.001, 0.5


def scene(frequency: float, phase: float, rate: float):
    """A rigid link of 0.5 m and 0.4 kg/m under a PD loop, with friction in its joint."""
    joints, feedback = [{"amplitude": AMPLITUDE, "phase": phase}], {"kind": "pd", "kp": [0.2], "kd": [DAMPING]}
    changes = {
        "links": [{"length": 0.5, "mass_per_length": 0.4, "modes": 0}],
        "effects": {"coulomb_friction": {"torque": TORQUE, "rate": rate}},
        "motion": {"kind": "harmonic", "frequency": frequency, "joints": joints},
        "control": {"feedback": feedback},
    }
    return fl.load_scene("single-link", {**changes, "designs": []})


FRICTION = CoulombFriction(torque=0.02, rate=1e-4)


def found(motion, friction=FRICTION):
    """Times and half-widths."""
    return np.array(friction.features(motion)).reshape(-1, 2).T


def fourier(**joint):
    return build_motion({"kind": "fourier", "period": 2.0, "joints": [joint]})


def test_every_joint_has_its_own_turns_rates_and_torques():
    joints = [{"amplitude": 0.5}, {"amplitude": 0.2, "phase": 1.0}, {"amplitude": 0.3, "phase": 2.0}]
    friction = CoulombFriction(torque=(0.1, 0.0, 0.2), rate=(1e-3, 1e-3, 1e-4))
    times, widths = found(build_motion(swinging(*joints)), friction)
    order = np.argsort(times)
    w = 2 * np.pi
    at = np.mod(np.array([np.pi / 2, 3 * np.pi / 2, np.pi / 2 - 2, 3 * np.pi / 2 - 2]), w) / w
    wide = np.array([1e-3 / (0.5 * w**2)] * 2 + [1e-4 / (0.3 * w**2)] * 2)
    assert times[order] == pytest.approx(np.sort(at), abs=1e-12)
    assert widths[order] == pytest.approx(wide[np.argsort(at)], rel=1e-4)


def test_a_turn_at_the_start_of_the_period_is_found_once():
    """q = cos: q' is exactly zero at t = 0."""
    times, widths = found(fourier(cos=(0.4,)))
    assert times == pytest.approx([0.0, 1.0], abs=1e-12)
    assert widths == pytest.approx(1e-4 / (0.4 * np.pi**2), rel=1e-6)


def test_a_rate_that_only_touches_zero_is_found():
    """q' = (1 - cos p)(cos p + 1/2) a w: touches zero at p = 0 as 3/4 a w p^2, turns round at p = 2 pi/3 and 4 pi/3."""
    times, widths = found(fourier(sin=(0.25, -0.125)))
    w, amplitude = np.pi, 0.5
    assert np.where(times > 2 - 1e-6, times - 2, times) == pytest.approx([0.0, 2 / 3, 4 / 3], abs=1e-6)
    assert widths[0] == pytest.approx(np.sqrt(1e-4 / (0.75 * amplitude * w)) / w, rel=1e-2)
    assert widths[1:] == pytest.approx(1e-4 / (amplitude * w**2 * 1.5 * np.sin(2 * np.pi / 3)), rel=1e-4)


def test_two_turns_closer_than_the_grid_are_found():
    """q' = (1 + d - cos p)(cos p + 1/2 + ...) with d < 0 dips below zero for p within sqrt(-2 d): here for 4e-5 of the period."""
    d, w = -4e-9, np.pi
    a = -0.5 / (1 + d)  # for which (1 + d - c)(c - a) has mean -a (1 + d) - 1/2 = 0
    sines = (1 + d + a) / w, -0.5 / (2 * w)
    times, _ = found(fourier(sin=sines), CoulombFriction(torque=1.0, rate=1e-12))
    inner = np.arccos(1 + d) / w
    assert np.abs(times[:, None] - [inner, 2 - inner]).min(axis=0).max() < 1e-8


@pytest.mark.parametrize("seed", range(6))
def test_turns_of_any_fourier_motion_are_the_roots_of_its_polynomial(seed):
    """q' = Re sum c_k z^k on |z| = 1: its zeros are roots of a polynomial, found by a companion matrix."""
    rng, k = np.random.default_rng(seed), np.arange(1, 13)
    cos, sin = rng.normal(size=(2, 12)) / k**2
    times, widths = found(fourier(cos=tuple(cos), sin=tuple(sin)), CoulombFriction(torque=1.0, rate=1e-9))
    half = 0.5 * np.pi * k * (sin + 1j * cos)  # of exp(i k p)
    roots = np.roots(np.concatenate([half[::-1], [0.0], half.conj()]))
    on = np.angle(roots[np.abs(np.abs(roots) - 1) < 1e-7]) / np.pi
    assert times == pytest.approx(np.sort(np.mod(on, 2.0)), abs=1e-8)
    angle = np.pi * np.outer(times, k)
    bend = np.abs((np.cos(angle) * cos + np.sin(angle) * sin) @ (np.pi * k) ** 2)  # |q''|
    assert widths == pytest.approx(1e-9 / bend, rel=1e-3)


def test_ends_of_a_rest_are_features_and_the_rest_is_none():
    """Quintic: q' = 30 D x^2/tau + ... at the ends of a move, so |q'| = rate a time tau sqrt(rate tau/(30 D)) from them."""
    table = {"kind": "point-to-point", "move_time": 0.4, "dwell_time": 0.6, "joints": [{"waypoints": [0.0, 1.0]}]}
    times, widths = found(build_motion(table), CoulombFriction(torque=1.0, rate=1e-6))
    assert times == pytest.approx([0.0, 0.4, 1.0, 1.4], abs=1e-7)
    assert widths == pytest.approx(0.4 * np.sqrt(1e-6 * 0.4 / 30), rel=0.02)


def test_motions_that_never_turn_or_never_move_have_none():
    spinning = {"kind": "rotation", "joints": [{"rate": 2.0}]}
    for table in (spinning, swinging({"amplitude": 0.0})):
        assert FRICTION.features(build_motion(table)) == ()
    assert CoulombFriction(torque=0.1, rate=10.0).features(fourier(cos=(0.4,))) == ()  # never leaves sticking


def test_the_linearization_says_it_and_the_present_values_count():
    own = scene(1.0, 0.0, 1e-3)
    lin = control_loop(own)
    width = 0.001 / (0.5 * (2 * np.pi) ** 2)
    assert np.array(lin.features) == pytest.approx(np.array([(0.25, width), (0.75, width)]), rel=1e-5)
    assert lin.complete
    assert pickle.loads(pickle.dumps(lin)).features == lin.features
    loop = parametric_loop(own, ["effects.coulomb_friction.rate", "motion.frequency"])
    times, widths = np.array(loop.at(np.array([0.01, 2.0])).features).T
    assert widths == pytest.approx(0.01 / (0.5 * (4 * np.pi) ** 2), rel=1e-3)
    assert times == pytest.approx([0.125, 0.375])


def test_a_motion_is_kept_only_while_none_of_its_own_numbers_changes():
    """Else features of one amplitude would be taken for another's; and a scan of torques would find them anew at each."""
    paths = "effects.coulomb_friction.torque", "motion.joints.0.amplitude"
    loop = parametric_loop(scene(1.0, 0.0, 1e-3), paths)
    own, rough, wide = (loop.at(loop.nominal * np.array(factors)) for factors in ((1, 1), (2, 1), (1, 2)))
    assert rough.motion is own.motion
    assert rough.features == own.features
    assert np.array(wide.features)[:, 1] == pytest.approx(np.array(own.features)[:, 1] / 2, rel=1e-3)


@pytest.mark.parametrize("name", ["single-link", "three-link", "rotating-beam", "pick-and-place"])
def test_without_friction_nothing_is_named(name):
    lin = opened(name)[1]
    assert (lin.features, lin.complete) == ((), True)


def test_equations_of_unknown_make_promise_nothing():
    lin = opened("khang-2019")[1]
    assert not lin.complete
    own = replace(lin, about=replace(lin.about, arm=replace(lin.arm, effects=None)))
    assert (own.features, own.complete) == ((), False)


MANY = [{"cos": (0.01,) * 3 + (0.0,) * (harmonics - 4) + (1e-9,)} for harmonics in (20, 60, 61, 200)]


@pytest.mark.parametrize(
    ("joint", "complete"),
    [*zip(MANY, (True, True, False, False), strict=True)]
    + [({"sin": (amplitude,)}, amplitude < 20) for amplitude in (0.5, 14.0, 40.0)],
)
def test_a_motion_of_many_harmonics_and_angles_that_turn_fast_promise_nothing(joint, complete):
    """sin(40 sin p) has harmonics up to about 40 times one: narrower than T/200, though the angle is a single sine."""
    assert fourier(**joint).complete is complete


def test_close_rows_of_a_table_are_features(tmp_path):
    """A few rows close together are named; a table that is fine all over has many harmonics instead."""
    t = np.sort(np.concatenate([np.linspace(0, 1, 41), [0.51, 0.5101, 0.5102]]))
    fine, plain = np.linspace(0, 1, 1001), np.linspace(0, 1, 51)
    for name, rows, complete in (("few", t, True), ("fine", fine, False), ("plain", plain, True)):
        path = tmp_path / f"{name}.csv"
        np.savetxt(path, np.column_stack([rows, 0.3 * np.sin(2 * np.pi * rows)]), delimiter=",")
        motion = read_table_motion(TableMotion(kind="table", file=str(path)), 1, (False,))
        assert motion.complete is complete
        known = [(0.51, 1e-4), (0.5101, 1e-4)] if name == "few" else ()
        assert np.array(motion.features) == pytest.approx(np.array(known), rel=1e-6)


def limit(frequency: float) -> float:
    """Growth rate as the rate goes to zero: half the mean damping over J, friction adding 4 c/(|q''| T) in two turn-arounds."""
    return -(DAMPING + 4 * TORQUE * frequency / (AMPLITUDE * (2 * np.pi * frequency) ** 2)) / (2 * J)


def growth(frequency: float, phase: float, rate: float) -> float:
    lin = control_loop(scene(frequency, phase, rate))
    return float(fl.floquet(lin.periodic_system()).exponents[0].real)


def test_the_known_answer_of_a_slow_motion():
    assert growth(1.0, 0.0, 1e-3) == pytest.approx(-0.15158543, abs=2e-8)


@pytest.mark.parametrize("rate", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize(("frequency", "phase"), [(1.0, 0.3), (20.0, 0.3), (20.0, 0.0)])
def test_pulses_of_any_width_are_met(frequency, phase, rate):
    """An integrator that steps over them finds -0.03 instead."""
    assert growth(frequency, phase, rate) == pytest.approx(limit(frequency), rel=2e-3)


def test_a_sweep_meets_them_too():
    rates = np.array([1e-2, 1e-4])
    data = fl.sweep(scene(20.0, 0.3, 0.01), {"effects.coulomb_friction.rate": rates}, 1e-6)
    assert data["exponents"].values.real.max(axis=1) == pytest.approx(limit(20.0), rel=2e-3)


def stretched(gap):
    """A five-bar whose distal links come within `gap` of being stretched, at half the period; the rigid motion turns both bases alike.

    The distance of the elbows is base + 0.4 cos x, x = 0.9 sin(2 pi t / T); the dead point at 0.6 lies at x = i sqrt(5 gap).
    """
    base = {"parent": "base", "mount": {"xyz": [0.2 - gap, 0.0, 0.0]}}
    more = [{}, {"passive": True, "name": "left"}, base, {"passive": True, "name": "right"}]
    posture = [np.pi - 0.15, -2.87, 0.15, 2.87]
    bars = [{"length": 0.2 + 0.1 * (k % 2), "mass_per_length": 0.1, "posture": posture[k], **more[k]} for k in range(4)]
    motion = swinging({"mean": np.pi, "amplitude": 0.9, "phase": np.pi}, {"mean": 0.0, "amplitude": 0.9})
    return linear(plain_scene(bars, motion, loops=[{"link": "left", "to": "right"}]))


@pytest.mark.parametrize("gap", thin([0.02, 1e-4, 3e-4]))
def test_what_is_complete_is_right_between_its_samples(gap):
    lin = stretched(gap)
    width = np.arcsinh(np.sqrt(5 * gap) / 0.9) / (2 * np.pi)  # of the dead point from real times, in periods
    assert lin.complete == (width > 1 / 100)
    resolved = lin.periodic_system().resolved
    t = lin.period * np.concatenate([np.random.default_rng(1).random(2000), 0.5 + 1e-3 * np.linspace(-1, 1, 201)])
    exact = np.concatenate(lin.equations(t), axis=2)
    assert np.all(np.abs(resolved.series(t) - exact) <= 2 * resolved.error + 1e-15 * np.abs(exact).max(axis=0))


@pytest.mark.parametrize("path", ["motion.frequency", "motion.joints.0.mean"])
def test_loops_at_other_numbers_are_looked_at_for_dead_points_too(path):
    loop = parametric_loop(fl.load_scene("spatial-four-bar"), [path])
    assert loop.at(1.01 * loop.nominal).complete
