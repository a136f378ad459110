"""Whatever holds balls side by side - lists, sets of states, steps, paths - taken apart and put together by its balls.

A batch is told apart by masks, arrays of truth values. A single ball is told apart by True or False: code that asks
for the places of a mask with something in it gets all there is.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from tippedisk_verify.proofs.kernel.frame import Frame
from tippedisk_verify.proofs.kernel.lanes import Lanes

__all__ = ["among", "chosen", "mapped", "replaced", "some", "some_model"]


def mapped(function: Callable[..., Any], tree: Any, *others: Any) -> Any:
    """The same structure with the function of its lanes and arrays; the others have the same structure."""
    if isinstance(tree, Lanes | np.ndarray):
        return function(tree, *others)
    if isinstance(tree, list | tuple):
        images = [mapped(function, *parts) for parts in zip(tree, *others, strict=True)]
        return type(tree)(*images) if hasattr(tree, "_fields") else type(tree)(images)
    if not (isinstance(tree, Frame) or is_dataclass(tree)):
        return tree
    names = Frame.__slots__ if isinstance(tree, Frame) else [entry.name for entry in fields(tree)]
    image = copy(tree)
    getattr(image, "__dict__", {}).pop("end", None)  # a step's, of all of the batch
    for name in names:
        object.__setattr__(image, name, mapped(function, *(getattr(part, name) for part in (tree, *others))))
    return image


def some(tree: Any, which: Any) -> Any:
    """Those in the places ``which``, a mask or indices."""
    return tree if np.ndim(which) == 0 else mapped(lambda part: part[which], tree)


def replaced(tree: Any, which: Any, values: Any) -> Any:
    """The tree with ``values``, as many as there are places ``which``, in these."""
    return values if np.ndim(which) == 0 else mapped(lambda old, new: _replaced(old, which, new), tree, values)


def chosen(mask: Any, tree: Any, other: Any) -> Any:
    """The tree where the mask is true, the other one where it is not."""
    if np.ndim(mask) == 0:
        return tree if mask else other
    return mapped(lambda x, y: x.where(mask, y) if isinstance(x, Lanes) else np.where(mask, x, y), tree, other)


def among(mask: Any, shown: Any) -> Any:
    """A mask of those places of ``mask`` of which ``shown``, an entry for each of these, is true."""
    if np.ndim(mask) == 0:
        return mask and bool(shown)
    result = np.zeros_like(mask)
    result[mask] = shown
    return result


def some_model(model: Any, which: Any) -> Any:
    """The model for some speeds; constants that are one ball go with any."""
    if np.ndim(which) == 0:
        return model
    if hasattr(model, "some"):
        return model.some(which)
    constants = type(model.constants)(*(part if len(part) == 1 else part[which] for part in model.constants))
    return type(model)(constants, model.omega[which], model.law)


def _replaced(old: Any, which: Any, new: Any) -> Any:
    if isinstance(old, Lanes):
        return Lanes(_replaced(old.midpoints, which, new.midpoints), _replaced(old.radii, which, new.radii))
    result = old.copy()
    result[which] = new
    return result
