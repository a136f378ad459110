"""The published numbers, counted anew as LaTeX counts them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.audit.numbering import numbers, outline
from tippedisk_verify.audit import citations
from tippedisk_verify.audit.catalogue import CLAIMS
from tippedisk_verify.audit.citations import cited

OUTLINE = Path(__file__).with_name("outline.tex")

SOURCE = r"""
\begin{equation} before % \begin{equation}\label{eq:comment}
\begin{document}
\section{One}\label{sec:one}
\begin{equation}\label{eq:a} \begin{aligned} x \\ y \end{aligned} \end{equation}
\begin{align} a \nonumber \\ \label{eq:b} b = \begin{bmatrix} 1 \\ 2 \end{bmatrix} \\ c \end{align}
\begin{equation*} none \end{equation*}
\subsection{Two}\label{sec:two}
\begin{figure} \begin{subfigure} \caption{p}\label{fig:p} \end{subfigure}
\begin{subfigure} \caption{q}\label{fig:q} \end{subfigure} \caption{whole}\label{fig:whole} \end{figure}
\begin{table} \begin{tabular} 1 \\ 2 \end{tabular} \caption{t}\label{tab:t} \end{table}
\appendix \section{Three}\label{sec:three} \subsection{Four}\label{sec:four}
\begin{equation}\label{eq:c}\end{equation}
\end{document}
"""


def test_numbers_are_latexs() -> None:
    expected = {
        "sec:one": "1",
        "sec:two": "1.1",
        "sec:three": "A",
        "sec:four": "A.1",
        "eq:a": "(1)",
        "eq:b": "(2)",
        "eq:b+1": "(3)",
        "eq:c": "(4)",
        "fig:p": "1a",
        "fig:q": "1b",
        "fig:whole": "1",
        "tab:t": "1",
    }
    for source in (SOURCE, outline(SOURCE)):
        found = numbers(source)
        assert {label: found.get(label) for label in expected} == expected


def test_every_number_is_the_outlines() -> None:
    counted = numbers(OUTLINE.read_text())
    table = {label: number for label, (_, number) in citations._NUMBERS.items()}
    assert {label: counted.get(label) for label in table} == table
    assert {label for label in counted if "+" not in label} <= set(table)


@pytest.mark.skipif("TIPPEDISK_PAPER" not in os.environ, reason="TIPPEDISK_PAPER names the paper's LaTeX source")
def test_the_outline_is_the_papers() -> None:
    lines = [line for line in OUTLINE.read_text().splitlines() if not line.startswith("%")]
    assert outline(Path(os.environ["TIPPEDISK_PAPER"]).read_text()).splitlines() == lines


def test_what_is_cited() -> None:
    assert cited("eq:Csol") == "eq. (48)"
    assert cited("eq:3DOF_lin, eq:A_coeff_O") == "eqs. (13), (14)"
    assert cited("below eq:Csol+2") == "below eq. (50)"
    assert cited("tab:dim_mass, fig:hom, sec:discussion") == "Table 1, Figure 7b, Section 6"
    with pytest.raises(KeyError):
        cited("eq:nonsense")
    assert {claim.name for claim in CLAIMS if not claim.labels} == {claim.name for claim in CLAIMS if claim.own_check}
    for claim in CLAIMS:
        assert claim.source.startswith(("own", cited(claim.labels)) if claim.labels else "own")
