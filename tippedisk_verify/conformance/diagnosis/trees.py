"""Syntax trees: where expressions are in a function, how they are shown, and which of its statements may be wrong.

A `Place` is an expression that may change, a `Suspect` a statement whose value moves what is wrong, and a `Cause` a
change that gives all answers.
"""

from __future__ import annotations

import ast
import copy
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from tippedisk_verify.conformance.diagnosis.specimen import Program

__all__ = [
    "Cause",
    "Change",
    "Node",
    "Place",
    "Suspect",
    "fixed",
    "is_binary",
    "kind",
    "places",
    "same",
    "scope",
    "shown",
    "sort_of",
    "statements",
    "substituted",
    "terms",
    "values",
]

Node = Any  # nodes of the syntax tree, whose classes have no common attributes
Path = tuple[tuple[Node, str, int | None], ...]  #: from the function down: node, field, index
_LONG = 80  # characters, after which it is no longer said what something is missing in


@dataclass(frozen=True)
class Change:
    """What may stand in place of a node."""

    node: Node
    said: str = ""  #: of the term around it; "" for "NEW for OLD"
    rank: int = 0
    operator: str = "left out"


@dataclass(frozen=True)
class Place:
    """An expression in a function, with the way down to it."""

    function: ast.FunctionDef | ast.Assign
    statement: Node
    path: Path

    @property
    def node(self) -> Node:
        return _child(*self.path[-1])

    def replaced(self, new: Node) -> Any:
        """The function with ``new`` there; what is not on the way is shared."""
        for parent, field, index in reversed(self.path):
            upper = copy.copy(parent)
            if index is None:
                setattr(upper, field, new)
            else:
                items = list(getattr(upper, field))
                items[index : index + 1] = [new] if new is not None else []
                setattr(upper, field, items)
            new = upper
        return new

    def within(self, outer: Place, new: Node) -> Node:
        """The expression of a place around this one, with ``new`` here."""
        inner = Place(self.function, None, self.path[len(outer.path) :])
        return inner.replaced(new) if inner.path else new

    def term(self) -> Place:
        """The term of a sum, the argument or the whole right side that the expression is a part of."""
        path = self.path
        while len(path) > 1 and kind(path[-1][0], ast.BinOp | ast.UnaryOp):
            if kind(path[-1][0], ast.BinOp) and kind(path[-1][0].op, ast.Add | ast.Sub):
                break
            path = path[:-1]
        return Place(self.function, self.statement, path)

    def lines(self, new: Node) -> tuple[str, str]:
        """The statement's first line as it is, and as it is with ``new`` here."""
        start = max(n for n, (parent, _, _) in enumerate(self.path) if kind(parent, ast.stmt) or n == 0)
        statement = self.path[start][0]
        changed = Place(self.function, None, self.path[start:]).replaced(new)
        before, after = map(ast.unparse, map(ast.fix_missing_locations, copy.deepcopy((statement, changed))))
        return before.partition("\n")[0], after.partition("\n")[0]

    def says(self, change: Change) -> str:
        """What is wrong, in the symbols of the formula."""
        around = self.term()
        powers = any(is_binary(parent, ast.Pow) for parent, _, _ in self.path[len(around.path) :])
        if change.said and not (powers and "{term}" in change.said):  # what is in a power is no factor of the term
            old = shown(self.node)
            said = change.said if len(old) < _LONG else change.said.replace(" in {old}", "")
            return said.replace("{old}", old).replace("{term}", shown(around.node))
        inner = Place(around.node, None, self.path[len(around.path) :])
        new = inner.replaced(change.node) if inner.path else change.node
        return f"{shown(new)} for {shown(around.node)}"


def _child(parent: Node, field: str, index: int | None) -> Node:
    child = getattr(parent, field)
    return child if index is None else child[index]


def shown(node: Node) -> str:
    """An expression as one writes it: powers with ^, products with a space."""
    text = ast.unparse(ast.fix_missing_locations(copy.deepcopy(node)) if not kind(node, ast.expr) else node)
    text = re.sub(r"\bnp\.", "", text).replace(" ** ", "^").replace(" * ", " ")
    return text if len(text) < 160 else text[:150] + " ..."


def statements(function: ast.FunctionDef | ast.Assign) -> Iterator[tuple[Node, Path]]:
    """The statements of a function with a value, at any depth."""
    if kind(function, ast.Assign):
        yield function, ()
        return

    def inside(parent: Node, path: Path) -> Iterator[tuple[Node, Path]]:
        for field in ("body", "orelse"):
            for index, child in enumerate(getattr(parent, field, ())):
                down = (*path, (parent, field, index))
                if not (kind(child, ast.Expr) and kind(child.value, ast.Constant)):
                    yield child, down
                if kind(child, ast.For | ast.If | ast.While | ast.With):
                    yield from inside(child, down)

    yield from inside(function, ())


def places(function: ast.FunctionDef | ast.Assign, statement: Node, path: Path) -> Iterator[Place]:
    """All expressions of a statement, but not those of the statements inside it."""

    def inside(node: Node, path: Path) -> Iterator[Place]:
        for field, value in ast.iter_fields(node):
            many = value if kind(value, list) else [value]
            hidden = field in ("body", "orelse") and kind(node, ast.stmt)
            hidden = hidden or (field == "func" and not kind(value, ast.Attribute))
            hidden = hidden or (field in ("targets", "target") and not kind(many[0], ast.Subscript))
            for index, child in enumerate(() if hidden else many):
                if kind(child, ast.expr | ast.comprehension):
                    down = (*path, (node, field, index if kind(value, list) else None))
                    if kind(child, ast.expr):
                        yield Place(function, statement, down)
                    yield from inside(child, down)

    yield from inside(statement, path)


def kind(node: Node, kinds: Any) -> bool:
    """isinstance, without a narrower type: nodes are told apart by their fields."""
    return isinstance(node, kinds)


def is_binary(node: Node, *operators: Any) -> bool:
    return kind(node, ast.BinOp) and kind(node.op, operators)


def sort_of(node: Node) -> Any:
    """What a pattern and a node that it fits have in common; None for a variable, which fits more."""
    if kind(node, ast.BinOp | ast.UnaryOp):
        return type(node.op)
    return None if kind(node, ast.Name) and len(node.id) == 1 else type(node)


def same(one: Node, other: Node) -> bool:
    return one is other or (sort_of(one) == sort_of(other) and ast.dump(one) == ast.dump(other))


class _Substitution(ast.NodeTransformer):
    def __init__(self, values: Mapping[str, Node]) -> None:
        self.values = values

    def visit_Name(self, node: ast.Name) -> Node:
        return self.values.get(node.id, node) if kind(node.ctx, ast.Load) else node


def substituted(node: Node, values: Mapping[str, Node]) -> Node:
    """The same with expressions in place of names."""
    return _Substitution(values).visit(copy.deepcopy(node))


def fixed(node: Any) -> Any:
    """With line numbers where nodes are new; below old ones there are none."""
    if isinstance(node, ast.expr | ast.stmt | ast.keyword) and not hasattr(node, "lineno"):
        node.lineno = node.end_lineno = 1
        node.col_offset = node.end_col_offset = 0
        for child in ast.iter_child_nodes(node):
            fixed(child)
    return node


@dataclass(frozen=True)
class Cause:
    """A change that gives all answers."""

    says: str
    rank: float
    name: str = ""
    function: str = ""  #: of the specimen that is changed
    before: str = ""  #: its line as it is
    after: str = ""  #: and as it would be
    program: Program | None = None

    @property
    def where(self) -> str:
        return self.says.partition(": ")[0]


@dataclass(frozen=True)
class Suspect:
    """A statement, or one element of it, that moves what is wrong."""

    function: str
    place: Place  #: of its value
    label: str  #: what it computes
    also: int  #: how many of the quantities without a wrong answer it moves

    @property
    def where(self) -> str:
        known = self.function in ("equations", "derivatives") and self.label
        if known and re.fullmatch(r"h_\d", self.label):  # of the right-hand side; the slow manifold has an h_5 as well
            return f"term {self.label} of h"
        return self.label if known else f"{self.label or 'the result'} ({self.function})"

    def cause(self, spot: Place, change: Change, program: Program) -> Cause:
        """What is said of a change in this statement."""
        says, lines = f"in {self.where}: {spot.says(change)}", spot.lines(change.node)
        return Cause(says, change.rank, change.operator, self.function, *lines, program)


def values(function: Any, statement: Any, path: Any) -> Iterator[tuple[Place, str]]:
    """The values that a statement computes, each with what it is called: of a tuple or dictionary each element."""
    value = getattr(statement, "value", None)
    if value is None:
        for name in ("iter", "test"):
            if hasattr(statement, name):
                yield Place(function, statement, (*path, (statement, name, None))), name
        return
    if isinstance(statement, ast.Assign):
        label = ", ".join(map(shown, statement.targets))
    elif isinstance(statement, ast.AugAssign):
        label = shown(statement.target)
    else:
        label = ""
    whole = Place(function, statement, (*path, (statement, "value", None)))
    if isinstance(statement, ast.Expr) and isinstance(value, ast.Call):
        for index in range(len(value.args)):
            yield Place(function, statement, (*whole.path, (value, "args", index))), shown(value.func)
        return
    if isinstance(value, ast.Dict):
        for index, key in enumerate(value.keys):
            yield Place(function, statement, (*whole.path, (value, "values", index))), shown(key).strip("'")
    elif (
        isinstance(value, ast.Tuple)
        and isinstance(statement, ast.Assign)
        and isinstance(statement.targets[0], ast.Tuple)
    ):
        for index, target in enumerate(statement.targets[0].elts):
            yield Place(function, statement, (*whole.path, (value, "elts", index))), shown(target)
    else:
        if isinstance(value, ast.Tuple) and isinstance(statement, ast.Return):
            for index, element in enumerate(value.elts):
                yield Place(function, statement, (*whole.path, (value, "elts", index))), shown(element)
        yield whole, label


def terms(place: Place) -> Iterator[Place]:
    """An expression and the terms of its sum: a mistake in one of them may leave what follows from another as it is."""
    yield place
    if isinstance(place.node, ast.BinOp) and isinstance(place.node.op, ast.Add | ast.Sub):
        for side in ("left", "right"):
            yield from terms(Place(place.function, place.statement, (*place.path, (place.node, side, None))))


@lru_cache(maxsize=64)
def scope(function: Any) -> list[str]:
    """The names that a function knows."""
    own = [node.arg for node in ast.walk(function) if isinstance(node, ast.arg)]
    own += [node.id for node in ast.walk(function) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    return list(dict.fromkeys(own))
