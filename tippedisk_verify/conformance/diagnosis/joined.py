"""How relations of single quantities are put together, and said."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from tippedisk_verify.conformance.diagnosis.entries import Array, Sheet
from tippedisk_verify.conformance.diagnosis.suspects import Cause

__all__ = ["Found", "joined"]

_STATEMENTS = 3  # different relations; more are several mistakes
_LAWS = ("both", "linear", "smooth")


@dataclass(frozen=True, eq=False)
class Found:
    """What wrong answers are instead of right."""

    name: str  #: a short word for the kind of relation
    says: str
    cells: Array  #: which answers of the sheet it explains
    rank: float  #: lower is simpler


def joined(sheet: Sheet, found: Sequence[Found]) -> list[Cause]:
    """Relations that hold for all wrong quantities, or the simplest one for each."""
    blamed, parts = set(sheet.stems[sheet.wrong]), list[tuple[Found, set[str]]]()
    whole = [cause for cause in found if blamed == set(sheet.stems[cause.cells])]
    if whole:
        return [Cause(_said(sheet, one.says, blamed), one.rank, one.name) for one in whole]
    for cause in found:
        mine = blamed & set(sheet.stems[cause.cells])
        parts += [(cause, mine)] if mine else []
        blamed -= mine
    texts = [_said(sheet, cause.says, mine) for cause, mine in parts]
    # Two quantities that have each other's values are exchanged.
    pairs = set(re.findall(r"^(\w+) has the values of (\w+)$", "\n".join(texts), re.M))
    for one, two in (pair for pair in pairs if pair[::-1] in pairs):
        old = f"{one} has the values of {two}"
        texts = [f"{min(one, two)} and {max(one, two)} are exchanged" if text == old else text for text in texts]
    texts = list(dict.fromkeys(texts))
    if blamed or len(texts) > _STATEMENTS:
        return []
    rank = max(cause.rank for cause, _ in parts) + len(texts) - 1
    return [Cause("; ".join(texts), rank, "-".join(dict.fromkeys(cause.name for cause, _ in parts)))]


def _said(sheet: Sheet, says: str, stems: set[str]) -> str:
    """A relation of some quantities, in words."""
    asked, laws = set(sheet.stems), sorted({stem.split(" ")[0] for stem in stems})
    names = sorted({stem.split(" ")[1] for stem in stems})
    one_law = {f"{law} {name}" for law in _LAWS for name in names} & asked != stems
    for kind, whole, least in ((r"^(lambda_\w+)_(re|im)$", r"\1", 2), (r"^(h|residual)_\d+$", r"\1_n", 3)):
        parts = [re.sub(kind, whole, name) for name in names]
        names = [part if parts.count(part) >= least else name for part, name in zip(parts, names, strict=True)]
    names = list(dict.fromkeys(names)) if stems != asked or len(stems) <= _STATEMENTS else ["all answers"]
    text = ", ".join(names[:-1]) + " and " * (len(names) > 1) + names[-1]
    verbs = {"has": "has", "is": "is"} if len(names) == 1 and names != ["all answers"] else {}
    text = says.format(**{"q": text, "has": "have", "is": "are", **verbs})
    return text + (f" under the {' and '.join(laws)} law" if one_law else "")
