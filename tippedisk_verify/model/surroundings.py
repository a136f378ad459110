"""Computations with a floating-point error state of their own: the caller's in NumPy neither reaches them nor changes.

NumPy's error state belongs to the caller's thread. It decides whether an underflow, which is harmless here, is ignored,
prints a warning or ends the program. Where an infinity or NaN matters, results are tested for it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, wraps
from inspect import isfunction
from typing import ParamSpec, TypeVar

__all__ = ["undisturbed", "undisturbed_methods"]

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)


def undisturbed(function: Callable[P, R]) -> Callable[P, R]:
    """Return the function as it runs when NumPy ignores all floating-point errors. For public functions."""

    @wraps(function)
    def call(*args: P.args, **options: P.kwargs) -> R:
        import numpy

        with numpy.errstate(all="ignore"):
            return function(*args, **options)

    return call


def undisturbed_methods(kind: C) -> C:
    """Make all public methods of a class `undisturbed`, its computed properties and ``__call__`` as well."""
    for name, member in list(vars(kind).items()):
        if name[0] == "_" and name != "__call__":
            continue
        if isfunction(member):
            setattr(kind, name, undisturbed(member))
        elif isinstance(member, classmethod):
            setattr(kind, name, classmethod(undisturbed(member.__func__)))
        elif isinstance(member, cached_property):
            member.func = undisturbed(member.func)
        elif isinstance(member, property) and member.fget is not None:
            setattr(kind, name, property(undisturbed(member.fget)))
    return kind
