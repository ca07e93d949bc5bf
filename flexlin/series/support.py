"""Explicit series, each held in the variables that it depends on and computed to the degree that it reaches."""

from dataclasses import dataclass
from math import comb

import numpy as np

from flexlin.checks import Array
from flexlin.series.embedding import Coefficients, Embedded, whole
from flexlin.series.engine import Tape
from flexlin.series.indices import TABLES, Indices, head_of, kept_indices, shared_indices
from flexlin.series.nodes import Angle, Choice, Integral, Node, Product, Sum, Switch
from flexlin.series.space import Numeric


@dataclass(frozen=True)
class Stage:
    """Operations of which some read lower degrees of a later one, such as sine and cosine; `over`: nodes that are not read again."""

    operations: list[tuple[int, Node]]
    over: list[int]


def find_stages(tape: Tape) -> list[Stage]:
    """Return the shortest stages of a tape, in its order."""
    places = {node: i for i, (node, _) in enumerate(tape.operations)}
    groups, end = list[list[tuple[int, Node]]](), -1
    for i, (node, operation) in enumerate(tape.operations):
        if i > end:
            groups.append([])
        groups[-1].append((node, operation))
        end = max(end, i, *(places.get(one, -1) for one in nodes_read(operation)))
    last = dict[int, int]()
    for i, group in enumerate(groups):
        for node, operation in group:
            last.update(dict.fromkeys((node, *nodes_read(operation)), i))
    over = [list[int]() for _ in groups]
    for node in last.keys() - set(tape.outputs[0]):
        over[last[node]].append(node)
    return [Stage(group, sorted(done)) for group, done in zip(groups, over, strict=True)]


def nodes_read(operation: Node) -> tuple[int, ...]:
    """Return all nodes whose series an operation reads, but its own."""
    if isinstance(operation, Integral):
        return (*operation.operands, operation.slope)
    if isinstance(operation, Angle):
        return (*operation.operands, *operation.slopes)
    if isinstance(operation, Switch):
        return operation.read
    if isinstance(operation, Choice):
        return (*operation.operands, operation.switch)
    return operation.operands


@dataclass(frozen=True)
class Support:
    """Which variables a node depends on, and the highest degree it has (at most the order)."""

    variables: tuple[int, ...]
    reach: int

    def indices(self, n: int, order: int) -> Indices:
        """Return the indices of these variables among n, divided as all n are."""
        head = sum(i < head_of(n) for i in self.variables)
        return kept_indices(head, len(self.variables) - head, order)


def find_supports(tape: Tape, order: int) -> list[Support]:
    """Return the support of each node of a tape with one input, its entries being the variables."""
    supports = [Support((), 0)] * tape.size
    for i, node in enumerate(tape.inputs[0]):
        supports[node] = Support((i,), min(1, order))
    for node, operation in tape.operations:
        read = [supports[i] for i in operation.operands]
        variables = tuple(sorted({i for one in read for i in one.variables}))
        supports[node] = Support(variables, min(order, reach_of(operation, [one.reach for one in read], order)))
    return supports


def reach_of(operation: Node, reaches: list[int], order: int) -> int:
    """Return the highest degree of a result, from those of its operands."""
    if isinstance(operation, Product):
        return sum(reaches)
    if isinstance(operation, Sum | Choice):
        return max(reaches)
    return order if any(reaches) else 0


@dataclass(frozen=True)
class Reading:
    """The series of a tape as one node reads them: in the variables of that node."""

    series: list[Array]
    supports: list[Support]
    node: int
    spaces: list[Numeric]

    def __getitem__(self, i: int) -> Coefficients:
        own, wider = self.supports[i].variables, self.supports[self.node].variables
        if own == wider or not set(own) <= set(wider):
            return self.series[i]
        among = tuple(wider.index(j) for j in own)
        sizes = self.spaces[i].indices, self.spaces[self.node].indices
        return Embedded(self.series[i], *sizes, among, self.supports[i].reach)


@np.errstate(all="ignore")
def expand_by_support(tape: Tape, point: Array, order: int) -> list[Array]:
    """Return the series of all outputs in all variables of the tape's one input; nan or infinite where they do not exist."""
    supports = find_supports(tape, order)
    spaces = [Numeric(one.indices(len(point), order)) for one in supports]
    series = [np.zeros(0)] * tape.size
    for node, value in zip(tape.inputs[0], point, strict=True):
        series[node] = spaces[node].zero()
        series[node][: min(2, len(series[node]))] = [value, 1.0][: len(series[node])]
    for node, value in tape.constants.items():
        series[node] = np.array([value])
    for stage in find_stages(tape):
        for node, operation in stage.operations:
            series[node] = spaces[node].zero()
            series[node][:1] = operation.value(spaces[node], Reading(series, supports, node, spaces))
        for k in range(1, order + 1):
            for node, operation in stage.operations:
                if k <= supports[node].reach:
                    part = operation.part(spaces[node], Reading(series, supports, node, spaces), k)
                    series[node][spaces[node].indices.degree(k)] = part
        for node in stage.over:
            series[node] = np.zeros(0)
    wide = shared_indices(len(point), order)
    return [whole(Embedded(series[i], spaces[i].indices, wide, supports[i].variables, order)) for i in tape.outputs[0]]


def bytes_of(tape: Tape, n: int, order: int) -> int:
    """Return the memory that the series of a tape in n variables that are needed at once, its outputs and one product take."""
    sizes = [comb(len(one.variables) + order, order) for one in find_supports(tape, order)]
    held = most = sum(sizes[i] for i in tape.inputs[0])
    for stage in find_stages(tape):
        held += sum(sizes[node] for node, _ in stage.operations)
        most = max(most, held)
        held -= sum(sizes[node] for node in stage.over)
    return 8 * (most + (2 * len(tape.outputs[0]) + 2) * comb(n + order, order) + TABLES)
