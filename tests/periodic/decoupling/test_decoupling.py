"""Decoupling: exponents of systems with very fast modes, against exact ones, and refusals where nothing stands apart."""

from dataclasses import replace
from functools import reduce
from itertools import pairwise, permutations
from unittest.mock import Mock

import numpy as np
import pytest
from scipy.linalg import expm

import flexlin as fl
from flexlin.errors import TooManySegments
from flexlin.periodic import Coupled, Group, decouple, decoupled_exponents, sylvester
from flexlin.periodic.decoupling.coupling import Decoupled, residual_effect
from flexlin.periodic.floquet import exponents as routes
from flexlin.periodic.floquet.by_decoupling import hide_enclosed
from flexlin.periodic.floquet.by_segments import SegmentedSpectrum
from studies import scaling
from tests.closed_arm import closed, control_loop
from tests.periodic.chains import Rotation, Wave
from tests.periodic.judge import covers
from tests.periodic.random_systems import draw
from tests.periodic.rotated import KINDS, Rotated, random_system, turn, wave
from tests.periodic.truths import apart


def chain(links, modes):
    """The closed loop of a chain of equal links."""
    return control_loop(scaling.scene_of(links, modes)).periodic_system()


def fast_and_slow(fast, period=2.0):
    """A lightly damped fast pair and a slow one, mixed by three waving rotations and a shear."""
    rng = np.random.default_rng(3)
    modes = [(Wave(-0.01 * fast), wave(rng, fast, 0.1 * fast, 2)), (Wave(-0.5), Wave(1.1))]
    turns = [turn(i, j, k < 3, wave(rng, 0.3, 0.3, 2)) for k, (i, j) in enumerate([(0, 2), (1, 3), (0, 3), (2, 1)])]
    return Rotated(period, modes, turns)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_no_exponent_is_further_off_than_three_times_its_error(kind):
    done = 0
    for seed in (3, 4):
        system = random_system(seed, kind)
        decoupled = decouple(system, system.period, tol=1e-8)
        if decoupled is None:
            continue
        done += 1
        assert covers(decoupled_exponents(decoupled), system.exponents, system.period, factor=3), seed
    assert done >= 1


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


@pytest.mark.parametrize(("links", "growth"), [(2, -1.877841128), (3, -0.4336677909)])
def test_a_chain_of_links(links, growth):
    """Leading real parts from Magnus integration on tens of thousands of segments."""
    system = chain(links, 2)
    answer = decoupled_exponents(decouple(system.A, system.period, tol=1e-8))
    assert answer.exponents[0].real == pytest.approx(growth, rel=2e-10)
    assert (answer.errors <= 1e-8 * np.maximum(1, np.abs(answer.exponents) * 50)).all()


def test_all_exponents_of_a_stiff_chain_are_known(monkeypatch):
    """Two pairs of fast modes turn into each other while they decay by exp(800) apart. Truth: 40,000 exponentials of A(t), extrapolated."""
    monkeypatch.setitem(scaling.LINK, "bending_stiffness", 2000.0)
    found = fl.floquet(chain(3, 2), 1e-8)
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


@pytest.mark.slow
def test_stiff_links_between_points_are_followed_or_bounded():
    """Accelerations jump: with stiffer links than segments can follow, the slow modes stay known and the fast ones are bounded."""
    found, modes = [], {"links.0.modes": 3, "links.1.modes": 3}
    for stiffer in (1.0, 300.0, 3000.0):
        stiffness = {"links.0.bending_stiffness": 671.0 * stiffer, "links.1.bending_stiffness": 189.0 * stiffer}
        found.append(fl.floquet(closed("pick-and-place", modes | stiffness).periodic_system()))
    assert [one.verdict for one in found] == 3 * ["stable"]
    assert [one.setting.method for one in found] == ["gauss", "radau", "radau"]
    assert max(one.errors[0] for one in found) < 1e-9
    moved = np.diff([one.exponents[0].real for one in found])
    assert abs(moved[1]) < abs(moved[0]) / 100


def group_of(values, size, period):
    """A decoupled system that is one real group, or a complex one beside its conjugates, and what is not known of it."""
    p, real = len(size), not np.iscomplexobj(values)
    whole = np.zeros((len(values), *(2 * (p,) if real else 2 * (2 * p,))), complex)
    unknown = np.zeros(whole.shape[1:])
    for k, part in enumerate([slice(0, p)] if real else [slice(0, p), slice(p, 2 * p)]):
        whole[:, part, part], unknown[part, part] = values.conj() if k else values, size
    groups = (Group(0, p, 0),) if real else (Group(0, p, 1), Group(p, 2 * p, 0))
    times, none = period * np.arange(len(values)) / len(values), np.zeros(len(groups), bool)
    return Decoupled(period, times, whole, whole, whole, groups, none, unknown, np.zeros_like(unknown), 1)


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

        coupled = Coupled(B(t), 2 * np.pi, (Group(0, 1, 0), Group(1, 2, 1)))
        # turns with the second mode, so that one factor serves a long step
        phases = np.exp(1j * gap * np.outer(steps, [0, 1]))
        slow = phases.conj()[:, :, None] * B(steps) * phases[:, None, :] - 1j * gap * np.diag([0, 1])
        whole = reduce(np.matmul, expm(2 * np.pi / 400 * slow)[::-1])
        logs = np.log(np.linalg.eigvals(whole)) / (2 * np.pi)
        moved = apart(mean - [0, 1j * gap], logs, 2 * np.pi).min(axis=1)
        bound = np.diagonal(residual_effect(coupled))
        assert np.all(moved <= 1.05 * bound + 1e-7 * c)
        softer.append(bound.max() / c)
    assert min(softer) < 0.02
    assert max(softer) > 0.3


def test_what_is_hidden_lies_below_all_that_is_known():
    """An enclosure between known exponents is said as it is: inf promises that an exponent lies below the others."""
    exponents = np.array([300.0, 60.0, -80.0, -80.0, -250.0, -5000.0])
    errors = np.array([1e-9, 1e-9, 30.0, 30.0, 1e-9, 600.0])
    assert hide_enclosed(exponents, errors).tolist() == [1e-9, 1e-9, 30.0, 30.0, 1e-9, np.inf]


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
