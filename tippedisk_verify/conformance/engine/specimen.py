"""The program that is changed: the Python client, its functions by name, run with one of them changed.

It is what `conformance client python` prints. Everything here goes by its functions' names and syntax trees; no
formula of it is repeated.
"""

from __future__ import annotations

import ast
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np

from tippedisk_verify.conformance.engine.entries import Array, Results, Sheet, Table

__all__ = ["Program", "Specimen", "specimen"]

_SOURCE = Path(__file__).parent.parent / "clients" / "client.py"
_KEPT = 4_000  # results of functions that changes do not reach


@dataclass(frozen=True)
class Specimen:
    """A right program: the client with some functions written in another right way."""

    way: str  #: what is written otherwise; empty for the client as it is
    functions: Mapping[str, ast.FunctionDef]
    constants: Mapping[str, ast.Assign]  #: of the module
    space: Mapping[str, Any]  #: the module as it ran

    @cached_property
    def codes(self) -> dict[str, types.CodeType]:
        return {name: compiled(tree) for name, tree in self.functions.items()}

    @cached_property
    def calls(self) -> dict[str, frozenset[str]]:
        """Which functions and constants each function reaches, itself included."""
        known = {*self.functions, *self.constants}
        direct = {
            name: {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and node.id in known}
            for name, tree in (*self.functions.items(), *self.constants.items())
        }
        reached = {name: {name, *names} for name, names in direct.items()}
        for _ in known:
            for names in reached.values():
                for name in tuple(names):
                    names |= reached[name]
        return {name: frozenset(names) for name, names in reached.items()}

    def starts(self, kind: str) -> str:
        """The function that answers questions of a kind."""
        return str(self.space["KINDS"][kind].__name__)

    def reach(self, sheet: Sheet) -> list[str]:
        """The functions that answers of these tables come from, in the order of the program."""
        names = frozenset[str]().union(*(self.calls[self.starts(table.kind)] for table in sheet.tables))
        return [name for name in (*self.constants, *self.functions) if name in names]

    def patched(self, way: str, source: str) -> Specimen:
        """The same with the functions of ``source`` in place of those of their names, or beside them."""
        tree = ast.parse(source)
        functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
        return Specimen(way, {**self.functions, **functions}, self.constants, self.space)


def compiled(tree: ast.FunctionDef) -> types.CodeType:
    module = compile(ast.Module([tree], []), f"<{tree.name}>", "exec")
    return next(part for part in module.co_consts if isinstance(part, types.CodeType))


class Program:
    """A specimen with one function changed, or none."""

    def __init__(self, right: Specimen, name: str = "", tree: ast.AST | None = None, **space: Any) -> None:
        self.space = {**right.space, **space}
        for function, code in right.codes.items():
            if function == name and isinstance(tree, ast.FunctionDef):
                code = compiled(tree)
            self.space[function] = types.FunctionType(code, self.space, function, _defaults(right, function))
        if name in right.constants and isinstance(tree, ast.Assign):
            exec(compile(ast.Module([tree], []), "<constant>", "exec"), self.space)
            later = [assign for other, assign in right.constants.items() if name in right.calls[other] and other != name]
            for assign in later:
                exec(compile(ast.Module([assign], []), "<constant>", "exec"), self.space)
        self.right = right

    def results(self, table: Table) -> Results:
        """The answers to a table's questions; nothing where the program fails."""
        function = self.space[self.right.starts(table.kind)]
        with np.errstate(all="ignore"):
            try:
                found: Results = function(table.p, table.smooth, table.given, table.asked)
            except Exception:  # what a change does to a program is its own affair
                return {}
        return found

    def answers(self, sheet: Sheet) -> Array:
        return np.concatenate([table.picked(self.results(table)) for table in sheet.tables])


def _defaults(right: Specimen, function: str) -> tuple[Any, ...] | None:
    defaults = right.functions[function].args.defaults
    return tuple(eval(compile(ast.Expression(one), "<default>", "eval"), dict(right.space)) for one in defaults) or None


@cache
def specimen() -> Specimen:
    """The client as it is."""
    tree = ast.parse(_SOURCE.read_text(encoding="utf-8"))
    space: dict[str, Any] = {"__name__": "specimen"}
    exec(compile(tree, str(_SOURCE), "exec"), space)
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    constants = {
        node.targets[0].id: node
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id != "KINDS"
    }
    return Specimen("", functions, constants, space)
