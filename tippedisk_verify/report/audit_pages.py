"""The pages that show results.json: a single HTML file, and the same in Markdown.

Nothing is computed here.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from markupsafe import Markup, escape

from tippedisk_verify.report.printed_digits import split_at_agreement
from tippedisk_verify.report.results_json import totals_sentence, verdict_words
from tippedisk_verify.support.web import render

__all__ = ["html_page", "markdown_page"]

_SIGNS = {"holds": "✓", "holds-for": "◐", "does-not-follow": "✗", "undecided": "?"}
_GREEK = dict(
    zip(
        (
            "alpha",
            "beta",
            "gamma",
            "delta",
            "epsilon",
            "kappa",
            "lambda",
            "mu",
            "chi",
            "omega",
            "Omega",
            "pi",
        ),
        "αβγδεκλμχωΩπ",
        strict=True,
    )
)
# Symbols in running text: Omega_crit, gamma_bar_0, dOmega, A_33, Bbar; not the name after "claim".
_SYMBOL = re.compile(
    rf"(?<!claim "
    rf")(?:\b|(?<=\bd))({'|'.join(_GREEK)}|[A-Za-z])(_?bar)?(?:_(\w+))?(?!\w)"
)


def html_page(
    results: dict[str, Any], pictures: dict[str, dict[str, Any]], formulas: dict[str, Any]
) -> str:
    """Return the report of an audit as an HTML page.

    Args:
        results: The content of results.json.
        pictures: For each figure's name, the wide picture and the narrow one for small screens.
        formulas: The formulas, as `draw_formulas` returns them. Their LaTeX is the package's own;
            text from users is always escaped.
    """
    return _page("page.html", results, pictures=pictures, formulas=formulas)


def markdown_page(results: dict[str, Any]) -> str:
    """Return the report of an audit in Markdown, with links to the figures as PNG files in the same
    folder.
    """
    return re.sub(r"\n{3,}", "\n\n", _page("page.md", results))


def _page(template: str, results: dict[str, Any], **more: Any) -> str:
    groups: dict[str, list[dict[str, Any]]] = {}
    for claim in results["claims"]:
        groups.setdefault(claim["group"], []).append(claim)
    filters: dict[str, Callable[..., Any]] = {
        "alike": _same_for_all_sets,
        "code": lambda text: " ".join(text.replace("`", "'").split()),
        "pieces": _digit_pieces,
        "plain": _escape_markdown,
        "reason": _reason,
        "sign": _SIGNS.__getitem__,
        "symbols": _mark_up_symbols,
        "words": verdict_words,
    }
    return render(
        "tippedisk_verify.report",
        template,
        filters,
        results=results,
        groups=groups,
        figures=results["figures"],
        totals=totals_sentence(results["summary"]),
        **more,
    )


def _reason(fault: dict[str, Any]) -> str:
    """Return a phrase for the report with the reason why a claim, or a group of claims, does not
    follow.
    """
    if fault["class"] == "follows-from":  # another claim, by its name, or a dropped term
        return f"Follows from {'dropping ' if ' ' in fault['cause'] else ''}{fault['cause']}"
    if fault["cause"] is None:  # a group of claims
        return "Slips of the pen" if fault["class"] == "slip" else "What is true differs"
    return f"{'A slip of the pen' if fault['class'] == 'slip' else 'What is true differs'}: {fault['cause']}"


def _digit_pieces(value: Any, printed: str, longest: int) -> list[tuple[str, str]]:
    """Split a number's text into the digits that agree with the printed ones, and the rest.

    Return pairs of kind (``agreed``, ``rest`` or ``text``) and text. A sentence stays in one piece.
    """
    if not isinstance(value, dict):
        return [("text", value or "")]
    pieces = zip(
        ("agreed", "rest"), split_at_agreement(value["value"], printed, longest), strict=True
    )
    return [(kind, text) for kind, text in pieces if text]


def _same_for_all_sets(values: dict[str, Any]) -> bool:
    """Return True if a claim's value is the same sentence for all parameter sets, which is then
    shown once.
    """
    sentences = list(values.values())
    return len(sentences) > 1 and all(
        isinstance(value, str) and value == sentences[0] for value in sentences
    )


def _mark_up_symbols(text: str) -> Markup:
    """Return a text as HTML with its symbols marked up: Greek letters, bars, indices, powers and
    roots.
    """

    def drawn(match: re.Match[str]) -> str:
        letter, bar, index = match.groups()
        if letter not in _GREEK and not (bar or index):
            return str(letter)
        below = f"<sub>{_GREEK.get(index, index)}</sub>" if index else ""
        return _GREEK.get(letter, letter) + ("\N{COMBINING MACRON}" if bar else "") + below

    marked = _SYMBOL.sub(drawn, str(escape(text))).replace("sqrt(", "√(")
    return Markup(re.sub(r"\^(-?\w+|\([^()]*\))", r"<sup>\1</sup>", marked))


def _escape_markdown(text: str) -> str:
    """Escape a text so that Markdown shows it unchanged, in a table too."""
    return re.sub(r"([\\`*<\[\]|])", r"\\\1", " ".join(text.split()))
