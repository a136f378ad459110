"""Grading from Python without a sheet: answers by id, in one call."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from tippedisk_verify.conformance.diagnosis import diagnosed
from tippedisk_verify.conformance.grading import answer_text, graded, levels_of
from tippedisk_verify.conformance.pages import Report
from tippedisk_verify.conformance.sheet import Answers
from tippedisk_verify.errors import InputError
from tippedisk_verify.model.surroundings import undisturbed
from tippedisk_verify.progress import progress_of
from tippedisk_verify.reference_values.lookup import full_id, reference
from tippedisk_verify.reference_values.store import Reading, stored

__all__ = ["grade"]


@undisturbed
def grade(answers: Mapping[str, object], *, reading: Reading = "doubles", progress: bool | None = None) -> Report:
    """The grades of many answers by id, with a diagnosis; ``reading`` is what they were computed from.

    What takes longer than two seconds shows its progress, unless ``progress`` is False.

    An answer is what `compare` takes. Anything else (None, a complex number, an array of several) is a failure with a
    note. The result's ``passed`` and ``failed`` are for a test, and str() of it is the reason.

    Raises InputError for an unknown id, and where there is no answer at all.
    """
    if not isinstance(answers, Mapping):
        raise InputError(f"answers are given by id, as a dictionary, not as {type(answers).__name__}")
    if not answers:
        raise InputError("there is no answer to grade")
    if reading not in ("decimals", "doubles"):
        raise InputError(f"answers are computed from decimals or doubles, not from '{reading!s:.40}'")
    store = stored()
    if any(str(id_).startswith("fresh-") for id_ in answers):
        from tippedisk_verify.reference_values.fresh import with_fresh

        with progress_of(progress=progress) as advance:
            store = with_fresh(store, "\n".join(map(str, answers)), advance)
    given, notes = Answers(), {}
    for asked_id, answer in answers.items():
        id_ = full_id(asked_id) if isinstance(asked_id, str) else asked_id
        given.sets.add((store.get(id_) or reference(id_)).set)  # which says what is wrong with an unknown id
        try:
            text = answer_text(answer)
        except InputError as fault:
            notes[id_], text = str(fault), f"({type(answer).__name__})"
        given.given[id_] = reading, text
    grades = [replace(one, note=notes[one.id]) if one.id in notes else one for one in graded(given, store)]
    asked = [quantity for quantity in store.values() if quantity.set in given.sets]
    with progress_of(progress=progress) as advance:
        return Report("answers", given, grades, levels_of(grades, asked), diagnosed(grades, store, advance))
