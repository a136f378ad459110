"""Computations that neither read nor change the caller's floating-point error state in NumPy.

NumPy's error state belongs to the caller's thread. It decides whether an underflow, which is
harmless here, is ignored, prints a warning or ends the program. Where an infinity or NaN matters,
results are tested for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from inspect import isfunction
from typing import TypeVar

__all__ = ["ignore_numpy_errors", "ignore_numpy_errors_in_methods"]

C = TypeVar("C", bound=type)


@contextmanager
def ignore_numpy_errors() -> Iterator[None]:
    """Ignore NumPy's floating-point errors while the context is entered.

    ``@ignore_numpy_errors()`` decorates a public function. NumPy is loaded when the function is
    called.
    """
    import numpy

    with numpy.errstate(all="ignore"):
        yield


def ignore_numpy_errors_in_methods(kind: C) -> C:
    """Decorate all public methods of a class with `ignore_numpy_errors`, its properties and
    ``__call__`` included.

    Args:
        kind: The class, which is changed.

    Returns:
        The class itself.
    """
    for name, member in list(vars(kind).items()):
        if name[0] == "_" and name != "__call__":
            continue
        if isfunction(member):
            setattr(kind, name, ignore_numpy_errors()(member))
        elif isinstance(member, classmethod):
            setattr(kind, name, classmethod(ignore_numpy_errors()(member.__func__)))
        elif isinstance(member, cached_property):
            member.func = ignore_numpy_errors()(member.func)
        elif isinstance(member, property) and member.fget is not None:
            setattr(kind, name, property(ignore_numpy_errors()(member.fget)))
    return kind
