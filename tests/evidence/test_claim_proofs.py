"""Claims that are called proved name a theorem that is on the page and a command that exists."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tippedisk_verify.cli import main
from tippedisk_verify.evidence.catalogue import CLAIMS
from tippedisk_verify.evidence.claim_proofs import proof_of

PAGE = Path(__file__).parents[2] / "docs" / "certified.md"


def test_theorems_and_commands_exist(capsys: pytest.CaptureFixture[str]) -> None:
    page = PAGE.read_text(encoding="utf-8")
    proofs = {claim.name: proof_of(claim.name, "linear", "printed") for claim in CLAIMS}
    assert sum(proof is not None for proof in proofs.values()) >= 12
    for proof in filter(None, proofs.values()):
        for number in re.findall(r"\d+", proof.theorem):
            assert f"**Theorem {number} (" in page
        words = proof.command.split()
        assert main([*words[1:3], "--help"]) == 0
    capsys.readouterr()


def test_only_for_the_sets_and_the_law_that_the_theorem_is_about() -> None:
    assert proof_of("supercritical", "linear", "calibrated") is not None
    assert proof_of("supercritical", "smooth", "calibrated") is None
    assert proof_of("noninverted_unstable", "smooth", "printed") is not None
    assert proof_of("omega_h", "linear", "custom") is None
    assert proof_of("convergent_series", "linear", "printed") is None
