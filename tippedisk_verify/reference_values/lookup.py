"""The search for reference values by id, whether stored or drawn and computed on demand."""

from __future__ import annotations

import re

from tippedisk_verify.errors import InputError
from tippedisk_verify.reference_values.store import Reading, ReferenceValue, Store, load_store

__all__ = ["full_id", "reference", "references"]

_MAX_SUGGESTIONS = 5  # ids that an error message suggests


def references(prefix: str = "", *, reading: Reading = "decimals") -> list[ReferenceValue]:
    """Return all reference values whose id starts with ``prefix``, in order of difficulty.

    Args:
        prefix: The beginning of the ids. ``fresh-7-1/`` is the first disk that seed 7 draws, whose
            values are computed here.
        reading: "decimals" takes the inputs exactly, "doubles" as the doubles nearest to them. With
            "doubles", values whose inputs doubles cannot tell apart are left out.

    Raises:
        InputError: If no value is left.
    """
    if not isinstance(prefix, str):
        raise InputError(
            f"the ids of reference values start with a string, not with {type(prefix).__name__}"
        )
    prefix = full_id(prefix)
    store = _store_with_fresh(prefix)
    found = [
        reference_value.read_from(reading)
        for reference_value in store.matching(prefix)
        if reading != "doubles" or reading in reference_value.values
    ]
    if not found:
        raise InputError(
            f"no reference value starts with '{prefix[:100]}': try table1/ or calibrated/"
        )
    return found


def reference(id_: str, *, reading: Reading = "decimals") -> ReferenceValue:
    """Return the installed reference value with an id.

    Args:
        id_: The id, for example ``table1/linear/limit-cycle/crit-0.5/period``.
        reading: "decimals" takes the inputs exactly, "doubles" as the doubles nearest to them.

    Raises:
        InputError: If there is no such value. The message suggests the nearest ids.
    """
    if not isinstance(id_, str):
        raise InputError(f"the id of a reference value is a string, not {type(id_).__name__}")
    id_ = full_id(id_)
    reference_value = _store_with_fresh(id_).get(id_)
    if reference_value is None:
        near = _similar_ids(id_[:200])
        hint = f"; did you mean {' or '.join(near)}?" if near else "; `reference list` shows them"
        raise InputError(f"no reference value '{id_[:100]}'{hint}")
    return reference_value.read_from(reading)


def full_id(id_: str) -> str:
    """Return an id with the set name ``printed``, used before version 2.0, replaced by ``table1``."""
    return re.sub("^printed(?=/|$)", "table1", id_)


def _similar_ids(asked: str) -> list[str]:
    """Return at most five ids that resemble a wrong one, the most similar first.

    Ids with the same ending are preferred to those that share its longest beginning.
    """
    from difflib import get_close_matches

    known, parts = list(load_store()), asked.split("/")
    sharing = [id_ for id_ in known if asked and f"/{id_}".endswith(f"/{asked}")]
    while parts and not sharing:
        sharing = [id_ for id_ in known if id_.startswith("/".join([*parts, ""]))]
        parts.pop()
    return get_close_matches(asked, sharing or known, _MAX_SUGGESTIONS, 0 if sharing else 0.5)


def _store_with_fresh(prefix: str) -> Store:
    """Return the stored reference values, extended by those of a drawn disk if `prefix` starts with
    the disk's name.
    """
    if not prefix.startswith("fresh-"):
        return load_store()
    from tippedisk_verify.reference_values.fresh_questions import (  # slow to import
        fresh_entry_ids,
        with_fresh,
    )

    return with_fresh(load_store(), fresh_entry_ids(prefix))
