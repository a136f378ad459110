"""Taylor coefficients of solutions, by recurrences on a graph that the equations of motion record.

A `Graph` makes nodes that know arithmetic. Evaluating `vector_field.vector_field` on them once
records its elementary operations. Each operation has a recurrence for the Taylor coefficients of
its result (Moore 1966, ch. 11; Griewank and Walther, *Evaluating Derivatives*, ch. 13). For a
product it is a convolution; sine and cosine follow from each other. Partial derivatives are
recorded on the same graph in reverse order (`Graph.gradient`), so the variational equations need no
transcription (`systems_with_derivatives`).

Besides sine and cosine there is the pair S = sin(a x) / a, C = cos(a x) with q = a^2
(`Graph.scaled_sine`). Along an orbit, without a division by a,

    S' = C x',   C' = -q S x',   dC/dq = -x S / 2,
    D' = (dC/dq) x' = -(x S) x' / 2   for D = dS/dq.

`jets.scaled_sine` gives their first coefficients.

On balls every coefficient is an enclosure: each step of a recurrence is an operation on balls,
Arb's or those of `ball_array`, which are inclusion-isotone. No ball is replaced by a point, a float
or a midpoint in this file. An arithmetic with its own sequences (``series``) sums its convolutions
itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from fractions import Fraction
from operator import add, mul, sub
from typing import Any

from tippedisk_verify.proofs.kernel.jets import scaled_sine

__all__ = ["Graph", "Node", "System", "systems_with_derivatives"]


_SINE_AND_COSINE = ("sin", "cos")


def _operation(kind: str, *, reflected: bool = False) -> Callable[[Node, Any], Node]:
    """Return a method of `Node` for an arithmetic operator, which adds the operation to the graph.

    If ``reflected``, the node is the right operand.
    """

    def record(node: Node, other: Any) -> Node:
        left, right = (node.graph.number(other), node) if reflected else (node, other)
        return node.graph.operation(kind, left, right)

    return record


class Node:
    """One operation in a graph, with the Taylor coefficients of its result that are known so far.

    A constant has one coefficient.
    """

    __slots__ = ("active", "coefficients", "constant", "graph", "kind", "left", "partner", "right")

    def __init__(self, graph: Graph, kind: str, left: Any = None, right: Any = None) -> None:
        self.graph, self.kind, self.left, self.right = graph, kind, left, right
        # The sine of an angle, the cosine of a sine, the sine of a cosine
        self.partner: Any = None
        self.coefficients: list[Any] = []
        parts: list[Node] = [part for part in (left, right) if isinstance(part, Node)]
        self.constant: bool = bool(parts) and all(part.constant for part in parts)
        self.active: bool = any(part.active for part in parts)
        graph.nodes.append(self)

    __add__ = __radd__ = _operation("add")
    __sub__, __rsub__ = _operation("subtract"), _operation("subtract", reflected=True)
    __mul__ = __rmul__ = _operation("multiply")
    __truediv__, __rtruediv__ = _operation("divide"), _operation("divide", reflected=True)

    def __neg__(self) -> Node:
        return self.graph.operation("multiply", self, -1)


class Graph:
    """A record of the arithmetic by which the rates of motion are computed, for Taylor recurrences.

    Its nodes are the operations in the order in which they were recorded. The graph also provides
    the sine and cosine (``ops``) that `vector_field.vector_field` needs.
    """

    def __init__(self) -> None:
        self.nodes: list[Node] = []

    def variable(self) -> Node:
        """Add an unknown function of time to the graph, and return its node.

        A `System` provides the Taylor coefficients of the function.
        """
        node = Node(self, "variable")
        node.active = True
        return node

    def number(self, value: Any, *, active: bool = False) -> Node:
        """Add a constant to the graph, and return its node. A node is returned unchanged.

        `gradient` may differentiate with respect to an ``active`` constant.
        """
        if isinstance(value, Node):
            return value
        node = Node(self, "number")
        node.constant, node.active, node.coefficients = True, active, [value]
        return node

    def operation(self, kind: str, left: Node, right: Any) -> Node:
        if kind == "multiply" and isinstance(right, int) and right == 1:
            return left
        node = Node(self, kind, left, self.number(right))
        if node.constant:
            node.coefficients = [
                _ON_CONSTANTS[kind](left.coefficients[0], node.right.coefficients[0])
            ]
        return node

    def sin(self, angle: Node) -> Any:
        return self.scaled_sine(angle, None)

    def cos(self, angle: Node) -> Any:
        return self.sin(angle).partner

    def scaled_sine(self, angle: Node, square: Node | None) -> Any:
        """Add sin(a x) / a and cos(a x) of an ``angle`` x to the graph, and return the node of the
        first.

        The cosine is the node's ``partner``. ``square`` is the constant a^2; without it a = 1. An
        angle whose sine is in the graph already gets the same node again.
        """
        if angle.partner is None:
            sine, cosine = Node(self, "sin", angle, square), Node(self, "cos", angle, square)
            angle.partner, sine.partner, cosine.partner = sine, cosine, sine
        return angle.partner

    def gradient(self, output: Node, inputs: Sequence[Node]) -> list[Node]:
        """Add the partial derivatives of ``output`` with respect to ``inputs`` to the graph, and
        return their nodes.

        The inputs are variables and active numbers.
        """
        adjoints: dict[Node, Any] = {output: 1}

        def add_to_adjoint(node: Node, contribution: Any) -> None:
            if node.active:
                adjoints[node] = adjoints[node] + contribution if node in adjoints else contribution

        # The list grows while it is read. The new entries are the adjoints' own operations, which
        # are not part of the output.
        for node in reversed(self.nodes[: self.nodes.index(output) + 1]):
            if node not in adjoints or node.left is None:
                continue
            bar = adjoints[node]
            if node.kind in ("add", "subtract"):
                add_to_adjoint(node.left, bar)
                add_to_adjoint(node.right, bar if node.kind == "add" else -bar)
            elif node.kind == "multiply":
                add_to_adjoint(node.left, node.right * bar)
                add_to_adjoint(node.right, node.left * bar)
            elif node.kind == "divide":
                contribution = bar / node.right
                add_to_adjoint(node.left, contribution)
                add_to_adjoint(node.right, -(node * contribution))
            else:
                angle, square, contribution = node.left, node.right, node.partner * bar
                if node.kind == "cos":
                    contribution = -contribution if square is None else -(square * contribution)
                add_to_adjoint(angle, contribution)
                if square is not None and square.active:
                    slope = (angle * node.partner) / -2
                    if node.kind == "sin":
                        slope = Node(self, "slope", angle * node, square)
                        slope.partner = angle
                    add_to_adjoint(square, slope * bar)
        return [self.number(adjoints.get(node, 0)) for node in inputs]


def systems_with_derivatives(
    graph: Graph, variables: Sequence[Node], numbers: Sequence[Node], rates: Sequence[Node]
) -> tuple[System, System]:
    """Return two systems of equations for the states and their derivatives, without and with the
    divergence's integral as a further unknown.

    The derivatives are those with respect to each variable at the start and each active number.
    Each of these adds a column of as many unknowns as there are variables.
    """
    partials = [graph.gradient(rate, [*variables, *numbers]) for rate in rates]
    unknowns, slopes = [*variables], [*rates]
    for column in range(len(variables) + len(numbers)):
        tangent = [graph.variable() for _ in variables]
        unknowns += tangent
        for row in partials:
            terms = [
                part * side for part, side in zip(row, tangent, strict=False) if not _is_zero(part)
            ]
            if column >= len(variables) and not _is_zero(row[column]):
                terms.append(row[column])
            slopes.append(_sum_of_nodes(graph, terms))
    divergence = _sum_of_nodes(
        graph, [part for k, row in enumerate(partials) if not _is_zero(part := row[k])]
    )
    plain = System(graph, unknowns, slopes)
    return plain, System(graph, [*unknowns, graph.variable()], [*slopes, divergence])


def _sum_of_nodes(graph: Graph, terms: Sequence[Node]) -> Node:
    return sum(terms[1:], terms[0]) if terms else graph.number(0)


def _is_zero(node: Node) -> bool:
    return node.constant and isinstance(node.coefficients[0], int) and node.coefficients[0] == 0


class System:
    """An initial value problem x' = rates(x), recorded in a graph, whose Taylor coefficients can be
    computed.

    Its variables and rates are nodes of the graph.
    """

    def __init__(self, graph: Graph, variables: Sequence[Node], rates: Sequence[Node]) -> None:
        self.variables, self.rates = tuple(variables), tuple(rates)
        needed = _ancestors(self.rates)
        varying = [node for node in graph.nodes if node in needed and not node.constant]
        if any(node.kind == "variable" and node not in self.variables for node in varying):
            raise ValueError("a rate depends on a variable without a rate")
        convolved = {part for node in varying for part in _nodes_convolved_by(node)}
        inner = [node for node in varying if node.kind != "variable"]
        self._nodes_with_history = [node for node in inner if node in convolved]
        # only their latest coefficient is needed
        self._nodes_without_history = [node for node in inner if node not in convolved]
        self._recurrences = [
            recurrence for node in varying if (recurrence := _recurrence(node)) is not None
        ]

    def coefficients(self, start: Sequence[Any], order: int) -> list[list[Any]]:
        """Return Taylor coefficients 0 … ``order`` at time 0 of each variable of the initial value
        problem, from enclosed starts.
        """
        empty = getattr(start[0], "series", _new_series)
        with getattr(start[0], "ignoring_numpy_warnings", nullcontext)():
            for node in self._nodes_with_history:
                node.coefficients = empty(node.coefficients)
            for variable in self.variables:  # new lists: the caller keeps them
                variable.coefficients = empty()
            for node in self._nodes_without_history:
                node.coefficients = []
            for variable, value in zip(self.variables, start, strict=True):
                variable.coefficients.append(value)
            zero = 0 * start[0]
            for k in range(order):
                for recurrence in self._recurrences:
                    recurrence(k)
                for variable, rate in zip(self.variables, self.rates, strict=True):
                    if rate.constant:
                        variable.coefficients.append(zero if k else rate.coefficients[0] + zero)
                    else:
                        variable.coefficients.append(rate.coefficients[k] / (k + 1))
                for node in self._nodes_without_history:
                    node.coefficients[k] = None
        return [variable.coefficients for variable in self.variables]


def _new_series(_: object = None) -> list[Any]:
    return []


def _quotient(a: Any, b: Any) -> Any:
    """Return a / b; a quotient of integers stays exact, as a Fraction."""
    return Fraction(a, b) if isinstance(a, int) and isinstance(b, int) else a / b


#: The operations on two constants, by kind
_ON_CONSTANTS = {"add": add, "subtract": sub, "multiply": mul, "divide": _quotient}


def _ancestors(nodes: Sequence[Node]) -> set[Node]:
    ancestors: set[Node] = set()
    open_nodes = list(nodes)
    while open_nodes:
        node = open_nodes.pop()
        if node not in ancestors:
            ancestors.add(node)
            # A sine's recurrence needs the cosine, and the other way round. A variable has a
            # partner that it does not need.
            partner = node.partner if node.kind in (*_SINE_AND_COSINE, "slope") else None
            open_nodes += [
                part for part in (node.left, node.right, partner) if isinstance(part, Node)
            ]
    return ancestors


def _nodes_convolved_by(node: Node) -> tuple[Node, ...]:
    """Return the nodes whose coefficients of all orders the recurrence of ``node`` needs."""
    if node.kind in _SINE_AND_COSINE:
        return (node,)
    if node.kind == "slope":
        return (node.left,)
    if node.kind == "divide" and not node.right.constant:
        return node, node.right
    if node.kind == "multiply" and not node.left.constant and not node.right.constant:
        return node.left, node.right
    return ()


def _recurrence(node: Node) -> Callable[[int], None] | None:
    """Return the function that computes and appends coefficient k of a node's Taylor series, or
    None.

    There is one case for each kind of operation. The function needs the operands' coefficients up
    to k and the node's own up to k - 1. The result is None for a variable and for a cosine, whose
    coefficients are appended by other functions.
    """
    kind, x, y = node.kind, node.left, node.right

    if kind in ("variable", "cos"):  # a variable's come from its rate, a cosine's with its sine
        return None
    if kind in ("sin", "slope"):
        return _sine_recurrence(node) if kind == "sin" else _scaled_sine_slope_recurrence(node)
    if kind == "divide":
        if y.constant:
            return lambda k: node.coefficients.append(x.coefficients[k] / y.coefficients[0])

        def divide(k: int) -> None:
            dividend = x.coefficients[k] if not x.constant else x.coefficients[0] if k == 0 else 0
            node.coefficients.append(
                (dividend - _convolution(y.coefficients[1:], node.coefficients)) / y.coefficients[0]
            )

        return divide
    if kind == "multiply":
        if x.constant:
            x, y = y, x
        if y.constant:
            return lambda k: node.coefficients.append(x.coefficients[k] * y.coefficients[0])
        if x is y:
            return lambda k: node.coefficients.append(_square(x.coefficients, k))
        return lambda k: node.coefficients.append(_convolution(x.coefficients, y.coefficients))
    sign = 1 if kind == "add" else -1
    if y.constant:
        return lambda k: node.coefficients.append(
            x.coefficients[k] if k else x.coefficients[0] + sign * y.coefficients[0]
        )
    if x.constant:
        return lambda k: node.coefficients.append(
            x.coefficients[0] + sign * y.coefficients[0] if k == 0 else sign * y.coefficients[k]
        )
    if kind == "add":
        return lambda k: node.coefficients.append(x.coefficients[k] + y.coefficients[k])
    return lambda k: node.coefficients.append(x.coefficients[k] - y.coefficients[k])


def _sine_recurrence(node: Node) -> Callable[[int], None]:
    """Return the function that appends Taylor coefficient k to a sine S and to its cosine C.

    Along an orbit S' = C x' and C' = -q S x', where x is the angle and q = 1 unless S is scaled.
    """
    x, square, cosine = node.left, node.right, node.partner
    slopes: Any = []

    def sine(k: int) -> None:
        nonlocal slopes
        if k == 0:
            slopes, start = (
                getattr(x.coefficients[0], "series", _new_series)(slopes),
                x.coefficients[0],
            )
            first = (
                (start.sin(), start.cos())
                if square is None
                else scaled_sine(start, square.coefficients[0])[:2]
            )
            node.coefficients.append(first[0])
            cosine.coefficients.append(first[1])
        else:
            slopes.append(k * x.coefficients[k])
            rise, fall = (
                _convolution(slopes, cosine.coefficients),
                _convolution(slopes, node.coefficients),
            )
            node.coefficients.append(rise / k)
            cosine.coefficients.append(
                -(fall if square is None else square.coefficients[0] * fall) / k
            )

    return sine


def _scaled_sine_slope_recurrence(node: Node) -> Callable[[int], None]:
    """Return the function that appends Taylor coefficient k to D = dS/dq, S = sin(a x) / a, q =
    a^2.

    Along an orbit D' = -(x S) x' / 2, and the operand ``left`` of the node is x S.
    """
    product, x, square = node.left, node.partner, node.right
    slopes: Any = []

    def slope(k: int) -> None:
        nonlocal slopes
        if k == 0:
            slopes = getattr(x.coefficients[0], "series", _new_series)()
            node.coefficients.append(scaled_sine(x.coefficients[0], square.coefficients[0])[2])
        else:
            slopes.append(k * x.coefficients[k])
            node.coefficients.append(_convolution(slopes, product.coefficients[:k]) / (-2 * k))

    return slope


def _convolution(a: Sequence[Any], b: Sequence[Any]) -> Any:
    """Return a_0 b_n + … + a_n b_0 for two sequences of the same length (0 for empty ones)."""
    fused = getattr(a, "convolution", None)
    return fused(b) if fused else sum(map(mul, a, reversed(b)))


def _square(a: Sequence[Any], k: int) -> Any:
    """Return coefficient k of the square of the power series a, computing products that occur twice
    only once.
    """
    if hasattr(a, "convolution"):
        return a.convolution(a)
    half = 2 * sum(map(mul, a[: (k + 1) // 2], a[: k - (k + 1) // 2 : -1])) if k else 0
    return half if k % 2 else half + a[k // 2] * a[k // 2]
