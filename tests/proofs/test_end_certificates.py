"""Whole certificates of the cycles next to the connection: written by the command, accepted, and refused if changed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from fractions import Fraction

import pytest

from tests.proofs.end_entries import Change, disk, put, remember
from tests.proofs.saddle_orbits import OMEGA_H
from tippedisk_verify.cli import main
from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED
from tippedisk_verify.proofs import checker


@pytest.fixture(autouse=True)
def _context(monkeypatch: pytest.MonkeyPatch) -> None:
    remember(monkeypatch)


def tampered() -> Iterator[tuple[str, Change]]:
    """Changes of the whole certificate."""
    for name in ("A", "mu", "m"):
        yield "not shown|the branch", put("claim", "parameters", name, exact_text(getattr(PRINTED, name) * 1001 / 1000))
    yield "not shown|the branch", put("claim", "parameters", disk(CALIBRATED))
    yield "the branch", put("claim", "numbers", "omega_h", "value", exact_text(OMEGA_H + Fraction(1, 10**8)))
    yield "the branch", put("claim", "numbers", "omega_h", "uncertainty", "1e-25")
    yield "crossings lie in Q", put("claim", "gamma", "0.13")
    yield "crossings lie in Q", put("claim", "v", "0.26")
    yield "Q lies in N", put("claim", "v", "0.5")
    yield "is empty", put("claim", "low", "30.0569")
    yield "not shown|the branch", put("bits", 30)
    for name, value in (("steps", [100, 500]), ("steps", [500, 100]), ("length", "-1p-7"), ("length", "1p-3"),
                        ("reach", "1p-1"), ("cone", ["1p-90", "1p-90"]), ("orders", [1, 1])):  # fmt: skip
        yield "the branch", put("evidence", "branch", name, value)
    yield "flight 1 1: step 1", put("evidence", "orders", [1, 1])
    yield "no flights", put("evidence", "flights", [])
    yield "no flights", put("evidence", "flights", 2, [])
    for i, j in ((0, 0), (2, 7), (-1, -1)):
        at = ("evidence", "flights", i, j)
        yield "flight .*", put(*at, "steps", 195)
        yield "flight .*", put(*at, "steps", 207)
        yield "flight .*", put(*at, "length", "1p-6")
        yield "flight .*not positive", put(*at, "length", "-1p-8")


@pytest.mark.slow(minutes=10)
def test_the_certificate_of_printed_is_accepted_and_nothing_else_is(tmp_path, capsys) -> None:
    """400 CPU seconds: 95 for the proof, 175 for the writing, which checks it, and the rest for what is changed."""
    path = tmp_path / "end.json"
    arguments = ["certify", "heteroclinic", "--near", str(float(OMEGA_H)), "--digits", "9", "--cycles", "0.008"]
    assert main([*arguments, "--certificate", str(path)]) == 0
    text = path.read_text()
    assert len(text) < 10_000
    capsys.readouterr()
    assert main(["certify", "check", str(path), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["accepted"]
    for part in (PRINTED.definition(), "from 30.0474 to 30.0569 rad/s exactly one, Omega_h", "3 pi/2 - 0.14 <= gamma"):
        assert part in result["statement"]
    for line, act in tampered():
        content = json.loads(text)
        act(content)
        assert content != json.loads(text), line
        content["sha256"] = checker.digest(content)
        with pytest.raises(checker.Unproved, match=line):
            checker.proved(content)
