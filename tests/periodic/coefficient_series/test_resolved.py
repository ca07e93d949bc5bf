"""Resolved coefficients against the functions they stand for: smooth, narrow, broken, noisy, badly scaled; no pulse hides in an entry."""

import pickle

import numpy as np
import pytest
from scipy.special import i0

import flexlin as fl
from flexlin.periodic import FourierSeries, resolve
from tests.periodic.coefficient_series.functions import SMOOTH, background, resolved, scalar
from tests.periodic.judge import covers
from tests.periodic.jumping_systems import reference_pulse
from tests.thinned import thin


@pytest.mark.parametrize("complete", [False, True])
@pytest.mark.parametrize("seed", thin(range(8), 4))
def test_random_trigonometric_polynomials_of_up_to_60_harmonics(seed, complete):
    rng = np.random.default_rng(seed)
    T, harmonics = 10.0 ** rng.uniform(-2, 2), int(rng.integers(1, 61))
    A = background(rng, T, harmonics=harmonics)
    series = resolved(A, T, below=1e-12 * np.abs(A(rng.uniform(0, T, 99))).max(), complete=complete)
    assert isinstance(series.series, FourierSeries)
    assert harmonics <= series.degree <= 2 * harmonics + 6


@pytest.mark.parametrize("seed", thin(range(10), 5))
def test_gaussian_pulses_anywhere(seed):
    rng = np.random.default_rng(seed)
    T = 10.0 ** rng.uniform(-1, 1)
    width, place = T * 10.0 ** rng.uniform(-4, -1), rng.uniform(0, T)
    smooth, pattern = background(rng, T), rng.standard_normal((2, 2))

    def A(t):
        pulse = sum(np.exp(-(((np.mod(t, T) - place + k * T) / width) ** 2)) for k in (-1, 0, 1))
        return smooth(t) + pulse[:, None, None] * pattern

    assert not resolved(A, T, [place], below=1e-10).found


@pytest.mark.parametrize("complete", [False, True])
@pytest.mark.parametrize("exponent", range(2, 9))
def test_named_pulses_down_to_a_hundred_millionth(exponent, complete):
    width, place = 10.0**-exponent, np.random.default_rng(exponent).uniform(0, 1)
    A = scalar(lambda t: 2 + np.exp(-np.minimum(((np.mod(t - place + 0.5, 1) - 0.5) / width) ** 2, 700)))
    series = resolved(A, 1.0, [place], features=[(place, width)], complete=complete)
    assert series.mean()[0, 0] - 2 == pytest.approx(np.sqrt(np.pi) * width, rel=1e-6)


@pytest.mark.parametrize("eps", [1e-1, 1e-2, 1e-3, 1e-5])
@pytest.mark.parametrize("named", [True, False])
def test_smoothed_switches(eps, named):
    A = scalar(lambda t: np.tanh(np.cos(t) / eps))
    turns = (np.pi / 2, 3 * np.pi / 2)
    features = [(t, eps) for t in turns] if named else ()
    assert not resolved(A, SMOOTH, turns, below=1e-14 / eps + 1e-12, features=features).found


@pytest.mark.parametrize("seed", thin(range(16), 8))
def test_jumps_are_found_to_the_last_bit(seed):
    rng = np.random.default_rng(seed)
    T, count = 10.0 ** rng.uniform(-2, 2), int(rng.choice([1, 2, 3, 20]))
    times, values = np.sort(rng.uniform(0, T, count)), rng.standard_normal((count + 1, 2, 2))
    smooth = background(rng, T)
    named = times[:1] if rng.random() < 0.3 else ()

    def A(t):
        return smooth(t) + values[np.searchsorted(times, np.mod(t, T), side="right")]

    series = resolved(A, T, times, breaks=named)
    assert series.breaks == pytest.approx([0.0, *times], abs=2e-15 * T)
    assert {place.kind for place in series.found} == {"jump"}


UNNAMED = (0.3, 0.300001), (0.5 + 1e-9,), (0.5,), (1e-9, 0.6), (0.6, 1 - 1e-9)
NAMED = ((0.3,), (0.3 + 1e-6,)), ((0.3,), (0.3 - 1e-10,)), ((0.3, 0.8), (0.3, 0.5, 0.8))


@pytest.mark.parametrize(("breaks", "jumps"), [*(((), jumps) for jumps in UNNAMED), *NAMED])
def test_jumps_in_awkward_places(breaks, jumps):
    around = jumps[0] < 1e-8 or jumps[-1] > 1 - 1e-8
    levels = np.array([1.0, 4.0, 1.0 if around else 2.0, 7.0])
    wave = 0.1 if len(jumps) == 1 else 0.0

    def f(t):
        t = np.mod(t, 1)
        return levels[np.searchsorted(jumps, t, side="right")] + wave * np.sin(2 * np.pi * t)

    series = resolved(scalar(f), 1.0, jumps, breaks=breaks)
    expected = {*jumps, *(() if around else (0.0,))} - set(breaks)
    assert [place.time for place in series.found] == pytest.approx(sorted(expected), abs=4e-16)


@pytest.mark.parametrize("level", [1e-12, 1e-10, 1e-7])
@pytest.mark.parametrize("jump", [0.0, 1.0])
def test_noise_is_measured_and_not_chased(level, jump):
    rng = np.random.default_rng(3)
    true = scalar(lambda t: np.cos(t) + jump * (np.mod(t, SMOOTH) < 2.345))
    noisy = lambda t: true(t) + level * rng.standard_normal((len(t), 1, 1))  # noqa: E731
    series = resolved(noisy, SMOOTH, below=50 * level, true=true)
    assert 2 * level < series.error[0, 0]
    assert [place.time for place in series.found if place.time] == pytest.approx([2.345] if jump else [], abs=1e-12)


@pytest.mark.parametrize("power", [6, 12])
@pytest.mark.parametrize("size", [1e-4, 1e-2, 1.0])
def test_rounding_that_comes_and_goes_is_not_chased(size, power):
    """An entry that is zero but for the order in which three factors are multiplied: exactly so here, a few units of 1e-17 there."""

    def A(t):
        a, b, c = size * np.sin(t) ** power, 0.3, np.cos(t) + 2
        rows = [3 + np.cos(t), (a * b) * c - a * (b * c), np.full_like(t, 0.1), 2 + np.sin(t)]
        return np.stack(rows, axis=1).reshape(-1, 2, 2)

    series = resolved(A, SMOOTH, below=1e-13, complete=True)
    assert isinstance(series.series, FourierSeries)
    assert series.degree == 1


@pytest.mark.parametrize("part", [0.01, 0.03])
def test_rounding_that_few_times_have_is_not_chased(part):
    """An inverse of condition 1e6 that pivots in another order at a few times: such an A was refused, cut to the last bit."""

    def rare(t):
        return np.mod(1e9 * t, 1.618) < 1.618 * part

    A = scalar(lambda t: (0.5 * np.cos(t) - 1) * (1 + 1e-12 * rare(t)))
    assert resolved(A, SMOOTH, below=2e-11).panels < 1000


@pytest.mark.parametrize("complete", [False, True])
def test_each_entry_by_its_own_size(complete):

    def A(t):
        rows = [1e-12 * np.cos(t), 1e12 * np.sin(3 * t), 1e-17 * np.cos(1e9 * t), np.full_like(t, 0.1)]
        return np.stack(rows, axis=1).reshape(-1, 2, 2)

    series = resolved(A, SMOOTH, below=np.array([[1e-25, 0.1], [1e-13, 1e-13]]), complete=complete)
    assert np.all(series(np.linspace(0, 6, 9))[:, 1, 1] == 0.1)


@pytest.mark.parametrize("breaks", [(), (0.4,)])
def test_derivative_and_mean(breaks):
    """The mean is Bessel's I_0(1)."""
    series = resolve(scalar(lambda t: np.exp(np.sin(t))), SMOOTH, breaks=breaks)
    t = np.random.default_rng(7).uniform(0, SMOOTH, 200)
    off = np.abs(series.derivative()(t)[:, 0, 0] - np.cos(t) * np.exp(np.sin(t))).max()
    assert off <= series.derivative().error[0, 0]
    assert off < 1e-10
    assert series.mean()[0, 0] == pytest.approx(i0(1.0), abs=1e-13)
    assert f"samples={series.samples}" in repr(series)
    assert np.all(pickle.loads(pickle.dumps(series))(t) == series(t))


def test_features_beside_breaks_make_no_slivers():
    A = scalar(lambda t: np.where(np.mod(t, 1) < 0.3, 1, np.exp(-np.clip((np.mod(t, 1) - 0.3) / 1e-6, 0, 700))))
    features = [(0.3, 1e-6), (0.3, 1e-14), (0.0, 1e-13), (0.9, 2.0)]
    series = resolved(A, 1.0, [0.3], breaks=(0.3,), features=features, complete=True)
    assert np.diff(series.edges).min() > 1e-11


@pytest.mark.parametrize("width", [1e-9, 3e-7, 2e-5])
@pytest.mark.parametrize("at_the_end", [False, True])
def test_pulses_that_begin_or_end_with_the_period_are_seen_however_narrow(width, at_the_end):
    """x' = a(t) x, whose exponent is the mean: a pulse of area one at one end of T = 3, never between two samples."""

    def a(t):
        phase = np.mod(t, 3.0)
        inside = phase >= 3.0 - 3.0 * width if at_the_end else phase < 3.0 * width
        return np.where(inside, 1 / (3.0 * width), -0.5)[:, None, None]

    found = fl.floquet(fl.PeriodicSystem(a, 3.0))
    assert abs(found.exponents[0].real - (1 / 3 - 0.5 * (1 - width))) <= found.errors[0] < 2e-11 / width + 1e-9


def test_what_a_narrow_pulse_is_not_known_by_counts_on_the_pulse_alone():
    """The reference pulse: 2e-4 wide, 17,000 high, so its flanks are known to 1e-8; claimed everywhere, that hid seven digits."""
    system = reference_pulse().system()
    assert fl.floquet(system).error < 1e-9
    marks = np.array([0.0, 0.29, 0.3, 0.31, 1.0])
    bound = system.resolved.mean_error(marks)[:, 1, 0]
    assert bound[[0, 3]].max() < 1e-2 * bound[[1, 2]].min()
    assert np.all(bound <= system.resolved.error[1, 0])


def two_coordinates(noise):
    """Two coordinates, the coupling of which is the rounding of two large terms that cancel, or that times zero."""

    def part(k):
        def of(t):
            c, s, one = np.cos(np.pi * t), np.sin(np.pi * t), np.ones_like(t)
            cancelled = noise * ((1e4 * c + s) - 1e4 * c - s)
            M = [[2.0 + 0.3 * c, 0.1 * s], [0.1 * s, one]]
            D = [[0.4 * one, cancelled], [cancelled, 3.0 + 0.1 * c]]
            K = [[30.0 + 2 * s, cancelled], [cancelled, 9e3 + 20 * c]]
            return np.array([M, D, K][k]).transpose(2, 0, 1)

        return of

    return fl.PeriodicSystem.from_second_order(part(0), part(1), part(2), 2.0)


def test_noise_where_terms_cancel_leaves_a_smooth_system_smooth():
    """Entries of M, D, K that ought to be zero do not decide how the others are represented."""
    assert isinstance(two_coordinates(1.0).resolved.series, FourierSeries)
    found, truth = fl.floquet(two_coordinates(1.0), tol=1e-10), fl.floquet(two_coordinates(0.0), tol=1e-10)
    assert covers(found, truth.exponents, 2.0, truth.errors)


def test_a_small_entry_across_a_large_one_keeps_its_digits():
    """Exponents of y'' + K y = 0 depend on K_12 K_21; where K_12 = 1e8 the digits of K_21 = 1e-8 count."""

    def exponents(unit):
        def stiffness(t):
            s = np.sin(np.pi * t)
            rows = [[4.0 + 0 * s, (1 + 0.5 * s) * unit], [(1 + 0.3 * s) / unit, 9.0 + 0 * s]]
            return np.array(rows).transpose(2, 0, 1)

        system = fl.PeriodicSystem.from_second_order(np.eye(2), 0.1 * np.eye(2), stiffness, 2.0)
        found = fl.floquet(system, tol=1e-10).exponents
        return np.sort(found.imag) + 1j * np.sort(found.real)

    np.testing.assert_allclose(exponents(1e8), exponents(1.0), rtol=0, atol=1e-8)


T = 2.0


def waving(rng, n, spread):
    """Entries of n x n with a few harmonics each, of sizes that are `spread` decades apart, some of them constant and some zero."""
    size = 10.0 ** rng.uniform(-spread / 2, spread / 2, (n, n)) * (rng.random((n, n)) < 0.8)
    smooth = background(rng, T, n, 3)
    return (lambda t: size * smooth(t)), size


def box(t, begin, width):
    """One from `begin` on for a while."""
    return ((np.mod(t, T) >= begin) & (np.mod(t, T) < begin + width)).astype(float)[:, None, None]


@pytest.mark.parametrize("share", [1e-9, 1e-6, 1.0])
@pytest.mark.parametrize("spread", [0.0, 16.0])
@pytest.mark.parametrize("seed", thin(range(6), 3))
def test_a_pulse_in_one_entry_is_seen_beside_entries_of_any_size(seed, spread, share):
    rng = np.random.default_rng([seed, int(spread)])
    n = int(rng.integers(1, 7))
    A, size = waving(rng, n, spread)
    row, column = rng.integers(n, size=2)
    height = np.zeros((n, n))
    height[row, column] = share * (size[row, column] or 1e-12)
    width = 1.001e-4 * T * 10.0 ** rng.uniform(0, 1)
    begin = rng.uniform(0, T - width)
    series = resolve(lambda t: A(t) + height * box(t, begin, width), T)
    inside = [place.time for place in series.found if place.time > 0]
    assert inside == pytest.approx([begin, begin + width], abs=1e-14 * T + 1e-12 * T * (share < 1e-3))
    assert {place.kind for place in series.found} == {"jump"}


@pytest.mark.parametrize("pattern", ["skew", "rows", "trace", "rank one", "all"])
@pytest.mark.parametrize("seed", thin(range(4), 2))
def test_no_pattern_of_entries_cancels_in_the_sum(seed, pattern):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    A, _ = waving(rng, n, 4.0)
    column = rng.standard_normal(n)
    height = {
        "skew": np.triu(np.ones((n, n)), 1) - np.tril(np.ones((n, n)), -1),
        "rows": np.outer((-1.0) ** np.arange(n), np.ones(n)),
        "trace": np.diag((-1.0) ** np.arange(n)),
        "rank one": np.outer(column, rng.permutation(column)),
        "all": np.ones((n, n)),
    }[pattern]
    begin = rng.uniform(0, 0.9 * T)

    def pulsed(t):
        return A(t) + 1e-6 * height * box(t, begin, 2.5e-4)

    assert len([place for place in resolved(pulsed, T).found if place.time > 0]) == 2


@pytest.mark.parametrize("n", [2, 8, 20])
def test_a_smooth_function_is_asked_once_in_parts_that_stay_in_cache(n):
    A, _ = waving(np.random.default_rng(n), n, 2.0)
    asked = []

    def counted(t):
        asked.append(len(t))
        return A(t)

    series = resolve(counted, T)
    assert series.degree == 3
    assert sum(asked) == series.samples < 10_500
    assert 8 * n * n * max(asked[1:]) <= 1_000_000
