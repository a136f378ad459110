"""results.json as one HTML page that needs no other file: nothing is computed here, and no number is made up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tippedisk_verify.report.digits import shortened
from tippedisk_verify.web import rendered

__all__ = ["grouped", "headline", "html_page", "verdict_words", "wrong"]

_SIGNS = {"holds": "✓", "holds-for": "◐", "does-not-follow": "✗", "undecided": "?"}
_WORDS = {"holds": "holds", "does-not-follow": "does not follow", "undecided": "undecided"}


def verdict_words(claim: dict[str, Any]) -> str:
    """The verdict as words."""
    if claim["verdict"] == "holds-for":
        return f"holds for {', '.join(claim['sets'])}"
    return _WORDS[str(claim["verdict"])]


def headline(results: dict[str, Any]) -> list[dict[str, Any]]:
    """The claims that are numbers: printed and computed can be laid side by side."""
    return [claim for claim in results["claims"] if claim["printed_digits"] is not None]


def wrong(results: dict[str, Any]) -> list[dict[str, Any]]:
    """What does not follow, in the paper's order."""
    return [claim for claim in results["claims"] if claim["verdict"] == "does-not-follow" and not claim["own_check"]]


def grouped(claims: Sequence[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """The claims by what they are about, in order."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for claim in claims:
        groups.setdefault(claim["group"], []).append(claim)
    return groups


def html_page(results: dict[str, Any], pictures: dict[str, dict[str, Any]], formulas: dict[str, Any]) -> str:
    """The page. ``pictures`` holds for each figure the wide one and, for small screens, the narrow one.

    ``formulas`` are those of `formulas_drawn`. Their LaTeX is the package's own: nothing that a user gives gets into a
    page unescaped.
    """
    return rendered(
        "tippedisk_verify.report",
        "page.html",
        {
            "pieces": _pieces,
            "sign": _SIGNS.__getitem__,
            "words": verdict_words,
            "alike": _alike,
        },
        formulas=formulas,
        results=results,
        pictures=pictures,
        headline=headline(results),
        wrong=wrong(results),
        groups=grouped(results["claims"]),
        redrawn=[figure for figure in results["figures"] if figure["source"]],
        studies=[figure for figure in results["figures"] if not figure["source"] and figure["name"] != "race"],
        races=[figure for figure in results["figures"] if figure["name"] == "race"],
    )


def _pieces(value: Any, printed: str) -> list[tuple[str, str]]:
    """A number's text in pieces by agreement, cut where it would not fit; a sentence in one piece."""
    if isinstance(value, str):
        return [("text", value)]
    return shortened(value["value"], value["uncertainty"], printed)


def _alike(values: dict[str, Any]) -> bool:
    """Whether all sets have the same sentence: it is then said once."""
    said = list(values.values())
    return len(said) > 1 and all(isinstance(value, str) and value == said[0] for value in said)
