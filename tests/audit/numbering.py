"""The numbers that LaTeX gives to an article's equations, figures, tables and sections, by counting in document order.

It knows what the published paper uses: ``equation`` (one number), ``align`` (one for each row without ``\\nonumber``),
``figure``, ``table`` and ``subfigure`` (numbered by their ``\\caption``), and the sections, with ``\\appendix``.
An environment that it does not know is ignored, with the rows in it: matrices, ``aligned``, ``tabular``.
"""

from __future__ import annotations

import re

__all__ = ["numbers", "outline"]

_TOKEN = re.compile(
    r"\\begin\{(?P<begin>[a-zA-Z*]+)\}|\\end\{(?P<end>[a-zA-Z*]+)\}|\\label\{(?P<label>[^}]*)\}"
    r"|\\(?P<section>(?:sub){0,2}section)\{|(?P<caption>\\caption\b(?!\w))|(?P<nonumber>\\(?:nonumber|notag)\b)"
    r"|(?P<row>\\\\)|(?P<appendix>\\appendix\b)"
)
_SECTIONS = ("section", "subsection", "subsubsection")


def _tokens(source: str) -> list[re.Match[str]]:
    source = re.sub(r"(?<!\\)%.*", "", source)
    return list(_TOKEN.finditer(source, source.index(r"\begin{document}")))


def outline(source: str) -> str:
    """The source without everything that has no say in the numbers."""
    kept, lines = ("document", "equation", "align", "figure", "table", "subfigure"), [""]
    hidden = 0  # depth of environments that are left out
    for token in _tokens(source):
        name = token["begin"] or token["end"]
        if name and name not in kept:
            hidden += 1 if token["begin"] else -1
        elif token["row"] and (hidden or "align" not in lines[-1]):
            continue
        elif not hidden or token["label"] or token["caption"]:
            starts = token["begin"] or token["section"]
            if starts:
                lines.append("")
            lines[-1] += token[0] + "}" * bool(token["section"]) + "{}" * bool(token["caption"])
    return "\n".join(lines).strip() + "\n"


def numbers(source: str) -> dict[str, str]:
    """What each label is cited by: "(2)", "8a", "3.1". ``LABEL+n`` is the n-th numbered equation after a labelled."""
    cited: dict[str, str] = {}
    counts = dict.fromkeys(("equation", "figure", "table", "subfigure", *_SECTIONS), 0)
    appendix, inside, current, latest = False, [], "", "eq:"
    after = 0

    def step_equation() -> str:
        counts["equation"] += 1
        return f"({counts['equation']})"

    pending: list[str] = []  # labels of the row at hand
    numbered = True

    def end_row() -> None:
        nonlocal latest, after
        if numbered:
            number = step_equation()
            after += 1
            if not pending:
                cited[f"{latest}+{after}"] = number
            for label in pending:
                cited[label], latest, after = number, label, 0
        pending.clear()

    for token in _tokens(source):
        kind = token.lastgroup
        if kind == "begin":
            inside.append(token["begin"])
            if inside[-1] in ("equation", "align"):
                numbered = True
            if inside[-1] == "figure":
                counts["subfigure"] = 0
        elif kind == "end":
            assert inside.pop() == token["end"]
            if token["end"] in ("equation", "align"):
                end_row()
        elif kind == "row" and inside[-1] == "align":
            end_row()
            numbered = True
        elif kind == "nonumber":
            numbered = False
        elif kind == "label":
            if inside[-1] in ("equation", "align"):
                pending.append(token["label"])
            else:
                cited[token["label"]] = current
        elif kind == "caption":
            float_ = next(name for name in reversed(inside) if name in ("figure", "table", "subfigure"))
            counts[float_] += 1
            current = str(counts[float_])
            if float_ == "subfigure":
                current = f"{counts['figure'] + 1}{'abcdefghij'[counts['subfigure'] - 1]}"
        elif kind == "appendix":
            appendix, counts["section"] = True, 0
        elif kind == "section":
            level = _SECTIONS.index(token["section"])
            counts[token["section"]] += 1
            counts |= dict.fromkeys(_SECTIONS[level + 1 :], 0)
            parts = [counts[name] for name in _SECTIONS[: level + 1]]
            current = ".".join([chr(64 + parts[0]) if appendix else str(parts[0]), *map(str, parts[1:])])
    return cited
