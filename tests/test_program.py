"""The door between CasADi and NumPy: values, layout, refusals; functions read as programs give CasADi's own numbers to the last bit."""

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

from flexlin import symbolic
from flexlin.errors import ArgumentError
from flexlin.program import CONST, INPUT, OUTPUT, Layout, Program


@pytest.fixture
def function():
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y")
    return ca.Function("f", [x, y], [ca.horzcat(x, y * x, ca.sin(x)), x[0] + y])


def test_values_and_layout(function):
    x, y = np.random.default_rng(1).normal(size=(2, 7, 2))[0], np.arange(7.0)[:, None]
    matrix, scalar = symbolic.evaluate(function, x, y)
    np.testing.assert_allclose(matrix, np.stack([x, y * x, np.sin(x)], axis=2), rtol=1e-15)
    np.testing.assert_allclose(scalar[:, 0, 0], x[:, 0] + y[:, 0], rtol=1e-15)


def test_chunks_join(function, monkeypatch):
    x, y = np.ones((10, 2)), np.arange(10.0)[:, None]
    whole = symbolic.evaluate(function, x, y)
    monkeypatch.setattr(symbolic, "CHUNK_POINTS", 3)
    for a, b in zip(whole, symbolic.evaluate(function, x, y), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(("x", "y"), [((4, 2), (1, 1)), ((4, 1), (4, 1)), ((0, 2), (0, 1)), ((4, 2), (4, 1))], ids=str)
def test_nothing_is_broadcast_and_numbers_are_finite(function, x, y):
    with pytest.raises(ArgumentError):
        symbolic.evaluate(function, np.full(x, np.nan if y == (4, 1) else 1.0), np.ones(y))


def test_sparse_outputs_are_refused():
    x = ca.SX.sym("x", 2)
    with pytest.raises(ArgumentError, match="sparse"):
        symbolic.evaluate(ca.Function("f", [x], [ca.diag(x)]), np.ones((3, 2)))


UNARY = [
    *(ca.exp, ca.log, ca.sqrt, ca.tan, ca.asin, ca.acos, ca.atan, ca.floor, ca.ceil, ca.fabs, ca.sign),
    *(ca.sinh, ca.cosh, ca.tanh, ca.asinh, ca.acosh, ca.atanh, ca.log1p, ca.expm1, ca.erf),
    *(lambda a: -a, lambda a: 1 / a, lambda a: a**2, lambda a: 2 * a, lambda a: a**1.5, ca.logic_not),
]
BINARY = [
    *(ca.fmin, ca.fmax, ca.atan2, ca.hypot, ca.power, ca.logic_or, ca.logic_and, ca.fmod, ca.remainder),
    *(lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a * b, lambda a, b: a / b),
    *(lambda a, b: a < b, lambda a, b: a <= b, lambda a, b: a == b, lambda a, b: a != b),
    *(lambda a, b: ca.if_else(a < b, a, 2 * b), lambda a, b: ca.if_else(a, b, 0)),
    lambda a, b: ca.if_else(a <= 0, ca.if_else(b > 1, ca.tan(a), -b), ca.if_else(a == b, a / b, a * b)),
]
BINARY.append(lambda a, b: ca.copysign(a, ca.fmax(b, -7.5)))  # the sign of what is no number is nobody's
HARD = [np.nan, np.inf, -np.inf, 0.0, -0.0, 1.0, -1.0, 2.5, -2.5, 1e-310, 1e308, 0.3]


def grow(known: list[ca.SX], choices: list[tuple[int, int, int]]) -> list[ca.SX]:
    """Operations on what came before."""
    every = UNARY + BINARY
    for which, i, j in choices:
        operation, a, b = every[which % len(every)], known[-1 - i % len(known)], known[-1 - j % len(known)]
        known.append(operation(a) if which % len(every) < len(UNARY) else operation(a, b))
    return known


SIZES = (3, 2, 0)
"""Numbers that the inputs of random functions hold."""


def random_function(seed: int, length: int = 300) -> ca.Function:
    """Operations of every kind on what came before, what is not a number among them."""
    rng = np.random.default_rng(seed)
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y", 2)
    known = [*ca.vertsplit(x), *ca.vertsplit(y), ca.SX(0.75), ca.SX(rng.normal())]
    known = grow(known, [tuple(c) for c in rng.integers(0, [1000, 40, 40], (length, 3)).tolist()])
    shape = ca.reshape(ca.vertcat(*known[-6:]), 2, 3)
    return ca.Function("random", [x, y, ca.SX(0, 1)], [shape, known[len(known) // 2], ca.densify(ca.SX(2, 1))])


def random_points(seed: int, points: int) -> list[np.ndarray]:
    """Inputs of a random function."""
    rng = np.random.default_rng(seed)
    return [rng.normal(size=(points, size)) for size in SIZES]


def run(made: Layout, function: ca.Function, arrays: list[np.ndarray]) -> list[np.ndarray]:
    outputs = symbolic.empty_outputs(function, len(arrays[0]))
    made(arrays, outputs)
    return [output.transpose(0, 2, 1) for output in outputs]


def assert_same(found: Iterable[np.ndarray], right: Iterable[np.ndarray]) -> None:
    """The same bits, signs of zeros among them."""
    for one, other in zip(found, right, strict=True):
        np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(np.signbit(one[other == 0]), np.signbit(other[other == 0]))


def agree(function: ca.Function, arrays: list[np.ndarray], made: Layout | None = None) -> None:
    """The same numbers as CasADi's."""
    found = run(made or Program.read(function).lay_out(), function, arrays)
    assert_same(found, symbolic.call_casadi(function, arrays))


def test_each_operation_gives_the_same_bits():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    arrays = [grid.ravel()[:, None] for grid in np.meshgrid(HARD, HARD)]
    for expression in (*(one(x) for one in UNARY), *(two(x, y) for two in BINARY)):
        agree(ca.Function("one", [x, y], [expression]), arrays)


def test_sines_and_cosines_are_right_within_an_ulp():
    """Against the processor's numbers of 64 bits: near multiples of pi/2 too, where a reduction by one number loses all digits."""
    rng, turns, x = np.random.default_rng(4), np.arange(1.0, 4000.0) * np.pi / 2, ca.SX.sym("x")
    drawn, rare = rng.uniform(-1, 1, 4000) * np.repeat([9, 1e5], 2000), [3e7, -1e17, 1e-9, *HARD]
    angles = np.concatenate([drawn, turns, np.nextafter(-turns, 0), rare])[:, None]
    function = ca.Function("sines", [x], [ca.sin(x), ca.cos(x)])
    found = [one[:, :, 0] for one in run(Program.read(function).lay_out(), function, [angles])]
    known, long = np.isfinite(angles), angles.astype(np.longdouble)
    with np.errstate(invalid="ignore"):
        exact = np.sin(long), np.cos(long)
    for one, right in zip(found, exact, strict=True):
        missed = np.abs(one.astype(np.longdouble) - right)[known]
        assert (missed <= np.spacing(np.abs(right[known]).astype(float))).all()
        assert np.isnan(one[~known]).all()
    zeros = angles == 0
    np.testing.assert_array_equal(np.signbit(found[0][zeros]), np.signbit(angles[zeros]))


@pytest.mark.parametrize("seed", range(12))
def test_random_functions_give_the_same_bits(seed):
    function = random_function(seed)
    made = Program.read(function).lay_out()
    for points in (1, 8, 9, 32, 33, 40, 41, 100):
        agree(function, random_points(seed, points), made)


@pytest.mark.parametrize("seed", range(6))
def test_what_is_written_often_is_computed_once(seed):
    """Against value numbering by a dictionary: as many steps, the same bits; signs of zeros are told apart."""
    rng, x = np.random.default_rng(seed), ca.SX.sym("x", 2)
    known = [*ca.vertsplit(x), ca.SX(0.0), ca.SX(-0.0), ca.SX(np.nan), ca.SX(2.5)]
    names, made_before = [str(k) for k in range(len(known))], {}
    for _ in range(400):
        i, j = rng.integers(len(known), size=2)
        which = rng.integers(4)
        known.append([ca.sinh, ca.atan, ca.fmin, ca.atan2][which](*[known[i], known[j]][: 1 if which < 2 else 2]))
        key = (which, names[i], names[j] if which > 1 else "")
        names.append(made_before.setdefault(key, f"made {len(made_before)}"))
    function = ca.Function("twice", [x], [ca.vertcat(*known)])
    program, arrays = Program.read(function), [rng.normal(size=(70, 2))]
    computed = int((~np.isin(program.steps[:, 0], (CONST, INPUT, OUTPUT))).sum())
    assert computed <= len(made_before)
    assert computed < 0.8 * 400
    agree(function, arrays)


def test_many_points_take_the_program_and_few_do_not():
    function, arrays = random_function(99), random_points(0, 50)
    few = symbolic.evaluate(function, *arrays)
    assert symbolic.usage_of(function).program is None
    many = symbolic.evaluate(function, *(np.tile(a, (40, 1)) for a in arrays))
    assert symbolic.usage_of(function).program is not None
    assert_same(many, (np.tile(one, (40, 1, 1)) for one in few))


def test_one_reading_serves_a_function_and_its_parts(monkeypatch):
    function, reads, read = random_function(41), [], Program.read
    monkeypatch.setattr(Program, "read", lambda f: reads.append(f) or read(f))
    part, arrays = symbolic.Part(function, (function.name_out()[1],)), random_points(0, 850)
    for _ in range(2):
        symbolic.evaluate(part, *arrays)
        symbolic.evaluate(function, *arrays)
        few = symbolic.evaluate(part, *(array[:2] for array in arrays))
    assert len(reads) == 1
    right = symbolic.call_casadi(part.function, arrays)
    np.testing.assert_array_equal(symbolic.evaluate(part, *arrays)[0], right[0])
    np.testing.assert_array_equal(few[0], right[0][:2])


def test_what_cannot_be_read_is_left_to_casadi(monkeypatch):
    monkeypatch.setattr(symbolic, "READING_COST", 0)
    x, matrix = ca.SX.sym("x"), ca.MX.sym("m", 2)
    inner = ca.Function("inner", [x], [ca.sin(x)], {"never_inline": True})
    calling = ca.Function("calling", [x], [inner(x) + x])
    rare = ca.Function("rare", [x], [ca.erfinv(x) + x])
    for function, why in ((ca.Function("matrices", [matrix], [matrix + 1]), "scalar"), (calling, "calls")):
        with pytest.raises(ArgumentError, match=why):
            Program.read(function)
    arrays = [np.linspace(0.1, 0.9, 2000)[:, None]]
    with pytest.raises(ArgumentError, match="OP_ERFINV"):
        run(Program.read(rare).lay_out(), rare, arrays)
    for function in (rare, calling):
        for outputs in (function, symbolic.Part(function, tuple(function.name_out()))):
            exact = symbolic.call_casadi(function, arrays)[0]
            np.testing.assert_array_equal(symbolic.evaluate(outputs, *arrays)[0], exact)
            np.testing.assert_array_equal(symbolic.evaluate(outputs, arrays[0][:2])[0], exact[:2])
        assert symbolic.usage_of(function).tried
        assert symbolic.usage_of(function).program is None


def test_threads_do_not_share_their_numbers():
    function = random_function(7)
    made, every = Program.read(function).lay_out(), [random_points(k, 5000) for k in range(8)]
    alone = [run(made, function, arrays) for arrays in every]
    with ThreadPoolExecutor(4) as pool:
        for right, found in zip(alone, pool.map(lambda arrays: run(made, function, arrays), every), strict=True):
            assert_same(found, right)
