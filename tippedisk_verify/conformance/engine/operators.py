"""What people do wrong where they write a formula: one table of changes of a syntax tree.

An operator sees a node, the names that its function knows, and nothing else: no quantity, no level. It yields what may
stand there by mistake. A new kind of mistake is one entry in `OPERATORS`.
"""

from __future__ import annotations

import ast
import copy
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

__all__ = ["Change", "Place", "changes", "places", "shown", "statements", "throughout"]

Node = Any  # nodes of the syntax tree, whose classes have no common attributes
Path = tuple[tuple[Node, str, int | None], ...]  #: from the function down: node, field, index

#: Names of one kind, which are mistaken for each other; so are names that differ in one part only, as A_31 and A_32.
_KIN = (
    {"r", "e", "rho"}, {"A", "B", "Bbar", "M", "inertia"}, {"beta", "gamma"}, {"Omega", "v", "omega"},
    {"mu", "epsilon", "m", "g", "k"}, {"gamma_y", "w_y", "v"}, {"sin", "cos"}, {"sin", "tan"}, {"h", "f_G"},
    {"cos_beta", "sin_beta", "cos_gamma", "sin_gamma"}, {"C", "omega"}, {"rho", "rho_squared"}, {"matrix", "A_33"},
    {"chi", "delta"}, {"drho_dgamma", "rho", "e"}, {"m", "rho"}, {"q", "p_star"}, {"c_1", "dlambda"},
)  # fmt: skip
_CALLS = {"sin": ("cos", "tan"), "cos": ("sin",), "argmax": ("argmin",), "argmin": ("argmax",), "minimum": ("maximum",),
          "maximum": ("minimum",), "ceil": ("floor",), "exp": ("log",)}  # fmt: skip
#: What stands for a name by habit.
_HABITS = {
    "Omega": ("critical_speed(p)", "30.92", "1"), "rho": ("(r - e)", "(r + e)"), "Bbar": ("(B + m * e**2)",),
    "A": ("(A - m * e**2)", "(A + m * e**2)"), "g": ("9.8",), "pi": ("3.14", "3.1416", "180"),
}  # fmt: skip
_EXTRA = ("r", "e", "m", "g", "mu", "epsilon", "Omega", "omega", "rho", "M", "Bbar", "v")


@dataclass(frozen=True)
class Change:
    """What may stand in place of a node."""

    node: Node
    said: str = ""  #: of the term around it; "" for "NEW for OLD"
    rank: int = 0


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

    def term(self) -> Place:
        """The term of a sum, the argument or the whole right side that the expression is a part of."""
        path = self.path
        while len(path) > 1 and _kind(path[-1][0], ast.BinOp | ast.UnaryOp):
            if _kind(path[-1][0], ast.BinOp) and _kind(path[-1][0].op, ast.Add | ast.Sub):
                break
            path = path[:-1]
        return Place(self.function, self.statement, path)

    def wider(self) -> Place:
        """The expression around this one."""
        return Place(self.function, self.statement, self.path[:-1])

    def says(self, change: Change) -> str:
        """What is wrong, in the symbols of the formula."""
        around = self.term()
        if change.said:
            return change.said.format(old=shown(self.node), term=shown(around.node))
        inner = Place(around.node, None, self.path[len(around.path) :])
        new = inner.replaced(change.node) if inner.path else change.node
        return f"{shown(new)} for {shown(around.node)}"


def _child(parent: Node, field: str, index: int | None) -> Node:
    child = getattr(parent, field)
    return child if index is None else child[index]


def shown(node: Node) -> str:
    """An expression as one writes it: powers with ^, products with a space."""
    text = ast.unparse(ast.fix_missing_locations(copy.deepcopy(node)) if not _kind(node, ast.expr) else node)
    text = re.sub(r"\bnp\.", "", text).replace(" ** ", "^").replace(" * ", " ")
    return text if len(text) < 160 else text[:150] + " ..."


def statements(function: ast.FunctionDef | ast.Assign) -> Iterator[tuple[Node, Path]]:
    """The statements of a function with a value, at any depth."""
    if _kind(function, ast.Assign):
        yield function, ()
        return

    def inside(parent: Node, path: Path) -> Iterator[tuple[Node, Path]]:
        for field in ("body", "orelse"):
            for index, child in enumerate(getattr(parent, field, ())):
                down = (*path, (parent, field, index))
                if not (_kind(child, ast.Expr) and _kind(child.value, ast.Constant)):
                    yield child, down
                if _kind(child, ast.For | ast.If | ast.While | ast.With):
                    yield from inside(child, down)

    yield from inside(function, ())


def places(function: ast.FunctionDef | ast.Assign, statement: Node, path: Path) -> Iterator[Place]:
    """All expressions of a statement, but not those of the statements inside it."""

    def inside(node: Node, path: Path) -> Iterator[Place]:
        for field, value in ast.iter_fields(node):
            many = value if _kind(value, list) else [value]
            hidden = field in ("body", "orelse") and _kind(node, ast.stmt)
            hidden = hidden or (field == "func" and not _kind(value, ast.Attribute))
            hidden = hidden or (field in ("targets", "target") and not _kind(many[0], ast.Subscript))
            for index, child in enumerate(() if hidden else many):
                if _kind(child, ast.expr):
                    down = (*path, (node, field, index if _kind(value, list) else None))
                    yield Place(function, statement, down)
                    yield from inside(child, down)

    yield from inside(statement, path)


def _kind(node: Node, kinds: Any) -> bool:
    """isinstance, without a narrower type: nodes are told apart by their fields."""
    return isinstance(node, kinds)


def _number(value: float) -> Node:
    return ast.Constant(value)


def _name(text: str) -> Node:
    return ast.Name(text, ast.Load())


def _call(name: str, *arguments: Node) -> Node:
    return ast.Call(_name(name), list(arguments), [])


def _is(node: Node, *operators: Any) -> bool:
    return _kind(node, ast.BinOp) and _kind(node.op, operators)


def _signs(node: Node, names: Sequence[str]) -> Iterator[Change]:
    if _is(node, ast.Add, ast.Sub):
        other = ast.Sub() if _kind(node.op, ast.Add) else ast.Add()
        yield Change(ast.BinOp(node.left, other, node.right))
        if not _is(node.left, ast.Add, ast.Sub) and not _kind(node.left, ast.UnaryOp):
            yield Change(ast.BinOp(ast.UnaryOp(ast.USub(), node.left), node.op, node.right))
    elif _kind(node, ast.UnaryOp) and _kind(node.op, ast.USub):
        yield Change(node.operand, "the minus sign of {old} is missing")
    elif _kind(node, ast.Name | ast.Call | ast.Subscript | ast.BinOp):
        yield Change(ast.UnaryOp(ast.USub(), node), "", 1)


def _dropped(node: Node, names: Sequence[str]) -> Iterator[Change]:
    if _is(node, ast.Add):
        yield Change(node.left, f"the term {shown(node.right)} is missing in {{old}}")
        yield Change(node.right, f"the term {shown(node.left)} is missing in {{old}}")
    elif _is(node, ast.Sub):
        yield Change(node.left, f"the term -{shown(node.right)} is missing in {{old}}")
        yield Change(ast.UnaryOp(ast.USub(), node.right), f"the term {shown(node.left)} is missing in {{old}}")
    elif _is(node, ast.Mult):
        yield Change(node.left, f"the factor {shown(node.right)} is missing in {{term}}")
        yield Change(node.right, f"the factor {shown(node.left)} is missing in {{term}}")
    elif _is(node, ast.Div):
        yield Change(node.left, f"the divisor {shown(node.right)} is missing in {{term}}")
        yield Change(ast.BinOp(_number(1), node.op, node.right), "", 1)
    elif _kind(node, ast.Call) and len(node.args) == 1 and _kind(node.args[0], ast.expr):
        yield Change(node.args[0], f"{shown(node.args[0])} for {{old}}", 1)
    elif _kind(node, ast.Call) and len(node.args) > 2 and _kind(node.func, ast.Name):
        for place in range(len(node.args)):
            fewer = node.args[:place] + node.args[place + 1 :]
            yield Change(
                ast.Call(node.func, fewer, node.keywords),
                f"the factor {shown(node.args[place])} is missing in {{old}}",
            )
    elif _kind(node, ast.Attribute | ast.Call) and _kind(getattr(node, "func", node), ast.Attribute):
        attribute: Node = node.func if _kind(node, ast.Call) else node
        yield Change(attribute.value, "", 1)


def _exchanged(node: Node, names: Sequence[str]) -> Iterator[Change]:
    if _kind(node, ast.Name):
        for other in names:
            if akin(node.id, other):
                yield Change(_name(other))
        for other in _HABITS.get(node.id, ()):
            yield Change(ast.parse(other, mode="eval").body, "", 2)


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


def _functions(node: Node, names: Sequence[str]) -> Iterator[Change]:
    if _kind(node, ast.Call):
        called = node.func.id if _kind(node.func, ast.Name) else getattr(node.func, "attr", "")
        for other in _CALLS.get(called, ()):
            named = _kind(node.func, ast.Name)
            function = _name(other) if named else ast.Attribute(node.func.value, other, ast.Load())
            yield Change(ast.Call(function, node.args, node.keywords), f"{other} for {called} in {{term}}")
        if called in ("sin", "cos"):
            twice = ast.BinOp(_number(2), ast.Mult(), node.args[0])
            yield Change(ast.Call(node.func, [twice], []), "", 1)
            half_turn = ast.BinOp(node.args[0], ast.Sub(), ast.BinOp(_name("pi"), ast.Div(), _number(2)))
            yield Change(ast.Call(node.func, [half_turn], []), "", 2)
            degrees = ast.BinOp(node.args[0], ast.Mult(), ast.BinOp(_name("pi"), ast.Div(), _number(180)))
            yield Change(ast.Call(node.func, [degrees], []), "{old} of degrees", 2)
        if len(node.args) == 2:
            yield Change(ast.Call(node.func, node.args[::-1], node.keywords), "", 1)
        if called == "where" and len(node.args) == 3:
            for kept in (node.args[1], node.args[2]):
                yield Change(kept, f"{shown(kept)} throughout for {{old}}", 0)
            exchanged = ast.Call(node.func, [node.args[0], node.args[2], node.args[1]], [])
            yield Change(exchanged, "the two cases exchanged in {old}")
    if _kind(node, ast.Attribute) and node.attr in ("real", "imag"):
        yield Change(ast.Attribute(node.value, {"real": "imag", "imag": "real"}[node.attr], node.ctx), "", 0)
        yield Change(_call("abs", node.value), "", 1)
    if _kind(node, ast.Call) and _kind(node.func, ast.Attribute) and node.func.attr == "conj":
        yield Change(node.func.value, "{old} without conj", 0)
    if _kind(node, ast.Compare) and len(node.ops) == 1:
        for operator in (ast.Lt, ast.Gt, ast.NotEq if _kind(node.ops[0], ast.Eq) else ast.Eq):
            if not _kind(node.ops[0], operator):
                yield Change(ast.Compare(node.left, [operator()], node.comparators), "", 1)


def _numbers(node: Node, names: Sequence[str]) -> Iterator[Change]:
    if _kind(node, ast.Constant) and _kind(node.value, int | float) and not _kind(node.value, bool):
        others = [node.value + 1, node.value - 1, 2 * node.value, node.value / 2, -node.value, node.value + 2, 1, 3]
        if _kind(node.value, int):
            others = [int(one) if one == int(one) else one for one in others]
        for other in dict.fromkeys(others):
            if other != node.value:
                yield Change(_number(other), "", 1)


def _multiples(node: Node, names: Sequence[str]) -> Iterator[Change]:
    if _kind(node, ast.Name | ast.Call | ast.Subscript) or _is(node, ast.Mult, ast.Div, ast.Pow):
        for number in (2, 3):
            yield Change(ast.BinOp(_number(number), ast.Mult(), node), "", 1)
            yield Change(ast.BinOp(node, ast.Div(), _number(number)), "", 1)


def _powers(node: Node, names: Sequence[str]) -> Iterator[Change]:
    if _is(node, ast.Pow):
        yield Change(node.left, f"{shown(node.left)} for {{old}} in {{term}}", 0)
        if _kind(node.right, ast.Constant):
            for exponent in (node.right.value + 1, node.right.value - 1, 2 * node.right.value):
                if exponent not in (0, 1):
                    yield Change(ast.BinOp(node.left, ast.Pow(), _number(exponent)), "", 1)
            yield Change(ast.BinOp(node.left, ast.Mult(), node.right), "", 1)
    elif _kind(node, ast.Name | ast.Call | ast.Subscript):
        yield Change(ast.BinOp(node, ast.Pow(), _number(2)), "", 1)
        yield Change(_call("sqrt", node), "", 2)
    elif _is(node, ast.Div):
        yield Change(ast.BinOp(node, ast.Pow(), _number(2)), "", 2)


def _parentheses(node: Node, names: Sequence[str]) -> Iterator[Change]:
    sums = (ast.Add, ast.Sub)
    if _is(node, ast.Mult, ast.Div):
        if _is(node.right, *sums):
            first = ast.BinOp(node.left, node.op, node.right.left)
            yield Change(ast.BinOp(first, node.right.op, node.right.right), "", 1)
        if _is(node.left, *sums):
            last = ast.BinOp(node.left.right, node.op, node.right)
            yield Change(ast.BinOp(node.left.left, node.left.op, last), "", 1)
        if _kind(node.op, ast.Div) and _is(node.right, ast.Mult):
            first = ast.BinOp(node.left, ast.Div(), node.right.left)
            yield Change(ast.BinOp(first, ast.Mult(), node.right.right), "", 0)
        if _kind(node.op, ast.Mult):
            yield Change(ast.BinOp(node.left, ast.Div(), node.right), "", 1)
            yield Change(ast.BinOp(node.left, ast.Add(), node.right), "", 2)
        else:
            yield Change(ast.BinOp(node.left, ast.Mult(), node.right), "", 1)
            yield Change(ast.BinOp(node.right, ast.Div(), node.left), "", 1)
    if _is(node, ast.Pow) and _is(node.left, ast.Add, ast.Sub, ast.Mult, ast.Div):
        last = ast.BinOp(node.left.right, ast.Pow(), node.right)
        yield Change(ast.BinOp(node.left.left, node.left.op, last), "", 1)
    if _is(node, *sums) and _is(node.right, ast.Mult, ast.Div):
        first = ast.BinOp(node.left, node.op, node.right.left)
        yield Change(ast.BinOp(first, node.right.op, node.right.right), "", 2)
    if _is(node, *sums) and _is(node.left, ast.Mult, ast.Div):
        last = ast.BinOp(node.left.right, node.op, node.right)
        yield Change(ast.BinOp(node.left.left, node.left.op, last), "", 2)
    if _is(node, ast.Sub) and _is(node.left, *sums):
        last = ast.BinOp(node.left.right, ast.Sub(), node.right)
        yield Change(ast.BinOp(node.left.left, node.left.op, last), "", 2)
    if _kind(node, ast.Call) and len(node.args) == 1 and _is(node.args[0], *sums, ast.Mult, ast.Div):
        inner = node.args[0]
        yield Change(ast.BinOp(ast.Call(node.func, [inner.left], []), inner.op, inner.right), "", 2)


def _indices(node: Node, names: Sequence[str]) -> Iterator[Change]:
    if _kind(node, ast.Tuple | ast.List) and 2 <= len(node.elts) <= 9:
        for first in range(len(node.elts)):
            for second in range(first + 1, len(node.elts)):
                if ast.dump(node.elts[first]) == ast.dump(node.elts[second]):
                    continue
                elements = list(node.elts)
                elements[first], elements[second] = elements[second], elements[first]
                one, other = shown(node.elts[first]), shown(node.elts[second])
                yield Change(type(node)(elements, node.ctx), f"{one} and {other} exchanged in {{old}}", 1)
    if _kind(node, ast.Subscript) and _kind(node.slice, ast.Tuple) and len(node.slice.elts) == 3:
        first, row, column = node.slice.elts
        transposed = ast.Tuple([first, column, row], ast.Load())
        yield Change(ast.Subscript(node.value, transposed, node.ctx), "", 1)


def _precision(node: Node, names: Sequence[str]) -> Iterator[Change]:
    if _kind(node, ast.Name | ast.BinOp | ast.Call):
        narrow = ast.Call(ast.Attribute(_name("np"), "float32", ast.Load()), [node], [])
        yield Change(narrow, "{old} in single precision", 3)
        yield Change(_call("abs", node), "the modulus of {old}", 2)


def _swapped(node: Node, names: Sequence[str]) -> Iterator[Change]:
    if _is(node, ast.Add, ast.Sub, ast.Mult):
        used = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
        for one in used:
            for other in used:
                if one < other and akin(one, other):
                    yield Change(renamed(node, {one: other, other: one}), f"{one} and {other} exchanged in {{old}}", 1)


def renamed(node: Node, names: Mapping[str, str]) -> Node:
    """The same with other names; what has none of them is shared."""
    if _kind(node, ast.Name):
        known = node.id in names and _kind(node.ctx, ast.Load)
        return ast.copy_location(_name(names[node.id]), node) if known else node
    changed: dict[str, Any] = {}
    for field, value in ast.iter_fields(node):
        if _kind(value, ast.AST):
            new: Any = renamed(value, names)
        elif _kind(value, list):
            new = [renamed(part, names) if _kind(part, ast.AST) else part for part in value]
            new = value if all(one is other for one, other in zip(new, value, strict=True)) else new
        else:
            continue
        if new is not value:
            changed[field] = new
    if not changed:
        return node
    upper = copy.copy(node)
    for field, value in changed.items():
        setattr(upper, field, value)
    return upper


def _extra(node: Node, names: Sequence[str]) -> Iterator[Change]:
    if _kind(node, ast.Name | ast.Call | ast.Attribute) or _is(node, ast.Mult, ast.Div, ast.Pow):
        for other in names:
            if other in _EXTRA and not (_kind(node, ast.Name) and node.id == other):
                yield Change(ast.BinOp(_name(other), ast.Mult(), node), f"the extra factor {other} in {{term}}", 2)
                yield Change(ast.BinOp(node, ast.Div(), _name(other)), f"{{term}} divided by {other}", 2)


Operator = Callable[[Node, Sequence[str]], Iterator[Change]]
OPERATORS: dict[str, Operator] = {
    "sign": _signs,
    "dropped": _dropped,
    "names": _exchanged,
    "functions": _functions,
    "numbers": _numbers,
    "multiples": _multiples,
    "powers": _powers,
    "parentheses": _parentheses,
    "indices": _indices,
    "swapped": _swapped,
    "extra": _extra,
    "precision": _precision,
}


def changes(place: Place, names: Sequence[str], whole: bool = False) -> Iterator[Change]:
    """What may stand there by mistake, by all operators; ``whole`` says that it is all that a statement computes."""
    if whole and not _kind(place.node, ast.Constant):
        yield Change(ast.BinOp(_number(0), ast.Mult(), place.node), "{old} is left out")
    for operator in OPERATORS.values():
        yield from operator(place.node, names)


def throughout(function: ast.FunctionDef, names: Sequence[str]) -> Iterator[tuple[str, ast.FunctionDef]]:
    """One name for another in the whole function, after it has its value: (phrase, function)."""
    used = [node.id for node in ast.walk(function) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)]
    for name in dict.fromkeys(used):
        if used.count(name) > 1:
            for other in names:
                if akin(name, other):
                    changed = renamed(function, {name: other})
                    yield f"{other} for {name} throughout", changed
