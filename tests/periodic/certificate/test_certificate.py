"""Lyapunov certificates against what no X can exceed, against changes of A, and against an independent checker and its forgeries."""

import copy
import json

import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import NotCertified, NotStable
from flexlin.periodic import digest
from studies import check_certificate as checker
from tests.periodic.systems import lyapunov_transformed, meissner


def damped_meissner(t):
    return meissner(t) - np.diag([0.0, 0.3])


def narrow(t):
    pulse = np.exp(-(((np.mod(t, 1.0) - 0.4) / 0.01) ** 2))[:, None, None]
    return np.array([[0.0, 1.0], [-4.0, -0.4]]) + pulse * np.array([[0.0, 0.0], [3.0, 0.0]])


def transformed(seed, values):
    """A system whose exponents are the eigenvalues of a random non-normal matrix."""
    rng = np.random.default_rng(seed)
    constant = np.diag(values) + np.triu(rng.standard_normal((len(values),) * 2), 1)
    return fl.PeriodicSystem(lyapunov_transformed(constant, 2.0, 2, rng), np.pi)


def shaken_oscillators():
    """Six oscillators, coupled, from 2 to 400 rad/s, whose frequencies and dampings move."""
    rng, frequencies = np.random.default_rng(11), np.array([2.0, 2.3, 9.0, 60.0, 75.0, 400.0])
    couple, turn = (rng.standard_normal((6, 6)) for _ in range(2))
    K = np.diag(frequencies**2) + 0.3 * (couple + couple.T)
    D = np.diag([0.4, 0.5, 1.0, 8.0, 9.0, 40.0]) + 0.05 * (turn - turn.T)

    return fl.PeriodicSystem.from_second_order(
        np.eye(6),
        lambda t: D * (1 + 0.3 * np.sin(t))[:, None, None],
        lambda t: K * (1 + 0.1 * np.cos(t))[:, None, None],
        2 * np.pi,
    )


SYSTEMS = {
    "many": shaken_oscillators(),
    "constant": fl.PeriodicSystem([[0.0, 1.0], [-1.0, -0.2]], 1.0),
    "defective": fl.PeriodicSystem([[-0.5, 1.0, 0.0], [0.0, -0.5, 1.0], [0.0, 0.0, -0.5]], 1.0),
    "jumps": fl.PeriodicSystem(damped_meissner, np.pi, breaks=[0.0, np.pi / 3]),
    "non-normal": transformed(1, [-0.3, -1.0, -4.0]),
    "fast and slow": transformed(2, [-0.05, -300.0]),
    "narrow": fl.PeriodicSystem(narrow, 1.0),
}


@pytest.fixture(scope="module")
def certificates():
    return {name: (system, fl.floquet(system)) for name, system in SYSTEMS.items()}


@pytest.mark.slow
@pytest.mark.parametrize("name", SYSTEMS)
def test_inequality_holds_where_nobody_sampled(name, certificates):
    system, result = certificates[name]
    proof = result.certificate()
    decay = -result.exponents.real.max()
    assert 0.5 * decay < proof.margin <= 2 * decay * (1 + 1e-9)
    edges = proof.panels.edges
    t = np.sort(np.random.default_rng(3).uniform(0, system.period, 4000))
    t = t[np.abs(t[:, None] - edges).min(axis=1) > 1e-6 * system.period]
    X, A, h = proof.X(t), system.A(t), 1e-7 * system.period
    slope = (proof.X(t + h) - proof.X(t - h)) / (2 * h)
    left = slope + np.swapaxes(A, 1, 2) @ X + X @ A
    L = np.linalg.inv(np.linalg.cholesky(X))
    ratio = np.linalg.eigvalsh(L @ left @ np.swapaxes(L, 1, 2)).max()
    assert ratio <= -proof.margin + 1e-5 * max(1.0, np.abs(L @ slope @ np.swapaxes(L, 1, 2)).max())
    assert checker.holds(json.loads(json.dumps(proof.record())))


def test_a_constant_loop_is_proved_in_full_and_fast_modes_cost_neither_margin_nor_tolerance(certificates):
    assert certificates["constant"][1].certificate().margin == pytest.approx(0.2, rel=1e-5)
    result = certificates["many"][1]
    proof = result.certificate()
    assert proof.margin > 0.95 * 2 * -result.exponents.real.max()
    assert proof.tolerates > 3e-4 * proof.margin


def forged(record, rng):
    """A certificate with one thing changed."""
    bad = copy.deepcopy(record)
    kind = rng.choice(["X", "A", "margin", "tolerates", "edges", "error", "panel"])
    if kind in ("margin", "tolerates"):
        return bad | {kind: bad[kind] * (1.5 + rng.random())}
    name = "X" if kind == "panel" else kind
    values = np.array(bad[name])
    if kind == "X":
        i, j = rng.integers(len(values[0, 0]), size=2)
        values[rng.integers(len(values)), 0, [i, j], [j, i]] -= (1 + rng.random()) * np.abs(values[:, 0]).max()
    elif kind == "A":
        values[:, 0] += bad["margin"] * (0.5 + rng.random()) * np.eye(len(values[0, 0]))
    elif kind == "panel":
        values[rng.integers(len(values))] *= 1e6 if len(values) > 1 else -1
    else:
        values = -values if kind == "edges" else values + bad["margin"] * (10 + rng.random())
    return bad | {name: values.tolist()}


def signed(record):
    """Anew, by somebody who knows how."""
    said = {key: value for key, value in record.items() if key != "sha256"}
    return said | {"sha256": digest(said)}


@pytest.mark.slow
def test_checker_rejects_a_hundred_forgeries(certificates):
    """As they are, by their digest; signed anew, by the inequality."""
    rng = np.random.default_rng(7)
    records = [json.loads(json.dumps(certificates[name][1].certificate().record())) for name in ("non-normal", "jumps")]
    for k in range(100):
        bad = forged(records[k % 2], rng)
        assert not checker.holds(bad, 33)
        assert not checker.holds(signed(bad), 17)
        assert k > 1 or checker.holds(signed(records[k]))


@pytest.mark.parametrize(("growth", "verdict"), [(0.01, "unstable"), (0.0, "undecided")])
def test_no_certificate_without_stability(growth, verdict):
    with pytest.raises(NotCertified, match=verdict) as refused:
        fl.floquet(fl.PeriodicSystem([[0.0, 1.0], [-1.0, growth]], 1.0)).certificate()
    assert isinstance(refused.value, NotStable)  # as norms and responses say it
