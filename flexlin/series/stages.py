"""A tape cut into stages that can be computed to the last degree one after the other, so that series are held only while they are read."""

from dataclasses import dataclass

from flexlin.series.nodes import Angle, Choice, Integral, Node, Switch
from flexlin.series.tape import Tape


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
