"""Formulas as small vector drawings, which look the same in every browser."""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import escape
from typing import Any

__all__ = ["draw_formulas"]

# The SVG command for each of Matplotlib's path codes, and the number of points that it takes.
_COMMANDS = {1: ("M", 1), 2: ("L", 1), 3: ("Q", 2), 4: ("C", 3), 79: ("Z", 1)}
_RELATIONS = ("=", "<", ">", r"\approx", r"\mapsto")


def draw_formulas(latex: Iterable[str]) -> dict[str, Any]:
    """Draw formulas as inline ``<svg>`` elements in the colour of the text.

    A formula is cut where a line may break, so that it wraps like text.

    Args:
        latex: The formulas.

    Returns:
        The elements of each formula under ``drawn``, and an element with the outlines of all
        letters under ``letters``.

    Raises:
        ValueError: If Matplotlib's mathtext does not know some of the LaTeX.
    """
    from matplotlib import rc_context

    outlines: dict[Any, Any] = {}  # the letters' outlines, by Matplotlib's names
    with rc_context({"mathtext.fontset": "cm"}):
        drawn = {text: " ".join(_svg(piece, outlines) for piece in _pieces(text)) for text in latex}
    letters = "".join(
        f'<path id="g{n}" d="{_outline(*path)}"/>' for n, path in enumerate(outlines.values())
    )
    defined = f'<svg aria-hidden="true" width="0" height="0" style="position:absolute"><defs>{letters}</defs></svg>'
    return {"drawn": drawn, "letters": defined}


def _pieces(latex: str) -> list[str]:
    """Cut a LaTeX formula into pieces between which a line may break.

    The cuts are before relations and sums and after wide spaces, but not inside brackets.
    """
    pieces, depth = [""], 0
    for token in re.findall(r"\\[A-Za-z]+|\\.|.", latex):
        depth += (token in ("{", "(", r"\left")) - (token in ("}", ")", r"\right"))
        if (
            not depth
            and token in (*_RELATIONS, "+", "-")
            and pieces[-1].strip() not in ("", *_RELATIONS)
        ):
            # After {} a sign has space on both sides.
            pieces.append("" if token in _RELATIONS else "{}")
        pieces[-1] += token
        if token == r"\quad":
            pieces.append("")
    return pieces


def _svg(latex: str, outlines: dict[Any, Any]) -> str:
    """Return a piece of a formula as an ``<svg>`` element.

    It is measured in ems and stands on the baseline of the text. New letters are added to
    ``outlines``.
    """
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    # Formulas have lines of their own, so \frac is drawn large. mathtext's \frac is LaTeX's \tfrac.
    text = "$" + latex.replace(r"\frac", r"\dfrac").replace(r"\tfrac", r"\frac") + "$"
    em = text_to_path.FONT_SCALE
    width, height, depth, *_ = text_to_path.mathtext_parser.parse(
        text, text_to_path.DPI, FontProperties(size=em)
    )
    letters, used, bars = text_to_path.get_glyphs_mathtext(FontProperties(size=em), text)
    outlines.update(used)
    numbers = {name: number for number, name in enumerate(outlines)}
    parts = [
        f'<use href="#g{numbers[name]}" transform="translate({x:.1f} {-y:.1f}) scale({size:g})"/>'
        for name, x, y, size in letters
    ]
    for corners, _ in bars:
        parts.append(f'<path d="M{" ".join(f"{x:.1f} {-y:.1f}" for x, y in corners[:4])}Z"/>')
    return (
        f'<svg role="img" aria-label="{escape(latex)}" fill="currentColor"'
        f' viewBox="0 {depth - height:g} {width:g} {height:g}"'
        f' style="width:{width / em:.2f}em;height:{height / em:.2f}em;vertical-align:{-depth / em:.2f}em">'
        f"{''.join(parts)}</svg>"
    )


def _outline(vertices: Any, codes: Any) -> str:
    """Return a letter's outline as an SVG path, with y pointing down."""
    path, index = [], 0
    while index < len(codes):
        letter, count = _COMMANDS[int(codes[index])]
        ends = vertices[index : index + count] if letter != "Z" else []
        path.append(letter + " ".join(f"{float(x):.1f} {-float(y):.1f}" for x, y in ends))
        index += count
    return "".join(path)
