"""The statements of a program that may be wrong, what may be changed in them, and what is said of a change."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.operators import changes
from tippedisk_verify.conformance.diagnosis.specimen import HERE, Program, Specimen
from tippedisk_verify.conformance.diagnosis.trees import Change, Place, places, shown, statements

__all__ = ["STIRRED", "Cause", "Stir", "Suspect", "all_changes", "candidates", "fixed", "scope", "terms", "values"]


STIRRED = (1e-3, 0.3)  #: relative changes of a statement's values


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
        return self.label if known else f"{self.label or 'the result'} ({self.function})"

    def cause(self, spot: Place, change: Change, program: Program) -> Cause:
        """What is said of a change in this statement."""
        says, lines = f"in {self.where}: {spot.says(change)}", spot.lines(change.node)
        return Cause(says, change.rank, change.operator, self.function, *lines, program)


class Stir:
    """Changes the numbers that pass through it, each by another share."""

    def __init__(self, share: float) -> None:
        self.share = share
        self.draws = np.random.default_rng(7)
        self.touched = False

    def __call__(self, value: Any) -> Any:
        if isinstance(value, tuple | list):
            return type(value)(self(part) for part in value)
        if isinstance(value, Mapping):
            return {name: self(part) for name, part in value.items()}
        array = np.asarray(value)
        if array.dtype.kind not in "fc":
            return value
        self.touched = True
        shape = array.shape if self.share > STIRRED[0] else ()  # a slight change leaves directions as they are
        stirred = array * (1 + self.share * self.draws.uniform(0.5, 1, shape))
        return stirred + self.share * (np.abs(array) == 0) if array.ndim else stirred


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
    target = getattr(statement, "targets", [None])[0]
    if isinstance(target, ast.Subscript) and isinstance(target.slice, ast.Tuple):
        down = (*path, (statement, "targets", 0), (target, "slice", None))
        for index, element in enumerate(target.slice.elts):
            if isinstance(element, ast.Constant):
                yield Place(function, statement, (*down, (target.slice, "elts", index))), f"the place of {label}"
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


def candidates(suspect: Suspect, ranks: Sequence[int]) -> Iterator[tuple[Place, Change]]:
    """What may be changed in a statement, and how."""
    place = suspect.place
    names = scope(place.function)
    for spot in (place, *places(place.function, place.node, place.path)):
        for change in changes(spot, names, spot is place):
            if change.rank in ranks:
                fixed(change.node)
                yield spot, change


def all_changes(right: Specimen, name: str, ranks: Sequence[int]) -> Iterator[tuple[Suspect, Place, Change, Program]]:
    """All changes of a function, each with a program that makes it until the next one is asked for."""
    function = right.functions[name]
    for statement, path in statements(function):
        for place, label in values(function, statement, path):
            suspect = Suspect(name, place, label, 0)
            program = Program(right, {name: place.replaced(HERE)})
            for spot, change in candidates(suspect, ranks):
                program.computes(spot.within(place, change.node))
                yield suspect, spot, change, program


def fixed(node: Any) -> Any:
    """With line numbers where nodes are new; below old ones there are none."""
    if isinstance(node, ast.expr | ast.stmt | ast.keyword) and not hasattr(node, "lineno"):
        node.lineno = node.end_lineno = 1
        node.col_offset = node.end_col_offset = 0
        for child in ast.iter_child_nodes(node):
            fixed(child)
    return node
