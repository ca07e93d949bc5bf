"""Critical values against closed forms and dense scans, of systems with piecewise constant stiffness: their spectra come from exponentials,
which share nothing with the engine and take microseconds; and spectra of many plain systems together: as `floquet` has them
one by one, or not said to be accurate."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b

import flexlin as fl
from flexlin.periodic import Effort, Spectra, find_crossings, find_together, match_logs
from flexlin.periodic.boundary.together import multiply_up
from flexlin.resources import Stopwatch
from tests.periodic.systems import lyapunov_transformed, mathieu_second_order
from tests.thinned import thin


def read(product, doubt=1):
    """Spectra of monodromy matrices (V, n, n), with the rounding of nearly double multipliers or so often that."""
    multipliers = np.linalg.eigvals(product).astype(complex)
    apart = np.abs(multipliers[:, :, None] - multipliers[:, None, :]) + 9 * np.eye(product.shape[-1])
    return Spectra(np.log(multipliers), doubt * (3e-12 + 3e-12 / np.maximum(apart.min(axis=2), 2e-6)))


def halves(a, q, damping):
    """Cosines and sines of both halves of the period, each pi long: y'' + d y' + (a +- q) y = 0."""
    roots = [np.sqrt(a + part - damping**2 / 4 + 0j) for part in (q, -q)]
    return [(np.cos(np.pi * w).real, (np.sin(np.pi * w) / w).real) for w in roots]


def trace(a, q, damping):
    """Of the monodromy matrix, but for its decay: multipliers 1 and -1 where it is +-2 cosh(pi d)."""
    (c1, s1), (c2, s2) = halves(a, q, damping)
    return 2 * c1 * c2 - 2 * (a - damping**2 / 4) * s1 * s2


def meissner(q, damping=0.0, doubt=1):
    """By the product of two exact transition matrices; the parameter is a."""

    def spectra(a):
        product, d = np.eye(2), damping
        for (c, s), part in zip(halves(a, q, d), (q, -q), strict=True):
            matrix = np.array([[c + d / 2 * s, s], [-(a + part) * s, c - d / 2 * s]])
            product = np.exp(-np.pi * d / 2) * np.moveaxis(matrix, 2, 0) @ product
        return read(product, doubt)

    return spectra


def trace_roots(q, low, high, damping=0.0):
    """Where a multiplier of Meissner's equation is 1 or -1."""

    def excess(a, sign):
        return trace(a, q, damping) - 2 * sign * np.cosh(np.pi * damping)

    grid, roots = np.linspace(low, high, 200001), []
    for sign in (1.0, -1.0):
        edges = find_changes(excess(grid, sign) > 0)
        roots += [brentq(excess, grid[k], grid[k + 1], (sign,), xtol=1e-14) for k in edges]
    return np.sort(roots)


def find_changes(signs):
    return np.flatnonzero(signs[1:] != signs[:-1])


@pytest.mark.parametrize(
    ("q", "low", "high", "damping", "tol", "doubt", "samples"),
    [(q, q + 0.03, 9.7, 0.0, 1e-9, 1, 257) for q in (0.02, 0.3, 1.0)]
    + [(0.05, 0.9, 1.2, 0.0, 0.1, 1, 17), (0.3, 8.5, 9.5, 1e-4, 1e-15, 1, 33), (0.004, 0.246, 3.0, 0.0, 1e-9, 1, 33)]
    + [(0.0029, 0.91, 1.11, 0.0, 1e-12, 25, 33), (0.0042, 0.82, 1.19, 0.0, 1e-12, 156, 33)],
)
def test_every_edge_is_found_within_its_error(q, low, high, damping, tol, doubt, samples):
    """Of tongues narrower than tol, in the first cell, with edges known to rounding, in doubtful spectra, and closed to within these."""
    spectra, exact = meissner(q, damping, doubt), trace_roots(q, low, high, damping)
    found = find_crossings(spectra, spectra, low, high, tol, samples)
    assert all(np.abs(exact - one.value).min() <= one.error + 2e-14 for one in found if not one.touching)
    assert all(min(abs(one.value - x) - one.error for one in found) <= 2e-14 for x in exact)
    assert all(one.onset != two.onset for one, two in pairwise(found))
    assert any(one.touching for one in found) == (doubt > 100)


def oscillators(rng, size, damping):
    """Two coupled modes whose stiffness swings by so much, one way for half of the period, then the other; the parameter is the rate."""
    turn = np.linalg.qr(rng.standard_normal((2, 2)))[0]
    mean = turn @ np.diag(rng.uniform(0.5, 6.0, 2)) @ turn.T
    swing = rng.standard_normal((2, 2)) * size
    swing, D = swing + swing.T, damping * np.diag(rng.uniform(0.3, 1.0, 2))
    parts = [np.block([[np.zeros((2, 2)), np.eye(2)], [-mean - part, -D]]) for part in (swing, -swing)]

    def spectra(p):
        first, second = (expm(A * (np.pi / p)[:, None, None]) for A in parts)
        return read(second @ first)

    return spectra


@pytest.mark.parametrize(
    ("seed", "size", "damping"),
    [(seed, 1.0, (0.02, 0.1, 0.3)[seed % 3]) for seed in range(6)]
    + thin([(seed, 0.3, (0.0, 3e-4)[seed % 2]) for seed in range(4)], 0),
)
def test_every_change_between_the_values_of_a_scan_is_found(seed, size, damping):
    """Also of a scan that leaves values out: in each cell as many changes as its ends' verdicts say, tongues of all orders and sums."""
    spectra = oscillators(np.random.default_rng(seed), size, damping)
    found = [one.value for one in find_crossings(spectra, spectra, 0.5, 4.0, 1e-9, samples=513) if not one.touching]
    grid, found = np.linspace(0.5, 4.0, 513), np.array(found)
    unstable = spectra(grid).verdicts > 0
    assert np.array_equal(np.histogram(found, grid)[0] % 2 == 1, unstable[1:] != unstable[:-1])
    beside = spectra(np.concatenate([found - 1e-7, found + 1e-7])).verdicts.reshape(2, -1) > 0
    assert (beside[0] != beside[1]).all()


def timed_by_values(monkeypatch, spectra):
    """The spectra under a clock that goes by one second a value, and the values that were asked for."""
    made = []

    def counted(x):
        made.extend(x)
        return spectra(x)

    monkeypatch.setattr(Stopwatch, "seconds", property(lambda _: float(len(made))))
    return counted, made


@pytest.mark.parametrize("seconds", [1.5, 4.0, 12.0, 40.0, 80.0, 150.0, 400.0])
def test_a_search_that_ends_early_says_what_it_knows(monkeypatch, seconds):
    """A clock that goes by one second a value: what is found holds a root each, and what may hide is called a gap."""
    counted, made = timed_by_values(monkeypatch, meissner(0.3))
    effort, exact = Effort(seconds), trace_roots(0.3, 0.8, 4.0)
    found = find_crossings(counted, counted, 0.8, 4.0, 1e-9, effort=effort)
    assert len(made) <= 1.2 * seconds + 8
    assert effort.values == len(made)
    for one in found:
        assert np.abs(exact - one.value).min() <= one.error
    assert effort.gap > 0 or (len(found) >= len(exact) and seconds > 50)
    if len(found) and seconds < 100:
        assert effort.unfinished or max(one.error for one in found) < 1e-8


@pytest.mark.parametrize(("about", "seconds"), [(1.6, 110.0), (2.6, 75.0), (3.5, 75.0)])
def test_a_search_that_ends_early_knows_most_about_the_value_that_is_asked_about(monkeypatch, about, seconds):
    """It ended where the next halving of all cells took too long, and said nothing of the part without gaps."""
    spectra = meissner(0.3, damping=0.1)
    counted, made = timed_by_values(monkeypatch, spectra)
    effort = Effort(seconds, about)
    assert find_crossings(counted, counted, 0.8, 4.0, 1e-9, effort=effort) == []
    low, high = effort.searched
    assert low < about - 0.1 < about + 0.2 < high
    assert effort.gap > 0.0
    assert 0.7 * seconds <= len(made) <= seconds
    between = np.linspace(max(low, 0.8), min(high, 4.0), 401)
    assert (spectra(between).verdicts < 0).all()


@pytest.mark.parametrize(("decay", "shortened"), [(20.0, True), (4.0, False)])
def test_a_short_scan_is_coarse_only_where_no_turn_of_a_multiplier_outweighs_its_decay(monkeypatch, decay, shortened):
    """Multipliers turn seven times across 1/32 of the range, so that both ends of a cell look alike: that is no proof for a wide one."""

    def spectra(x):
        logs = -decay + 1j * np.pi * (0.3 + 14 * 32 * x)
        return Spectra(np.stack([logs, logs.conj()], axis=1), np.full((len(x), 2), 1e-9))

    counted, made = timed_by_values(monkeypatch, spectra)
    effort = Effort(30.0, 0.4)
    assert find_crossings(counted, counted, 0.0, 1.0, 1e-9, effort=effort) == []
    assert (effort.gap == 0.0) == shortened
    assert len(made) < 30


def agree(systems, tol):
    """How many systems meet tol; each of them lies within both errors of what `floquet` says, and its verdict is the same."""
    products = find_together(systems, tol)
    found, reached = products.spectra, products.meets(tol)
    for k in np.flatnonzero(reached):
        one = fl.floquet(systems[k], 1e-11)
        partner, apart = match_logs(found.logs[k], one.log_multipliers)
        known = np.isfinite(one.errors[partner])
        assert np.all(apart[known] <= (found.errors[k] + one.errors[partner] * one.period)[known])
        verdict = found.at(np.array([k])).verdicts[0]
        assert verdict in (0, {"stable": -1, "unstable": 1, "undecided": 0}[one.verdict])
    return int(reached.sum())


def test_tongues_of_mathieus_equation():
    """Anywhere, on the edges of tongues and a little beside them, with and without damping."""
    rng, systems = np.random.default_rng(0), []
    for q in np.repeat(10 ** rng.uniform(-3, 0.5, 12), 2):
        edge = float(rng.choice([mathieu_a, mathieu_b])(int(rng.integers(1, 5)), q))
        beside = edge + rng.choice([-1, 1]) * 10 ** rng.uniform(-9, -3)
        systems += [mathieu_second_order(a, q) for a in (edge, beside)]
    systems += [mathieu_second_order(a, 0.4, 0.02) for a in rng.uniform(0.1, 12, 12)]
    assert agree(systems, 1e-5) > 50


@pytest.mark.parametrize("seed", range(3))
def test_non_normal_systems(seed):
    rng, systems = np.random.default_rng(seed), []
    for _ in range(8):
        constant = np.diag(rng.uniform(-2, 0.3, 3)) + np.triu(3 * rng.standard_normal((3, 3)), 1)
        systems.append(fl.PeriodicSystem(lyapunov_transformed(constant, 2.0, 2, rng), np.pi))
    assert agree(systems, 1e-8) > 5


def test_what_the_segments_do_not_follow_is_not_called_accurate():
    """Fast modes, a jump that nobody named, and multipliers that lie 1e40 apart."""

    def jump(t):
        return np.where(np.mod(t, 1.0) < 0.4142, -1.0, 0.7)[:, None, None] * np.eye(2)

    def apart(t):
        return np.array([[1.0, 5.0], [0.0, -90.0]]) + 0.1 * np.sin(2 * np.pi * t)[:, None, None]

    systems = [fl.PeriodicSystem(A, 1.0) for A in (np.diag([-1.0, -1e5]), jump, apart)]
    assert not find_together(systems, 1e-8).meets(1e-8).any()


@pytest.mark.parametrize("seed", [0, 3, 6, 9])
def test_products_are_no_farther_off_than_their_bound(seed):
    """Of turning, shearing, decaying factors, against the same product with 11 more bits; the bound is not much too large."""
    rng, n = np.random.default_rng(seed), 2 + seed
    noise = rng.standard_normal((100, n, n))
    turning, shear = np.linalg.qr(noise)[0], np.eye(n) + 0.3 * np.triu(noise, 1)
    factors = np.array([turning, shear, 0.9 * turning @ shear])
    made, bound = multiply_up(factors)
    exact = np.broadcast_to(np.eye(n, dtype=np.longdouble), made.shape)
    for k in range(100):
        exact = factors[:, k].astype(np.longdouble) @ exact
    off = np.abs(made - exact)
    assert np.all(off <= bound)
    assert np.all(bound.max(axis=(1, 2)) < 1e4 * off.max(axis=(1, 2)))


def test_a_frequency_is_searched_on_few_systems():
    """y'' + (1 - 0.4 cos pt) y = 0: Mathieu's equation of a = 4 / p^2, q = a / 5; SciPy knows its edges."""
    asked = []

    def system(p):
        asked.append(p)
        stiffness = lambda t: (1 - 0.4 * np.cos(p * t))[:, None, None]  # noqa: E731
        return fl.PeriodicSystem.from_second_order([[1.0]], [[0.0]], stiffness, 2 * np.pi / p)

    found = [one.value for one in fl.critical_values(system, "p", (0.45, 3.0), tol=1e-8)]
    edges = [(edge, n) for n in range(1, 5) for edge in (mathieu_a, mathieu_b)]
    exact = sorted(2 / np.sqrt(brentq(lambda a, e=e, n=n: a - e(n, a / 5), n**2 / 2, 2 * n**2)) for e, n in edges)
    np.testing.assert_allclose(found, exact, atol=1e-8)
    assert len(asked) < 250
