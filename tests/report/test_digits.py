"""Digits that agree are told from those that do not, to the printed places."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tippedisk_verify.audit.claims import rounds_to
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.report.digits import agreed_digits, marked, shortened


@pytest.mark.parametrize(
    ("value", "uncertainty", "printed", "pieces"),
    [
        ("30.886592", "1e-5", "30.92", "agreed 30.|differs 886|beyond 5|open 92"),
        ("30.9169", "0", "30.92", "agreed 30.916|beyond 9"),
        ("0.88668", "0", "0.886", "agreed 0.88|differs 66|beyond 8"),
        ("-128.7912", "0", "-129.04", "agreed -12|differs 8.79|beyond 12"),
        ("128.7912", "0", "-129.04", "differs 128.79|beyond 12"),
        ("1.3143e-7", "0", "1.31e-7", "agreed 1.31|beyond 43|agreed e-7"),
        ("9.99", "0.5", "10.0", "agreed 9.|open 99"),
        ("5.25", "0.1", "", "beyond 5.|open 25"),
        ("no number", "0", "3", "beyond no number"),
    ],
)
def test_pieces(value: str, uncertainty: str, printed: str, pieces: str) -> None:
    assert "|".join(f"{kind} {text}" for kind, text in marked(value, uncertainty, printed)) == pieces


@pytest.mark.parametrize(
    ("value", "printed", "count"),
    [
        ("30.8866", "30.92", (2, 4)),
        ("30.9169", "30.92", (4, 4)),
        ("1.18e-7", "1.31e-7", (1, 3)),
        ("2", "7", (0, 1)),
        ("-7", "7", (0, 1)),
        ("stable", "7", None),
        ("7", "stable", None),
        ("7", "nan", None),
    ],
)
def test_counts(value: str, printed: str, count: tuple[int, int] | None) -> None:
    assert agreed_digits(value, printed) == count


@given(st.decimals(-1000, 1000, places=6, allow_nan=False), st.decimals(-1000, 1000, places=2, allow_nan=False))
def test_all_printed_digits_agree_exactly_if_the_value_rounds_to_them(value, printed) -> None:
    text = f"{value:f}"
    assert "".join(piece for _, piece in marked(text, "1e-5", f"{printed:f}")) == text
    count = agreed_digits(text, f"{printed:f}")
    if count is None:
        assert printed == 0
        return
    rounds = rounds_to(Measured(Fraction(value), Fraction(0)), f"{printed:f}")
    half = abs(Fraction(value) - Fraction(printed)) == Fraction(1, 200)  # a tie may go either way
    assert half or rounds == (count[0] == count[1])


def test_a_long_number_keeps_its_exponent() -> None:
    pieces = shortened("1.18184621710526315789473684210526e-7", "1e-50", "1.31e-7")
    text = "".join(piece for _, piece in pieces)
    assert text.startswith("1.1818462171")
    assert text.endswith("…e-7")
    assert shortened("30.25", "0") == marked("30.25", "0")
