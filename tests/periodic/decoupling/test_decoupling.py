"""Decoupling: exponents of systems with very fast modes, that hide, take turns or stand close, against exact ones; refusals."""

from dataclasses import replace
from functools import reduce
from itertools import pairwise, permutations
from unittest.mock import Mock

import numpy as np
import pytest
from scipy.linalg import expm

import flexlin as fl
from flexlin.errors import TooManySegments
from flexlin.periodic import Decoupled, Group, as_real, decouple, decoupled_exponents, sylvester
from flexlin.periodic.floquet import exponents as routes
from flexlin.periodic.floquet.by_segments import SegmentedSpectrum
from studies import scaling
from tests.closed_arm import closed, control_loop
from tests.periodic.chains import Rotation, Wave
from tests.periodic.judge import covers
from tests.periodic.random_systems import draw
from tests.periodic.rotated import Rotated, gentle_system, mix, turn, wave
from tests.periodic.truths import apart


def fast_and_slow(fast, period=2.0):
    """A lightly damped fast pair and a slow one, mixed by three waving rotations and a shear."""
    rng = np.random.default_rng(3)
    modes = [(Wave(-0.01 * fast), wave(rng, fast, 0.1 * fast, 2)), (Wave(-0.5), Wave(1.1))]
    turns = [turn(i, j, k < 3, wave(rng, 0.3, 0.3, 2)) for k, (i, j) in enumerate([(0, 2), (1, 3), (0, 3), (2, 1)])]
    return Rotated(period, modes, turns)


@pytest.mark.parametrize(("kind", "least"), [("kept shapes", 15), ("waving shapes", 3), ("uneven gaps", 20)])
def test_no_exponent_is_further_off_than_its_error(kind, least):
    cases = [draw(kind, seed) for seed in range(24)]
    done = [(case, decouple(case.A, case.period, tol=1e-8)) for case in cases]
    done = [(case, decoupled_exponents(one)) for case, one in done if one is not None]
    assert all(covers(one, case.exponents, case.period, doubt=1e-15) for case, one in done)
    assert len(done) >= least


@pytest.mark.parametrize("fast", [1e3, 1e4, 1e5, 1e6])
def test_the_fastest_frequency_costs_neither_nodes_nor_digits(fast):
    system = fast_and_slow(fast)
    decoupled = decouple(system, system.period, tol=1e-8)
    answer = decoupled_exponents(decoupled)
    assert len(decoupled.times) == 128
    assert (answer.errors <= 1e-8 * np.maximum(1, 3 * fast)).all()
    slow = np.argsort(-answer.exponents.real)[:2]
    assert answer.errors[slow].max() < 1e-8
    assert covers(answer, system.exponents, system.period)


def test_all_exponents_of_a_stiff_chain_are_known(monkeypatch):
    """Two pairs of fast modes turn into each other while they decay by exp(800) apart. Truth: 40,000 exponentials of A(t), extrapolated."""
    monkeypatch.setitem(scaling.LINK, "bending_stiffness", 2000.0)
    found = fl.floquet(control_loop(scaling.scene_of(3, 2)).periodic_system(), 1e-8)
    assert (found.verdict, found.setting.method) == ("stable", "decoupling")
    assert (found.errors <= 1e-8 * np.maximum(1, np.abs(found.exponents))).all()
    truth = np.array([-4.978312806, -823.4559995])
    assert (np.abs(found.exponents[[0, -4]].real - truth) <= found.errors[[0, -4]] + 1e-9 * np.abs(truth)).all()


def test_the_worse_of_two_answers_is_not_given(monkeypatch):
    """Decoupling that misses tol in one mode stands beside segments that miss it in all, and beside segments that do not end."""
    system = fl.PeriodicSystem(fast_and_slow(1e4), 2.0)
    good = fl.floquet(system, 1e-8)
    half = replace(good, errors=np.append(good.errors[:-1], 1e3))
    monkeypatch.setattr(routes, "try_decoupling", lambda *_: half)
    monkeypatch.setattr(routes, "COLLOCATION_WORK", np.inf)
    blind = SegmentedSpectrum(good.log_multipliers, np.full(4, 1e3), np.zeros(4), good.setting, np.eye(4))
    endless = TooManySegments("too many")
    for outcome in ({"return_value": blind}, {"side_effect": endless}):
        monkeypatch.setattr(routes, "solve_by_segments", Mock(**outcome))
        assert routes.find_exponents(system, 1e-8, "auto", None, None, 10**6) is half


def test_a_mode_whose_vector_turns_over_within_the_period():
    """Half a turn in a period of 2: A(t) is the same again, the vectors point the other way."""
    half = Rotated(4.0, [(Wave(-1.0), None), (Wave(-900.0), None)], [Rotation(0, 1, Wave(0.0, 1))])
    answer = decoupled_exponents(decouple(half, 2.0, tol=1e-8))
    assert covers(answer, half.exponents + 1j * np.pi / 2, 2.0, factor=3)
    assert answer.errors.max() < 1e-7


def test_a_group_that_turns_over_claims_what_it_is_known_by():
    """Its generator had an imaginary part of 1e-4 that the rounds made and nobody counted: exponents 3e-11 off beside claims of 5e-12."""
    case = draw("multipliers 1e-300 to 1e300", 7707000584)
    assert covers(decoupled_exponents(decouple(case.A, case.period)), case.exponents, case.period)


@pytest.mark.parametrize("turns", [128, 129, 247, 654])
def test_harmonics_that_the_nodes_take_for_others_are_seen(turns):
    """129 turns have the harmonic 258, which 64, 128 and 256 nodes take for 2; of 654, 64 and 128 nodes see 28, but 32 see another.

    Real exponents came out as pairs, off by 0.5, with errors of 1e-12.
    """
    modes = [(Wave(-0.5), None), (Wave(-3.0), None), (Wave(-1.2), None)]
    answer = decouple(Rotated(1.0, modes, [Rotation(0, 1, Wave(0.0, turns))], [(0, 1, 2.0)]), 1.0)
    assert answer is None


@pytest.mark.parametrize(
    "A",
    [
        lambda t: np.array([[0, 1], [-1, -0.1]]) + 0 * t,
        lambda t: np.array([[0, 1.0], [0, 0]]) + 0 * t,
        lambda t: np.diag([-1.0, -500]) * (1 + 0.3 * (t > 1.0002)),
    ],
    ids=["slow", "defective", "jump"],
)
def test_what_does_not_part_is_not_decoupled(A):
    assert decouple(lambda t: A(t[:, None, None]), 2.0) is None


@pytest.mark.parametrize("corner", [0.0, 0.0078125, 0.00390625, 0.71, 1.3])
def test_a_corner_that_is_not_named_shows_in_the_error(corner):
    distance = lambda t: np.abs(np.mod(t - corner, 2.0) - 1)  # noqa: E731
    answer = decoupled_exponents(decouple(lambda t: np.diag([-1.0, -500]) * (1 + distance(t))[:, None, None], 2.0))
    assert (np.abs(answer.exponents - np.array([-1.5, -750])) <= answer.errors).all()
    assert answer.errors[1] > 1e-3


def group_of(values, size, period):
    """A decoupled system that is one real group, or a complex one beside its conjugates, and what is not known of it."""
    p, real = len(size), not np.iscomplexobj(values)
    whole = np.zeros((len(values), *(2 * (p,) if real else 2 * (2 * p,))), complex)
    unknown = np.zeros(whole.shape[1:])
    for k, part in enumerate([slice(0, p)] if real else [slice(0, p), slice(p, 2 * p)]):
        whole[:, part, part], unknown[part, part] = values.conj() if k else values, size
    groups = (Group(0, p, 0),) if real else (Group(0, p, 1), Group(p, 2 * p, 0))
    times = period * np.arange(len(values)) / len(values)
    return Decoupled(period, times, whole, whole, groups, unknown)


@pytest.mark.parametrize("seed", range(6))
def test_a_group_claims_what_the_worst_signs_of_the_unknown_do(seed):
    """Constant non-normal groups of nine: left and right vectors give each exponent's worst perturbation of the unknown's size."""
    rng, p, period = np.random.default_rng(seed), 9, 2.0
    left, _, right = np.linalg.svd(rng.standard_normal((p, p)) + (1j * rng.standard_normal((p, p)) if seed % 2 else 0))
    V = left @ np.diag(np.geomspace(1, 0.02, p)) @ right
    rates = -np.linspace(1, 40, p) + (1j * rng.uniform(-1, 1, p) if seed % 2 else 0)
    B = V @ np.diag(rates) @ np.linalg.inv(V)
    size = 1e-8 * rng.random((p, p))
    answer = decoupled_exponents(group_of(np.broadcast_to(B, (64, p, p)), size, period))
    assert answer.errors.max() < 1e-3
    right = np.linalg.eig(B).eigenvectors
    left = np.linalg.inv(right)
    for k in range(p):
        slope = np.outer(left[k], right[:, k])
        E = size * (slope.conj() / np.abs(slope) if seed % 2 else np.sign(slope.real))
        distance = apart(answer.exponents, np.linalg.eigvals(B + E), period)
        assert (distance.min(axis=0) <= answer.errors[distance.argmin(axis=0)]).all()


def test_resonances_move_exponents_by_no_more_than_is_bounded():
    """Two modes that a harmonic brings into resonance, against their multipliers: at first order where they beat slowly, else at second."""
    rng, t, steps = np.random.default_rng(7), 2 * np.pi * np.arange(64) / 64, 2 * np.pi * (np.arange(400) + 0.5) / 400
    softer = []
    for _ in range(20):
        gap, c = rng.integers(6, 20), 10 ** rng.uniform(-5, -2)
        mean = np.array([0, 1j * gap + rng.choice([0.0, 0.3]) * (rng.standard_normal(2) @ [1, 1j])])
        swing, size = 0.3 * rng.standard_normal((2, 2)) @ [1, 1j], c * rng.uniform(0.5, 1, 2)

        def B(t, mean=mean, gap=gap, swing=swing, size=size):
            values = np.zeros((len(t), 2, 2), complex)
            values[:, [0, 1], [0, 1]] = mean + swing * np.cos(t)[:, None]
            values[:, 0, 1], values[:, 1, 0] = size[0] * np.exp(-1j * gap * t), size[1] * np.exp(1j * gap * t)
            return values

        coupled = Decoupled(2 * np.pi, t, B(t), B(t), (Group(0, 1, 0), Group(1, 2, 1)), np.zeros((2, 2)))
        # turns with the second mode, so that one factor serves a long step
        phases = np.exp(1j * gap * np.outer(steps, [0, 1]))
        slow = phases.conj()[:, :, None] * B(steps) * phases[:, None, :] - 1j * gap * np.diag([0, 1])
        whole = reduce(np.matmul, expm(2 * np.pi / 400 * slow)[::-1])
        logs = np.log(np.linalg.eigvals(whole)) / (2 * np.pi)
        moved = apart(mean - [0, 1j * gap], logs, 2 * np.pi).min(axis=1)
        bound = np.diagonal(coupled.eliminated)
        assert np.all(moved <= 1.05 * bound + 1e-7 * c)
        softer.append(bound.max() / c)
    assert min(softer) < 0.02
    assert max(softer) > 0.3


APART = (1, 1, 2), (2, 3, 1), (2, 2, 4), (6, 5), (4, 6, 1)
MET = (3, 1, 1), (6, 1, 1), (21, 1, 1)


@pytest.mark.parametrize(
    ("sizes", "exchanged"), [*((sizes, False) for sizes in APART), *((sizes, True) for sizes in MET)]
)
def test_every_block_solves_its_equation(sizes, exchanged):
    """The equations that take the coupling between groups out, for groups of all sizes.

    exchanged: a group's first entry is a mode's of the next one: elimination in the given order would divide by zero.
    """
    rng, edges = np.random.default_rng(5), np.concatenate([[0], np.cumsum(sizes)])
    groups = tuple(Group(int(a), int(b), i) for i, (a, b) in enumerate(pairwise(edges)))
    n, first = edges[-1], edges[1]
    B = rng.standard_normal((9, n, n)) + 1j * rng.standard_normal((9, n, n))
    if exchanged:
        B[:, 0, 0] = B[:, first, first]
    else:
        B += np.diag(np.repeat(20j * np.arange(len(sizes)), sizes))
    S = sylvester(B, groups)
    for g in groups:
        assert not S[:, g.part, g.part].any()
    for g, h in permutations(groups, 2):
        across = B[:, g.part, g.part] @ S[:, g.part, h.part] - S[:, g.part, h.part] @ B[:, h.part, h.part]
        allowed = 1e-9 * np.abs(S).max() if exchanged else 1e-13 * np.abs(B).max()
        assert np.abs(across + B[:, g.part, h.part]).max() < allowed


T = 2.0


def test_what_rounding_hides_is_stated():
    """Two modes that take turns in damping by exp(25): nobody can make their exponents surer, and the slow ones stand."""
    swelling, falling = (Wave(-90.0, 0, (swing,), (0.0,)) for swing in (-31.5, 31.5))
    modes = [(Wave(-1.0), Wave(2.0)), (swelling, Wave(9e3, 0, (90.0,), (0.0,))), (falling, Wave(3e4))]
    system = Rotated(T, modes, mix(np.random.default_rng(0), 6, -2.5, -2.0))
    found = fl.floquet(fl.PeriodicSystem(system, T), 1e-9, max_segments=100)
    assert (found.setting.method, found.verdict) == ("decoupling", "stable")
    assert found.errors[:2].max() < 1e-9
    assert found.errors[2:].min() > 1e-6
    assert covers(found, system.exponents, T)


def test_leading_modes_that_are_hidden_are_enclosed():
    gentle = gentle_system(10)
    assert fl.floquet(fl.PeriodicSystem(gentle, gentle.period, complete=True), 1e-4).error < 10


def test_nothing_hides_between_eight_times():
    """What vanishes at all eighths of the period is seen."""

    def bump(t):
        return np.diag([-1.0, -500]) + 400 * np.sin(8 * np.pi * t)[:, None, None] ** 2 * np.eye(2)[::-1]

    one, other = fl.floquet(fl.PeriodicSystem(bump, 1.0)), fl.floquet(fl.PeriodicSystem(bump, 1.0), method="gauss")
    assert covers(one, other.exponents, 1.0, other.errors)


def loop_with_integral_action():
    """-4.3 +- 2.5j and -1.1 +- 13.5j stand close for a motion of 3.1 1/s, and part by exp(6.4) over its period."""
    rng, mean = np.random.default_rng(4), np.diag([-4.3, -4.3, -1.1, -1.1, -1.6, -1.6, -500.0])
    for i, frequency in zip((0, 2, 4), (2.5, 13.5, 95.0), strict=True):
        mean[i, i + 1], mean[i + 1, i] = frequency, -frequency
    V, C, S = np.linalg.qr(rng.standard_normal((7, 7)))[0], *rng.standard_normal((2, 7, 7))

    def A(t):
        c, s = (f(np.pi * t)[:, None, None] for f in (np.cos, np.sin))
        return V @ (mean + 0.05 * c * C + 0.05 * s * S) @ V.T

    return A


HARD_DRIVE = {
    "links.0.bending_stiffness": 12.388797456853958,
    "motion.frequency": 1.0400200303386022,
    "motion.joints": [{"mean": 0.7813837525671954, "amplitude": 1.9389085670418087}],
    "effects.payload.mass": 0.021919559665140278,
    "effects.modal_damping.ratio": 0.004038122123472825,
    "control.feedback": {"kind": "pd", "kp": [7.684278843470476], "kd": [1.5899715647696537]},
    "links.0.modes": 3,
}
"""Eigenvectors of the mean, in metres and metres per second, of a joint mode that decays within a millisecond: their inverse needs care."""


@pytest.mark.parametrize("changes", [None, HARD_DRIVE], ids=["integral", "hard drive"])
def test_segments_give_the_same_exponents(changes):
    system = closed(changes=changes).periodic_system() if changes else fl.PeriodicSystem(loop_with_integral_action(), T)
    exact, found = fl.floquet(system, 1e-10, method="gauss"), [fl.floquet(system, 1e-8)]
    decoupled = decouple(system.resolved, system.period, tol=1e-8)
    found += [] if decoupled is None else [decoupled_exponents(decoupled, 1e-8)]
    assert all(covers(one, exact.exponents, system.period, exact.errors) for one in found)


def cycling(rate, roots):
    """w' = (20 i r - 3 r + [0, r; r q, 0]) w in real form, q = prod (exp(i t) - root), and its exponents."""
    height = 20 * rate * max(1.0, np.prod([1 + abs(root) for root in roots]))

    def A(t):
        q = np.prod([np.exp(1j * np.asarray(t)) - root for root in roots], axis=0)
        B = np.zeros((len(q), 2, 2), complex)
        B[:, 0, 1], B[:, 1, 0] = rate, rate * q
        return as_real(B + (1j * height - 3 * rate) * np.eye(2))

    split = rate * np.sqrt(complex(np.prod([-root for root in roots])))
    own = 1j * height - 3 * rate + np.array([split, -split])
    return A, np.concatenate([own, own.conj()])


@pytest.mark.parametrize(
    "roots", [(0.2, 0.5j), (0.3, -0.3), (0.1, 0.15), (-0.5, 0.2j, 1.6), (3.0, -3.0), (2.0,), (0.3,)]
)
@pytest.mark.parametrize("rate", [6.0, 60.0, 600.0])
def test_means_of_followed_modes_are_not_claimed_where_others_may_be_followed(roots, rate):
    """Modes take turns in being damped less: which one a multiplier follows cannot be seen, and may not be claimed.

    w'' = q(t) w with q a polynomial in exp(i t): only one sign of harmonics, so the exponents are +-sqrt(q_0) exactly, whatever the
    eigenvalues +-sqrt(q(t)) do on the way (Berry, Uzdin, J. Phys. A 44 (2011), 435303). Where roots of q lie inside the unit circle,
    their means are others.
    """
    A, exponents = cycling(rate, roots)
    decoupled = decouple(A, 2 * np.pi, tol=1e-8)
    if decoupled is None:
        return
    answer = decoupled_exponents(decoupled)
    assert covers(answer, exponents, 2 * np.pi)
    assert (answer.exponents.real + answer.errors < 0).all()  # enclosed well enough for a verdict
