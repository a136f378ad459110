"""Planted optimism: a room's half-widths a hundred times too narrow, to see whether the
default draws notice.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass, replace
from functools import reduce, wraps
from importlib import import_module
from typing import Any

import numpy

from tippedisk_verify import Measured, Parameters
from tippedisk_verify.flow.contract import ErrorEstimate

#: What makes half-widths, as module and function or method, and the kind of draws that must notice.
PLANTS = {
    "flow.half_widths_by_defect:_RunWithError._half_widths": "flow",
    "flow.half_widths_by_wider_run:_half_widths": "half periods",
    "cycles.shooting.error_budget:half_widths_by_twins": "limit cycle in double",
    "cycles.shooting.error_budget:half_widths_by_wider_run": "limit cycle",
    "cycles.families.interpolant:FamilyInterpolant.half_widths": "branch",
    "cycles.near_omega_h.cycles_by_broyden:with_uncertainty_of_omega_h": "next to Omega_h",
    "cycles.near_omega_h.cycles_by_passages:with_half_widths": "by passages",
    "connection.splitting:splitting_zero": "Omega_h by manifolds",
    "cycles.near_omega_h.period_continuation:limit_of_cycles": "Omega_h by limit cycles",
    "connection.bisection:bisect_omega_h": "Omega_h by bisection",
    "cycles.families.folds:_fold_in": "fold of rotating cycles",
    "motion.basin_boundary:BasinBoundary._upper": "basin boundary",
    "theory.hopf:hopf_point": "Hopf point",
    "theory.slow_manifold:analyse_slow_manifold": "slow manifold",
    "cycles.collocation.collocation_cycles:collocation_cycle": "harmonic balance",
    "proofs.ball_conversions:ball_to_measured": "proved closed forms",
}
_FACTOR = 100


def narrowed(result: Any, widths: bool = False) -> Any:
    """The same with a hundredth of its half-widths; arrays are half-widths, and so are floats
    if ``widths``.
    """
    if isinstance(result, Measured):
        return Measured(result.value, result.uncertainty / _FACTOR)
    if isinstance(result, numpy.ndarray) or (widths and isinstance(result, float)):
        return result / _FACTOR
    if is_dataclass(result) and not isinstance(result, Parameters):
        known = {part.name: getattr(result, part.name) for part in fields(result) if part.init}
        return replace(result, **narrowed(known, isinstance(result, ErrorEstimate)))
    if isinstance(result, dict):
        return {name: narrowed(value, widths) for name, value in result.items()}
    if isinstance(result, tuple | list):
        parts = [narrowed(part, widths) for part in result]
        return result._make(parts) if hasattr(result, "_make") else type(result)(parts)
    return result


@contextmanager
def planted(where: str) -> Iterator[None]:
    """What that function gives is too narrow meanwhile, for all who have imported it."""
    module, _, names = where.partition(":")
    *path, name = names.split(".")
    owner = reduce(getattr, path, import_module(f"tippedisk_verify.{module}"))
    was = getattr(owner, name)

    @wraps(was)
    def optimistic(*args: Any, **options: Any) -> Any:
        return narrowed(was(*args, **options))

    def replace_everywhere(old: Any, new: Any) -> None:
        ours = [
            module
            for known, module in sys.modules.items()
            if known.startswith(("tippedisk_verify", "tests.honesty"))
        ]
        for holder in (owner, *ours):
            if vars(holder).get(name) is old:
                setattr(holder, name, new)

    replace_everywhere(was, optimistic)
    try:
        yield
    finally:
        replace_everywhere(optimistic, was)  # in modules, too, that were imported meanwhile
