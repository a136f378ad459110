"""Planted optimism: half-widths with one of their terms taken out, to see whether the draws notice.

A term is a constant of a module, or a piece of a function's text; both are named by what stands in the code, so that a
term that has gone, or has been rewritten, is seen to have gone. A new term is one more line of `TERMS`.
"""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, reduce
from importlib import import_module
from types import FunctionType
from typing import Any

__all__ = ["TERMS", "Term", "planted"]


@dataclass(frozen=True)
class Term:
    """One term of an error budget, and what takes it out (or makes it smaller than it must be)."""

    what: str
    module: str  #: within the package
    name: str  #: a constant, or a function or method whose text has the term
    old: str | None  #: the text, once in the function; None for a constant
    new: object  #: the text instead of it, or the constant's value
    kinds: tuple[str, ...]  #: of draws that notice it


_ESTIMATE, _CYCLE, _BRANCH = "flow.error_estimate", "orbits.cycle_budget", "orbits.branch_budget"
_RUNS, _CYCLES, _FAMILY = ("flow", "half periods"), ("limit-cycle in double",), ("branch",)
TERMS = (
    Term("the distance", _ESTIMATE, "budgeted", "abs(exact - truths) * DISTANCES", "0 * abs(exact - truths)", _RUNS),
    Term("the wider run's rounding", _ESTIMATE, "_WIDER_SHARE", None, 0.0, _RUNS),
    Term("the spread", _CYCLE, "TWIN_FACTOR", None, 0.0, _CYCLES),
    Term("most of the spread", _CYCLE, "TWIN_FACTOR", None, 0.25, _CYCLES),
    Term("the spread", _BRANCH, "TWIN_FACTOR", None, 0.0, _FAMILY),
    Term("most of the spread", _BRANCH, "TWIN_FACTOR", None, 0.1, _FAMILY),
)


@contextmanager
def planted(term: Term) -> Iterator[None]:
    """Without the term. Raises LookupError if it is not where it is said to be."""
    module = import_module(f"tippedisk_verify.{term.module}")
    if term.old is None:
        before = getattr(module, term.name)
        setattr(module, term.name, term.new)
        try:
            yield
        finally:
            setattr(module, term.name, before)
        return
    function = _function(reduce(getattr, term.name.split(".")[:-1], module), term.name.rpartition(".")[2])
    text = textwrap.dedent(inspect.getsource(function))
    if text.count(term.old) != 1:
        raise LookupError(f"{term.module}.{term.name} has {text.count(term.old)} times the text of '{term.what}'")
    made: dict[str, Any] = {}
    exec(compile(text.replace(term.old, str(term.new)), f"<{term.what}>", "exec"), vars(module), made)
    # The code is what changes: whoever imported the function by name has the same one.
    code, function.__code__ = function.__code__, _function(made, function.__name__).__code__
    try:
        yield
    finally:
        function.__code__ = code


def _function(owner: Any, name: str) -> FunctionType:
    """The function that stands there, out of what wraps it."""
    found = owner[name] if isinstance(owner, dict) else inspect.getattr_static(owner, name)
    for wrapper, inner in (
        (classmethod, "__func__"),
        (staticmethod, "__func__"),
        (property, "fget"),
        (cached_property, "func"),
    ):
        if isinstance(found, wrapper):
            found = getattr(found, inner)
    return inspect.unwrap(found)  # type: ignore[no-any-return]
