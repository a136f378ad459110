"""The digits that agree with the printed ones."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tippedisk_verify.audit.claims import rounds_to
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.report.printed_digits import printed_digits_reached, split_at_agreement


@pytest.mark.parametrize(
    ("value", "printed", "count", "pieces"),
    [
        ("30.8866", "30.92", (2, 4), ("30", ".8866")),
        ("30.9169", "30.92", (4, 4), ("30.91", "69")),
        ("0.88668", "0.886", (2, 3), ("0.88", "668")),
        ("-128.7912", "-129.04", (2, 5), ("-12", "8.7912")),
        ("128.7912", "-129.04", (0, 5), ("", "128.7912")),
        (
            "1.18184621710526315789473684210526e-7",
            "1.31e-7",
            (1, 3),
            ("1", ".1818462171052631578…e-7"),
        ),
        ("stable", "7", None, ("", "stable")),
        ("7", "nan", None, ("", "7")),
    ],
)
def test_digits_that_agree(
    value: str, printed: str, count: tuple[int, int] | None, pieces: tuple[str, str]
) -> None:
    assert printed_digits_reached(value, printed) == count
    assert split_at_agreement(value, printed) == pieces


@given(
    st.decimals(-1000, 1000, places=6, allow_nan=False),
    st.decimals(-1000, 1000, places=2, allow_nan=False),
)
def test_all_printed_digits_agree_exactly_if_the_value_rounds_to_them(value, printed) -> None:
    assert "".join(split_at_agreement(f"{value:f}", f"{printed:f}")) == f"{value:f}"
    count = printed_digits_reached(f"{value:f}", f"{printed:f}")
    if count is None:
        assert printed == 0
        return
    rounds = rounds_to(Measured(Fraction(value), Fraction(0)), f"{printed:f}")
    half = abs(Fraction(value) - Fraction(printed)) == Fraction(1, 200)  # a tie may go either way
    assert half or rounds == (count[0] == count[1])
