"""Grading from Python without a sheet: answers by id, in one call."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from tippedisk_verify.conformance.diagnosis import diagnose
from tippedisk_verify.conformance.grade_pages import Report
from tippedisk_verify.conformance.grading import answer_text, grade_answers, tally_levels
from tippedisk_verify.conformance.sheet import Answers
from tippedisk_verify.errors import InputError
from tippedisk_verify.numbers.exact import is_one_of
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors
from tippedisk_verify.reference_values.lookup import full_id, reference
from tippedisk_verify.reference_values.store import Reading, load_store
from tippedisk_verify.support.progress import show_progress

__all__ = ["grade"]


@ignore_numpy_errors()
def grade(
    answers: Mapping[str, object], *, reading: Reading = "doubles", progress: bool | None = None
) -> Report:
    """Return the grades of many answers, with a diagnosis.

    Anything but a number (None, a complex number, an array of several) is a failure with a note.
    The result's ``passed`` and ``failed`` serve a test, and str() of the result is the reason.

    Args:
        answers: The answers by id, each as `compare` takes it.
        reading: The inputs from which the answers were computed, decimals or doubles.
        progress: False to show no progress. Otherwise a computation of more than two seconds shows
            it.

    Raises:
        InputError: If an id is unknown, or there is no answer at all.
    """
    if not isinstance(answers, Mapping):
        raise InputError(
            f"answers are given by id, as a dictionary, not as {type(answers).__name__}"
        )
    if not answers:
        raise InputError("there is no answer to grade")
    if not is_one_of(reading, ("decimals", "doubles")):
        raise InputError(
            f"answers are computed from decimals or doubles, not from '{reading!s:.40}'"
        )
    store = load_store()
    if any(str(id_).startswith("fresh-") for id_ in answers):
        from tippedisk_verify.reference_values.fresh_questions import with_fresh

        with show_progress(progress=progress) as advance:
            store = with_fresh(store, "\n".join(map(str, answers)), advance)
    collected, notes = Answers(), {}
    for asked_id, answer in answers.items():
        id_ = full_id(asked_id) if isinstance(asked_id, str) else asked_id
        # `reference` raises the error for an unknown id.
        collected.sets.add((store.get(id_) or reference(id_)).set)
        try:
            text = answer_text(answer)
        except InputError as fault:
            notes[id_], text = str(fault), f"({type(answer).__name__})"
        collected.by_id[id_] = reading, text
    grades = [
        replace(grade_, note=notes[grade_.id]) if grade_.id in notes else grade_
        for grade_ in grade_answers(collected, store)
    ]
    asked = [quantity for quantity in store.values() if quantity.set in collected.sets]
    with show_progress(progress=progress) as advance:
        return Report(
            "answers",
            collected,
            grades,
            tally_levels(grades, asked),
            diagnose(grades, store, advance),
        )
