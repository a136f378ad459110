"""The right equations of all levels as definitions, and what people write in place of their parts.

Each kind of mistake is one entry of a table of replacements:

- `IN_PLACE` if another symbol or sum is written for a factor of a term,
- `REDEFINED` if a symbol or a sum means something else wherever it stands,
- `INPUTS` if inputs are understood in another way.

`changes` adds the mistakes that can happen to every term and to every factor: a wrong sign, a
missing term, a wrong power, a missing factor, and an additional factor.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import combinations

import numpy as np

from tippedisk_verify.conformance.diagnosis.terms import (
    ZERO_TERM,
    EquationValues,
    Substitution,
    Term,
    parse_definitions,
    parse_sum,
    sum_text,
)
from tippedisk_verify.model.equations import STATE_NAMES

__all__ = ["LINEAR", "SMOOTH", "Change", "changes"]

_EQUATIONS = """
Bbar = B - m e^2
rho = r + e sin(gamma)
inertia = A cos(gamma)^2 + Bbar sin(gamma)^2
M = inertia + m rho^2 cos(beta)^2
h_1 = inertia Omega^2 sin(beta) cos(beta)
h_2 = -2 (A - Bbar) Omega v cos(beta) sin(gamma) cos(gamma)
h_3 = m rho^2 v^2 sin(beta) cos(beta)
h_4 = m e rho Omega^2 sin(beta) cos(beta)^3 sin(gamma)
h_5 = -m e rho (3 sin(beta)^2 - 2) Omega v cos(beta) cos(gamma)
h = h_1 + h_2 + h_3 + h_4 + h_5
f_G = -m g rho cos(beta)
w_y = rho sin(beta)
gamma_y = rho v sin(beta) - e Omega sin(beta)^2 cos(gamma)
gamma_rate = -Omega cos(beta)
force = h + f_G + w_y lambda_Ty
v_rate = force / M
answered_rate = v_rate
dv_rate_dbeta = d(force)/d(beta) / M - d(M)/d(beta) answered_rate / M
dv_rate_dgamma = d(force)/d(gamma) / M - d(M)/d(gamma) answered_rate / M
dv_rate_dv = d(force)/d(v) / M - d(M)/d(v) answered_rate / M
"""
_FORMULAS = """
A_31 = m g (r + side e) / Bbar - Omega^2
A_32 = -mu m g side e (r + side e) Omega / epsilon / Bbar
A_33 = -mu m g (r + side e)^2 / epsilon / Bbar
omega_crit_squared = m g (r + e)^2 / r / Bbar
omega = sqrt(e) hopf_speed / sqrt(r + e)
c_real = 1/2 g_gamma_real + 1/2 g_v_real
c_imag = 1/2 g_gamma_imag + 1/2 g_v_imag
rate_real = rate_21_real + rate_31_real + rate_32_real
rate_imag = rate_21_imag + rate_31_imag + rate_32_imag
omega_crit = sqrt(omega_crit_squared)
hopf_speed = omega_crit
hopf_period = 2 pi / omega
transversality = rate_real
first_lyapunov_coefficient = c_real / omega
amplitude_squared_slope = 4 q_beta^2 rate_real / c_real
period_slope = -2 pi c_imag rate_real / c_real / omega^2 + 2 pi rate_imag / omega^2
chi = A (r - 2 e) - 1/2 Bbar bracket / (r + e) + 1/2 consistent Bbar e^2 / (r + e)
bracket = 2 r^2 + e (r + e)
delta = -1/8 Omega^2 (r - e + consistent e) / (r + e)
excess = Bbar r Omega^2 - m g (r + e)^2
denominator = chi Omega^2 + m g e (r + e)
amplitude_squared = -4 e excess / denominator / (r + e)
amplitude = sqrt(amplitude_squared)
answered_amplitude = amplitude
frequency_squared = e Omega^2 / (r + e) + delta answered_amplitude^2
frequency = sqrt(frequency_squared)
answered_frequency = frequency
law_period = 2 pi / answered_frequency
h_0 = e Omega sin(beta) cos(gamma) / rho
drag = mu m g rho^2 sin(beta)^2
recursion = first h_1 + first h_4 + first f_G + h_2 h_last + h_5 h_last + h_3 h_h - M h_dh - M gamma_rate dh_last
h_next = recursion / drag
recursion_parts = M + h_1 + h_2 + h_3 + h_4 + h_5 + f_G + drag + gamma_rate
transport = slope_beta v + slope_gamma gamma_rate
residual = epsilon transport - epsilon h / M - epsilon f_G / M + drag v / M - drag h_0 / M
"""
LINEAR = parse_definitions(_EQUATIONS + "lambda_Ty = -mu m g gamma_y / epsilon" + _FORMULAS)
SMOOTH = LINEAR | parse_definitions("lambda_Ty = -mu m g gamma_y / (abs(gamma_y) + epsilon)")

#: The symbols and sums that are written by mistake for a factor of a term.
IN_PLACE: dict[str, tuple[str, ...]] = {
    "r": ("e", "(r + e)", "(r - e)"),
    "e": ("r", "(r + e)"),
    "m": ("g",),
    "g": ("m",),
    "mu": ("epsilon",),
    "A": ("B", "Bbar"),
    "B": ("A", "Bbar"),
    "Bbar": ("B", "A", "(B + m e^2)", "M"),
    "Omega": ("v",),
    "v": ("Omega",),
    "epsilon": ("mu",),
    "M": ("inertia", "Bbar", "A"),
    "rho": (
        "r",
        "(r + e)",
        "e",
        "(r - e)",
        "(r - e sin(gamma))",
        "(r + e cos(gamma))",
        "(e + r sin(gamma))",
    ),
    "sin(beta)": ("cos(beta)", "sin(gamma)", "beta", "(2 sin(beta) cos(beta))"),
    "cos(beta)": ("sin(beta)", "cos(gamma)", "(1 - 2 sin(beta)^2)"),
    "sin(gamma)": ("cos(gamma)", "sin(beta)", "(2 sin(gamma) cos(gamma))"),
    "cos(gamma)": ("sin(gamma)", "cos(beta)", "(1 - 2 sin(gamma)^2)"),
    "gamma_y": ("v", "abs(gamma_y)", "w_y", "sgn(gamma_y)"),
    "w_y": ("gamma_y", "rho", "1"),
    "(A - Bbar)": ("(A + Bbar)", "(Bbar - A)", "(A - B)", "(B - Bbar)"),
    "inertia": ("A", "Bbar", "M", "(A sin(gamma)^2 + Bbar cos(gamma)^2)", "(A + Bbar)"),
    "(r + e)": ("(r - e)", "r", "e", "rho"),
    "(r - 2 e)": ("(r + 2 e)", "(r - e)", "(2 r - e)", "r"),
    "(r + side e)": ("r", "(r - side e)", "(r + e)", "e", "rho"),
    "(r - e + consistent e)": ("(r + e)", "r", "(r - e)", "e"),
    "excess": ("(m g (r + e)^2 - Bbar r Omega^2)",),
    "lambda_Ty": ("gamma_y",),
    "side": ("1",),
    "h_h": ("h_h_last", "h_h_zero", "h_h_own"),
    "h_dh": ("h_dh_last", "h_dh_zero", "h_dh_own", "h_dh_short"),
    "h_last": ("h_zero",),
    "dh_last": ("dh_zero", "dh_other"),
    "slope_beta": ("slope_beta_last", "slope_beta_before"),
    "slope_gamma": ("slope_gamma_last", "slope_gamma_before"),
    "c_real": (
        "c_imag",
        "sqrt(c_real^2 + c_imag^2)",
        "(c_real / q_beta^2)",
        "(c_real / q_gamma^2)",
        "(c_real / q_v^2)",
        "(c_real / omega)",
        "(c_real q_beta^2)",
        "(c_real / q_beta^2 + c_real q_gamma^2 / q_beta^2)",
        "(c_real / q_beta^2 / q_gamma^2)",
        "(c_real / q_beta)",
        "(1/2 c_real / q_beta^2)",
        "abs(c_real)",
        "(c_real / (q_beta^2 + q_gamma^2))",
        "transversality",
    ),
    "rate_real": ("rate_imag", "sqrt(rate_real^2 + rate_imag^2)", "abs(rate_real)"),
    "c_imag": ("c_real",),
    "rate_imag": ("rate_real",),
    "q_beta": ("q_gamma", "q_v"),
    "omega": ("hopf_speed", "hopf_period"),
    "sqrt(e)": ("sqrt(r)",),
    "sqrt(r + e)": ("sqrt(r)", "sqrt(r - e)"),
    "consistent": ("1", "(1 - consistent)"),
}
#: The sums that a symbol or a sum means by mistake, wherever it stands.
REDEFINED: dict[str, tuple[str, ...]] = {
    "Bbar": (
        "B",
        "B + m e^2",
        "B - m e",
        "B - 2 m e^2",
        "B - m r^2",
        "B - m e r",
        "A - m e^2",
        "B - e^2",
        "A",
        "B - m (r + e)^2",
        "B - 1/2 m e^2",
        "B + m r^2",
        "m e^2 - B",
    ),
    "rho": (
        "r",
        "r + e",
        "r - e",
        "e",
        "r + e cos(gamma)",
        "r - e sin(gamma)",
        "e + r sin(gamma)",
        "r sin(gamma)",
        "e sin(gamma)",
        "r - e cos(gamma)",
        "r + e sin(beta)",
        "r + e sin(gamma)^2",
        "r + abs(e sin(gamma))",
        "r + r sin(gamma)",
        "sqrt(r^2 + e^2 + 2 r e sin(gamma))",
    ),
    "inertia": (
        "A sin(gamma)^2 + Bbar cos(gamma)^2",
        "A cos(gamma) + Bbar sin(gamma)",
        "A + Bbar",
        "A cos(beta)^2 + Bbar sin(beta)^2",
        "A cos(gamma^2) + Bbar sin(gamma^2)",
    ),
    "(3 sin(beta)^2 - 2)": (
        "3 cos(beta)^2 - 2",
        "2 sin(beta)^2 - 3",
        "2 - 3 sin(beta)^2",
        "1 - 3 cos(beta)^2 - 2",
        "3 sin(beta) - 2",
        "3 sin(beta)^2 - 2 cos(beta)^2",
        "sin(beta)^2",
        "3 sin(beta^2) - 2",
    ),
    "(abs(gamma_y) + epsilon)": (
        "gamma_y + epsilon",
        "gamma_y^2 + epsilon^2",
        "sqrt(gamma_y^2 + epsilon^2)",
        "abs(gamma_y) - epsilon",
        "gamma_y^2 + epsilon",
        "abs(gamma_y) + mu",
        "abs(v) + epsilon",
        "sqrt(gamma_y^2 + epsilon)",
        "abs(gamma_y) + epsilon^2",
        "abs(gamma_y) / epsilon + 1",
    ),
    "lambda_Ty": (
        "-mu m g tanh((gamma_y / epsilon))",
        "-2 mu m g arctan((gamma_y / epsilon)) / pi",
        "-mu m g arctan((gamma_y / epsilon))",
        "-mu m g sgn(gamma_y)",
        "-mu m g gamma_y / epsilon",
        "-mu m g gamma_y / (abs(gamma_y) + epsilon)",
        "-mu m g gamma_y / abs(gamma_y) - epsilon",
        "-mu m g gamma_y / abs(gamma_y) - mu m g epsilon",
        "-mu m g (1 - exp((-1 gamma_y / epsilon)))",
        "-mu m g gamma_y / abs(gamma_y) + epsilon",
    ),
    "sin(beta)": ("sin(2 beta)", "sin(1/2 beta)"),
    "bracket": ("2 r^2 + e r", "2 r^2"),
    "denominator": ("chi omega_crit_squared + m g e (r + e)",),
    "amplitude_squared": ("-4 e^2 excess / denominator / (r + e)^2",),
    "frequency_squared": (
        "e omega_crit_squared / (r + e) - 1/8 omega_crit_squared (r - e + consistent e) "
        "answered_amplitude^2 / (r + e)",
        "e omega_crit_squared / (r + e) + delta answered_amplitude^2",
    ),
    "omega_crit_squared": ("m g (r + 2 e) / Bbar",),
    "period_slope": ("c_imag rate_real / c_real - rate_imag",),
    "residual": (
        "epsilon transport - epsilon h - epsilon f_G + drag v - drag h_0",
        "transport - h / M - f_G / M + drag v / M / epsilon - drag h_0 / M / epsilon",
        "epsilon transport - epsilon h / M - epsilon f_G / M",
    ),
}
# The parts of the normal form at the Hopf point
_NORMAL_FORM_PARTS = ("g_gamma", "g_v", "rate_21", "rate_31", "rate_32")
_NORMAL_FORM_INPUTS = [f"{name}_{part}" for name in _NORMAL_FORM_PARTS for part in ("real", "imag")]
#: Changes of the inputs, by the sentence about them: the new definition of each input.
INPUTS: dict[str, dict[str, str]] = {
    "the adjoint eigenvector p is not scaled to p q = 1": {
        name: f"given(unit_{name})" for name in _NORMAL_FORM_INPUTS
    },
    "the adjoint eigenvector p is (i omega (i omega - A_33), A_32, i omega), not scaled to p q = "
    "1": {name: f"given(unscaled_{name})" for name in _NORMAL_FORM_INPUTS},
    "the adjoint eigenvector is scaled by the conjugate of p q": {
        name: f"given(conjugate_{name})" for name in _NORMAL_FORM_INPUTS
    },
    "the eigenvector q in place of the adjoint one": {
        name: f"given(eigenvector_{name})" for name in _NORMAL_FORM_INPUTS
    },
    "A and B exchanged": {"A": "given(B)", "B": "given(A)"},
    "r and e exchanged": {"r": "given(e)", "e": "given(r)"},
    "mu and epsilon exchanged": {"mu": "given(epsilon)", "epsilon": "given(mu)"},
    "beta and gamma exchanged": {"beta": "given(gamma)", "gamma": "given(beta)"},
    "Omega and v exchanged": {"Omega": "given(v)", "v": "given(Omega)"},
    "the angles taken as degrees": {x: f"1/180 pi given({x})" for x in ("beta", "gamma")},
    "the angles turned into degrees": {x: f"180 given({x}) / pi" for x in ("beta", "gamma")},
    "both angles shifted by pi/2": {x: f"given({x}) + 1/2 pi" for x in ("beta", "gamma")},
    "both angles shifted by -pi/2": {x: f"given({x}) - 1/2 pi" for x in ("beta", "gamma")},
    "Omega taken as turns per minute": {"Omega": "1/30 pi given(Omega)"},
    "Omega taken as turns per second": {"Omega": "2 pi given(Omega)"},
    "A - m e^2 for A": {"A": "given(A) - m e^2"},
    "A + m e^2 for A": {"A": "given(A) + m e^2"},
    "r for r + e": {"r": "given(r) + given(e)"},
    **{f"g = {g}": {"g": g} for g in ("9.8", "9.80665", "9.82", "10", "9.81")},
    "g = -9.81": {"g": "-9.81"},
    "pi = 3.14159": {"pi": "3.14159"},
    "pi = 3.1416": {"pi": "3.1416"},
    "pi = 3.14": {"pi": "3.14"},
    **{
        f"{x} {sentence}": {x: text.format(x=f"given({x})")}
        for x in ("beta", "gamma")
        for sentence, text in {
            "taken as degrees": "1/180 pi {x}",
            "shifted by pi/2": "{x} + 1/2 pi",
            "shifted by -pi/2": "{x} - 1/2 pi",
            "measured the other way from pi/2": "1/2 pi - {x}",
            "measured the other way from pi": "pi - {x}",
            "shifted by pi": "{x} + pi",
            "turned into degrees": "180 {x} / pi",
        }.items()
    },
    **{
        f"{sentence} {x}": {x: text.format(x=f"given({x})")}
        for x in ("Omega", *STATE_NAMES)
        for sentence, text in {
            "the sign of": "-1 {x}",
            "the modulus of": "abs({x})",
            "the first entry's": "first({x})",
            "half of": "1/2 {x}",
            "the previous entry's": "previous({x})",
            "the next entry's": "next({x})",
            "twice": "2 {x}",
            "only the whole part of": "whole({x})",
            "nothing for": "0 {x}",
            "single precision in": "single({x})",
        }.items()
    },
    **{
        f"{sentence} {x}": {x: text.format(x=f"given({x})")}
        for x in ("r", "e", "m", "A", "B", "g", "mu", "epsilon")
        for sentence, text in {
            "half of": "1/2 {x}",
            "twice": "2 {x}",
            "a thousand times": "1000 {x}",
            "a thousandth of": "1/1000 {x}",
            "nothing for": "0 {x}",
            "the square of": "{x}^2",
            "the reciprocal of": "1 / {x}",
            "single precision in": "single({x})",
            "the sign of": "-1 {x}",
            "a tenth of": "1/10 {x}",
            "ten times": "10 {x}",
            "a hundredth of": "1/100 {x}",
            "a hundred times": "100 {x}",
        }.items()
    },
    **{
        f"{names} rounded to {n} decimals": {x: f"to{n}(given({x}))" for x in names.split(", ")}
        for n in range(1, 7)
        for names in ("beta, gamma, v", "Omega", "beta", "gamma", "v", "Omega, beta, gamma, v")
    },
    **{
        f"{names} in single precision": {x: f"single(given({x}))" for x in names.split(", ")}
        for names in (
            "beta, gamma, v",
            "Omega, beta, gamma, v",
            "r, e, m, A, B, g, mu, epsilon",
            "r, e, m, A, B, g, mu, epsilon, Omega, beta, gamma, v",
        )
    },
    "Table 1's parameters": dict(
        zip(
            ("r", "e", "m", "A", "B", "g", "mu", "epsilon"),
            ("0.045", "0.0025", "0.435", "0.000249", "0.000227", "9.81", "0.3", "0.1"),
            strict=True,
        )
    ),
    "Table 1's A": {"A": "0.000249"},
    "Table 1's B": {"B": "0.000227"},
}
_ANGLES = ("sin(beta)", "cos(beta)", "sin(gamma)", "cos(gamma)")
# Additional factors that a term may have by mistake, each with its power.
_EXTRA_FACTORS = (
    *(
        (name, 1)
        for name in (*("Omega", "v", "m", "e", "r", "g", "rho", "mu", "epsilon", "M"), *_ANGLES)
    ),
    *((name, -1) for name in ("epsilon", "M", "Omega")),
)
# Additional numbers by which a term may be multiplied by mistake, each with its rank.
_EXTRA_NUMBERS = {
    **dict.fromkeys((0.5, 2.0), 1),
    **dict.fromkeys((1.5, 2 / 3, 1 / 3, 3.0, 4.0, 0.25), 2),
    **dict.fromkeys((0.75, 4 / 3, 6.0, 1 / 6, 8.0, 1 / 8), 3),
    **dict.fromkeys((np.pi, 1 / np.pi, 2 * np.pi, 1 / (2 * np.pi), np.pi / 180, 180 / np.pi), 3),
}
# Sums whose parts are likelier to be wrong than the sums
_COMPOSITE_SUMS = ("recursion", "residual")
# Factors by which a whole sum may be multiplied by mistake.
_SUM_FACTORS: dict[str, tuple[float, str, int]] = {
    "the wrong sign": (-1.0, "", 1),
    "the factor 2": (2.0, "", 1),
    "the factor 1/2": (0.5, "", 1),
    **{f"the factor {name}": (1.0, name, 1) for name in ("M", "Omega", "epsilon", "m")},
    **{f"the factor 1/{name}": (1.0, name, -1) for name in ("M", "Omega", "epsilon", "m")},
}
# Symbols that stand for sums, which may be wrong in one place only
_SHARED_SUMS = ("Bbar", "rho", "inertia")
_TERMS_OF_H = ("h_1", "h_2", "h_3", "h_4", "h_5")


@dataclass(frozen=True)
class Change:
    """A possible mistake in the equations: what is put in the place of some definitions, or of some
    of their terms.
    """

    substitutions: tuple[Substitution, ...]
    sentence: str
    rank: int = 0  #: lower is likelier
    #: Changes with the same effect
    equivalent: tuple[Change, ...] = field(default=(), compare=False, repr=False)

    @property
    def sort_key(self) -> tuple[int, bool, bool, int]:
        """The sort key by which changes with the same effect are ordered, the likelier mistakes
        first.

        At the same rank, changes of a whole definition with a name come first, then missing or
        doubled terms, then changes of a later term.
        """
        return (
            self.rank,
            self.substitutions[0][1] is not None or self.substitutions[0][0][0] == "(",
            "term" not in self.sentence,
            -(self.substitutions[0][1] or 0),
        )


_UNUSUAL = re.compile("ten|hundred|thousand")  # what sentences about unlikely inputs contain
_INPUT_CHANGES = [
    Change(
        tuple((name, None, parse_sum(text)) for name, text in new_definitions.items()),
        sentence if "vector" in sentence else f"the inputs: {sentence}",
        3 if _UNUSUAL.search(sentence) else 2,
    )
    for sentence, new_definitions in INPUTS.items()
]


def changes(values: EquationValues, names: Iterable[str]) -> list[Change]:
    """Return all possible mistakes in some definitions and inputs of the equations, as single
    changes, each once.

    A change that would define a symbol by itself is left out.

    Args:
        values: The program that is changed.
        names: The names of the definitions and inputs that may be changed.
    """
    names = frozenset(names)
    unique: dict[tuple[Substitution, ...], Change] = {}
    for change in (
        *(change for name in sorted(names) for change in _definition_changes(name, values)),
        *(change for change in _INPUT_CHANGES if names & {x for x, *_ in change.substitutions}),
    ):
        new = {x for *_, terms in change.substitutions for term in terms for x, _ in term.factors}
        changed = {name for name, *_ in change.substitutions}
        if not any(changed & values.inputs_of(factor) for factor in new):
            unique.setdefault(change.substitutions, change)
    return list(unique.values())


def _definition_changes(name: str, values: EquationValues) -> Iterator[Change]:
    """Yield the possible mistakes in one definition: a change of the whole sum, of each term, or by
    a common factor.

    Args:
        name: The name of the definition.
        values: The program that contains it.
    """
    terms = values.terms_of(name)
    for text in REDEFINED.get(name, ()):
        yield Change(((name, None, parse_sum(text)),), f"{name} = {text}, not {sum_text(terms)}")
    is_sum = len(terms) > 1
    for n, term in enumerate(terms):
        for new, sentence, rank in (
            _term_replacements(term, is_sum or name in _TERMS_OF_H) if term.number else ()
        ):
            late = name in _COMPOSITE_SUMS or (name[0] == "(" and "(" in sum_text(new))
            yield Change(((name, n, new),), f"in {name}: {sentence}", rank + late)
    for text, factor in _SUM_FACTORS.items() if is_sum and name[0] != "(" else ():
        yield Change(
            tuple((name, n, (term.times(*factor),)) for n, term in enumerate(terms)),
            f"{name} has {text}",
            1,
        )


Replacement = tuple[tuple[Term, ...], str, int]  #: new terms, sentence, and rank


@lru_cache(4096)
def _term_replacements(term: Term, one_of_several: bool) -> tuple[Replacement, ...]:
    """Return what people may write by mistake in place of a term, each with a sentence and a rank.

    Args:
        term: The term.
        one_of_several: True if the term is one of several in a sum, so that it may be missing.
    """
    return (
        *_other_numbers(term, one_of_several),
        *_other_factors(term),
        *(  # two factors have exchanged their powers
            _replacement(
                term, term.times(1.0, one, second - first).times(1.0, two, first - second), 1
            )
            for (one, first), (two, second) in combinations(term.factors, 2)
            if first != second and first * second > 0
        ),
        *(
            _replacement(term, term.times(1.0, name, power), 2)
            for name, power in _EXTRA_FACTORS
            if name not in dict(term.factors)
        ),
    )


def _replacement(old: Term, new: Term, rank: int) -> Replacement:
    return (new,), f"{sum_text((new,))} for {sum_text((old,))}", rank


def _other_numbers(term: Term, one_of_several: bool) -> Iterator[Replacement]:
    """Yield possible mistakes in a term of the equations: another number or sign, or a missing or
    doubled term.

    Args:
        term: The term.
        one_of_several: True if the term is one of several in a sum, so that it may be missing or
            doubled.
    """
    if one_of_several:
        yield (ZERO_TERM,), f"the term {sum_text((term,))} is missing", 0
        yield (term.times(2.0),), f"the term {sum_text((term,))} is doubled", 2
    yield (term.times(-1.0),), f"the sign of {sum_text((term,))}", 0 if one_of_several else 1
    for number, rank in _EXTRA_NUMBERS.items():
        new, sentence, rank = _replacement(
            term, term.times(number), rank + (len(term.factors) == 1)
        )
        if abs(number * term.number) == 1 and term.factors:
            sentence = f"the factor {abs(term.number):g} is missing in {sum_text((term,))}"
        yield new, sentence, rank


def _other_factors(term: Term) -> Iterator[Replacement]:
    """Yield possible mistakes in a term of the equations that replace a factor, change its power,
    or omit it.
    """
    for name, power in term.factors:
        one = 1 if power > 0 else -1  # the power next to 0 with the same sign
        sums = [f"({text})" for text in REDEFINED[name]] if name in _SHARED_SUMS else []
        for other in (*IN_PLACE.get(name, ()), *sums):
            # A shared sum is likelier wrong where it is defined
            rank = int(name in _SHARED_SUMS and other.startswith("("))
            yield _replacement(term, term.with_factor_replaced(name, other, power), rank)
            if abs(power) > 1:
                yield _replacement(term, term.with_factor_replaced(name, other, one), 1)
        yield (
            (term.times(1.0, name, -power),),
            f"the factor {name} is missing in {sum_text((term,))}",
            0,
        )
        for new, rank in {power - one: 0, one: 0, power + one: 1, -power: 1}.items():
            if new not in (0, power):
                yield _replacement(term, term.times(1.0, name, new - power), rank)
        yield _replacement(term, term.times(-1.0, name, -power), 3)
        if abs(power) > 1 and name.startswith(("sin", "cos")) and "^" not in name:
            inside = f"{name[:-1]}^{abs(power)})"  # sin(beta^2) for sin(beta)^2
            yield _replacement(
                term, term.with_factor_replaced(name, inside, one).times(1.0, name, one - power), 0
            )
