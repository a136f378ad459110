"""Certificates of Omega_h and of the cycles next to it: accepted as written, and refused if
tampered with.
"""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from tests.command_line import answer
from tests.proofs.cases import ChangeOfContent, proved_connection, replace_entry, sealed
from tests.proofs.saddle_orbits import OMEGA_H
from tippedisk_verify import PRINTED, shoot_limit_cycle
from tippedisk_verify.numbers.decimals import exact_text
from tippedisk_verify.numbers.exact import fraction
from tippedisk_verify.proofs.kernel.balls import arb, ball, working_precision
from tippedisk_verify.proofs.kernel.certificate_format import read_dyadic
from tippedisk_verify.proofs.kernel.certificates import (
    Unproved,
    cycles_near_omega_h,
    verify_content,
)
from tippedisk_verify.proofs.kernel.certificates.connection import _enclose_unstable_branch
from tippedisk_verify.proofs.kernel.saddle import SaddleCoordinates
from tippedisk_verify.proofs.search.cycles_near_omega_h_proof import prove_cycles_near_omega_h


@pytest.fixture(scope="module")
def certified(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The file of a certificate of Omega_h, and the statement that was proved, by the command."""
    path = tmp_path_factory.mktemp("certificates") / "omega_h.json"
    words = f"certify heteroclinic --near {float(OMEGA_H)} --digits 5 --certificate {path}"
    return path, answer(words)["statement"]


@pytest.fixture
def text(certified: tuple[Path, str]) -> str:
    """Its text."""
    return certified[0].read_text()


def refused(text: str, line: str, act: ChangeOfContent) -> None:
    content = json.loads(text)
    act(content)
    assert content != json.loads(text), line
    with pytest.raises(Unproved, match=line) as fault:
        verify_content(sealed(content))
    assert str(fault.value).isprintable()


#: Other disks than the one of which it is proved, and fewer bits.
DISKS: list[tuple[str, ChangeOfContent]] = [
    *(
        (
            ".",
            replace_entry(
                "claim", "parameters", name, exact_text(getattr(PRINTED, name) * 1001 / 1000)
            ),
        )
        for name in ("A", "mu", "m")
    ),
    ("no disk has", replace_entry("claim", "parameters", "e", "0.05")),
    (".", replace_entry("bits", 30)),
]


OF_THE_CONNECTION: list[tuple[str, ChangeOfContent]] = [
    ("the smooth law has sides", replace_entry("claim", "friction", "smooth")),
    ("box at the second saddle", replace_entry("claim", "beta", "0.0001")),
    ("eigenvalues", replace_entry("claim", "numbers", "lambda_u", "value", "6.65")),
    (
        "eigenvalues",
        lambda c: c["claim"]["numbers"].update(lambda_s=c["claim"]["numbers"]["lambda_ss"]),
    ),
    ("opposite sides", replace_entry("claim", "numbers", "omega_h", "uncertainty", "1e-8")),
    (
        "interval of speeds is empty",
        replace_entry("claim", "numbers", "omega_h", "uncertainty", "0"),
    ),
    (".", replace_entry("evidence", "directions", lambda rows: [row[::-1] for row in rows])),
    ("no inverse", replace_entry("evidence", "directions", [["1p0"] * 3] * 3)),
    ("next to the saddle", replace_entry("evidence", "unstable", "reach", "-1p-4")),
    ("unstable manifold", replace_entry("evidence", "unstable", "reach", "1p1")),
    ("next to the saddle", replace_entry("evidence", "cone", ["0p0", "1p-20"])),
    ("unstable manifold", replace_entry("evidence", "cone", ["1p-90", "1p-90"])),
    ("unstable manifold", replace_entry("evidence", "unstable", "graph", 0, 3, "1p0")),
    ("pass the saddle", replace_entry("evidence", "unstable", "graph", 1, 0, "1p-20")),
    ("block", replace_entry("evidence", "slow", "graph", 0, 1, "1p-4")),
    ("cones at the first saddle", replace_entry("evidence", "drift", ["1p-40", "1p-40", "1p-40"])),
    ("the block", replace_entry("evidence", "block", 0, "1p-20")),
    ("no other speed", replace_entry("evidence", "apart", 0, "1p10")),
    (".", replace_entry("evidence", "flight", lambda log: log[:-9])),
    ("steps end|log", replace_entry("evidence", "flight", [])),
    ("the flight, step 3", replace_entry("evidence", "flight", 2, "steps", 0, 0, "-1p-9")),
    (".", replace_entry("evidence", "flight", 5, "axes", [["0p0"] * 3] * 3)),
]


def test_the_certificate_of_omega_h_is_accepted(certified: tuple[Path, str]) -> None:
    path, statement = certified
    assert path.stat().st_size < 60_000
    assert "exactly one Omega with |Omega - 30.048868" in statement
    assert answer(f"certify check {path}") == {"accepted": True, "statement": statement}


def test_a_weaker_claim_is_accepted_as_what_it_says(text: str) -> None:
    content = json.loads(text)
    content["claim"]["unique"] = content["claim"]["upright"] = False
    sentence = verify_content(sealed(content))
    assert "at least one Omega" in sentence
    assert "all along" not in sentence


def test_the_branch_on_which_gamma_falls_is_not_taken_for_the_other_one(text: str) -> None:
    """In directions with a first column that mixes two eigenvectors, in which the falling
    branch has z_u > 0.
    """
    content = json.loads(text)
    claim, evidence = content["claim"], content["evidence"]
    with working_precision(content["bits"]):
        P = [[read_dyadic(entry) for entry in row] for row in evidence["directions"]]
        mixed = [[(2 * row[1] - row[0]).mid(), *row[1:]] for row in P]
        assert P[1][0] > 0
        assert mixed[1][0] > 0
        omega = ball(fraction(claim["numbers"]["omega_h"]["value"]))
        evidence: dict[str, Any] = {
            "unstable": {"graph": [[arb(0), arb(-2), arb(0)], [arb(0)] * 3], "reach": arb(2) ** -6},
            "cone": [arb(2) ** -4] * 2,
            "drift": [arb("0.01"), arb(4), arb(4)],
        }
        saddle = SaddleCoordinates(claim["parameters"], "linear", omega, mixed)
        with pytest.raises(Unproved, match="gamma grows where the branch leaves"):
            _enclose_unstable_branch(saddle, lambda name, *_: evidence[name])


@pytest.mark.parametrize(
    "share", [slice(5, None, 6), pytest.param(slice(None), marks=pytest.mark.slow)]
)
def test_no_tampered_certificate_of_omega_h_is_accepted(share: slice, text: str) -> None:
    for line, act in [*OF_THE_CONNECTION, *DISKS][share]:
        refused(text, line, act)
    content = json.loads(text)
    content["claim"]["beta"] = "0.006"
    with pytest.raises(Unproved, match="digest"):
        verify_content(content)


OF_THE_CYCLES: list[tuple[str, ChangeOfContent]] = [
    ("is empty", replace_entry("claim", "low", "30.0569")),
    ("is empty", replace_entry("claim", "high", "30.0488")),
    ("crossings lie in Q", replace_entry("claim", "gamma", "0.13")),
    ("crossings lie in Q", replace_entry("claim", "v", "0.26")),
    ("Q lies in N", replace_entry("claim", "v", "0.5")),
    ("the extents of D", replace_entry("claim", "gamma", "-0.14")),
    (".", replace_entry("claim", "high", "30.3")),
    (
        "opposite sides|eigenvalues",
        replace_entry("claim", "numbers", "omega_h", "uncertainty", "1e-25"),
    ),
    ("box lies in N|box at", replace_entry("evidence", "connection", "room", 1, "0.5")),
    ("eigenvalues", replace_entry("evidence", "connection", "eigenvalues", 0, 0, "7")),
    ("no flights", replace_entry("evidence", "flights", "lengths", [])),
    ("flight 1: the states", replace_entry("evidence", "flights", "lengths", 0, 0, "1p-4")),
    ("the extents", replace_entry("evidence", "box", "extents", 1, "0p0")),
    (".", replace_entry("evidence", "box", "extents", 0, "3p0")),
    ("the cones of the steep weights", replace_entry("evidence", "weights", "steep", 2, "1p-30")),
    ("the variation by the speed", replace_entry("evidence", "weights", "drift", 0, "1p-30")),
    ("no inverse", replace_entry("evidence", "box", "directions", [["1p0"] * 3] * 3)),
    (".", replace_entry("evidence", "box", "cells", [1, 1])),
    ("the cones of the flat weights", replace_entry("evidence", "weights", "flat", "1p-12")),
    ("the cones of the flat weights", replace_entry("evidence", "weights", "lipschitz", "1p20")),
    ("the second compound", replace_entry("evidence", "weights", "compound", 0, "1p-10")),
    ("the thin set", replace_entry("evidence", "weights", "thin", "1p-10")),
    ("after a crossing", replace_entry("evidence", "weights", "return", "1p10")),
    ("D and the graph", replace_entry("evidence", "entry", "lid", "1p-10")),
    ("crossings lie in Q", replace_entry("evidence", "entry", "moment", "1p-6")),
]


@pytest.mark.slow(minutes=2)
def test_the_certificate_of_the_cycles_is_accepted_and_nothing_else_is(
    taylor, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And cycles of shooting are among those of which it speaks.

    What is shown once of Omega_h is remembered.
    """
    proof = proved_connection()
    end = prove_cycles_near_omega_h(proof)
    assert end.proved, end.statement
    kappa, least_time = (float(end.numbers[name]) for name in ("kappa", "T"))
    assert end.high - OMEGA_H > Fraction("5.6e-3")
    for share in (Fraction(9, 10), Fraction(1, 30)):
        cycle = shoot_limit_cycle(PRINTED, OMEGA_H + (end.high - OMEGA_H) * share, taylor)
        with working_precision(64):
            assert end.contains_cycle(
                ball(cycle.omega.value), ball(cycle.gamma_bar_0.value), ball(cycle.v_0.value)
            )
        assert float(cycle.multiplier_slow) < kappa**2  # of two half maps
        assert float(cycle.period) > 2 * least_time
        assert float(cycle.dperiod_domega) < 0
    text = end.certificate()
    assert len(text) < 60_000
    assert verify_content(json.loads(text)) == end.statement
    for part in (
        PRINTED.definition(),
        "from 30.0474 to 30.0569 rad/s exactly one, Omega_h",
        "3 pi/2 - 0.14 <= gamma",
    ):
        assert part in end.statement
    usual, original = cycles_near_omega_h.verify_connection, json.loads(text)
    steps = replace_entry("evidence", "flights", "steps", 198)  # is found at the flights' end only
    for line, act in (*DISKS, *OF_THE_CYCLES, ("its last step|pass", steps)):
        content = json.loads(text)
        act(content)
        same = all(
            at(content) == at(original)
            for at in (
                lambda c: c["claim"]["parameters"],
                lambda c: c["claim"]["numbers"],
                lambda c: c["evidence"]["connection"],
                lambda c: c["bits"],
            )
        )
        monkeypatch.setattr(
            cycles_near_omega_h, "verify_connection", (lambda *_: proof.verified) if same else usual
        )
        refused(text, line, act)
