"""Claims called proved: the named commands run here, and must prove the verdict for each set."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable, Collection
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest

from tests.command_line import TABLE_1_FILE, printed
from tippedisk_verify.audit.claim_catalogue import CLAIMS, select_claims
from tippedisk_verify.audit.claim_proofs import ClaimProof, proof_of
from tippedisk_verify.audit.claims import Audit, Claim, Finding, examine_claim, rounds_to, sets_with
from tippedisk_verify.audit.linear_claims import table_box
from tippedisk_verify.flow import default_engine
from tippedisk_verify.model.parameters import GEOMETRY, NAMED_SETS, PRINTED, Friction, Parameters
from tippedisk_verify.numbers.measured import Measured

PAGES = sorted((Path(__file__).parents[2] / "docs").glob("certified*.md"))
PROVED: dict[Friction, set[str]] = {
    "smooth": {
        "omega_crit",
        "omega_crit_friction",
        "period_crit",
        "inverted_stable_above",
        "inverted_unstable_below",
        "noninverted_unstable",
        "both_connections",
    }
}
PROVED["linear"] = PROVED["smooth"] | {
    "table_1",
    "chi",
    "supercritical",
    "attracting_cycle",
    "stable_branch",
    "omega_h",
    "infinite_period",
}
IN_PART: dict[Friction, set[str]] = {"smooth": {"lambda_3", "critical_pair"}}
IN_PART["linear"] = IN_PART["smooth"] | {"only_above_omega_h"}


def _stated(
    *words: str, of: str = "statement", verdict: bool = True
) -> Callable[[list[Any], Claim], bool | None]:
    """Return a test for words in a command's statement: the verdict that they entail, else None."""
    return lambda told, claim: (
        verdict if all(word in (told[0][of] or "") for word in words) else None
    )


def _enclosed(name: str) -> Callable[[list[Any], Claim], bool | None]:
    """Return a test that a command's enclosure rounds to the number that the paper prints."""
    return lambda told, claim: rounds_to(_measured(told[0][name]), claim.printed)


def _omega_h(told: list[Any], claim: Claim) -> bool | None:
    found = rounds_to(_measured(told[0]["omega_h"]), claim.printed)
    if not told[0]["unique"] or not told[1]["proved"]:
        return None
    one, other = (_measured(entry["omega_h"]) for entry in told)
    assert abs(one.value - other.value) <= one.uncertainty + other.uncertainty
    return found


def _of_table_1(told: list[Any], claim: Claim) -> bool | None:
    """Test that the stated disk rounds to the table, and all numbers to the printed ones."""
    found = {
        name: Fraction(text)
        for name, text in re.findall(r"\b([remABg]) = ([\d.e/-]+)", told[0]["statement"])
    }
    inside = all(low <= found[name] <= high for name, (low, high) in table_box().items())
    names = ("omega_crit", "period", "lambda_3", "chi")
    pairs = zip(names, claim.printed.split(", "), strict=True)
    return inside and all(rounds_to(_measured(told[0][name]), text) for name, text in pairs)


#: What each claim's verdict follows from, in the commands' own answers.
DECIDED: dict[str, Callable[[list[Any], Claim], bool | None]] = {
    "table_1": _of_table_1,
    "omega_crit": _enclosed("omega_crit"),
    "omega_crit_friction": _stated("whatever mu and epsilon are"),
    "lambda_3": _enclosed("lambda_3"),
    "critical_pair": _stated(
        "a pair of complex conjugate eigenvalues", "crosses the imaginary axis", verdict=False
    ),
    "inverted_stable_above": _stated(
        "inverted spinning is asymptotically stable at every Omega > Omega_crit"
    ),
    "inverted_unstable_below": _stated("and unstable", "at every Omega < Omega_crit"),
    "noninverted_unstable": _stated("noninverted spinning is unstable at every Omega > 0"),
    "period_crit": _enclosed("period"),
    "chi": _enclosed("chi"),
    "supercritical": lambda told, claim: told[0]["criticality"] == "supercritical",
    "omega_h": _omega_h,
    "infinite_period": _stated("a in (0, pi)", "the period tends to infinity"),
    "only_above_omega_h": _stated(
        "each Omega with Omega_h < Omega < Omega_crit", "none but these cycles'"
    ),
    "stable_branch": _stated(
        "asymptotically stable",
        "Omega falls strictly, and the period and the largest |beta - pi/2| grow strictly",
    ),
    "both_connections": _stated("the connection back exists at the same speed"),
    "attracting_cycle": _stated("the orbit is asymptotically stable", of="limit_cycle"),
}
#: Numbers of a command's answer that the audit computed, too.
NUMBERS = {
    "omega_crit": "omega_crit",
    "lambda_3": "lambda_3",
    "period_crit": "period",
    "chi": "chi",
    "omega_h": "omega_h",
}


def _measured(entry: dict[str, str]) -> Measured:
    return Measured(Fraction(entry["value"]), Fraction(entry["uncertainty"]))


@lru_cache(maxsize=32)
def _answers_of(command: str) -> tuple[str, ...]:
    """Return the output of each part of a command, which must succeed as it is written."""
    answers = []
    for part in command.split(" && "):
        program, _, words = part.partition(" ")
        assert program == "tippedisk-verify"
        answers.append(printed(f"{words} --json"))
    return tuple(answers)


def _prove(claim: Claim, finding: Finding, proof: ClaimProof, sets: Collection[str]) -> None:
    """Run the proof's commands for these sets: each must prove the answer about these numbers."""
    for name, command in ((name, proof.commands[name]) for name in sets):
        assert all(f"--parameters {shlex.quote(name)}" in part for part in command.split(" && "))
        told = [json.loads(answer) for answer in _answers_of(command)]
        assert all(answer["proved"] is True for answer in told), (claim.name, name)
        assert DECIDED[claim.name](told, claim) is finding.holds[name], (claim.name, name)
        if claim.name in NUMBERS:
            mine, theirs = _measured(told[0][NUMBERS[claim.name]]), finding.computed[name]
            assert abs(mine.value - theirs.value) <= mine.uncertainty + theirs.uncertainty, (
                claim.name,
                name,
            )


def _proofs(parameters: Parameters, wanted: set[str]) -> dict[str, tuple[Claim, Finding, Any]]:
    audit = Audit(parameters, default_engine())
    found = {}
    for claim in select_claims(sorted(wanted)):
        finding = examine_claim(audit, claim)
        found[claim.name] = (claim, finding, proof_of(claim, finding, audit.sets))
    return found


def _closed_form(command: str) -> bool:
    return "--every-speed" in command or "certify hopf" in command


@pytest.mark.parametrize("friction", ["linear", "smooth"])
def test_closed_forms_are_proved_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, friction: Friction
) -> None:
    """Include a disk whose name is a file's, which is read where the command runs."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my disk.toml").write_text(TABLE_1_FILE.replace("9.81", "9.79"), encoding="utf-8")
    parameters = Parameters.named("./my disk.toml").with_friction(friction)
    #: Theorems that are spoken of for the named sets only
    named = {"table_1", "chi", "supercritical"}
    local = {"lambda_3", "critical_pair"} | named | PROVED["smooth"] - {"both_connections"}
    proved = 0
    for claim, finding, proof in _proofs(parameters, local).values():
        if claim.name in named:
            assert (proof is None) == (friction == "smooth")
            if proof is not None:  # the file's own is not spoken of
                assert proof.extent == "proved in part"
                assert "my disk.toml" in proof.not_proved
        else:
            assert "my disk.toml" in proof.commands
            assert (proof.extent == "proved") == (claim.name in PROVED["smooth"])
        if proof is not None:
            assert all(map(_closed_form, proof.commands.values()))
            _prove(claim, finding, proof, proof.commands)
            proved += 1
    assert proved == (11 if friction == "linear" else 8)


@pytest.mark.parametrize("parameters", NAMED_SETS)
@pytest.mark.parametrize(
    ("friction", "wanted"),
    [
        pytest.param(
            "linear",
            {*DECIDED, "homoclinic_identified", "amplitude_law"},
            marks=pytest.mark.slow(minutes=7),
            id="linear",
        ),
        pytest.param(
            "smooth", {"both_connections"}, marks=pytest.mark.slow(minutes=0.5), id="smooth"
        ),
    ],
)
def test_every_proof_is_proved_again(friction: Friction, wanted: set[str], parameters: str) -> None:
    """Check how much of each claim is proved, and run every command for one set."""
    found = _proofs(PRINTED.with_friction(friction), wanted)
    extents = {name: proof.extent if proof else "computed" for name, (_, _, proof) in found.items()}
    assert {name for name, extent in extents.items() if extent == "proved"} == PROVED[
        friction
    ] & wanted
    assert {name for name, extent in extents.items() if extent == "proved in part"} == IN_PART[
        friction
    ] & wanted
    for claim, finding, proof in found.values():
        if proof is not None:
            assert set(proof.commands) == set(finding.holds)
            _prove(claim, finding, proof, [parameters])


def test_theorems_and_commands_exist() -> None:
    page = "\n".join(path.read_text(encoding="utf-8") for path in PAGES)
    finding = Finding(dict.fromkeys(NAMED_SETS, "-"), dict.fromkeys(NAMED_SETS, False))
    proofs = {claim.name: proof_of(claim, finding, NAMED_SETS) for claim in CLAIMS}
    assert {name for name, proof in proofs.items() if proof} == set(DECIDED)
    for name, proof in proofs.items():
        if proof is None:
            continue
        assert name in page
        for number in re.findall(r"\d+", proof.theorem):
            assert f"**Theorem {number} (" in page
        for part in proof.commands["table1"].split(" && "):
            printed(f"{' '.join(part.split()[1:3])} --help")


def _of(name: str, parameters: Parameters, **answers: bool | None) -> ClaimProof | None:
    """Return the proof of a claim with given verdicts."""
    (claim,) = select_claims([name])
    sets = sets_with(parameters)
    holds = dict.fromkeys(sets, True) | answers
    return proof_of(claim, Finding(dict.fromkeys(sets, "-"), holds), sets)


def test_only_for_the_sets_and_the_law_that_the_theorem_is_about() -> None:
    assert _of("supercritical", GEOMETRY).extent == "proved"
    assert _of("supercritical", GEOMETRY.with_friction("smooth")) is None
    assert _of("noninverted_unstable", PRINTED.with_friction("smooth")).friction == (
        "linear",
        "smooth",
    )
    assert _of("convergent_series", PRINTED) is None
    # Theorem 6 is about both laws, and its command needs the law; Theorem 7 is about the linear
    # one.
    proof = _of("both_connections", PRINTED.with_friction("smooth"))
    assert proof.extent == "proved"
    assert (
        proof.commands["table1"]
        == "tippedisk-verify certify heteroclinic --parameters table1 --friction smooth"
    )
    assert "--friction" not in _of("both_connections", PRINTED).commands["table1"]
    for name in ("attracting_cycle", "omega_h", "infinite_period", "stable_branch"):
        assert _of(name, PRINTED.with_friction("smooth")) is None
    # An answer that was left open is not proved, nor is anything of a set that no command can name.
    assert set(_of("noninverted_unstable", PRINTED, table1=None).commands) == {
        "calibrated",
        "geometry",
    }
    assert set(_of("noninverted_unstable", PRINTED.changed(mu="0.2")).commands) == set(NAMED_SETS)
    posing = PRINTED.changed(mu="0.2", name="table1")
    assert set(_of("both_connections", posing).commands) == {"calibrated", "geometry"}
    assert _of("both_connections", posing).extent == "proved in part"


def test_a_number_next_to_a_rounding_boundary_is_not_called_proved() -> None:
    """A_33 = -129.045 exactly rounds to -129.04, by half a unit: twelve digits cannot decide."""
    (claim,) = select_claims(["lambda_3"])
    sets = {"edge.toml": PRINTED.changed(name="edge.toml"), "table1": PRINTED}
    computed = {
        "edge.toml": Measured(Fraction("-129.045"), Fraction(0)),
        "table1": Measured(Fraction(-129), Fraction(0)),
    }
    proof = proof_of(claim, Finding(computed, {"edge.toml": True, "table1": False}), sets)
    assert set(proof.commands) == {"table1"}
    assert "edge.toml" in proof.not_proved
