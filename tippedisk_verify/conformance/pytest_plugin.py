"""Fixtures for the test suites of other implementations; pytest finds them where this package is installed.

``tippedisk_reference(id)`` is a reference value; ``tippedisk_agrees(id, answer, digits=10)`` fails a test with
one line that says how many digits the answer has. Nothing is loaded until a test asks for one of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from tippedisk_verify.conformance.grading import Grade
    from tippedisk_verify.reference_values.store import Quantity, Reading

__all__ = ["tippedisk_agrees", "tippedisk_reference"]


@pytest.fixture(scope="session")
def tippedisk_reference() -> Callable[[str], Quantity]:
    """The function id -> reference value; ``float`` of it is the nearest double, ``.inputs`` what was asked."""
    from tippedisk_verify.reference_values.store import reference

    return reference


@pytest.fixture(scope="session")
def tippedisk_agrees() -> Callable[..., Grade]:
    """The function (id, answer, digits=..., reading="doubles") that fails the test unless the answer has the digits.

    ``digits`` is what the question needs if it is not given. Returns the grade.
    """
    from tippedisk_verify.conformance.grading import compare

    def agrees(id_: str, answer: Any, *, digits: float | None = None, reading: Reading = "doubles") -> Grade:
        __tracebackhide__ = True
        grade = compare(id_, answer, reading=reading)
        wanted = grade.needs if digits is None else digits
        # An answer that is right to the reference's own digits has as many as anyone can ask for.
        if not (grade.digits >= wanted or grade.verdict == "exact"):
            pytest.fail(
                f"{id_} = {grade.answer}: {grade.digits:.1f} digits, not {wanted:g}; the truth is {grade.truth}"
            )
        return grade

    return agrees
