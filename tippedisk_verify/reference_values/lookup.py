"""A reference value by its id, or all whose ids start alike: stored ones, and drawn ones, whose truths are computed."""

from __future__ import annotations

import re

from tippedisk_verify.errors import InputError
from tippedisk_verify.reference_values.store import Quantity, Reading, Store, stored

__all__ = ["full_id", "reference", "references"]

_MOST_NEAR = 5  # ids that an error suggests


def references(prefix: str = "", *, reading: Reading = "decimals") -> list[Quantity]:
    """The installed reference values whose id starts with ``prefix``, in order of difficulty.

    ``fresh-7-1/`` is the first disk that seed 7 draws, whose truths are computed here. From doubles, those are left
    out whose inputs doubles cannot tell apart. Raises InputError if none is left.
    """
    if not isinstance(prefix, str):
        raise InputError(f"the ids of reference values start with a string, not with {type(prefix).__name__}")
    prefix = full_id(prefix)
    store = _with_drawn(prefix)
    found = [q.read_from(reading) for q in store.matching(prefix) if reading != "doubles" or reading in q.values]
    if not found:
        raise InputError(f"no reference value starts with '{prefix[:100]}': try printed/ or calibrated/")
    return found


def reference(id_: str, *, reading: Reading = "decimals") -> Quantity:
    """The installed reference value of that id, for example ``printed/linear/limit-cycle/crit-0.5/period``.

    ``reading`` says what its inputs are taken as: the decimals as they stand, or the doubles nearest to them. Raises
    InputError if there is no such value, with the nearest ids.
    """
    if not isinstance(id_, str):
        raise InputError(f"the id of a reference value is a string, not {type(id_).__name__}")
    id_ = full_id(id_)
    quantity = _with_drawn(id_).get(id_)
    if quantity is None:
        near = _near(id_[:200])
        hint = f"; did you mean {' or '.join(near)}?" if near else "; `reference list` shows them"
        raise InputError(f"no reference value '{id_[:100]}'{hint}")
    return quantity.read_from(reading)


def full_id(id_: str) -> str:
    """The id with its set's name in the data: ``table1`` is there as ``printed``."""
    return re.sub("^table1(?=/|$)", "printed", id_)


def _near(asked: str) -> list[str]:
    """At most five ids that end as a wrong one, or else share its longest beginning; the most similar of them first."""
    from difflib import get_close_matches

    known, parts = list(stored()), asked.split("/")
    sharing = [id_ for id_ in known if asked and f"/{id_}".endswith(f"/{asked}")]
    while parts and not sharing:
        sharing = [id_ for id_ in known if id_.startswith("/".join([*parts, ""]))]
        parts.pop()
    return get_close_matches(asked, sharing or known, _MOST_NEAR, 0 if sharing else 0.5)


def _with_drawn(prefix: str) -> Store:
    """What is stored, and the truths of a drawn disk if ids start with its name."""
    if not prefix.startswith("fresh-"):
        return stored()
    from tippedisk_verify.reference_values.fresh import entries_of, with_fresh  # slow to import

    return with_fresh(stored(), entries_of(prefix))
