"""The methods that compute each kind of entry: that of `Disk`, and others that confirm it."""

from __future__ import annotations

import csv
from collections.abc import Callable
from fractions import Fraction
from functools import lru_cache
from typing import Any

from reference_data.make import cycles, local
from reference_data.make.proofs import proved
from tippedisk_verify.errors import AccuracyError
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.reference_values import truths
from tippedisk_verify.reference_values.entries import (
    STORED_DIGITS,
    Case,
    MeasuredValues,
    Reading,
    ReferenceEntry,
    case_of,
    disagreements,
    rounded_to_digits,
)
from tippedisk_verify.reference_values.grading_rules import values_csv_row
from tippedisk_verify.reference_values.manifest import data_folder, verified_texts

__all__ = ["CONFIRM", "answered", "confirmed", "methods_of"]

_DIGITS = {"heteroclinic": 104, "trajectory": 43}  # other kinds have `_USUAL_DIGITS`
_USUAL_DIGITS = 36
# The relative agreement with another method that the grade two-method needs.
_CONFIRMED = Fraction(1, 10**30)


def _again(case: Case, values: MeasuredValues) -> MeasuredValues:
    return truths.cross_check_values(case, _USUAL_DIGITS)


def _shifted(case: Case, values: MeasuredValues) -> MeasuredValues:
    """Integrate in shifted angles, with ten digits more.

    Its own error is then far below the half-widths that it is compared with.
    """
    return truths.trajectory_values(case, _DIGITS["trajectory"] + 10, shift=True)


#: The methods after the first of each kind, by their names in methods.csv.
CONFIRM: dict[str, dict[str, Callable[[Case, MeasuredValues], MeasuredValues]]] = {
    "rhs": {"shifted": _again, "symbolic": local.symbolic},
    "equilibrium": {"eigensolver": _again},
    "hopf": {"balance": local.hopf_by_balance},
    "harmonic-balance": {"floating": _again},
    "slow-manifold": {"differences": local.differences},
    "trajectory": {"shifted": _shifted, "scipy": local.orbit_by_scipy},
    "limit-cycle": {
        "full-period": cycles.whole_period,
        "balance": cycles.balance,
        "scipy": cycles.scipy,
    },
    "heteroclinic": {
        "limit-cycles": lambda case, values: truths.omega_h_values(case, 60, "limit-cycles"),
        "scipy": lambda case, values: truths.omega_h_values(case, 11, "scipy"),
    },
    "near-heteroclinic": {"full-period": cycles.whole_period, "balance": cycles.balance},
    "rotating-cycle": {
        "bottom": cycles.whole_period,
        "collocation": cycles.collocation,
        "scipy": cycles.scipy,
    },
    "rotation-fold": {
        "bottom": cycles.fold_from_the_bottom,
        "collocation": cycles.fold_by_collocation,
        "scipy": cycles.fold_by_scipy,
    },
}


@lru_cache(maxsize=16)
def methods_of(kind: str) -> dict[str, bool]:
    """Return the methods of a kind by name; the first gives the values.

    Returns:
        True for each method that shares no integrator with the first.
    """
    rows = csv.DictReader(
        verified_texts(data_folder(), ["methods.csv"])["methods.csv"].splitlines()
    )
    return {row["method"]: row["independent"] == "yes" for row in rows if row["kind"] == kind}


def confirmed(case: Case, values: MeasuredValues) -> dict[str, MeasuredValues]:
    """Compute the numbers by each further method.

    Args:
        case: The entry in one reading.
        values: The numbers of the first method.

    Raises:
        AccuracyError: If a method excludes them.
    """
    answers = {}
    for name, method in CONFIRM[case.entry.kind].items():
        answers[name] = method(case, values)
        for line in disagreements(values, answers[name]):
            raise AccuracyError(f"{case.entry.id} by {name}: {line}")
    return answers


def answered(entry: ReferenceEntry) -> dict[str, Any]:
    """Compute the numbers of an entry by all methods.

    Returns:
        Its ``rows`` in values.csv, and its ``proof`` or None.

    Raises:
        AccuracyError: If two methods exclude each other.
    """
    kind, digits = entry.kind, _DIGITS.get(entry.kind, _USUAL_DIGITS)
    kept = max(STORED_DIGITS, digits - 2)
    values: dict[Reading, MeasuredValues] = {}
    distances: dict[str, dict[str, Fraction]] = {}
    twice: set[str] = set()
    for reading in entry.readings:
        case = case_of(entry, reading)
        first = truths.true_values(case, digits)
        # Take the numbers as they will be written, because the proof is about these.
        values[reading] = {
            name: Measured.of(*rounded_to_digits(value, kept).decimals())
            for name, value in first.items()
        }
        for method, answers in confirmed(case, first).items():
            for name, other in answers.items():
                away = abs(other.value - values[reading][name].value)
                by_method = distances.setdefault(name, {})
                by_method[method] = max(by_method.get(method, Fraction(0)), away)
                near = away + other.uncertainty <= _CONFIRMED * max(
                    abs(other.value), Fraction(1, 10**6)
                )
                if near and reading == "decimals" and methods_of(kind)[method]:
                    twice.add(name)
    case = case_of(entry, "decimals")
    slopes, proof = _slopes(case, values["decimals"]), proved(case, values["decimals"])
    rows = []
    for name in values["decimals"]:
        proven = proof is not None and name in proof["enclosures"]
        by = {method: f"{float(away):.3g}" for method, away in distances.get(name, {}).items()}
        grade = (
            "proved" if proven else "two-method" if name in twice else "agreed" if by else "single"
        )
        numbers = {reading: values[reading][name].decimals() for reading in entry.readings}
        quantity = truths.as_reference_value(
            entry,
            name,
            numbers,
            slopes.get(name, {}),
            grade,
            {next(iter(methods_of(kind))): "0", **by},
        )
        rows.append(values_csv_row(case.disk.decimals(), quantity))
    return {"rows": rows, "proof": proof}


def _slopes(case: Case, values: MeasuredValues) -> truths.Sensitivities:
    """Return condition numbers; next to Omega_h by steps far smaller than the distance."""
    if case.entry.kind not in ("near-heteroclinic", "heteroclinic", "rotation-fold"):
        return truths.sensitivities(case, values)
    step = Fraction(1, 10**8)
    if case.entry.kind == "near-heteroclinic":
        step = (1 - cycles.omega_h_for(case) / case.inputs["Omega"]) / 10**5
    return truths.sensitivities_by_differences(
        case,
        lambda moved: {
            name: number.value for name, number in truths.true_values(moved, 17).items()
        },
        step,
    )
