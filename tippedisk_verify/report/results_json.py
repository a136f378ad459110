"""The JSON object of the main job: claims, figures, parameters and provenance; and the words that
the report and the terminal use for a verdict.
"""

from __future__ import annotations

import os
import platform
import time
from collections import Counter
from collections.abc import Sequence
from shlex import quote
from typing import Any, get_args

from tippedisk_verify.audit.claim_catalogue import CLAIMS, group_of
from tippedisk_verify.audit.claim_proofs import proof_of
from tippedisk_verify.audit.claims import Claim, Fault, FaultKind, Finding, Verdict, sets_with
from tippedisk_verify.display import as_json
from tippedisk_verify.model.parameters import NAMED_SETS, Parameters
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.report.printed_digits import printed_digits_reached
from tippedisk_verify.report.tasks import AuditJob
from tippedisk_verify.support.provenance import DRAWING, processor, versions

__all__ = [
    "claim_json",
    "results_json",
    "run_facts",
    "summary",
    "totals_sentence",
    "value_text",
    "verdict_words",
]

Findings = Sequence[tuple[Claim, Finding]]
_NAMES = {claim.name for claim in CLAIMS}


def value_text(value: Measured | str) -> str:
    """Return a computed value as text for the terminal. Numbers have at most twelve digits."""
    if isinstance(value, str):
        return value
    text, width = value.decimals()
    return text if width == "0" else f"{float(text):.12g}"


def claim_json(claim: Claim, finding: Finding, job: AuditJob) -> dict[str, Any]:
    """Return a claim and its outcome as one entry of ``claims`` in results.json, with the values
    for all audited sets.

    Args:
        claim: The claim.
        finding: Its outcome.
        job: The audit that it belongs to.
    """
    by_set = as_json(finding.computed)
    agreed = {
        name: digits
        for name, value in by_set.items()
        if isinstance(value, dict)
        and (digits := printed_digits_reached(value["value"], claim.printed)) is not None
    }
    proof = proof_of(claim, finding, sets_with(job.parameters))
    return {
        "name": claim.name,
        "group": group_of(claim.name),
        "source": claim.source,
        "cited": "" if claim.own_check else claim.cited,
        "statement": claim.statement,
        "formula": claim.formula,
        "unit": claim.unit,
        "printed": claim.printed,
        "computed": by_set.get(job.parameters.name),
        "computed_by_set": by_set,
        "agreed_digits": {name: count for name, (count, _) in agreed.items()},
        "printed_digits": next((whole for _, whole in agreed.values()), None),
        "verdict": finding.verdict.value,
        **_fault_json(claim, finding),
        "sets": list(finding.sets),
        "holds": finding.holds,
        "note": finding.note,
        "methods": list(claim.methods),
        "grade": "computed" if proof is None else proof.extent,
        "proof": None if proof is None else proof.to_dict(),
        "own_check": claim.own_check,
        "command": f"{_command(job)} --only {claim.name}",
    }


def verdict_words(entry: dict[str, Any]) -> str:
    """Return the verdict on a claim in words, for the terminal and the report.

    ``entry`` is the claim's entry in results.json. If the sets differ, the words give the verdict
    on the user's own disk, or name the smaller group of sets.
    """
    if entry["verdict"] == "holds-for":
        selected, own = next(iter(entry["holds"].items()))
        holds = entry["holds"] if selected in NAMED_SETS else {selected: own}
        words = {True: "holds", False: "fails", None: "undecided"}
        named = {
            words[answer]: ", ".join(name for name in holds if holds[name] is answer)
            for answer in holds.values()
        }
        return min((f"{word} for {names}" for word, names in named.items()), key=len)
    why = {"slip": " (slip)", "follows-from": " (term)"}.get(entry["class"], "")
    proved = " (proved)" if entry["grade"] == "proved" else ""
    return str(entry["verdict"]).replace("-", " ") + (why or proved)


def _fault(claim: Claim, finding: Finding) -> Fault | None:
    """Return the reason why a claim does not follow, or None for any other verdict."""
    if finding.verdict is not Verdict.DOES_NOT_FOLLOW:
        return None
    return claim.fault or Fault("differs", "what is computed differs from what is printed", "")


def _fault_json(claim: Claim, finding: Finding) -> dict[str, str | None]:
    fault = _fault(claim, finding)
    values = (None,) * 3 if fault is None else (fault.kind, fault.cause, fault.instead or None)
    return dict(zip(("class", "cause", "instead"), values, strict=True))


def _command(job: AuditJob) -> str:
    parts = ["tippedisk-verify verify"]
    for option, value, usual in (
        ("parameters", job.parameters.name, "table1"),
        ("friction", job.parameters.law.name, "linear"),
        ("digits", str(job.digits), "12"),
    ):
        if value != usual:
            parts.append(f"--{option} {quote(value)}")
    return " ".join(parts)


def summary(findings: Findings) -> dict[str, Any]:
    """Return a summary of an audit: the claims counted by verdict, those that do not follow in
    groups, and failed own checks.
    """
    counts = Counter(finding.verdict for _, finding in findings)
    failed = [
        claim.name
        for claim, finding in findings
        if claim.own_check and finding.verdict is not Verdict.HOLDS
    ]
    alike: dict[tuple[str, str | None], list[str]] = {}
    for claim, finding in findings:
        if fault := _fault(claim, finding):
            alike.setdefault(
                (fault.kind, fault.cause if fault.kind == "follows-from" else None), []
            ).append(claim.name)
    kinds = list(get_args(FaultKind))
    faults = sorted(alike.items(), key=lambda entry: kinds.index(entry[0][0]))
    return {
        "claims": len(findings),
        **{verdict.value: counts[verdict] for verdict in Verdict},
        "not_following": [
            {"class": kind, "cause": cause, "claims": names} for (kind, cause), names in faults
        ],
        "own_checks_failed": failed,
    }


def totals_sentence(counts: dict[str, Any]) -> str:
    """Return a sentence with the numbers of claims by verdict, from the result of `summary`."""

    faults = ", ".join(_counted_fault(fault) for fault in counts["not_following"])
    verdicts = {
        "holds": ("holds", "hold", ""),
        "holds-for": ("holds", "hold", " for some parameter sets"),
        "undecided": ("is", "are", " undecided"),
        "does-not-follow": ("does", "do", f" not follow: {faults}"),
    }
    parts = [
        f"{counts[verdict]} {singular if counts[verdict] == 1 else plural}{rest}"
        for verdict, (singular, plural, rest) in verdicts.items()
        if counts[verdict]
    ]
    return (
        f"{counts['claims']} {'claim' if counts['claims'] == 1 else 'claims'}: {', '.join(parts)}"
    )


def _counted_fault(fault: dict[str, Any]) -> str:
    count = len(fault["claims"])
    if fault["class"] == "slip":
        return f"{count} {'slip' if count == 1 else 'slips'} of the pen"
    if fault["class"] == "differs":
        return f"{count} {'differs' if count == 1 else 'differ'}"
    return f"{count} from {'one dropped term' if fault['cause'] not in _NAMES else fault['cause']}"


def results_json(
    job: AuditJob,
    findings: Findings,
    figures: Sequence[dict[str, Any]] = (),
    run: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Return the content of results.json, all results of an audit, as plain data.

    Args:
        job: The audit.
        findings: The claims with their findings.
        figures: The figures, as `figures.exhibit.draw_exhibit` returns them.
        run: Facts about this run alone, as `run_facts` returns them. On one
            machine all other entries are the same in every run, except that a figure of run times
            shows the times measured when it was drawn.
    """
    from dataclasses import fields

    parameters = job.parameters
    decimals = parameters.decimals()
    return {
        "claims": [claim_json(claim, finding, job) for claim, finding in findings],
        "summary": summary(findings),
        "sets": list(sets_with(parameters)),
        "parameters": {"name": parameters.name, **decimals},
        "units": {
            item.name: item.metadata["unit"] for item in fields(Parameters) if item.name in decimals
        },
        "friction": job.parameters.friction,
        "digits": job.digits,
        "command": _command(job),
        "figures": [figure["entry"] for figure in figures],
        **{name: fact for figure in figures for name, fact in figure["facts"].items()},
        "provenance": _provenance(),
        "run": run or {},
    }


def run_facts(began: float, tasks: int, kept: int) -> dict[str, Any]:
    """Return facts about one run of an audit: its end, its duration and its numbers of tasks.

    Args:
        began: The value of time.monotonic() at the start [s].
        tasks: The number of tasks.
        kept: The number of results reused from earlier runs.
    """
    return {
        "ended": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()),
        "seconds": f"{time.monotonic() - began:.1f}",
        "tasks": tasks,
        "kept": kept,
        "computed": tasks - kept,
    }


def _provenance() -> dict[str, str]:
    from tippedisk_verify import __version__

    return {
        "tippedisk-verify": __version__,
        "python": platform.python_version(),
        "system": platform.system(),
        "machine": platform.machine(),
        "processor": processor(),
        "cores": str(os.cpu_count()),
        **versions(DRAWING),
    }
