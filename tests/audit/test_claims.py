"""The verdicts on claims follow from the computed values, and undecided stays undecided; the
published numbers are those of an outline of the paper.
"""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import pytest

from tippedisk_verify import PRINTED, Audit, InputError, Measured, Verdict
from tippedisk_verify.audit import citations
from tippedisk_verify.audit.citations import published_numbers
from tippedisk_verify.audit.claim_catalogue import CLAIMS, GROUPS, select_claims
from tippedisk_verify.audit.claims import Finding, examine_claim, rounds_to
from tippedisk_verify.audit.linear_claims import table_box
from tippedisk_verify.flow import default_engine
from tippedisk_verify.report.results_json import summary, totals_sentence


@pytest.mark.parametrize(
    ("value", "width", "printed", "answer"),
    [
        ("30.9169", "1e-4", "30.92", True),
        ("30.8866", "1e-4", "30.92", False),
        ("30.9250", "1e-4", "30.92", None),
        ("-129.0407", "0", "-129.04", True),
        ("0.8867", "1e-5", "0.886", False),
        ("1.314e-7", "1e-10", "1.31e-7", True),
    ],
)
def test_rounding(value, width, printed, answer) -> None:
    assert rounds_to(Measured(Fraction(value), Fraction(width)), printed) is answer


@pytest.mark.parametrize(
    ("answers", "verdict"),
    [
        ((True, True), Verdict.HOLDS),
        ((True, False), Verdict.HOLDS_FOR),
        ((True, None), Verdict.HOLDS_FOR),
        ((False, False), Verdict.DOES_NOT_FOLLOW),
        ((False, None), Verdict.UNDECIDED),
    ],
)
def test_verdicts(answers, verdict) -> None:
    assert Finding({}, dict(zip("xy", answers, strict=True))).verdict is verdict


#: Misprints and overstatements, each found by an independent derivation (see the tests of theory/).
WRONG = {
    "sliding_velocity",
    "critical_pair",
    "expansion_gyroscopic",
    "expansion_gravity",
    "kappa_1",
    "kappa_2",
    "delta",
    "amplitude_law",
    "period_law",
    "reduced_dimension",
    "second_noninverted_state",
    "order_0_noninverted",
    "globally_attractive",
    "smooth_same_asymptotics",
    "almost_all_trajectories",
}


@pytest.mark.parametrize("groups", [slice(2), pytest.param(slice(2, None), marks=pytest.mark.slow)])
def test_all_claims_on_the_named_sets(taylor, groups) -> None:
    audit = Audit(PRINTED, taylor)
    chosen = [claim for claims in list(GROUPS.values())[groups] for claim in claims]
    found = {claim.name: examine_claim(audit, claim) for claim in chosen}
    # What the model's notes say independently of this code: printed misses three numbers,
    # calibrated has all.
    for name in {"omega_crit", "period_crit", "lambda_3"} & set(found):
        assert found[name].sets == ("calibrated", "geometry")
    if "omega_h" in found:
        assert found["omega_h"].sets == ("calibrated",)
    for claim in chosen:
        assert (claim.fault is not None) == (claim.name in WRONG)
        if claim.name == "convergent_series":
            assert found[claim.name].verdict is Verdict.UNDECIDED
        elif claim.own_check:
            assert found[claim.name].verdict is Verdict.HOLDS
        else:
            assert ("calibrated" in found[claim.name].sets) == (claim.name not in WRONG), claim.name


def test_a_set_without_connection_stays_undecided(taylor) -> None:
    odd = PRINTED.changed(A="2e-3", C=None, name="odd")
    finding = examine_claim(Audit(odd, taylor), *select_claims(["omega_h"]))
    assert finding.holds["odd"] is None
    assert "connection" in finding.note


def test_claims_are_found_by_equation() -> None:
    assert {claim.name for claim in select_claims(["eq. 7"])} == {"sliding_velocity"}
    assert {claim.name for claim in select_claims(["eq.30", "chi"])} == {"chi", "kappa_2"}
    assert select_claims(["eq (48)"]) == select_claims(["amplitude_law"])
    for wrong, message in (
        ("eq. 3", r"no claim is about eq\. \(3\)"),
        ("omega_krit", "omega_crit"),
    ):
        with pytest.raises(InputError, match=message):
            select_claims([wrong])


def test_a_disk_rounds_to_table_1_by_its_decimals() -> None:
    (claim,) = select_claims(["table_1"])
    for name, (low, high) in table_box().items():
        for value, inside in (
            (low, "inside"),
            (high, "inside"),
            (2 * low - high, "outside"),
            (2 * high - low, "outside"),
        ):
            audit = Audit(PRINTED.changed(**{name: value}, name="mine"), default_engine())
            assert claim.examine(audit, "mine", claim.printed)[0].startswith(inside), (name, value)
    assert table_box()["e"] == (Fraction("2.45e-3"), Fraction("2.55e-3"))


def test_the_summary_counts_what_does_not_follow_by_its_cause() -> None:
    finding = Finding({}, {"x": False})
    counts = summary(
        [
            (claim, finding)
            for claim in select_claims(["delta", "kappa_2", "critical_pair", "order_0_noninverted"])
        ]
    )
    assert [(fault["class"], fault["claims"]) for fault in counts["not_following"]] == [
        ("slip", ["critical_pair"]),
        ("follows-from", ["kappa_2", "delta"]),
        ("differs", ["order_0_noninverted"]),
    ]
    assert totals_sentence(counts).endswith(
        "4 do not follow: 1 slip of the pen, 2 from one dropped term, 1 differs"
    )


# -------------------------- the published numbers, counted in an outline of the paper as LaTeX does
OUTLINE = Path(__file__).with_name("outline.tex")
_PLACE = re.compile(r"\\(?:begin\{(\w+)\}|((?:sub)*section)\{\})(.*)")


def counted() -> dict[str, str]:
    """Return each label's number; ``LABEL+n`` is the n-th equation after it without a label."""
    numbers, sections, floats = {}, [0, 0, 0], {"figure": 0, "table": 0, "subfigure": 0}
    equation, latest, after = 0, "eq:", 0
    for kind, section, rest in (
        _PLACE.match(line).groups() for line in OUTLINE.read_text().splitlines()[3:]
    ):
        labels = re.findall(r"\\label\{([^}]*)\}", rest)
        if section:
            level = section.count("sub")
            sections = [*sections[:level], sections[level] + 1, *[0] * (2 - level)]
            numbers |= dict.fromkeys(labels, ".".join(str(number) for number in sections if number))
        # A row of the latter has a number unless it says that it has none
        elif kind in ("equation", "align"):
            for row in rest.split(r"\\"):
                if r"\nonumber" not in row:
                    equation, after = equation + 1, after + 1
                    if found := re.findall(r"\\label\{([^}]*)\}", row):
                        latest, after = found[0], 0
                    numbers[f"{latest}+{after}" if after else latest] = f"({equation})"
        elif kind == "subfigure":
            floats["subfigure"] += 1
            numbers[labels[0]] = f"{floats['figure'] + 1}{' abcdef'[floats['subfigure']]}"
            if len(labels) == 2:  # the last one's line has the caption of the whole
                floats["figure"] += 1
                floats["subfigure"] = 0
                numbers[labels[1]] = str(floats["figure"])
        elif labels:
            floats[kind] += 1
            numbers[labels[0]] = str(floats[kind])
    return numbers


def test_every_number_is_the_outlines() -> None:
    numbers = counted()
    table = {label: number for label, (_, number) in citations._NUMBERS.items()}
    assert {label: numbers.get(label) for label in table} == table
    assert {label for label in numbers if "+" not in label} <= set(table)


def test_what_is_cited() -> None:
    assert published_numbers("eq:3DOF_lin, eq:A_coeff_O") == "eq. (13), eq. (14)"
    assert published_numbers("below eq:Csol+2") == "below eq. (50)"
    assert (
        published_numbers("tab:dim_mass, fig:hom, sec:discussion")
        == "Table 1, Figure 7b, Section 6"
    )
    with pytest.raises(KeyError):
        published_numbers("eq:nonsense")
    assert {claim.name for claim in CLAIMS if not claim.labels} == {
        claim.name for claim in CLAIMS if claim.own_check
    }
