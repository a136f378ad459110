"""Arcs that fit together, what is claimed of them, and certificates of the family of limit
cycles.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import pytest

from tests.proofs.cases import sealed
from tests.proofs.test_family import DISK, SUBCRITICAL, first, quick, second  # noqa: F401
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED
from tippedisk_verify.proofs.kernel import certificates
from tippedisk_verify.proofs.kernel.balls import ball, working_precision
from tippedisk_verify.proofs.kernel.certificates import cycles_near_omega_h
from tippedisk_verify.proofs.kernel.certificates import family as module
from tippedisk_verify.proofs.kernel.certificates.family import (
    ArcJob,
    ProvedArc,
    enclosed_omega_crit,
    last_cycle,
    verify,
    verify_arc,
)
from tippedisk_verify.proofs.search.family_proof import FamilyProof
from tippedisk_verify.proofs.search.proof_search import parameter_texts


# ------------------------------------------------------------------------------------------- gluing
def arcs_without_flights() -> tuple[dict[str, Any], list[dict[str, Any]], list[list[Fraction]]]:
    """A claim and arcs without flights, for what is shown of their ends: Omega falls by 1 in
    each, from Omega_crit.
    """
    with working_precision(100):
        middle = Fraction(float(enclosed_omega_crit(DISK).mid())).limit_denominator(10**6)
    wide = {"radii": ["0.1", "0.2"], "steps": []}
    first = {
        "end": "0.5",
        "curve": [["-2", "-1/10"], [str(middle - Fraction(1, 2)), "-1/2"]],
        "wide box": wide,
    }
    second = {
        "end": "1",
        "curve": [["-3/2", "-9/20"], [str(middle - Fraction(3, 2)), "-1/2"]],
        "wide box": wide,
    }
    claim = {
        "kind": "family of limit cycles",
        "parameters": DISK,
        "friction": "linear",
        "amplitude_first": "0.5",
        "amplitude_end": "1",
        "omega_end": str(middle - 2 + Fraction(1, 50)),
        "numbers": {"omega_crit": {"value": str(middle), "uncertainty": "0.0001"}},
        "unique_within": {"v_0_per_gamma_bar_0": "0.09", "v_0": "0.09", "omega": "0.18"},
    }
    return (
        claim,
        [copy.deepcopy(arc) for arc in (first, second)],
        [[Fraction(1, 128), Fraction(1, 64)]] * 2,
    )


def proved_arcs(entries: Any, within: Any, low: Fraction = Fraction(0)) -> list[ProvedArc]:
    made = []
    for arc, near in zip(entries, within, strict=False):
        v, omega = (tuple(map(Fraction, row)) for row in arc["curve"])
        room = [Fraction(text) for text in arc["wide box"]["radii"]]
        made.append(
            ProvedArc(low, Fraction(arc["end"]), (v, omega), (room[0], room[1]), (near[0], near[1]))
        )
        low = made[-1].high
    return made


def glued(claim: Any, entries: Any, within: Any) -> None:
    with working_precision(100):
        verify(claim, {"arcs": entries}, lambda function, jobs: proved_arcs(entries, within))


def test_arcs_that_fit_are_one_curve() -> None:
    glued(*arcs_without_flights())


def _moved(entries: Any, number: int, row: int, by: Fraction) -> None:
    coefficients = entries[number]["curve"][row]
    coefficients[0] = str(Fraction(coefficients[0]) + by)


SPOILED_CLAIMS: dict[str, tuple[Callable[[Any, Any], Any], str]] = {
    "v moved": (lambda c, e: _moved(e, 1, 0, Fraction(1, 10)), "not shown to be one curve"),
    "Omega moved": (lambda c, e: _moved(e, 1, 1, Fraction(1, 5)), "not shown to be one curve"),
    "the Hopf point": (
        lambda c, e: [_moved(e, k, 1, Fraction(1, 60)) for k in (0, 1)],
        "begin at the Hopf point",
    ),
    "omega_end": (
        lambda c, e: c.update(omega_end=str(Fraction(c["omega_end"]) - Fraction(1, 100))),
        "omega_end",
    ),
    "amplitude_end": (lambda c, e: c.update(amplitude_end="1.1"), "amplitude_end"),
    "amplitude_first": (lambda c, e: c.update(amplitude_first="0.4"), "amplitude_first"),
    "omega_crit": (lambda c, e: c["numbers"]["omega_crit"].update(value="30.9"), "omega_crit"),
    "a wider tube": (lambda c, e: c["unique_within"].update(v_0="0.093"), "no other v_0 is"),
    "a wider first tube": (
        lambda c, e: c["unique_within"].update(v_0_per_gamma_bar_0="0.093"),
        "no other v_0_per",
    ),
    "a wider tube of speeds": (
        lambda c, e: c["unique_within"].update(omega="0.185"),
        "no other omega",
    ),
    "no tube": (lambda c, e: c["unique_within"].update(v_0="0"), "no other v_0 is"),
    "another disk": (
        lambda c, e: c.update(parameters=parameter_texts(CALIBRATED)),
        "begin at the Hopf point",
    ),
    "no disk": (lambda c, e: c.update(parameters={**DISK, "e": "0.05"}), "no disk has"),
    "no arcs": (lambda c, e: e.clear(), "no arcs"),
}


@pytest.mark.parametrize("name", SPOILED_CLAIMS)
def test_what_does_not_fit_is_not_shown(name) -> None:
    claim, entries, within = copy.deepcopy(arcs_without_flights())
    SPOILED_CLAIMS[name][0](claim, entries)
    with pytest.raises(certificates.Unproved, match=SPOILED_CLAIMS[name][1]):
        glued(claim, entries, within)


@pytest.mark.parametrize(("row", "by"), [(0, "0.097"), (1, "0.19")])
def test_a_cycle_that_may_lie_outside_is_not_joined(row: int, by: str) -> None:
    """The polynomials' end lies in the other arc's wide box, but the cycle, near it, may not.

    The first arc's v_0 / a is near to 1/128, so v_0 is to 1/256 where a is 1/2: 0.094 off is within
    0.1.
    """
    claim, entries, within = copy.deepcopy(arcs_without_flights())
    _moved(entries, 1, 0, Fraction("0.094"))
    glued(claim, entries, within)
    claim, entries, within = copy.deepcopy(arcs_without_flights())
    _moved(entries, 1, row, Fraction(by))
    with pytest.raises(certificates.Unproved, match="one curve"):
        glued(claim, entries, within)


def test_the_last_cycle_is_a_ball() -> None:
    """About the polynomials' end, as wide as the arc's cycles are shown to be near."""
    _, entries, within = arcs_without_flights()
    with working_precision(100):
        omega, _, v = last_cycle(proved_arcs(entries, within))
        for enclosure, row, radius in ((v, 0, Fraction(1, 128)), (omega, 1, Fraction(1, 64))):
            end = sum(Fraction(text) for text in entries[1]["curve"][row])
            assert enclosure.contains(ball(end - radius))
            assert enclosure.contains(ball(end + radius))


@pytest.mark.parametrize("contains_cycle", [True, False])
def test_the_whole_family_runs_into_the_cycles_next_to_the_connection(
    contains_cycle, monkeypatch
) -> None:
    """Of the last cycle the other end is asked, with the claim's numbers and its own evidence."""
    asked: list[Any] = []

    def verified_end(claim: Any, evidence: Any) -> Any:
        asked.append((claim["numbers"]["omega_h"], claim["high"], evidence))
        return SimpleNamespace(contains_cycle=lambda *cycle: asked.append(cycle) or contains_cycle)

    monkeypatch.setattr(cycles_near_omega_h, "verify", verified_end)
    claim, entries, within = arcs_without_flights()
    number = {"value": "30.05", "uncertainty": "0.001"}
    claim |= {
        "kind": "whole family of limit cycles",
        "low": "30",
        "high": "30.1",
        "gamma": "0.1",
        "v": "0.2",
    }
    claim["numbers"] |= {"omega_h": number}
    with (
        working_precision(100),
        nullcontext() if contains_cycle else pytest.raises(certificates.Unproved, match="run into"),
    ):
        verify(
            claim,
            {"arcs": entries, "end": "choices"},
            lambda function, jobs: proved_arcs(entries, within),
        )
    assert asked[0] == (number, "30.1", "choices")
    assert all(
        a.overlaps(b)
        for a, b in zip(asked[1], last_cycle(proved_arcs(entries, within)), strict=True)
    )
    said = certificates.sentence(claim)
    for words in (
        "a in (0, pi)",
        "Omega_h = 30.05 ± 0.001 rad/s",
        "from 30 to 30.1 rad/s Omega_h is the only one",
    ):
        assert words in said


# --------------------------------------------------------------------------------------------- arcs
ARC = {"end": "1", "curve": [["1", "0"]] * 2, "half": ["1", "0"], "bits": 64}


def test_both_boxes_and_the_signs_are_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    """The signs in the narrow one. A wide box that does not hold the other one is refused."""
    said: list[Any] = []

    class Test:
        included, shift = True, (ball("1e-3"), ball("2e-3"))

    def spied_test(
        disk: Any, low: Any, arc: Any, radii: Sequence[Fraction], step_proposer: Any
    ) -> Any:
        said.append([float(radius) for radius in radii])
        return Test()

    monkeypatch.setattr(module, "krawczyk_test_of_box", spied_test)
    monkeypatch.setattr(module, "first_unproved_sign", lambda arc: said.append("signs"))
    narrow, wide = {"radii": ["0.01", "0.02"], "steps": []}, {"radii": ["0.1", "0.2"], "steps": []}
    arc = verify_arc((DISK, Fraction("0.5"), 2, ARC | {"box": narrow, "wide box": wide}))
    assert said == [[0.01, 0.02], "signs", [0.1, 0.2]]
    assert arc.unique_within == (Fraction("0.1"), Fraction("0.2"))
    assert all(
        x <= near < x + Fraction(1, 10**9)
        for x, near in zip((Fraction("1e-3"), Fraction("2e-3")), arc.within, strict=True)
    )
    with pytest.raises(certificates.Unproved, match="does not hold the other one"):
        verify_arc((DISK, Fraction("0.5"), 2, ARC | {"box": wide, "wide box": narrow}))
    monkeypatch.setattr(Test, "included", False)
    with pytest.raises(certificates.Unproved, match="arc 2, box: Krawczyk"):
        verify_arc((DISK, Fraction("0.5"), 2, ARC | {"box": narrow}))


@pytest.mark.parametrize(
    "change",
    [
        {"end": "0.5"},
        {"end": "0.4"},
        {"half": ["1"]},
        {"curve": [["1"], ["1", "0"]]},
        {"box": {"radii": ["0", "0.02"], "steps": []}},
        {"box": {"radii": ["0.1", "-0.02"], "steps": []}},
    ],
)
def test_an_arc_that_is_none_is_not_shown(change) -> None:
    arc = ARC | {"box": {"radii": ["0.01", "0.02"], "steps": []}} | change
    with pytest.raises(
        certificates.Unproved,
        match=r"not above its beginning|unlike degrees|not "
        r"positive",
    ):
        verify_arc((DISK, Fraction("0.5"), 2, arc))


def test_what_is_no_arc_is_refused() -> None:
    with pytest.raises(certificates.NotACertificate, match="arc 2"):
        verify_arc((DISK, Fraction("0.5"), 2, ARC))


# ------------------------------------------------------------------------------------- certificates
#: In the second arc: what is spoiled, and what is said.
IN_THE_ARC: dict[str, tuple[Callable[[Any], Any], str]] = {
    "the curve is moved by ten radii": (
        lambda arc: _moved([arc], 0, 1, 10 * Fraction(arc["box"]["radii"][1])),
        "Krawczyk|return|move|section|stable",
    ),
    "the box is a hundred times smaller": (
        lambda arc: arc["box"].update(
            radii=[str(Fraction(text) / 100) for text in arc["box"]["radii"]]
        ),
        "Krawczyk",
    ),
    "a step is missing": (lambda arc: arc["box"]["steps"].pop(30), "return|move|section|missing"),
}


@pytest.mark.slow(minutes=0.5)
def test_a_certificate_is_accepted_and_what_is_tampered_with_is_not(quick) -> None:  # noqa: F811
    """Two short arcs of low degree, with one box each: they are written, shown, and spoiled
    one number at a time.
    """
    proved = (first(PRINTED), second())
    proof = FamilyProof(PRINTED, proved)
    content = json.loads(proof.certificate())
    shown: dict[int, ProvedArc] = {}

    def mapped(function: Any, jobs: Sequence[ArcJob]) -> list[ProvedArc]:
        for job in jobs:
            shown[job[2]] = shown.get(job[2]) or function(job)
        return [shown[job[2]] for job in jobs]

    # The sentence is the one that was proved, word for word.
    assert certificates.verify_content(content, mapped) == proof.statement
    for arc, again in zip(proved, shown.values(), strict=True):
        assert all(a <= b for a, b in zip(again.within, arc.within, strict=True))
    for spoil, said in IN_THE_ARC.values():
        arc = copy.deepcopy(content["evidence"]["arcs"][1])
        spoil(arc)
        with pytest.raises((certificates.Unproved, certificates.NotACertificate), match=said):
            verify_arc((DISK, Fraction("0.1"), 2, arc))
    assert first(SUBCRITICAL) is module.ArcStatus.SPEED_GROWS
    for other in (SUBCRITICAL, CALIBRATED):
        with pytest.raises(certificates.Unproved, match="arc 2"):
            verify_arc((parameter_texts(other), Fraction("0.1"), 2, content["evidence"]["arcs"][1]))
    content["claim"]["amplitude_end"] = "0.12"
    with pytest.raises(certificates.Unproved, match="digest"):
        certificates.verify_content(content, mapped)
    with pytest.raises(certificates.Unproved, match="amplitude_end"):
        certificates.verify_content(sealed(content), mapped)
