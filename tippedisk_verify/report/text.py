"""results.json as Markdown: the same report for a terminal, a repository or a mail."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from tippedisk_verify.report.digits import shortened
from tippedisk_verify.report.page import grouped, headline, verdict_words, wrong
from tippedisk_verify.report.results import totals

__all__ = ["markdown_page"]


def markdown_page(results: dict[str, Any]) -> str:
    """The report; figures are linked, as PNG files beside it."""
    counts = results["summary"]
    sets = results["sets"]
    lines = [
        "# The tippedisk's claims, audited",
        "",
        f"Parameter set *{_plain(results['parameters']['name'])}*, {results['friction']} friction law."
        f" {totals(counts)}.",
    ]
    if counts["own_checks_failed"]:
        lines.append(f"**Own checks that fell short: {', '.join(counts['own_checks_failed'])}.**")
    if numbers := headline(results):
        lines += [
            "",
            "## The paper's numbers",
            "",
            "Bold digits agree with the paper's, once rounded to its places (the digit that rounds up is bold too).",
            "",
        ]
        rows = [
            (_named(claim), claim["printed"], *_values(claim, sets), _plain(verdict_words(claim)))
            for claim in numbers
        ]  # fmt: skip
        lines += _table(("claim", "paper", *map(_plain, sets), "verdict"), rows)
    if faults := wrong(results):
        lines += ["", "## What does not follow", ""]
        lines += [
            f"- **{claim['name']}**: {_plain(claim['statement'])}." + f" ({_plain(_why(claim))}.)" for claim in faults
        ]
    for group, claims in grouped(results["claims"]).items():
        lines += ["", f"## {group}", ""]
        for claim in claims:
            lines += _claim(claim, sets)
    for heading, chosen in (
        ("The paper's figures, redrawn", [f for f in results["figures"] if f["source"]]),
        ("Accuracy and run time", [f for f in results["figures"] if not f["source"]]),
    ):
        if chosen:
            lines += ["", f"## {heading}", ""]
            for figure in chosen:
                lines += _figure(figure)
    lines += ["", "## Parameters and provenance", ""]
    units = results["units"]
    lines += _table(("quantity", "value", "unit"), [(name, results["parameters"][name], units[name]) for name in units])
    lines += ["", "Computed with " + ", ".join(f"{k} {_plain(v)}" for k, v in results["provenance"].items()) + "."]
    lines += ["", f"Recompute everything: `{_code(results['command'])} --fresh --out report`.", ""]
    return "\n".join(lines)


def _named(claim: dict[str, Any]) -> str:
    return f"{claim['name']} \\[{claim['unit']}\\]" if claim["unit"] else str(claim["name"])


def _claim(claim: dict[str, Any], sets: Sequence[str]) -> list[str]:
    said = [
        f"### {claim['name']}: {_plain(verdict_words(claim))}",
        "",
        f"{_plain(claim['statement'])} ({_plain(claim['source'])}).",
    ]
    if claim["formula"]:
        said += ["", f"$${claim['formula']}$$"]
    unit = f" {claim['unit']}" if claim["unit"] else ""
    values = [f"paper: {_plain(claim['printed'])}{unit if claim['printed_digits'] else ''}"] if claim["printed"] else []
    values += [
        f"{_plain(name)}: {text}{unit}" for name, text in zip(sets, _values(claim, sets), strict=True) if text
    ]  # fmt: skip
    said += ["", *(f"- {text}" for text in values), ""]
    if claim["class"]:
        said.append(f"{_why(claim)}.")
    if claim["note"]:
        said.append(f"Note: {_plain(claim['note'])}.")
    if claim["proof"]:
        said += [*_proof(claim), ""]
    by = f"By {_plain(', '.join(claim['methods']))}. " if claim["methods"] else ""
    return [*said, f"{by}Recompute: `{_code(claim['command'])}`", ""]


def _why(claim: dict[str, Any]) -> str:
    """Why a claim does not follow, and what is true instead."""
    kind = {"slip": "A slip of the pen: ", "follows-from": "Follows from ", "differs": "Differs: "}[claim["class"]]
    instead = f". Instead: {claim['instead']}" if claim["instead"] else ""
    return f"{kind}{claim['cause']}{instead}"


def _proof(claim: dict[str, Any]) -> list[str]:
    proof = claim["proof"]
    rest = f" Not proved: {_plain(proof['not_proved'])}." if proof["not_proved"] else ""
    return [
        f"{claim['grade'].capitalize()} by {proof['theorem']} of docs/certified.md ({' and '.join(proof['friction'])}"
        f" friction): {_plain(proof['proves'])}.{rest}",
        "",
        *(f"- prove again for {_plain(name)}: `{_code(command)}`" for name, command in proof["commands"].items()),
    ]


def _figure(figure: dict[str, Any]) -> list[str]:
    source = f" ({_plain(figure['source'])})" if figure["source"] else ""
    lines = [f"### {figure['title']}{source}", ""]
    if "missing" in figure:
        return [*lines, f"Not drawn: {_plain(figure['missing'])}", ""]
    lines += [f"![{figure['alternative']}]({figure['name']}.png)", "", _plain(figure["reading"]), ""]
    for table in figure["tables"]:
        lines += [_plain(table["caption"]), "", *_table(table["columns"], table["shown"]), ""]
    return [*lines, "Files: " + ", ".join(f"[{name}]({name})" for name in figure["files"]), ""]


def _values(claim: dict[str, Any], sets: Sequence[str]) -> list[str]:
    return [_value(claim["computed_by_set"].get(name), claim["printed"]) for name in sets]


def _value(value: Any, printed: str) -> str:
    """A number with the agreed digits bold, a sentence as it is."""
    if value is None:
        return ""
    if isinstance(value, str):
        return _plain(value)
    pieces = shortened(value["value"], value["uncertainty"], printed)
    text = "".join(f"**{piece}**" if kind == "agreed" else piece for kind, piece in pieces)
    return text if value["uncertainty"] == "0" else f"{text} ± {value['uncertainty']}"


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(" ".join(str(cell).replace("|", "\\|").split()) for cell in cells) + " |"

    return [line(header), "|---" * len(header) + "|", *map(line, rows)]


def _plain(text: str) -> str:
    """Text that Markdown shows as it stands."""
    return re.sub(r"([\\`*<\[\]])", r"\\\1", " ".join(text.split()))


def _code(text: str) -> str:
    return " ".join(text.replace("`", "'").split())
