"""Mistakes planted in an independent program, several at once, and how many the diagnosis names.

`EQUATION_MISTAKES` is the table: what is replaced in the text of `blind_program.py`, by what, and a
pattern that a statement which names the mistake matches. Draws take mistakes that change different
lines. A seed gives the same draws on every machine.
"""

from __future__ import annotations

import csv
import re
import sys
import types
import warnings
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from tippedisk_verify.conformance import CLIENTS_FOLDER
from tippedisk_verify.conformance.diagnosis import diagnose
from tippedisk_verify.conformance.grading import Grade, grade_answers
from tippedisk_verify.conformance.sheet import Answers, collect_answers, questions, sheet_csv
from tippedisk_verify.reference_values.store import is_optional, load_store

FOLDER = Path(__file__).parent
PROGRAM_TEXTS = [
    (folder / name).read_text()
    for folder, name in ((CLIENTS_FOLDER, "client.py"), (FOLDER, "blind_program.py"))
]
_BBAR = "Bbar = B - m * e**2\n    sb, cb, sg"
_RHO = "rho = r + e * sg\n    inertia = A * cg**2"


class Mistake(NamedTuple):
    """What is replaced by what, and what a statement that names it says."""

    old: str
    new: str
    cause_pattern: str


EQUATION_MISTAKES: dict[str, Mistake] = {
    "Bbar-plus": Mistake(_BBAR, _BBAR.replace("-", "+"), r"Bbar.*(\+ m e\^2|sign of -m e\^2)"),
    "Bbar-B": Mistake(
        _BBAR,
        _BBAR.replace(" - m * e**2", ""),
        r"Bbar = B, not|Bbar: the term -m e\^2 "
        r"is missing",
    ),
    "Bbar-e": Mistake(_BBAR, _BBAR.replace("e**2", "e"), r"Bbar.*m e([, ]|$)"),
    "rho-r": Mistake(
        _RHO,
        _RHO.replace(" + e * sg", ""),
        r"rho = r, not|rho: the term e sin\(gamma\) "
        r"is missing",
    ),
    "rho-cosine": Mistake(_RHO, _RHO.replace("sg\n", "cg\n"), r"rho.*e cos\(gamma\)"),
    "rho-minus": Mistake(_RHO, _RHO.replace("+ e", "- e"), r"rho.*(r - e sin|sign of e sin)"),
    "rho-exchanged": Mistake(
        _RHO,
        _RHO.replace("r + e", "e + r"),
        r"rho = e \+ r sin|r and e "
        r"exchanged",
    ),
    "inertia-exchanged": Mistake(
        "A * cg**2 + Bbar * sg**2",
        "A * sg**2 + Bbar * cg**2",
        r"inertia.*A "
        r"sin\(gamma\)\^2",
    ),
    "inertia-B": Mistake("A * cg**2 + Bbar * sg**2", "A * cg**2 + B * sg**2", r"B sin\(gamma\)\^2"),
    "inertia-powers": Mistake(
        "A * cg**2 + Bbar * sg**2",
        "A * cg + Bbar * sg",
        r"inertia.*(A cos|Bbar sin)"
        r"\(gamma\)[^^]",
    ),
    "M-sine": Mistake("m * rho**2 * cb**2", "m * rho**2 * sb**2", r"M.*m rho\^2 sin\(beta\)\^2"),
    "M-power": Mistake("m * rho**2 * cb**2", "m * rho**2 * cb", r"M.*m rho\^2 cos\(beta\) for"),
    "M-rho": Mistake("m * rho**2 * cb**2", "m * rho * cb**2", r"M.*m rho cos"),
    "M-term": Mistake(
        "inertia + m * rho**2 * cb**2",
        "inertia",
        r"M: the term m rho\^2 "
        r"cos\(beta\)\^2 is missing",
    ),
    "h1-sign": Mistake("h = h1 +", "h = -h1 +", r"the sign of (h_1|inertia Omega)"),
    "h1-Omega": Mistake(
        "h1 = inertia * Omega**2", "h1 = inertia * Omega", r"h_1: inertia Omega sin"
    ),
    "h1-missing": Mistake("h = h1 +", "h = 0 +", r"term (h_1|inertia Omega\^2.*) is missing"),
    "h2-sign": Mistake("h2 = -2", "h2 = 2", r"the sign of (h_2|-2 \(A)"),
    "h2-factor": Mistake("h2 = -2", "h2 = -1", r"(factor 2 is missing in -2 \(A|1/2 h_2)"),
    "h2-sum": Mistake(
        "h2 = -2 * (A - Bbar)",
        "h2 = -2 * (A + Bbar)",
        r"\(A \+ Bbar\)|\(A - Bbar\): the sign of -Bbar",
    ),
    "h2-B": Mistake(
        "h2 = -2 * (A - Bbar)", "h2 = -2 * (A - B)", r"\(A - B\)|\(A - Bbar\): -B for -Bbar"
    ),
    "h2-sine": Mistake(
        "v * cb * sg * cg",
        "v * sb * sg * cg",
        r"h_2: .*v sin\(beta\) sin\(gamma\) "
        r"cos",
    ),
    "h3-sign": Mistake("+ h3", "- h3", r"the sign of (h_3|m rho\^2 v)"),
    "h3-v": Mistake("rho**2 * v**2", "rho**2 * v", r"h_3: m rho\^2 v sin"),
    "h3-rho": Mistake("rho**2 * v**2", "rho * v**2", r"h_3: m rho v\^2"),
    "h3-missing": Mistake("+ h3", "", r"term (h_3|m rho\^2 v.*) is missing"),
    "h4-sign": Mistake("+ h4", "- h4", r"the sign of (h_4|m e rho)"),
    "h4-square": Mistake("cb**3", "cb**2", r"h_4: .*cos\(beta\)\^2"),
    "h4-power": Mistake("cb**3", "cb", r"h_4: .*cos\(beta\) sin"),
    "h4-cosine": Mistake("cb**3 * sg", "cb**3 * cg", r"h_4: .*cos\(gamma\) for"),
    "h4-e": Mistake("h4 = m * e * rho", "h4 = m * rho", r"h_4: the factor e is missing"),
    "h5-sign": Mistake("+ h5", "- h5", r"the sign of (h_5|-m e rho)"),
    "h5-one": Mistake("3 * sb**2 - 2", "3 * sb**2 - 1", r"-1 for -2"),
    "h5-cosine": Mistake("3 * sb**2 - 2", "3 * cb**2 - 2", r"3 cos\(beta\)\^2"),
    "h5-sine": Mistake(
        "Omega * v * cb * cg",
        "Omega * v * cb * sg",
        r"h_5: .*cos\(beta\) "
        r"sin\(gamma\) for",
    ),
    "h5-v": Mistake("Omega * v * cb * cg", "Omega * cb * cg", r"h_5: the factor v is missing"),
    "f_G-sign": Mistake("f_G = -m", "f_G = m", r"the sign of (f_G|-m g rho)"),
    "f_G-sine": Mistake(
        "f_G = -m * g * rho * cb", "f_G = -m * g * rho * sb", r"f_G: -?m g rho sin\(beta\)"
    ),
    "f_G-mass": Mistake("f_G = -m * g", "f_G = -g", r"f_G: the factor m is missing"),
    "f_G-r": Mistake("f_G = -m * g * rho * cb", "f_G = -m * g * r * cb", r"f_G: -?m g r cos"),
    "w_y-cosine": Mistake("w_y = rho * sb", "w_y = rho * cb", r"w_y: rho cos\(beta\)"),
    "w_y-r": Mistake("w_y = rho * sb", "w_y = r * sb", r"w_y: r sin\(beta\)"),
    "w_y-sine": Mistake("w_y = rho * sb", "w_y = rho", r"w_y: the factor sin\(beta\) is missing"),
    "gamma_y-sign": Mistake("v * sb - e", "v * sb + e", r"gamma_y: the sign of -e Omega"),
    "gamma_y-power": Mistake(
        "Omega * sb**2 * cg",
        "Omega * sb * cg",
        r"gamma_y: -e Omega sin\(beta\) "
        r"cos",
    ),
    "gamma_y-misprint": Mistake(
        "Omega * sb**2 * cg", "Omega * o.sin(beta**2) * cg", r"sin\(beta\^2\)"
    ),
    "gamma_y-sine": Mistake(
        "Omega * sb**2 * cg",
        "Omega * sb**2 * sg",
        r"gamma_y: -e Omega "
        r"sin\(beta\)\^2 sin",
    ),
    "gamma_y-r": Mistake("gamma_y = rho", "gamma_y = r", r"gamma_y: r v sin"),
    "linear-mu": Mistake(
        "-mu * m * g / eps",
        "-m * g / eps",
        r"lambda_Ty: the factor mu is "
        r"missing.*linear",
    ),
    "linear-epsilon": Mistake(
        "-mu * m * g / eps",
        "-mu * m * g",
        r"lambda_Ty: the factor epsilon is "
        r"missing.*linear",
    ),
    "linear-sign": Mistake(
        "-mu * m * g / eps",
        "mu * m * g / eps",
        r"the sign of (-mu m g "
        r"gamma_y|w_y|mu).*linear",
    ),
    "smooth-modulus": Mistake(
        "(size + eps)", "(gamma_y + eps)", r"gamma_y \+ epsilon|abs\(gamma_y\)"
    ),
    "smooth-square": Mistake("(size + eps)", "(size**2 + eps**2)", r"gamma_y\^2 \+ epsilon\^2"),
    "smooth-root": Mistake(
        "(size + eps)",
        "o.sqrt(size**2 + eps**2)",
        r"sqrt\(gamma_y\^2 \+ "
        r"epsilon\^2\)",
    ),
    "gamma-sign": Mistake(
        "gamma_rate = -Omega", "gamma_rate = Omega", r"gamma_rate(: the sign| has the wrong sign)"
    ),
    "gamma-sine": Mistake(
        "gamma_rate = -Omega * cb",
        "gamma_rate = -Omega * sb",
        r"gamma_rate: "
        r"-?Omega sin",
    ),
    "v-lever": Mistake("w_y * lambda_Ty)", "lambda_Ty)", r"force: (lambda_Ty for|the factor w_y)"),
    "v-friction-sign": Mistake("f_G + w_y", "f_G - w_y", r"force: the sign of w_y"),
    "v-no-f_G": Mistake("(h + f_G +", "(h +", r"force: the term f_G is missing"),
}

#: Mistakes at levels 2 to 5: what is replaced by what in the program, and what a statement that
#: names it says.
FORMULA_MISTAKES: dict[str, Mistake] = {
    "eigenvalues-by-modulus": Mistake(
        "key=lambda x: (-round(x.real, 9)",
        "key=lambda x: (-round(abs(x), 9)",
        "another order: descending moduli",
    ),
    "equilibrium-as-printed": Mistake(
        "jacobian(p, Omega, smooth, [HALF_PI, gamma, 0.0])",
        "jacobian(p, Omega, smooth, [HALF_PI if gamma > 0 else 3 * HALF_PI, HALF_PI, 0.0])",
        r"taken at \(3 pi/2, pi/2, 0\)",
    ),
    "equilibrium-formula": Mistake(
        "    values = np.linalg.eigvals(jacobian(p, Omega, smooth, [HALF_PI, gamma, 0.0]))",
        "    J = jacobian(p, Omega, smooth, [HALF_PI, gamma, 0.0])\n"
        "    J[2, 0] += 2 * Omega**2\n"
        "    values = np.linalg.eigvals(J)",
        r"A_31: the sign of -Omega\^2",
    ),
    "hopf-speed": Mistake(
        "sqrt((r + e) ** 2 / r * m * g / Bbar)",
        "sqrt((r + e) * m * g / Bbar)",
        r"omega_crit_squared: m g "
        r"\(r \+ e\) / Bbar for",
    ),
    "hopf-slope": Mistake(
        "4 * abs(q[0]) ** 2 * z_squared_slope",
        "4 * abs(q[0]) * z_squared_slope",
        "4 q_beta rate_real / c_real for",
    ),
    "hopf-modulus": Mistake(
        "c_1.real / omega", "abs(c_1) / omega", r"sqrt\(c_real\^2 \+ c_imag\^2\)"
    ),
    "law-chi": Mistake("A * (r - 2 * e)", "A * (r - e)", r"chi: A \(r - e\) for"),
    "law-delta": Mistake("delta = -1 / 8", "delta = -1 / 4", "delta: -1/4 Omega"),
    "law-denominator": Mistake(
        "+ m * g * e * (r + e)))",
        "+ m * g * (r + e)))",
        "denominator: the factor e is missing",
    ),
    "law-hertz": Mistake(
        '"frequency": omega,',
        '"frequency": omega / (2 * pi),',
        r"frequency has the "
        r"factor 1/\(2 pi\)",
    ),
    "manifold-h_0": Mistake(
        "series_quotient(series_product(sin_beta, cos_gamma), rho)",
        "series_quotient(cos_gamma, rho)",
        r"h_0: the factor "
        r"sin\(beta\) is missing",
    ),
    "manifold-h_4": Mistake(
        "free = gyroscopic + eccentric + gravity",
        "free = gyroscopic + gravity",
        "h_4: the term .* is missing",
    ),
    "manifold-residual": Mistake(
        "v - dv_dgamma * Omega", "v + dv_dgamma * Omega", "transport: the sign of slope_gamma"
    ),
    "manifold-order": Mistake(
        'answers[f"h_{n}"]', 'answers[f"h_{n + 1}"]', "the values of the previous order"
    ),
}

_DIFFERENCES = '''def gradient(p, Omega, smooth, y):
    """Derivatives of gamma' and v' by central differences under some laws, else with imaginary steps."""
    columns = []
    for k in range(4):
        if smooth in DIFFERENCED:
            ends = []
            for side in (1, -1):
                z = [*y, Omega]
                z[k] = z[k] + side * 1e-6
                ends.append(model(math, p, z[3], smooth, *z[:3]))
            columns.append(tuple((ends[0][n] - ends[1][n]) / 2e-6 for n in (6, 7)))
            continue
'''
_GRADIENT = PROGRAM_TEXTS[1][
    PROGRAM_TEXTS[1].index("def gradient") : PROGRAM_TEXTS[1].index("        z = [*y, Omega]")
]


@cache
def question_rows(levels: range) -> list[dict[str, str]]:
    """The questions of the printed set at some levels."""
    asked = questions(load_store(), sets=("table1",), frictions=(), levels=tuple(levels))
    return list(csv.DictReader(sheet_csv(load_store(), asked).splitlines()))


FIRST_QUESTIONS = [row for row in question_rows(range(1, 2)) if int(row["id"].split("/")[3]) < 5]


class DiagnosedMistakes(NamedTuple):
    """What the diagnosis says of some mistakes at once."""

    names: tuple[str, ...]
    named: frozenset[str]
    false_causes: tuple[str, ...]  #: statements that name none of them


def patched_program(patches: list[tuple[str, str]]) -> dict[str, Any] | None:
    """The program with replacements in its texts; None where one does not fit in exactly one
    place of the last text that has it.
    """
    texts = list(PROGRAM_TEXTS)
    for old, new in patches:
        place = max(range(len(texts)), key=lambda n: (old in texts[n], n))
        if texts[place].count(old) != 1:
            return None
        texts[place] = texts[place].replace(old, new)
    for name, text in zip(("client", "program"), texts, strict=True):
        sys.modules[name] = types.ModuleType(name)
        exec(compile(text, name, "exec"), sys.modules[name].__dict__)
    return sys.modules["program"].__dict__


def grades_of(program: dict[str, Any], levels: range, id_pattern: str = "") -> list[Grade]:
    """The grades of a program's answers but the optional ones, or of those to some ids only."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what mistakes do to square roots and integrators
        answers = program["answered"](question_rows(levels))
    given = [
        (id_, "doubles", str(text), {})
        for id_, text in answers.items()
        if (re.search(id_pattern, id_) if id_pattern else not is_optional(id_))
    ]
    return grade_answers(collect_answers(given, load_store(), None, Answers()), load_store())


def diagnose_planted(
    names: tuple[str, ...],
    differences: tuple[bool, ...] = (),
    id_pattern: str = "",
) -> DiagnosedMistakes | None:
    """Plant some mistakes at once, with derivatives by differences under these laws; None where
    they do not fit.
    """
    patches = [(EQUATION_MISTAKES[name].old, EQUATION_MISTAKES[name].new) for name in names]
    if differences:
        patches.append((_GRADIENT, _DIFFERENCES.replace("DIFFERENCED", repr(differences))))
    program = patched_program(patches)
    if program is None:
        return None
    grades = grades_of(program, range(1, 2), id_pattern)
    diagnoses = diagnose(grades, load_store())
    causes = [says for one in diagnoses for name, says in one.causes if name != "digits"]
    named = frozenset(
        name
        for name in names
        if any(re.search(EQUATION_MISTAKES[name].cause_pattern, says) for says in causes)
    )
    false = tuple(
        says
        for says in causes
        if not any(re.search(EQUATION_MISTAKES[name].cause_pattern, says) for name in names)
    )
    return DiagnosedMistakes(names, named, false)


def draw_mistakes(seed: int, count: int, size: int) -> Iterator[tuple[str, ...]]:
    """So many sets of mistakes in different terms, none of which is hidden by the others."""
    draws, found = Random(seed), 0
    while found < count:
        names = tuple(sorted(draws.sample(list(EQUATION_MISTAKES), size)))
        every = _first_answers(names)
        terms = {name.split("-")[0] for name in names}
        if (
            every
            and len(terms) == size
            and all(
                _first_answers(tuple(one for one in names if one != name)) != every
                for name in names
            )
        ):
            found += 1
            yield names


def _first_answers(names: tuple[str, ...]) -> dict[str, str] | None:
    """The answers to the first questions with some mistakes planted; None where they do not fit
    together.
    """
    program = patched_program([EQUATION_MISTAKES[name][:2] for name in names])
    return program["answered"](FIRST_QUESTIONS) if program else None


#: The planted mistakes of the tests: the laws under which derivatives are differences, the pattern
#: of the ids that are answered, and count and size of the draws.
DRAWS: dict[str, tuple[tuple[bool, ...], str, tuple[tuple[int, int], ...]]] = {
    "some": ((), "", ((1, 1), (1, 2), (2, 3))),
    "exact": ((), "", ((3, 1), (12, 2), (6, 3))),
    "linear": ((False,), "", ((4, 2), (2, 3))),
    "both": ((False, True), "", ((2, 2), (4, 3))),
    "optional": ((), ".", ((8, 6),)),
}
