"""The program that is changed: the Python client, its functions by name, run with one of them changed.

It is what `conformance client python` prints. Everything here goes by its functions' names and syntax trees; no
formula of it is repeated.
"""

from __future__ import annotations

import ast
import math
import types
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from tippedisk_verify.conformance import client_text
from tippedisk_verify.conformance.diagnosis.entries import Array, Results, Sheet, Table

__all__ = ["HERE", "Program", "Specimen", "of", "specimen"]

_LONGER = 3.0  # times: so many more turns of loops are allowed to a changed program
HERE = ast.parse("_here(locals())", mode="eval").body  #: stands for an expression that changes
NOTHING: Mapping[str, ast.stmt] = MappingProxyType({})


@dataclass(frozen=True)
class Specimen:
    """A right program: the client with some functions written in another right way."""

    way: str  #: what is written otherwise; empty for the client as it is
    functions: Mapping[str, ast.FunctionDef]
    constants: Mapping[str, ast.Assign]  #: of the module
    space: Mapping[str, Any]  #: the module as it ran
    counts: dict[Any, int] = field(default_factory=dict, compare=False)

    @cached_property
    def codes(self) -> dict[str, types.CodeType]:
        return {name: compiled(tree) for name, tree in self.functions.items()}

    @cached_property
    def calls(self) -> dict[str, frozenset[str]]:
        """Which functions and constants each function reaches, itself included."""
        known = {**self.functions, **self.constants}

        def reached(name: str, names: frozenset[str] = frozenset()) -> frozenset[str]:
            used = {node.id for node in ast.walk(known[name]) if isinstance(node, ast.Name) and node.id in known}
            names |= {name}
            for other in used - names:
                names = reached(other, names)
            return names

        return {name: reached(name) for name in known}

    def effort(self, table: Table) -> int:
        """How many turns of loops the answers to a table take."""
        key = table.kind, table.friction, len(table.entries), table.asked
        if key not in self.counts:
            program = Program(self)
            program.results(table)
            self.counts[key] = program.turns
        return self.counts[key]

    def text(self, name: str) -> str:
        return ast.unparse(self.functions[name]) + "\n"

    def starts(self, kind: str) -> str:
        """The function that answers questions of a kind."""
        return str(self.space["KINDS"][kind].__name__)

    def reach(self, sheet: Sheet) -> list[str]:
        """The functions that answers of these tables come from, in the order of the program."""
        names = frozenset[str]().union(*(self.calls[self.starts(table.kind)] for table in sheet.tables))
        return [name for name in (*self.constants, *self.functions) if name in names]

    def patched(self, way: str, source: str, **space: Any) -> Specimen:
        """The same with the functions of ``source`` in place of those of their names, or beside them."""
        tree = ast.parse(source)
        functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
        return Specimen(way, {**self.functions, **functions}, self.constants, {**self.space, **space})


def compiled(tree: ast.FunctionDef) -> types.CodeType:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)
        module = compile(ast.Module([tree], []), f"<{tree.name}>", "exec")
    return next(part for part in module.co_consts if isinstance(part, types.CodeType))


class Program:
    """A specimen with the trees of ``changes`` in place of those of their names."""

    def __init__(self, right: Specimen, changes: Mapping[str, ast.stmt] = NOTHING, **space: Any) -> None:
        self.right, self.trees = right, changes
        self.turns, self.left = 0, math.inf  # turns of loops so far, and still allowed
        self.space = {**right.space, **space, "range": self._range}
        for function, code in right.codes.items():
            tree = changes.get(function)
            if isinstance(tree, ast.FunctionDef):
                code = compiled(tree)
            defaults = getattr(right.space.get(function), "__defaults__", None)  # which other ways leave as they are
            self.space[function] = types.FunctionType(code, self.space, function, defaults)
        for name, assign in right.constants.items():
            if right.calls[name] & changes.keys():
                assign = changes.get(name, assign)  # type: ignore[assignment]
                exec(compile(ast.Module([assign], []), "<constant>", "exec"), self.space)

    def computes(self, value: ast.expr) -> None:
        """Have ``value`` computed where the program says `HERE`; cheaper than another program."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)
            code = compile(ast.Expression(value), "<value>", "eval")
        self.space["_here"] = lambda known: eval(code, {**self.space, **known})

    def results(self, table: Table) -> Results:
        """The answers to a table's questions; nothing where the program fails."""
        function = self.space[self.right.starts(table.kind)]
        self.left = _LONGER * self.right.effort(table) if self.trees else math.inf
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                found = function(table.p, table.smooth, table.given, table.asked)
            except Exception:  # what a change does to a program is its own affair
                return {}
        return found if isinstance(found, Mapping) else {}

    def _range(self, *bounds: int) -> range:
        """A range that ends a program whose loops a change has made too long."""
        turns = range(*bounds)
        self.turns += len(turns)
        self.left -= len(turns)
        if self.left < 0:
            raise TimeoutError
        return turns

    def answers(self, sheet: Sheet) -> Array:
        return np.concatenate([table.picked(self.results(table)) for table in sheet.tables])


@cache
def specimen() -> Specimen:
    """The client as it is."""
    tree = ast.parse(client_text("client.py"))
    space: dict[str, Any] = {"__name__": "specimen"}
    exec(compile(tree, "client.py", "exec"), space)
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    constants = {}
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            names = {part.id for part in ast.walk(node.value) if isinstance(part, ast.Name)}
            if not names & functions.keys() and node.targets[0].id != "KINDS":
                constants[node.targets[0].id] = node
    return Specimen("", functions, constants, space)


def of(name: str) -> Any:
    """A function or constant of the client."""
    return specimen().space[name]
