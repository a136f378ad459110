"""The published numbers, compared with numbers counted in an outline of the paper as LaTeX does."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tippedisk_verify.audit import citations
from tippedisk_verify.audit.citations import published_numbers
from tippedisk_verify.audit.claim_catalogue import CLAIMS

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
