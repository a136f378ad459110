"""What people do wrong where they write a formula: one table of changes of a syntax tree.

A rule sees a node, the names that its function knows, and nothing else: no quantity, no level. A new kind of mistake is
one line in `RULES`; what no pattern says is a function in `OPERATORS`.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

from tippedisk_verify.conformance.diagnosis.trees import (
    Change,
    Node,
    Place,
    is_binary,
    kind,
    same,
    shown,
    sort_of,
    substituted,
)

__all__ = ["changes"]


#: Names of one kind, which are mistaken for each other; so are names that differ in one part only, as A_31 and A_32.
_KIN = (
    {"r", "e", "rho"}, {"A", "B", "Bbar", "M", "inertia"}, {"beta", "gamma"}, {"Omega", "v", "omega"},
    {"mu", "epsilon", "m", "g", "k"}, {"gamma_y", "w_y", "v"}, {"sin", "cos"}, {"sin", "tan"}, {"h", "f_G"},
    {"cos_beta", "sin_beta", "cos_gamma", "sin_gamma"}, {"C", "omega"}, {"rho", "rho_squared"}, {"matrix", "A_33"},
    {"chi", "delta"}, {"drho_dgamma", "rho", "e"}, {"m", "rho"}, {"q", "p_star"}, {"c_1", "dlambda"}, {"v", "h_0"},
    {"rho", "radius"},
)  # fmt: skip
#: What stands for a name by habit.
_HABITS = {
    "Omega": ("critical_speed(p)", "30.92", "1"),
    "rho": ("(r - e)", "(r + e)", "(r + e * cos(gamma))", "(r - e * sin(gamma))", "(r + e * sin(beta))"),
    "Bbar": ("(B + m * e**2)",),
    "A": ("(A - m * e**2)", "(A + m * e**2)"), "g": ("9.8",), "pi": ("3.14", "3.1416", "180"),
}  # fmt: skip
_EXTRA = ("r", "e", "m", "g", "mu", "epsilon", "Omega", "omega", "rho", "M", "Bbar", "v")
_INDICES = ("i", "j", "k", "n", "size", "last")
_NORMS = ("a[0]", "sum(abs(a))", "np.max(abs(a), axis=0)", "sqrt(sum(abs(a[:2]) ** 2))", "1")
#: What stands there and what may stand there by mistake, what is said of it ("" for "NEW for OLD"), and its rank. In a
#: pattern a to d are any expressions, f any function, x a name, call or element, t such a one, a product, quotient or
#: power, and i an index; +- stands for either sign, and */ for either operator.
RULES: tuple[tuple[str, str, str, int], ...] = (
    ("a + b", "a - b", "-{b} for +{b}", 0), ("a - b", "a + b", "+{b} for -{b}", 0),
    ("t +- b", "-t +- b", "-{t} for +{t}", 0),
    ("-a", "a", "the minus sign of {old} is missing", 0), ("t", "-t", "", 1),
    ("a + b", "a", "the term {b} is missing in {old}", 0), ("a - b", "a", "the term -{b} is missing in {old}", 0),
    ("a + b", "b", "the term {a} is missing in {old}", 0), ("a - b", "-b", "the term {a} is missing in {old}", 0),
    ("a * b", "a", "the factor {b} is missing in {term}", 0), ("a * b", "b", "the factor {a} is missing in {term}", 0),
    ("a / b", "a", "the divisor {b} is missing in {term}", 0), ("a / b", "1 / b", "", 1), ("a - b", "b", "", 1),
    ("f(a)", "a", "{a} for {old}", 1), ("f(a, b)", "f(b, a)", "", 1),
    ("f(a, b)", "a", "the factor {b} is missing in {old}", 0),
    ("f(a, b)", "b", "the factor {a} is missing in {old}", 0),
    ("f(a, b)", "f(a, f(a, b))", "the factor {a} twice in {old}", 1),
    ("f(a, b)", "f(b, f(a, b))", "the factor {b} twice in {old}", 1), ("a[i - 1]", "a[0]", "", 1),
    ("sin(a)", "cos(a)", "cos for sin in {term}", 0), ("cos(a)", "sin(a)", "sin for cos in {term}", 0),
    ("sin(a)", "np.tan(a)", "", 0), ("cos(a)", "pi / 2 - a", "", 2), ("cos(a)", "1", "", 2),
    ("sin(a)", "sin(2 * a)", "", 1), ("cos(a)", "cos(2 * a)", "", 1), ("sin(a)", "sin(a - pi / 2)", "", 2),
    ("cos(a)", "cos(a - pi / 2)", "", 2), ("sin(a)", "sin(a * pi / 180)", "{old} of degrees", 2),
    ("cos(a)", "cos(a * pi / 180)", "{old} of degrees", 2), ("np.linalg.eigvals(a)", "np.linalg.eigvalsh(a)", "", 0),
    ("a.argmax(axis=b)", "a.argmin(axis=b)", "", 0), ("np.argmax(a, axis=b)", "np.argmin(a, axis=b)", "", 0),
    ("np.max(a, axis=b)", "np.min(a, axis=b)", "", 0), ("np.ceil(a)", "np.floor(a)", "", 0),
    ("np.where(a, b, c)", "b", "{b} throughout for {old}", 0),
    ("np.where(a, b, c)", "c", "{c} throughout for {old}", 0),
    ("np.where(a, b, c)", "np.where(a, c, b)", "the two cases exchanged in {old}", 0),
    ("a.real", "a.imag", "", 0), ("a.imag", "a.real", "", 0), ("a.real", "abs(a)", "", 1), ("a.imag", "abs(a)", "", 1),
    ("a.real", "a", "", 1), ("a.imag", "a", "", 1), ("a.conj()", "a", "{old} without conj", 0),
    *((f"a {one} b", f"a {two} b", "", 1) for one in ("<", ">", "==") for two in ("<", ">", "!=", ">=") if one != two),
    ("t", "2 * t", "", 1), ("t", "3 * t", "", 1), ("t", "t / 2", "", 1), ("t", "t / 3", "", 1),
    ("a ** b", "a", "{a} for {old} in {term}", 0), ("a ** b", "a * b", "", 1), ("x", "x ** 2", "", 1),
    ("x", "sqrt(x)", "", 2), ("a / b", "(a / b) ** 2", "", 2), ("f(a) ** b", "f(a ** b)", "", 1),
    ("sqrt(a + b)", "sqrt(a) * (1 + b / (2 * a))", "the root's expansion for {old}", 1),
    ("c * (a +- b)", "c * a +- b", "", 1), ("c / (a +- b)", "c / a +- b", "", 1), ("(a +- b) * c", "a +- b * c", "", 1),
    ("(a +- b) / c", "a +- b / c", "", 1), ("a / (b * c)", "a / b * c", "", 0), ("a * b", "a / b", "", 1),
    ("a * b", "a + b", "", 2), ("a / b", "a * b", "", 1), ("a / b", "b / a", "", 1),
    ("(a +- b) ** c", "a +- b ** c", "", 1), ("(a */ b) ** c", "a */ b ** c", "", 1),
    ("c +- a */ b", "(c +- a) */ b", "", 2), ("a * b +- c", "a * (b +- c)", "", 2),
    ("a +- b - c", "a +- (b - c)", "", 2), ("c * a +- b", "b * a +- c", "{c} and {b} exchanged in {old}", 2),
    ("f(a +- b)", "f(a) +- b", "", 2), ("f(a */ b)", "f(a) */ b", "", 2),
    ("a * b / (abs(b) + c)", "a * np.tanh(b / c)", "", 1), ("a * b / (abs(b) + c)", "a * np.arctan(b / c)", "", 1),
    ("a * b / (abs(b) + c)", "a * b / sqrt(b ** 2 + c ** 2)", "", 1),
    ("a * b / (abs(b) + c)", "a * np.clip(b / c, -1, 1)", "", 1),
    ("a * b / (abs(b) + c)", "a * 2 / pi * np.arctan(b / c)", "", 1),
    ("a * b / (abs(b) + c)", "a * 2 / pi * np.arctan(pi / 2 * b / c)", "", 1),
    *(("sqrt(sum(abs(a) ** 2))", norm, "", 1) for norm in _NORMS),
    ("i", "i + 1", "", 1), ("i", "i - 1", "", 1), ("i", "0", "", 1), ("range(a)", "range(1)", "", 1),
    ("a[b, c, d]", "a[b, d, c]", "", 1),
    ("smooth", "False", "the linear friction law", 0), ("smooth", "not smooth", "the other friction law", 0),
    ("np.linalg.solve(a - b, c)", "np.linalg.solve(a - b @ b, c)", "the square of {b} for {b} in {old}", 0),
    ("np.linalg.solve(a - b, c)", "np.linalg.solve(a - np.swapaxes(b, 1, 2), c)", "{b} transposed in {old}", 0),
    ("np.max(abs(np.linalg.eigvals(a)), axis=1)", "np.linalg.norm(a, 2, (1, 2))", "", 1),
    ("np.max(abs(np.linalg.eigvals(a)), axis=1)", "a[:, 0, 0]", "", 1),
    ("t", "np.float32(t)", "{old} in single precision", 3),
    ("a +- b", "np.float32(a +- b)", "{old} in single precision", 3), ("t", "abs(t)", "the modulus of {old}", 2),
    ("a +- b", "abs(a +- b)", "the modulus of {old}", 2),
)  # fmt: skip


# ------------------------------------------------------------------------------------------ patterns
_VALUES = (ast.Name, ast.Call, ast.Subscript, ast.Attribute)
_PRODUCTS = (ast.Mult, ast.Div, ast.Pow)


@cache
def _parsed(text: str) -> Node:
    return ast.parse(text, mode="eval").body


def _bound(pattern: Node, node: Node, found: dict[str, Node]) -> bool:
    """Whether a node is as a pattern says; ``found`` is what the pattern's variables are then."""
    if kind(pattern, ast.Name) and len(pattern.id) == 1:
        name = pattern.id
        if (
            (name == "x" and not kind(node, _VALUES))
            or (name == "t" and not (kind(node, _VALUES) or is_binary(node, *_PRODUCTS)))
            or (name == "i" and not (kind(node, ast.Name) and node.id in _INDICES))
        ):
            return False
        return same(found.setdefault(name, node), node)
    if type(pattern) is not type(node):
        return False
    for field in pattern._fields:
        wanted, given = getattr(pattern, field), getattr(node, field)
        parts = wanted if kind(wanted, list) else [wanted]
        here = given if kind(given, list) else [given]
        if field != "ctx" and len(parts) != len(here):
            return False
        for one, other in zip(parts, here, strict=True) if field != "ctx" else ():
            if not (_bound(one, other, found) if kind(one, ast.AST) else one == other):
                return False
    return True


@cache
def _rules() -> Mapping[Any, list[tuple[Node, Node, str, int]]]:
    by_sort: dict[Any, list[tuple[Node, Node, str, int]]] = {}
    for old, new, said, rank in RULES:
        for sign in "+-" if "+-" in old else " ":
            for by in "*/" if "*/" in old else " ":
                texts = [text.replace("+-", sign).replace("*/", by) for text in (old, new)]
                pattern, filled = map(_parsed, texts)
                by_sort.setdefault(sort_of(pattern), []).append((pattern, filled, said, rank))
    return by_sort


def _patterns(node: Node, names: Sequence[str]) -> Iterator[Change]:
    rules = _rules()
    for pattern, filled, said, rank in (*rules.get(sort_of(node) or ast.Name, ()), *rules[None]):
        found: dict[str, Node] = {}
        if _bound(pattern, node, found):
            new = substituted(filled, found)
            if not same(new, node):
                text = re.sub(r"\{([a-dt])\}", lambda match: shown(found[match[1]]), said)  # noqa: B023
                yield Change(new, text, rank)


# ------------------------------------------------------------------------------------------ other changes


def _exchanged(node: Node, names: Sequence[str]) -> Iterator[Change]:
    if kind(node, ast.Name):
        for other in names:
            if akin(node.id, other):
                yield Change(ast.Name(other, ast.Load()))
        for other in _HABITS.get(node.id, ()):
            yield Change(_parsed(other), "", 2)


def akin(one: str, other: str) -> bool:
    """Whether one name is easily mistaken for the other."""
    if one == other:
        return False
    if any(one in group and other in group for group in _KIN):
        return True
    first, second = re.split("[_ ]", one), re.split("[_ ]", other)
    if len(first) == len(second) > 1:
        return sum(bool(a != b) for a, b in zip(first, second, strict=True)) == 1
    short, long = sorted((one, other), key=len)
    return len(short) > 2 and long.startswith(short + "_") and long != short


def _numbers(node: Node, names: Sequence[str]) -> Iterator[Change]:
    if kind(node, ast.Constant) and type(node.value) in (int, float):
        others = [node.value + 1, node.value - 1, 2 * node.value, node.value / 2, -node.value, node.value + 2, 1, 3]
        if kind(node.value, int):
            others = [int(one) if one == int(one) else one for one in others]
        for other in dict.fromkeys(others):
            if other != node.value:
                yield Change(ast.Constant(other), "", 1)


def _swapped(node: Node, names: Sequence[str]) -> Iterator[Change]:
    if is_binary(node, ast.Add, ast.Sub, ast.Mult):
        used = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
        for one in used:
            for other in used:
                if one < other and akin(one, other):
                    pair = {one: other, other: one}
                    values = {old: ast.copy_location(ast.Name(new, ast.Load()), node) for old, new in pair.items()}
                    yield Change(substituted(node, values), f"{one} and {other} exchanged in {{old}}", 1)


def _extra(node: Node, names: Sequence[str]) -> Iterator[Change]:
    if kind(node, ast.Name | ast.Call | ast.Attribute) or is_binary(node, ast.Mult, ast.Div, ast.Pow):
        for other in names:
            if other in _EXTRA and not (kind(node, ast.Name) and node.id == other):
                name = ast.Name(other, ast.Load())
                yield Change(ast.BinOp(name, ast.Mult(), node), f"the extra factor {other} in {{term}}", 2)
                yield Change(ast.BinOp(node, ast.Div(), name), f"{{term}} divided by {other}", 2)


Operator = Callable[[Node, Sequence[str]], Iterator[Change]]
OPERATORS: dict[str, Operator] = {
    "rule": _patterns,
    "names": _exchanged,
    "number": _numbers,
    "swapped": _swapped,
    "extra": _extra,
}


def _passed_on(place: Place) -> bool:
    """Whether a value has its name from another statement of the function, which is where it may be wrong."""
    name = getattr(place.node, "id", "")
    stored = (
        node for node in ast.walk(place.function) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    )
    return any(node.id == name for node in stored)


def changes(place: Place, names: Sequence[str], whole: bool = False) -> Iterator[Change]:
    """What may stand there by mistake, by all operators; ``whole`` says that it is all that a statement computes."""
    added = kind(place.statement, ast.AugAssign)
    if whole and not kind(place.node, ast.Constant) and (added or not _passed_on(place)):
        yield Change(ast.BinOp(ast.Constant(0), ast.Mult(), place.node), "{old} is left out")
        if not kind(place.node, ast.UnaryOp):
            yield Change(ast.UnaryOp(ast.USub(), place.node), "the wrong sign of {old}")
        for d in range(1, 7):
            rounded = substituted(_parsed(f"np.round(a, {d})"), {"a": place.node})
            yield Change(rounded, f"{{old}} rounded to {d} decimals", 2, "rounded")
    for name, operator in OPERATORS.items():
        for change in operator(place.node, names):
            yield replace(change, operator=name)
