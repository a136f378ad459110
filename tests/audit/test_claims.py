"""Verdicts follow from what was computed, and undecided is never called decided."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from tippedisk_verify.audit.catalogue import CLAIMS, selected
from tippedisk_verify.audit.claims import Audit, Finding, Verdict, examined, rounds_to
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED, ROUNDED
from tippedisk_verify.orbits.bisection import unstable_branch


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


def test_all_claims_on_the_named_sets(taylor) -> None:
    audit = Audit(PRINTED, taylor)
    found = {claim.name: examined(audit, claim) for claim in CLAIMS}
    # What the model's notes say independently of this code: printed misses three numbers, calibrated has all.
    for name in ("omega_crit", "period_crit", "lambda_3"):
        assert found[name].sets == ("calibrated", "geometry")
    assert found["omega_h"].sets == ("calibrated",)
    # Misprints and overstatements, each found by an independent derivation (see the tests of theory/).
    wrong = {
        *("sliding_velocity", "critical_pair", "expansion_gyroscopic", "expansion_gravity", "kappa_1", "kappa_2"),
        *("delta", "amplitude_law", "period_law", "reduced_dimension", "second_noninverted_state"),
        *("order_0_noninverted", "globally_attractive", "smooth_same_asymptotics", "almost_all_trajectories"),
    }
    for name, finding in found.items():
        if name == "convergent_series":
            assert finding.verdict is Verdict.UNDECIDED
        elif name not in ("engines_agree", "omega_h_two_roads"):
            assert ("calibrated" in finding.sets) == (name not in wrong), name
    assert found["engines_agree"].verdict is found["omega_h_two_roads"].verdict is Verdict.HOLDS


def test_a_rounded_rim_is_discussed_and_not_judged(taylor) -> None:
    """The numbers in the notes against the paper's formulas, and Omega_h against the branch's fate on either side."""
    audit = Audit(PRINTED, taylor)
    table, connection = (examined(audit, claim) for claim in selected(["table_1", "omega_h"]))
    assert "rounded" not in {*table.holds, *connection.holds}
    p = ROUNDED
    r, e, A, bbar, weight = (float(x) for x in (p.r, p.e, p.A, p.Bbar, p.m * p.g))
    crit = (r + e) * math.sqrt(weight / (r * bbar))
    wanted = {
        "Omega_crit": crit,
        "T_crit": 2 * math.pi / crit * math.sqrt((r + e) / e),
        "lambda_3": -float(p.mu / p.epsilon) * weight / bbar * (r + e) ** 2,
        "chi": A * (r - 2 * e) - bbar * (2 * r**2 + e * (r + e)) / (2 * (r + e)),  # below Eq. Csol
    }
    for name, value in wanted.items():
        told = float(table.note.partition(f"{name} = ")[2].split()[0])
        assert told == pytest.approx(value, rel=1e-5), name  # six digits are told
    assert A / bbar > r * (2 * r - e) / (2 * (r + e) * (r - 2 * e))
    assert "a supercritical Hopf point" in table.note
    told = Fraction(connection.note.partition("Omega_h would be ")[2].split()[0])
    half_unit = Fraction(1, 20_000)
    ends = [unstable_branch(ROUNDED, told + side * half_unit, taylor).events[-1].name for side in (-1, 1)]
    assert ends == ["passes", "turns back"]
    for finding in (table, connection):
        assert "a sensitivity, not the paper's model" in finding.note


def test_closed_forms_compile_nothing() -> None:
    engine = Taylor()
    for claim in selected(["omega_crit", "noninverted_unstable", "period_crit"]):
        examined(Audit(PRINTED, engine), claim)
    assert engine.builds == ()


def test_a_set_without_connection_stays_undecided(taylor) -> None:
    odd = PRINTED.changed(A="2e-3", C=None, name="odd")
    finding = examined(Audit(odd, taylor), *selected(["omega_h"]))
    assert finding.holds["odd"] is None
    assert "connection" in finding.note


def test_selected_set_comes_first_and_names_are_checked(taylor) -> None:
    assert next(iter(Audit(CALIBRATED, taylor).sets)) == "calibrated"
    with pytest.raises(InputError, match="omega_crit"):
        selected(["omega_krit"])
