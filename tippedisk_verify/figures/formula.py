"""Formulas as small vector drawings: they look the same in every browser, with or without fonts for mathematics."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Any

__all__ = ["Formulas", "formulas_drawn"]

_SIZE = 16.0  # of the letters, in the drawings' units; the page scales one of its own font sizes to it
#: Matplotlib's path codes: the letter of the same command in SVG, and how many points it takes.
_COMMANDS = {1: ("M", 1), 2: ("L", 1), 3: ("Q", 2), 4: ("C", 3), 79: ("Z", 1)}


class Formulas:
    """The formulas of one page. They share their letters, which `definitions` draws once."""

    def __init__(self) -> None:
        self._letters: dict[Any, tuple[str, str]] = {}  # by Matplotlib's name: our name and the outline

    def svg(self, latex: str) -> str:
        """An inline ``<svg>`` element in the text's colour, for LaTeX that Matplotlib's mathtext knows.

        Raises ValueError for what it does not know.
        """
        from matplotlib import rc_context
        from matplotlib.font_manager import FontProperties
        from matplotlib.textpath import text_to_path

        # On a line of its own a fraction has room; mathtext writes LaTeX's small one as the usual one.
        text = latex.replace(r"\frac", r"\dfrac").replace(r"\tfrac", r"\frac")
        with rc_context({"mathtext.fontset": "cm"}):
            letters, outlines, bars = text_to_path.get_glyphs_mathtext(FontProperties(size=_SIZE), f"${text}$")
        scale = _SIZE / text_to_path.FONT_SCALE
        parts, xs, ys = [], [], []
        for name, x, y, size in letters:
            vertices, codes = outlines[name]
            if len(vertices) == 0:  # a space
                continue
            ours, _ = self._letters.setdefault(name, (f"g{len(self._letters)}", _outline(vertices, codes)))
            parts.append(
                f'<use href="#{ours}" transform="translate({scale * x:.2f} {-scale * y:.2f}) scale({size:g})"/>'
            )
            xs += [scale * (x + size * float(vertex[0])) for vertex in vertices]
            ys += [-scale * (y + size * float(vertex[1])) for vertex in vertices]
        for corners, _ in bars:
            places = [(scale * float(x), -scale * float(y)) for x, y in corners[:4]]  # the fifth only closes
            left, top = min(x for x, _ in places), min(y for _, y in places)
            right, bottom = max(x for x, _ in places), max(y for _, y in places)
            parts.append(f'<path d="M{left:.2f} {top:.2f}H{right:.2f}V{bottom:.2f}H{left:.2f}Z"/>')
            xs += [left, right]
            ys += [top, bottom]
        width, height = max(xs) - min(xs) + 2, max(ys) - min(ys) + 2
        return (
            f'<svg role="img" aria-label="{escape(latex)}" fill="currentColor"'
            f' viewBox="{min(xs) - 1:.2f} {min(ys) - 1:.2f} {width:.2f} {height:.2f}"'
            f' style="width:{width / _SIZE:.3f}em;height:{height / _SIZE:.3f}em">{"".join(parts)}</svg>'
        )

    def definitions(self) -> str:
        """An ``<svg>`` element without size that holds the letters."""
        letters = "".join(f'<path id="{name}" d="{outline}"/>' for name, outline in self._letters.values())
        return f'<svg aria-hidden="true" width="0" height="0" style="position:absolute"><defs>{letters}</defs></svg>'


def formulas_drawn(latex: Iterable[str]) -> dict[str, Any]:
    """Each formula as `Formulas.svg` draws it, and the letters that they share."""
    formulas = Formulas()
    drawn = {text: formulas.svg(text) for text in latex}
    return {"drawn": drawn, "letters": formulas.definitions()}


def _outline(vertices: Any, codes: Any) -> str:
    """A letter's outline, upwards negative, at size one."""
    from matplotlib.textpath import text_to_path

    scale = _SIZE / text_to_path.FONT_SCALE
    path, index = [], 0
    while index < len(codes):
        letter, count = _COMMANDS[int(codes[index])]
        ends = vertices[index : index + count] if letter != "Z" else []
        path.append(letter + " ".join(f"{scale * float(x):.2f} {-scale * float(y):.2f}" for x, y in ends))
        index += count
    return "".join(path)
