"""Computations that neither read nor change the caller's floating-point error state in NumPy.

NumPy's error state belongs to the caller's thread. It decides whether an underflow, which is
harmless here, is ignored, prints a warning or ends the program. Where an infinity or NaN matters,
results are tested for it.
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
    """Wrap a public function so that NumPy's floating-point errors are ignored while it runs.

    Args:
        function: The function.
    """

    @wraps(function)
    def call(*args: P.args, **options: P.kwargs) -> R:
        import numpy

        with numpy.errstate(all="ignore"):
            return function(*args, **options)

    return call


def undisturbed_methods(kind: C) -> C:
    """Make all public methods of a class `undisturbed`, its properties and ``__call__`` included.

    Args:
        kind: The class, which is changed.

    Returns:
        The class itself.
    """
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
