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
    draws: tuple[int, ...]  #: far ones that notice it, those first that notice it soon


_ESTIMATE, _CYCLE, _BRANCH = "flow.error_estimate", "orbits.cycle_budget", "orbits.branch_budget"
#: Half periods, with events and derivatives, and short runs; cycles in double; cycles that double does not hold to the
#: digits asked for; the branch as a function; Omega_h.
_RUNS = (28, 30, 33, 129, 131, 132, 133, 2, 5, 102, 104)
_CYCLES, _FINER, _FAMILY, _CONNECTION = (49, 50, 51, 52, 53, 55), (273, 276, 73), (85, 86), (94,)
#: Cycles whose chord iteration stands still above rounding. Which of them shows it differs with the packages' versions.
_CHORDS = (74, 73, 80, 77, 175)
#: Of the wider run's own error the distance tells nothing only where it is small by chance: that takes many numbers.
_DERIVATIVES = tuple(100 * block + place for block in range(16) for place in range(20, 28))
TERMS = (
    Term("the distance", _ESTIMATE, "DISTANCES", None, 0, _RUNS),
    Term("the wider run's rounding", _ESTIMATE, "_WIDER_SHARE", None, 0.0, _DERIVATIVES),
    Term("the spread", _CYCLE, "TWIN_FACTOR", None, 0.0, _CYCLES),
    Term("most of the spread", _CYCLE, "TWIN_FACTOR", None, 0.25, _CYCLES),
    Term("the spread, of the next wider arithmetic", _CYCLE, "TWIN_FACTOR", None, 0.0, _FINER),
    Term("what a chord iteration leaves", _CYCLE, "_STANDING", None, 0, _CHORDS),
    Term("the distance", "model.measured", "DISTANCES", None, 0, (74, *_FINER)),
    Term("the spread", _BRANCH, "TWIN_FACTOR", None, 0.0, _FAMILY),
    Term("most of the spread", _BRANCH, "TWIN_FACTOR", None, 0.1, _FAMILY),
    Term("the last Newton step", _BRANCH, "_SLOPE", None, 0, (288,)),
    Term("truncation between the nodes", "orbits.branch_interpolant", "DISTANCES", None, 0, _FAMILY),
    Term("the shift of the zero", "orbits.splitting", "DISTANCES", None, 0, _CONNECTION),
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
