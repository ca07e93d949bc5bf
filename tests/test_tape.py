"""Functions that many points go through, in compiled code: the same numbers as CasADi's own, to the last bit, or CasADi's own."""

from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

from flexlin import symbolic, tape

UNARY = [
    *(ca.exp, ca.log, ca.sqrt, ca.sin, ca.cos, ca.tan, ca.asin, ca.acos, ca.atan, ca.floor, ca.ceil, ca.fabs, ca.sign),
    *(ca.sinh, ca.cosh, ca.tanh, ca.asinh, ca.acosh, ca.atanh, ca.log1p, ca.expm1),
    *(lambda a: -a, lambda a: 1 / a, lambda a: a**2, lambda a: 2 * a, lambda a: a**1.5, ca.logic_not),
]
BINARY = [
    *(ca.fmin, ca.fmax, ca.atan2, ca.copysign, ca.hypot, ca.power, ca.logic_or, ca.logic_and),
    *(lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a * b, lambda a, b: a / b),
    *(lambda a, b: a < b, lambda a, b: a <= b, lambda a, b: a == b, lambda a, b: a != b),
    *(lambda a, b: ca.if_else(a < b, a, 2 * b), lambda a, b: ca.if_else(a, b, 0)),
]


def random_function(seed: int, length: int = 300) -> ca.Function:
    """Operations of every kind on what came before, what is not a number among them."""
    rng = np.random.default_rng(seed)
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y", 2)
    known = [*ca.vertsplit(x), *ca.vertsplit(y), ca.SX(0.75), ca.SX(rng.normal())]
    for _ in range(length):
        a, b = (known[rng.integers(max(0, len(known) - 40), len(known))] for _ in range(2))
        one, two = UNARY[rng.integers(len(UNARY))], BINARY[rng.integers(len(BINARY))]
        known.append(one(a) if rng.random() < 0.4 else two(a, b))
    shape = ca.reshape(ca.vertcat(*known[-6:]), 2, 3)
    return ca.Function("random", [x, y, ca.SX(0, 1)], [shape, known[len(known) // 2], ca.densify(ca.SX(2, 1))])


def run(made: tape.Tape, function: ca.Function, arrays: list[np.ndarray]) -> list[np.ndarray]:
    outputs = symbolic.empty_outputs(function, len(arrays[0]))
    made(arrays, outputs)
    return [output.transpose(0, 2, 1) for output in outputs]


def test_each_operation_gives_the_same_bits() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    hard = [np.nan, np.inf, -np.inf, 0.0, -0.0, 1.0, -1.0, 2.5, -2.5, 1e-310, 1e308, 0.3]
    arrays = [grid.ravel()[:, None] for grid in np.meshgrid(hard, hard)]
    for expression in (*(one(x) for one in UNARY), *(two(x, y) for two in BINARY)):
        function = ca.Function("one", [x, y], [expression])
        made = tape.Tape.of(function)
        assert made is not None
        right, found = symbolic.call_casadi(function, arrays)[0], run(made, function, arrays)[0]
        np.testing.assert_array_equal(found, right, str(expression))
        np.testing.assert_array_equal(np.signbit(found[right == 0]), np.signbit(right[right == 0]), str(expression))


@pytest.mark.parametrize("seed", range(12))
def test_random_functions_give_the_same_bits(seed: int) -> None:
    function, rng = random_function(seed), np.random.default_rng(seed)
    made = tape.Tape.of(function)
    assert made is not None
    for points in (1, 31, 32, 33, 100):
        arrays = [rng.normal(size=(points, 3)), rng.normal(size=(points, 2)), np.zeros((points, 0))]
        for right, found in zip(symbolic.call_casadi(function, arrays), run(made, function, arrays), strict=True):
            np.testing.assert_array_equal(found, right)


@pytest.mark.parametrize("seed", range(6))
def test_what_is_written_often_is_computed_once(seed: int) -> None:
    """Against value numbering by a dictionary: as many steps, the same bits; signs of zeros are told apart."""
    rng, x = np.random.default_rng(seed), ca.SX.sym("x", 2)
    known = [*ca.vertsplit(x), ca.SX(0.0), ca.SX(-0.0), ca.SX(np.nan), ca.SX(2.5)]
    names, made_before = [str(k) for k in range(len(known))], {}
    for _ in range(400):
        i, j = rng.integers(len(known), size=2)
        which = rng.integers(4)
        known.append([ca.sin, ca.atan, ca.fmin, ca.atan2][which](*[known[i], known[j]][: 1 if which < 2 else 2]))
        key = (which, names[i], names[j] if which > 1 else "")
        names.append(made_before.setdefault(key, f"made {len(made_before)}"))
    function = ca.Function("twice", [x], [ca.vertcat(*known)])
    made, arrays = tape.Tape.of(function), [rng.normal(size=(70, 2))]
    assert made is not None
    computed = int((~np.isin(made.steps[:, 0], (tape.CONST, tape.INPUT, tape.OUTPUT))).sum())
    assert computed <= len(made_before)
    assert computed < 0.8 * 400
    right, found = symbolic.call_casadi(function, arrays)[0], run(made, function, arrays)[0]
    np.testing.assert_array_equal(found, right)
    np.testing.assert_array_equal(np.signbit(found[right == 0]), np.signbit(right[right == 0]))
    few = made.keep((0,))
    np.testing.assert_array_equal(run(few, function, arrays)[0], right)


def test_many_points_take_the_tape_and_few_do_not() -> None:
    function = random_function(99)
    arrays = np.random.default_rng(0).normal(size=(50, 3)), np.ones((50, 2)), np.zeros((50, 0))
    few = symbolic.evaluate(function, *arrays)
    assert tape.usage_of(function).tape is None
    again = symbolic.evaluate(function, *(np.tile(a, (40, 1)) for a in arrays))
    assert tape.usage_of(function).tape is not None
    for one, many in zip(few, again, strict=True):
        np.testing.assert_array_equal(many, np.tile(one, (40, 1, 1)))


@pytest.mark.parametrize("seed", range(4))
def test_some_of_the_outputs_need_some_of_the_operations(seed: int) -> None:
    function, rng = random_function(seed), np.random.default_rng(seed)
    names = function.name_out()
    arrays = [rng.normal(size=(70, k)) for k in (3, 2, 0)]
    right, made = symbolic.call_casadi(function, arrays), tape.Tape.of(function)
    assert made is not None
    for outputs in ((0,), (2, 1), (1,), (2, 1, 0)):
        part = symbolic.selected(function, tuple(names[i] for i in outputs))
        kept = made.keep(outputs)
        assert len(kept.steps) <= part.n_instructions() + 6
        for i, found in zip(outputs, run(kept, part, arrays), strict=True):
            np.testing.assert_array_equal(found, right[i])


def test_one_reading_serves_a_function_and_its_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    function, reads = random_function(41), []
    monkeypatch.setattr(tape, "read_steps", lambda f, read=tape.read_steps: reads.append(f) or read(f))
    part = symbolic.Part(function, (function.name_out()[1],))
    arrays = np.random.default_rng(0).normal(size=(450, 3)), np.ones((450, 2)), np.zeros((450, 0))
    for _ in range(2):
        symbolic.evaluate(part, *arrays)
        symbolic.evaluate(function, *arrays)
        few = symbolic.evaluate(part, *(array[:2] for array in arrays))
    assert len(reads) == 1
    right = symbolic.call_casadi(part.function, list(arrays))
    np.testing.assert_array_equal(symbolic.evaluate(part, *arrays)[0], right[0])
    np.testing.assert_array_equal(few[0], right[0][:2])


def test_parts_without_a_tape_are_functions_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tape.Tape, "of", lambda function: None)
    function = random_function(43)
    part = symbolic.Part(function, tuple(function.name_out()[i] for i in (2, 0)))
    arrays = [np.random.default_rng(0).normal(size=(900, k)) for k in (3, 2, 0)]
    right = symbolic.call_casadi(function, arrays)
    for size in (2, 900):
        for i, found in zip((2, 0), symbolic.evaluate(part, *(array[:size] for array in arrays)), strict=True):
            np.testing.assert_array_equal(found, right[i][:size])
    assert symbolic.selected.cache_info().currsize > 0


def test_what_cannot_be_read_is_left_to_casadi(monkeypatch: pytest.MonkeyPatch) -> None:
    x = ca.SX.sym("x")
    whole = [random_function(3), ca.Function("erf", [x], [ca.erf(x) + x]), ca.Function("mod", [x], [ca.fmod(x, 0.3)])]
    matrix = ca.MX.sym("m", 2)
    whole.append(ca.Function("matrices", [matrix], [matrix + 1]))
    assert all(tape.Tape.of(function) is None for function in whole[1:])
    arrays = [np.linspace(0.1, 0.9, 900)[:, None]]
    exact = symbolic.call_casadi(whole[1], arrays)[0]
    np.testing.assert_array_equal(symbolic.evaluate(whole[1], *arrays)[0], exact)
    monkeypatch.setattr(ca.Function, "serialize", lambda self: "abc" * 1000)
    assert tape.Tape.of(whole[0]) is None


def test_operations_that_were_read_wrong_are_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slot out of range is seen at once, another operation by the first points."""
    function = random_function(5)
    steps = tape.read_steps(function)
    assert steps is not None
    for column, value in ((1, 10_000), (2, -1), (0, 77)):
        broken = steps.copy()
        broken[np.flatnonzero(np.isin(steps[:, 0], tape.BINARY))[7], column] = value
        monkeypatch.setattr(tape, "read_steps", lambda function, broken=broken: broken)
        assert tape.Tape.of(function) is None
    moved = steps.copy()
    moved[np.flatnonzero(steps[:, 0] == ca.OP_OUTPUT)[0], 2] = steps[np.flatnonzero(steps[:, 0] == ca.OP_INPUT)[0], 1]
    moved[np.isin(steps[:, 0], (ca.OP_ADD,)), 0] = ca.OP_SUB
    monkeypatch.setattr(tape, "read_steps", lambda function: moved)
    arrays = [np.random.default_rng(1).normal(size=(900, k)) for k in (3, 2, 0)]
    found = symbolic.evaluate(function, *arrays)
    assert tape.usage_of(function).tape is None
    for right, one in zip(symbolic.call_casadi(function, arrays), found, strict=True):
        np.testing.assert_array_equal(one, right)


def test_threads_do_not_share_their_numbers() -> None:
    function = random_function(7)
    made, rng = tape.Tape.of(function), np.random.default_rng(7)
    assert made is not None
    every = [[rng.normal(size=(5000, k)) for k in (3, 2, 0)] for _ in range(8)]
    alone = [run(made, function, arrays) for arrays in every]
    with ThreadPoolExecutor(4) as pool:
        for right, found in zip(alone, pool.map(lambda arrays: run(made, function, arrays), every), strict=True):
            for one, other in zip(right, found, strict=True):
                np.testing.assert_array_equal(one, other)
