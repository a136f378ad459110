"""Parameter sets agree with their sources, and wrong ones are refused with a clear message."""

from __future__ import annotations

import tomllib
from fractions import Fraction
from pathlib import Path

import pytest

from tests.command_line import TABLE_1_FILE
from tippedisk_verify import CALIBRATED, DOUBLE, PRINTED, InputError, Parameters, precision_of_bits
from tippedisk_verify.model.parameters import NAMED_SETS, Constants
from tippedisk_verify.numbers.exact import fraction


def test_named_sets_are_as_documented() -> None:
    assert set(NAMED_SETS) == {"table1", "calibrated", "geometry"}
    assert Parameters.named("printed") is Parameters.named("table1") is PRINTED
    assert PRINTED.Bbar == Fraction("0.227e-3") - Fraction("0.435") * Fraction("0.0025") ** 2
    # Inside Table 1's rounding: half a unit of the last printed digit.
    for name in ("r", "e", "m"):
        assert getattr(CALIBRATED, name) == getattr(PRINTED, name)
    for name in ("A", "B"):
        assert abs(getattr(CALIBRATED, name) - getattr(PRINTED, name)) < Fraction("0.5e-6")


def test_constants_are_rounded_once_from_exact_values() -> None:
    for precision in (DOUBLE, precision_of_bits(200)):
        constants = PRINTED.constants_in(precision)
        assert constants is PRINTED.constants_in(precision)
        assert constants.pi == precision.pi
        for name, true in zip(Constants._fields[:-1], PRINTED.rational_constants(), strict=False):
            assert abs(fraction(getattr(constants, name)) - true) <= true * precision.epsilon / 2


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"m": "-1"}, "m must be positive"),
        ({"m": 0}, "m must be positive"),
        ({"e": "0.05"}, "smaller than the radius"),
        ({"r": "nan"}, "parameter r"),
        ({"g": float("inf")}, "parameter g"),
        ({"B": "0.3e-3"}, "B must not exceed A"),
        ({"B": "1e-6"}, "Bbar"),
        ({"C": "0.1e-3"}, "A must not exceed C"),
        ({"mu": "pi"}, "multiple of pi"),
        ({"m": -1, "r": "x", "g": "1e31"}, "between 1e-30 and 1e30"),
        ({"friction": "sticky"}, "linear or smooth"),
    ],
)
def test_each_fault_has_its_line(change: dict[str, object], word: str) -> None:
    with pytest.raises(InputError, match=word) as caught:
        PRINTED.changed(**change)
    # A disk with e >= r has its centre of gravity outside, and B cannot hold m e^2 either.
    assert len(caught.value.faults) == max(len(change), 2 if "e" in change else 1)


def test_the_definition_names_the_disk_exactly() -> None:
    """Check that it holds all numbers of the equations, and no others."""
    disk = PRINTED.changed(mu=Fraction(1, 3))
    definition = "r = 0.045 m, e = 0.0025 m, m = 0.435 kg, A = 0.000249 kg m^2, B = 0.000227 kg m^2, g = 9.81 m/s^2"
    assert disk.definition() == f"{definition}, mu = 1/3, epsilon = 0.1 m/s"


@pytest.mark.parametrize("name", ["printed", "table1", "disk"])
def test_a_file_is_never_taken_for_a_named_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Check that a file's own name leads back to it, so that printed commands are about it."""
    (tmp_path / name).write_text(TABLE_1_FILE.replace('"', ""), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    read = Parameters.named(str(tmp_path / name))
    assert read.name not in NAMED_SETS
    assert Parameters.named(read.name) == read == PRINTED.changed(C=None, name=read.name)


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "is empty"),
        (b"\x00\xff\xfe", "not a TOML text file"),
        (TABLE_1_FILE.replace("mu", "nu").encode(), "unknown key 'nu'"),
        (TABLE_1_FILE.replace('"0.435"', '["0.435"]').encode(), "a real number is needed"),
        (TABLE_1_FILE.replace('"0.435"', '"-0.435"').encode(), "m must be positive"),
        (TABLE_1_FILE.replace('"0.0025"', '"0.045"').encode(), "smaller than the radius"),
        (TABLE_1_FILE.replace('m = "0.435"\n', "").encode(), "key 'm' is missing"),
        (b"a = " + b"[" * 5000, "not a TOML text file"),
    ],
)
def test_bad_files_are_refused(tmp_path: Path, content: bytes, word: str) -> None:
    path = tmp_path / "disk.toml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=word):
        Parameters.named(str(path))


_DEEP = ".".join(["a"] * 150_000)


@pytest.mark.parametrize(
    "content",
    [
        f'{_DEEP} = "1"\n',
        f"[{_DEEP}]\n",
        f"{_DEEP[:1000]} = 1\n",
        f'"#".{_DEEP[:1000]} = 1\n',
        "#" * 100_000,
    ],
    ids=["deep key", "deep table", "deeper than any", "behind a quoted number sign", "large"],
)
def test_other_files_are_refused_unread(
    content: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Refuse a key of 300 kB, which once took minutes and all memory."""
    path = tmp_path / "disk.toml"
    path.write_text(content + TABLE_1_FILE, encoding="utf-8")
    monkeypatch.setattr(tomllib, "loads", lambda text: pytest.fail("parsed"))
    with pytest.raises(InputError, match=r"larger than 64000 bytes|more than 200 dots"):
        Parameters.from_toml(path)


def test_long_decimals_and_long_comments_are_read(tmp_path: Path) -> None:
    path = tmp_path / "disk.toml"
    lines = [f'{name} = "{text}{"0" * 3900}"' for name, text in PRINTED.decimals().items()]
    path.write_text("\n".join(["#" * 2000, "# " + "." * 150, *lines]), encoding="utf-8")
    assert Parameters.from_toml(path) == PRINTED.changed(name="disk.toml")
