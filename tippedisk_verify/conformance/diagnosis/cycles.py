"""What is wrong with cycles: which orbit was answered, at which speed, and what was made of the half map.

The answered state is flown for half the answered period: it closes, closes at another speed or by other equations, or
does not close. Where it is right, its half map and variants of it are made once, and put together wrongly.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.cycle_orbits import orbits
from tippedisk_verify.conformance.diagnosis.cycle_slips import answered, differences, instants, slips, variants
from tippedisk_verify.conformance.diagnosis.entries import Array, Sheet, Table
from tippedisk_verify.conformance.diagnosis.halfmap import RINGS
from tippedisk_verify.conformance.diagnosis.saddles import connections, near
from tippedisk_verify.conformance.diagnosis.search import Search
from tippedisk_verify.conformance.diagnosis.suspects import Cause

__all__ = ["cycle_causes"]


def cycle_causes(search: Search) -> list[Cause]:
    """The first of the mechanisms that gives all answers."""
    sheet, calm = search.sheet, _without_equilibria(search.sheet)
    if calm is None:
        return [Cause(_fallen(sheet), 1, name="cycle")]
    also = f"; {_fallen(sheet)}" * (calm is not sheet)
    ways = (connections,) if sheet.level == 8 else (near, instants, orbits, differences, slips, variants)
    with np.errstate(all="ignore"):
        for way in ways:
            partly = []
            for says, results in way(calm):
                parts = way in (slips, differences, variants)
                more = _fitting(calm, results, parts, -1.0 if way is differences else 0.0)
                says = says.replace("half map", "turn map") if sheet.level == 10 else says
                if more == "" or (more and says.startswith(more[5:-6])):
                    return [Cause(says + also, 1, name="cycle")]
                partly += [Cause(says + more + also, 1, name="cycle")] if more else []
            if partly:
                return partly[:1]
    return []


def _fitting(sheet: Sheet, results: list[Any], parts: bool, digits: float) -> str | None:
    """Whether all answers are those, or those of quantities that have wrong ones; None if not.

    Differences carry the errors of what they are formed of, so that fewer digits are asked of them.
    """
    picked = np.concatenate([table.picked(one or {}) for table, one in zip(sheet.tables, results, strict=True)])
    picked = np.where(np.isnan(picked), sheet.truth, picked)
    if sheet.fits(picked, digits):
        return ""
    stems = np.unique(sheet.stems[sheet.wrong])
    if parts and sheet.fits(np.where(np.isin(sheet.stems, stems), picked, sheet.truth), digits):
        return f", in {' and '.join(dict.fromkeys(stem.split(' ')[1] for stem in stems))} alone"
    return None


def _resting(table: Table) -> Array:
    """Which entries' answers are the equilibrium."""
    if table.kind not in RINGS:
        return np.zeros(len(table.entries), dtype=bool)
    (mine, _), (right, _) = answered(table, table.answer), answered(table, table.truth)
    return np.asarray((np.abs(mine) < 1e-3 * np.abs(right)).all(axis=0))


def _fallen(sheet: Sheet) -> str:
    count = sum(int(_resting(table).sum()) for table in sheet.tables)
    return f"the cycles of {count} speed{'s' * (count > 1)} are the equilibrium: a shooting that fell onto it"


def _without_equilibria(sheet: Sheet) -> Sheet | None:
    """The sheet without them; None if nothing else is wrong."""
    if not any(_resting(table).any() for table in sheet.tables):
        return sheet
    rest = sheet.where(lambda table: np.flatnonzero(~_resting(table)))
    return rest if rest.tables and rest.wrong.any() else None
