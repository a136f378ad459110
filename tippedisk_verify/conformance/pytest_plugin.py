"""Fixtures for the test suites of other implementations.

pytest finds them where this package is installed.

``tippedisk_reference(id)`` is a reference value. ``tippedisk_agrees(id, answer, digits=10)`` fails
a test with one line that names the answer's digits. An unknown id, or an answer that is not one
real number, fails it with one line as well. Nothing is loaded until a test requests one of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

from tippedisk_verify.errors import InputError

if TYPE_CHECKING:
    from tippedisk_verify.conformance.grading import Grade
    from tippedisk_verify.reference_values.store import Reading, ReferenceValue

__all__ = ["tippedisk_agrees", "tippedisk_reference"]


@pytest.fixture(scope="session")
def tippedisk_reference() -> Callable[[str], ReferenceValue]:
    """Return a function that looks up a reference value: (id, reading="decimals") -> value.

    The value is a number that has ``.parameters`` and ``.inputs``.
    """
    from tippedisk_verify.reference_values.lookup import reference

    return _in_one_line(reference)


@pytest.fixture(scope="session")
def tippedisk_agrees() -> Callable[..., Grade]:
    """Return a function that fails the test if an answer has too few digits.

    It is called as (id, answer, digits=..., reading="doubles") and returns the grade. Without
    ``digits`` it requires those that the question needs.
    """
    from tippedisk_verify.conformance.grading import compare

    compared = _in_one_line(compare)

    def agrees(
        id_: str, answer: Any, *, digits: float | None = None, reading: Reading = "doubles"
    ) -> Grade:
        __tracebackhide__ = True
        grade: Grade = compared(id_, answer, reading=reading)
        wanted = grade.required_digits if digits is None else digits
        # An answer that is right to the reference's own digits has as many as anyone can ask for.
        if not (grade.digits >= wanted or grade.verdict == "exact"):
            pytest.fail(grade.shortfall(wanted), pytrace=False)
        return grade

    return agrees


def _in_one_line(function: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a function so that an InputError fails the test with one line."""

    def called(id_: str, *given: Any, **options: Any) -> Any:
        __tracebackhide__ = True
        try:
            return function(id_, *given, **options)
        except InputError as fault:
            reason = str(fault)
        pytest.fail(f"{id_}: {reason}", pytrace=False)  # out here pytest has no other error to show

    return called
