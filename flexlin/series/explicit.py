"""Taylor maps of explicit functions, each series held in the variables that it depends on and computed to the degree that it reaches."""

from dataclasses import dataclass
from math import comb
from typing import Annotated, Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import Kind, checked, instance
from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError
from flexlin.series.engine import Tape, record_expressions
from flexlin.series.indices import TABLES, Indices, Polynomial, head_of, indices, kept_indices, shared_indices
from flexlin.series.nodes import Angle, Choice, Integral, Node, Product, Sum, Switch
from flexlin.series.space import Coefficients, Embedded, Numeric, whole
from flexlin.summary import represent
from flexlin.symbolic import as_expression


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


def is_expression(value: Any) -> bool:
    """Whether it is of CasADi."""
    return isinstance(value, (ca.SX, ca.MX, ca.DM))


Expression = Annotated[Any, Kind("a CasADi expression", is_expression)]


@dataclass(frozen=True)
class TaylorMap:
    """The Taylor polynomial of a matrix function.

        A(x0 + dx) ~ sum_k 1/k! D^k A(x0) (E_p (x) dx^(x)k)

    Call it with dx (n,) to get the value (m, p), or with dx (N, n) to get (N, m, p).

    Attributes
    ----------
    polynomial : Polynomial
        The coefficients, each monomial stored once.
    x0 : array, shape (n,)
        Where it is expanded.
    shape : tuple of int
        (m, p).

    Examples
    --------
    >>> import casadi as ca
    >>> import flexlin as fl
    >>> x = ca.SX.sym("x", 2)
    >>> P = fl.taylor(x[0] * x[1] ** 2, x, [1.0, 2.0], 3)
    >>> P([0.5, 0.0]).item(), P.derivative(1).tolist()
    (6.0, [[4.0, 4.0]])
    """

    polynomial: Polynomial
    x0: Array
    shape: tuple[int, int]

    __repr__ = represent

    @property
    def order(self) -> int:
        """The highest degree."""
        return self.polynomial.indices.order

    @checked
    def __call__(self, dx: ArrayLike) -> Array:
        """Return the values (m, p) at dx (n,), or (N, m, p) at dx (N, n)."""
        values = self.polynomial(dx)
        rows, columns = self.shape
        return values.reshape(*values.shape[:-1], columns, rows).swapaxes(-1, -2)

    def derivative(self, k: int) -> Array:
        """Return a derivative at x0 in Kronecker layout.

        Parameters
        ----------
        k : int
            Its order, at most that of the map.

        Returns
        -------
        array, shape (m, p n^k)
            D^k A(x0).

        Raises
        ------
        ArgumentError
            For an order that is not known.
        TooLarge
            When the layout would not fit into memory.

        References
        ----------
        Khang, Dat, Tuan (2019), Eqs (15), (18).
        """
        rows, columns = self.shape
        return self.polynomial.kronecker(k).reshape(columns, rows, -1).swapaxes(0, 1).reshape(rows, -1)

    def function(self) -> ca.Function:
        """Return the polynomial as a CasADi function.

        Returns
        -------
        casadi.Function
            dx (n,) -> A (m, p).
        """
        dx = ca.SX.sym("dx", len(self.x0))
        return ca.Function("taylor", [dx], [ca.reshape(self.polynomial.expression(dx), *self.shape)], ["dx"], ["A"])


@checked
def taylor(A: Expression, x: Expression, x0: ArrayLike, order: int) -> TaylorMap:
    """Expand a scalar, vector or matrix function of a vector.

        A(x0 + dx) ~ A(x0) + sum_(k=1..order) 1/k! D^k A(x0) (E_p (x) dx^(x)k)

    by truncated power series on the expression's own operations; each mixed derivative is computed and stored once.
    Assumes that A is analytic at x0.

    Parameters
    ----------
    A : casadi.SX or casadi.MX, shape (m, p)
        An expression of x only.
    x : casadi.SX or casadi.MX, shape (n, 1)
        A column of symbols.
    x0 : array_like, shape (n,)
        Where to expand.
    order : int
        The highest degree, from 0 on.

    Returns
    -------
    TaylorMap
        P: P(dx) (m, p), P.derivative(k) (m, p n^k), P.function().

    Raises
    ------
    ArgumentError
        On shapes, free symbols, and operations or points without a power series.
    TooLarge
        When the coefficients would not fit into memory; the message gives the bytes.

    References
    ----------
    Khang, Dat, Tuan (2019), Eqs (36), (41), (47).

    Examples
    --------
    >>> import casadi as ca
    >>> import numpy as np
    >>> import flexlin as fl
    >>> x = ca.SX.sym("x")
    >>> P = fl.taylor(ca.sin(x), x, [0.0], 7)
    >>> print(f"{P([0.5]).item():.8f} {np.sin(0.5):.8f}")
    0.47942553 0.47942554
    """
    check_symbols("x", x)
    A = A if isinstance(A, ca.MX) else as_expression("A", A)
    point = real_array("x0", x0, (x.numel(),))
    tape = record_expressions("A", [ca.vec(A)], [x])
    table = indices(x.numel(), order, bytes_of(tape, len(point), max(order, 0)))
    coefficients = np.array(expand_by_support(tape, point, order)).T.reshape(table.size, -1)
    check_analytic(coefficients, "x0", point)
    return TaylorMap(Polynomial(table, coefficients), point, A.shape)


def check_symbols(name: str, x: Any) -> None:
    """Check that x is a column of symbols."""
    instance(name, x, (ca.SX, ca.MX), "give a vector of CasADi symbols")
    if not (isinstance(x, ca.SX | ca.MX) and x.is_column() and x.is_valid_input() and x.numel()):
        raise ArgumentError(f"{name} is not a column of symbols", got=x, expected="SX.sym or MX.sym of shape (n, 1)")


def check_analytic(coefficients: Array, name: str, point: Array) -> None:
    """Refuse a point where the series does not exist."""
    if not np.all(np.isfinite(coefficients)):
        raise ArgumentError(
            "the expression has no power series here", got=f"{name} = {point.tolist()}", todo="move the point"
        )
