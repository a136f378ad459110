"""Every single slip in a formula that is written down as Python assignments: what a hand does wrong once.

A sign, an operator, a term or factor that is missing, another name of the vocabulary, another number, sine for cosine,
a doubled angle, a square or root, lost parentheses, an index, a condition. A vocabulary is a set of groups; a group
holds expressions that may stand for each other, from names to whole right-hand sides.
"""

from __future__ import annotations

import ast
import io
import itertools
import re
import tokenize
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import CodeType
from typing import Any

__all__ = ["Slip", "Written", "plain"]

_NUMBERS = (0, 1, 2, 3, 4, 0.5)
_SINES = {"sin": "cos", "cos": "sin"}
_SELDOM = ("down(", "up(")  # where a number rounded to the nearest is the same, this is meant
_NEAR = 24  # characters of an expression that a sentence quotes before and after
_LONGEST = 90  # and of the term that it belongs to
Names = dict[str, Any]
_Variant = tuple[int, ast.expr, str]  # rank, what stands there instead, what is said of it


@dataclass(frozen=True)
class Slip:
    """One slip: a changed statement, compiled. ``says`` has to be called before the next slip is drawn."""

    rank: int  #: 0 for what happens most easily
    place: int  #: of the statement
    code: CodeType
    says: Callable[[], str]


class Written:
    """The text of a formula."""

    def __init__(self, source: str, groups: Sequence[Sequence[str]]) -> None:
        self.source = source
        self.statements = ast.parse(source).body
        self.codes = [_compiled(statement) for statement in self.statements]
        self.others: dict[str, list[ast.expr]] = {}
        for group in groups:
            parsed = [ast.parse(text, mode="eval").body for text in group]
            for one in parsed:
                self.others.setdefault(ast.unparse(one), []).extend(other for other in parsed if other is not one)

    def run(self, names: Mapping[str, Any], slip: Slip | None = None) -> Names:
        """All names after the statements, from those given."""
        found = dict(names)
        for place, code in enumerate(self.codes):
            exec(slip.code if slip is not None and place == slip.place else code, found)
        return found

    def slips(self, only: Sequence[str] = ()) -> Iterator[Slip]:
        """All of them, or those in the statements that assign one of these names."""
        for place, statement in enumerate(self.statements):
            if only and _assigned(statement) not in only:
                continue
            for rank, says in self._changes(statement):
                try:
                    code = _compiled(statement)
                except (SyntaxError, ValueError):
                    continue
                yield Slip(rank, place, code, says)
            yield from self._unbracketed(place, statement)
            yield from self._exchanged(place, statement, bool(only))

    def scaled(self, factor: str = "free") -> Iterator[Slip]:
        """Each term, and each whole right-hand side, times a name or an expression: always in the same order."""
        times = ast.parse(factor, mode="eval").body
        for place, statement in enumerate(self.statements):
            for node, (parent, field, index), _, target in _walked(statement):
                whole = isinstance(parent, ast.Assign | ast.AugAssign | ast.Return)
                summed = isinstance(parent, ast.BinOp) and isinstance(parent.op, ast.Add | ast.Sub)
                if isinstance(node, ast.List) or not (whole or summed) or ast.unparse(node) == "0":
                    continue
                text = plain(ast.unparse(node))
                text = target if isinstance(parent, ast.Assign | ast.Return) else f"{text} in {target}"
                _put(parent, field, index, ast.fix_missing_locations(ast.BinOp(times, ast.Mult(), node)))
                code = _compiled(statement)
                _put(parent, field, index, node)
                yield Slip(0, place, code, lambda text=text: text)  # type: ignore[misc]

    def _exchanged(self, place: int, statement: ast.stmt, alone: bool) -> Iterator[Slip]:
        """What two statements assign, exchanged: this one and one before it, or two in a loop."""
        targets = [] if alone or not isinstance(statement, ast.Assign) else [_assigned(statement)]
        for mine in targets:
            for other in dict.fromkeys(
                _assigned(one) for one in self.statements[:place] if isinstance(one, ast.Assign)
            ):
                if other != mine and re.fullmatch(r"\w+", other):
                    code = compile(f"{ast.unparse(statement)}\n{mine}, {other} = {other}, {mine}", "formula", "exec")
                    yield Slip(2, place, code, lambda text=f"{other} and {mine} are exchanged": text)  # type: ignore[misc]
        body = statement.body if isinstance(statement, ast.For) else []
        parts = [one for one in body if isinstance(one, ast.Assign | ast.AugAssign)]
        for n, one in enumerate(parts):
            for other_part in parts[:n]:
                one.value, other_part.value = other_part.value, one.value
                text = f"what {_assigned(other_part)} and {_assigned(one)} are is exchanged"
                yield Slip(2, place, _compiled(statement), lambda text=text: text)  # type: ignore[misc]
                one.value, other_part.value = other_part.value, one.value

    def _changes(self, statement: ast.stmt) -> Iterator[tuple[int, Callable[[], str]]]:
        """Change the statement in place, and back, one slip after the other."""
        for node, (parent, field, index), chain, target in _walked(statement):
            texts = [ast.unparse(one) for one in chain]
            near = [one for one, text in zip(chain, texts, strict=True) if len(text) <= _NEAR]
            context = near[0] if near else node
            old, old_node = plain(ast.unparse(context)), plain(ast.unparse(node))
            given = ast.unparse(node) == f"given_{target}"
            term = next((plain(text) for text in texts if len(text) <= _LONGEST), old_node)
            whole = isinstance(parent, ast.Assign | ast.AugAssign | ast.Return)
            for rank, new, words in self._variants(node, parent, whole):

                def says(
                    new: ast.expr = new, words: str = words, context: ast.expr = context, node: ast.expr = node,
                    old: str = old, old_node: str = old_node, term: str = term, target: str = target,
                    given: bool = given,
                ) -> str:  # fmt: skip
                    if given:
                        return f"{plain(ast.unparse(new))} taken for {target}"
                    changed = f"{plain(ast.unparse(new if context is node else context))} for {old}"
                    text = words or changed
                    around = [one for one in (old_node, old, term) if one not in text and len(one) <= _LONGEST]
                    places = dict.fromkeys((*around[:1], *around[-1:]))
                    return (f"in {target}: " if target else "") + " in ".join([text, *places])

                _put(parent, field, index, ast.fix_missing_locations(new))
                yield rank, says
                _put(parent, field, index, node)
        yield from _not_summed(statement)
        for condition in [node for node in ast.walk(statement) if isinstance(node, ast.If)]:
            test = condition.test
            target = _assigned(condition.body[0])
            for value, words in ((True, "the condition {} is lost"), (False, "what holds only if {} is missing")):
                condition.test = ast.fix_missing_locations(ast.Constant(value))
                text = words.format(ast.unparse(test))
                yield 0, lambda text=text, target=target: f"in {target}: {text}"  # type: ignore[misc]
            for other in self.others.get(ast.unparse(test), ()):
                condition.test = other
                text = f"{ast.unparse(other)} instead of {ast.unparse(test)}"
                yield 1, lambda text=text, target=target: f"in {target}: if {text}"  # type: ignore[misc]
            condition.test = test

    def _variants(self, node: ast.expr, parent: ast.AST, whole: bool) -> Iterator[_Variant]:
        said = plain(ast.unparse(node))
        if isinstance(parent, ast.For):  # what it runs over
            yield from ((1, other, "") for other in self.others.get(ast.unparse(node), ()))
            return
        if isinstance(node, ast.BinOp):
            yield from _operations(node)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            yield 0, node.operand, f"the sign of {said.removeprefix('-')}"
        elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            yield from ((1, ast.Constant(x), "") for x in _NUMBERS if x != node.value)
            if node.value > 2:
                yield from ((1, ast.Constant(node.value + step), "") for step in (-1, 1))
        elif isinstance(node, ast.Call):
            yield from _calls(node)
            yield from ((1, ast.Call(one, node.args, []), "") for one in self.others.get(ast.unparse(node.func), ()))
        elif isinstance(node, ast.IfExp):
            yield from ((0, part, f"{plain(ast.unparse(part))} always") for part in (node.body, node.orelse))
            yield 0, ast.IfExp(node.test, node.orelse, node.body), ""
        elif isinstance(node, ast.List):
            for i in range(len(node.elts)):
                for j in range(i):
                    moved = list(node.elts)
                    moved[i], moved[j] = moved[j], moved[i]
                    yield 1, ast.List(moved, ast.Load()), ""
        if isinstance(parent, ast.Subscript):
            for other in (ast.BinOp(node, ast.Add(), ast.Constant(1)), ast.BinOp(node, ast.Sub(), ast.Constant(1))):
                yield 0, other, ""
            yield 0, ast.Constant(0), ""
        elif isinstance(node, ast.Name | ast.Call | ast.Subscript) and not isinstance(parent, ast.Call):
            if not (isinstance(parent, ast.BinOp) and isinstance(parent.op, ast.Pow)):
                yield 2, ast.BinOp(node, ast.Pow(), ast.Constant(2)), ""
                yield 2, _call("sqrt", node), ""
            yield 2, _call("abs", node), ""
        summed = isinstance(parent, ast.BinOp) and isinstance(parent.op, ast.Add | ast.Sub)
        if (whole or summed) and not isinstance(node, ast.Constant | ast.List):
            if whole or (isinstance(parent, ast.BinOp) and parent.left is node):
                yield 0, ast.UnaryOp(ast.USub(), node), f"the sign of {said}"
            yield 2, ast.BinOp(ast.Constant(2), ast.Mult(), node), f"twice {said}"
            yield 2, ast.BinOp(node, ast.Div(), ast.Constant(2)), f"half of {said}"
        if whole:
            if isinstance(node, ast.Name):
                yield 0, ast.Constant(1), f"the factor {said} is missing"
            if isinstance(parent, ast.AugAssign):
                yield 0, ast.Constant(0), f"{said} is missing"
            yield 2, _call("abs", node), f"the absolute value of {said}"
            yield 2, _call("sqrt", node), f"the square root of {said}"
            yield 2, ast.BinOp(node, ast.Pow(), ast.Constant(2)), f"the square of {said}"
        if not isinstance(node, ast.Constant):
            others = self.others.get(ast.unparse(node), ())
            yield from ((2 if ast.unparse(other).startswith(_SELDOM) else 1, other, "") for other in others)

    def _unbracketed(self, place: int, statement: ast.stmt) -> Iterator[Slip]:
        """The statement without one pair of its parentheses."""
        source = ast.get_source_segment(self.source, statement) or ""
        lines = source.splitlines(keepends=True)
        starts = [sum(map(len, lines[:n])) for n in range(len(lines))]
        opened: list[tuple[int, bool]] = []
        previous = ""
        for token in tokenize.generate_tokens(io.StringIO(source).readline):
            at = starts[min(token.start[0], len(lines)) - 1] + token.start[1]
            if token.string == "(":
                opened.append((at, bool(re.fullmatch(r"\w+|[)\]]", previous))))
            elif token.string == ")":
                start, called = opened.pop()
                less = source[:start] + source[start + 1 : at] + source[at + 1 :]
                if not called:
                    before = re.findall(r"def (\w+)|(\w+) [-+*/]?= ", source[:start])
                    target = _assigned(statement) or "".join(before[-1])
                    words = f"in {target}: the parentheses of ({plain(source[start + 1 : at])}) are lost"
                    with suppress(SyntaxError):
                        yield Slip(0, place, compile(less, "formula", "exec"), lambda words=words: words)  # type: ignore[misc]
            previous = token.string


def _not_summed(statement: ast.stmt) -> Iterator[tuple[int, Callable[[], str]]]:
    """What a loop adds up: only what comes last, only the first, or all but the first."""

    def below(parts: list[ast.stmt], variables: list[str]) -> Iterator[tuple[int, Callable[[], str]]]:
        for n, part in enumerate(parts):
            if isinstance(part, ast.For):
                yield from below(part.body, [*variables, ast.unparse(part.target)])
            elif isinstance(part, ast.AugAssign) and variables:
                target, added = _assigned(part), part.value
                parts[n] = ast.copy_location(ast.Assign([part.target], part.value), part)
                yield 0, lambda target=target: f"{target} is not summed up: what is added last replaces the rest"  # type: ignore[misc]
                parts[n] = part
                for variable, test in itertools.product(variables, ("> 0", "> 1", "== 0", "== 1")):
                    condition = ast.parse(f"{variable} {test}", mode="eval").body
                    part.value = ast.fix_missing_locations(ast.BinOp(added, ast.Mult(), condition))
                    text = f"in {target}: {plain(ast.unparse(added))} only where {ast.unparse(condition)}"
                    yield 1, lambda text=text: text  # type: ignore[misc]
                part.value = added

    yield from below([statement], [])


def plain(text: str) -> str:
    """Python's spelling of a formula as the rest of the package writes formulas in sentences; inputs by their names."""
    text = re.sub(r"\^1(?![\d.])", "", re.sub(r" ?\*\* ?", "^", text.replace("given_", "")))
    text = re.sub(r"(?<=[\w)\]]) ?\* ?(?=[\w(])", " ", text)
    return re.sub(r"(?<![\w.^] )(?<![\w.^])1 (?=[a-zA-Z(])", "", text)


def _operations(node: ast.BinOp) -> Iterator[_Variant]:
    left, right, op = node.left, node.right, node.op
    first, second = plain(ast.unparse(left)), plain(ast.unparse(right))
    if isinstance(op, ast.Add | ast.Sub):
        other = ast.Sub() if isinstance(op, ast.Add) else ast.Add()
        yield 0, ast.BinOp(left, other, right), f"the sign of {second}"
        yield 0, left, f"{second} is missing"
        yield 0, right if isinstance(op, ast.Add) else ast.UnaryOp(ast.USub(), right), f"{first} is missing"
        if isinstance(op, ast.Sub):
            yield 1, ast.BinOp(right, op, left), ""
    elif isinstance(op, ast.Mult):
        yield 0, left, f"the factor {second} is missing"
        yield 0, right, f"the factor {first} is missing"
        yield 1, ast.BinOp(left, ast.Div(), right), ""
        yield 1, ast.BinOp(left, ast.Add(), right), ""
    elif isinstance(op, ast.Div):
        yield 0, left, f"the division by {second} is missing"
        yield 0, ast.BinOp(ast.Constant(1), ast.Div(), right), f"the factor {first} is missing"
        yield 1, ast.BinOp(left, ast.Mult(), right), ""
        yield 1, ast.BinOp(right, ast.Div(), left), ""
        if isinstance(right, ast.BinOp) and isinstance(right.op, ast.Mult):
            yield 0, ast.BinOp(ast.BinOp(left, ast.Div(), right.left), ast.Mult(), right.right), ""
    elif isinstance(op, ast.Pow) and isinstance(left, ast.Call) and len(left.args) == 1:
        yield 2, ast.Call(left.func, [ast.BinOp(left.args[0], op, right)], []), ""


def _calls(node: ast.Call) -> Iterator[_Variant]:
    name = ast.unparse(node.func)
    if len(node.args) != 1:
        for n, one in enumerate(node.args):
            less = [*node.args[:n], ast.Constant(0), *node.args[n + 1 :]]
            yield 0, ast.Call(node.func, less, []), f"{plain(ast.unparse(one))} is missing"
        return
    (inside,) = node.args
    if name in _SINES:
        yield 1, _call(_SINES[name], inside), ""
        yield 2, _call(name, ast.BinOp(ast.Constant(2), ast.Mult(), inside)), ""
        yield 2, _call(name, ast.BinOp(inside, ast.Div(), ast.Constant(2))), ""
    else:
        yield 0, inside, ""


def _call(name: str, inside: ast.expr) -> ast.Call:
    return ast.Call(ast.Name(name, ast.Load()), [inside], [])


def _put(parent: ast.AST, field: str, index: int | None, node: ast.expr) -> None:
    if index is None:
        setattr(parent, field, node)
    else:
        getattr(parent, field)[index] = node


def _assigned(statement: ast.stmt) -> str:
    if isinstance(statement, ast.Assign):
        return plain(ast.unparse(statement.targets[0]))
    return plain(ast.unparse(statement.target)) if isinstance(statement, ast.AugAssign) else ""


def _walked(
    statement: ast.stmt,
) -> Iterator[tuple[ast.expr, tuple[ast.AST, str, int | None], list[ast.expr], str]]:
    """Each expression that is read, where it stands, the expressions around it, and what is assigned."""

    def below(parent: ast.AST, chain: list[ast.expr], target: str) -> Iterator[Any]:
        for field, value in ast.iter_fields(parent):
            kept = {ast.Call: ("func",), ast.Subscript: ("value",), ast.IfExp: ()}
            if field in kept.get(type(parent), ("targets", "target", "test", "args")):
                continue
            for index, node in enumerate(value) if isinstance(value, list) else [(None, value)]:
                if isinstance(node, ast.expr):
                    if isinstance(parent, ast.For):
                        target = " and ".join(dict.fromkeys(filter(None, map(_assigned, parent.body))))
                    if not isinstance(parent, ast.Expr):
                        yield node, (parent, field, index), chain, target
                    yield from below(node, [*chain, node], target)
                elif isinstance(node, ast.stmt):
                    name = node.name if isinstance(node, ast.FunctionDef) else _assigned(node)
                    yield from below(node, [], name or target)

    name = statement.name if isinstance(statement, ast.FunctionDef) else _assigned(statement)
    yield from below(statement, [], name)


def _compiled(statement: ast.stmt) -> CodeType:
    return compile(ast.Module([statement], []), "formula", "exec")
