"""Lyapunov transformations of random constant matrices D: rotated, sheared, stretched, in reparametrised and in kinked time.

The exponents are D's, exactly; the doubt is what the rounding of A to doubles does, measured in D's coordinates.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from tests.periodic.cases import Case, kind, tol_of
from tests.periodic.chains import Chain, Clock, Rotation, Shear, Stretch, Unipotent, Wave


@dataclass(frozen=True)
class Block:
    """A real block of D: its eigenvalues, the size of its Jordan chains and the coupling in them."""

    matrix: np.ndarray
    chain: int = 1
    coupling: float = 1.0


def real_parts(rng, style, period):
    if style == "wide":
        return rng.uniform(-690, 690) / period
    if style == "stiff":
        return -(10 ** rng.uniform(2, 7)) if rng.random() < 0.5 else rng.normal()
    return rng.choice(
        [rng.normal(), -(10 ** rng.uniform(-3, 1.5)), 10 ** rng.uniform(-3, 0.5), 10 ** rng.uniform(-9, -3)]
    )


def random_block(rng, style, period, room):
    """A real number, a complex pair (now and then on the axis, or at half a turn), or a Jordan chain of either."""
    a, w = real_parts(rng, style, period), 10 ** rng.uniform(-1, 1)
    pair, chain = room >= 2 and rng.random() < 0.4, 1
    if style == "jordan":
        chain = int(rng.integers(2, 4)) if room >= (6 if pair else 3) else 2 if room >= (4 if pair else 2) else 1
    if rng.random() < 0.1 and style != "wide":
        a = 0.0
    if pair and rng.random() < 0.1:
        w = np.pi / period * rng.choice([1.0, 1 + 1e-9, 2.0])
    coupling = 10 ** rng.uniform(-2, 1)
    base = np.array([[a, w], [-w, a]]) if pair else np.array([[a]])
    links = np.kron(np.eye(chain, k=1), coupling * np.eye(len(base)))
    return Block(np.kron(np.eye(chain), base) + links, chain, coupling)


def random_blocks(rng, n, style, period):
    blocks, size = [], 0
    while size < n:
        blocks.append(random_block(rng, style, period, n - size))
        size += len(blocks[-1].matrix)
    if n > 1 and len(blocks) > 1 and rng.random() < 0.1:  # the same exponents twice, without a chain
        same = [k for k in range(1, len(blocks)) if blocks[k].matrix.shape == blocks[0].matrix.shape]
        blocks = [blocks[0] if k in same[:1] else b for k, b in enumerate(blocks)]
    return blocks


def block_exponents(block):
    """The diagonal blocks' eigenvalues, in the order of the block's rows."""
    size = len(block.matrix) // block.chain
    a, w = block.matrix[0, 0], block.matrix[0, size - 1] if size == 2 else 0.0
    return np.tile([a + 1j * w, a - 1j * w][:size], block.chain)


def block_doubts(blocks, E):
    """First order in each block's share of E; the k-th root in a chain of k: |E c^(k-1)|^(1/k)."""
    doubts, at = [], 0
    for block in blocks:
        m = len(block.matrix)
        size = float(np.linalg.norm(E[at : at + m, at : at + m]))
        root = 2 * (block.chain * size * block.coupling ** (block.chain - 1)) ** (1 / block.chain)
        doubts += [2 * size + (root if block.chain > 1 else 0.0)] * m
        at += m
    return np.array(doubts)


def wave(rng, size, turns=False, harmonics=3):
    count = int(rng.integers(1, harmonics + 1))
    parts = size * rng.standard_normal((2, count)) / (1 + np.arange(count)) ** 1.5 / np.sqrt(2)
    return Wave(size * rng.normal(), int(rng.integers(-2, 3)) if turns else 0, *(tuple(p.tolist()) for p in parts))


def planes(rng, n):
    return (int(k) for k in rng.permutation(n)[:2])


def random_factors(rng, n, style):
    """The chain of P: first a constant basis, then what the style asks for; shears and stretches grow with the wanted condition."""
    if n == 1:
        return (Stretch(0, wave(rng, rng.uniform(0, 3))),)
    log_condition = rng.choice([rng.uniform(0, 1), rng.uniform(0, 6)])
    size = 10 ** (log_condition / 2) / n**0.5
    basis = [Rotation(*planes(rng, n), Wave(3.0 * rng.normal())) for _ in range(n)]
    basis += [Stretch(int(k), Wave(0.5 * rng.normal())) for k in range(n)]
    turns = [Rotation(*planes(rng, n), wave(rng, 0.7, turns=True)) for _ in range(max(1, n - 1))]
    shears = [Shear(*planes(rng, n), wave(rng, size)) for _ in range(2)]
    level = rng.integers(0, 3, n)
    up = np.subtract.outer(level, level) == 1  # one of three levels, so that N^3 = 0
    N = np.round(rng.standard_normal((n, n)), 3) * up
    powers = [Stretch(int(k), wave(rng, log_condition * 0.3)) for k in rng.permutation(n)[:2]]
    powers.append(Unipotent(N / n**0.5, wave(rng, min(size, 3.0))))
    last = {"rotation": turns, "shear": [*turns[:2], *shears], "exponential": [*turns[:2], *powers]}
    return (*basis, *last.get(style, [*turns[:3], *shears[:1], *powers[:2]]))


def smooth_clock(rng, period):
    count = int(rng.integers(1, 4))
    depth = rng.uniform(0.1, 1.2) * rng.dirichlet(np.ones(count))
    return Clock(period, tuple(depth.tolist()), tuple(rng.uniform(0, 6, count).tolist()))


def kinked_clock(rng, period):
    shape = str(rng.choice(["sine", "cube", "triangle", "square"], p=[0.4, 0.15, 0.3, 0.15]))
    start = float(rng.choice([0.0, rng.uniform(0, period)]))
    return Clock(period, (float(rng.uniform(0.1, 0.95)),), (), shape, start, float(rng.uniform(0.2, 0.8)))


def transformed(rng, factors="mixed", constants="plain", clock=None, named=False, largest=12, period=None):
    """A random D behind a random chain and clock."""
    period = float(10 ** rng.uniform(-1, 1.5)) if period is None else period
    n = int(rng.integers(2 if constants == "jordan" else 1, largest + 1))
    blocks = random_blocks(rng, n, constants, period)
    D = block_diag(*(b.matrix for b in blocks))
    while True:
        A = Chain(D, random_factors(rng, n, factors), Clock(period) if clock is None else clock(rng, period))
        if A.condition() <= 1e6:
            break
    exponents = np.concatenate([block_exponents(b) for b in blocks])
    doubt = block_doubts(blocks, A.rounding(rng)) + 2.0**-52 * np.abs(exponents)
    marginal = bool(exponents.real.max() == 0)
    return Case(A, period, exponents, doubt, tol_of(rng), A.clock.corners if named else (), {}, marginal)


for style in ("rotation", "shear", "exponential", "mixed"):
    kind(style, 1500)(lambda rng, style=style: transformed(rng, style))
kind("jordan", 1000)(lambda rng: transformed(rng, constants="jordan"))
kind("multipliers 1e-300 to 1e300", 1000)(lambda rng: transformed(rng, constants="wide"))
kind("reparametrised", 1000)(lambda rng: transformed(rng, clock=smooth_clock))
kind("kinks named", 500)(lambda rng: transformed(rng, clock=kinked_clock, named=True, largest=6))
kind("kinks not named", 500)(lambda rng: transformed(rng, clock=kinked_clock, largest=6))
kind("stiff", 500)(
    lambda rng: transformed(rng, constants="stiff", largest=5, period=float(10 ** rng.uniform(-0.5, 0.8)))
)
