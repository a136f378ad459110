"""Equations as sums of products in the paper's symbols, and their evaluation.

A definition is a line such as ``f_G = -m g rho cos(beta)``. It is a sum of terms between plus and
minus signs. Each term has a number and factors with powers; a slash divides by the next factor. A
factor is a symbol, another definition, a sum in parentheses, a function of a sum, or a derivative
such as ``d(M)/d(beta)``. ``given(x)`` is the input x, even where a definition has put something
else in its place. Inputs may be numbers or arrays, real or complex.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from typing import Any, NamedTuple

import numpy as np

__all__ = [
    "ZERO_TERM",
    "EquationValues",
    "Substitution",
    "Term",
    "parse_definitions",
    "parse_sum",
    "sum_text",
]


_UNIT_FACTORS = ("", "1")  # names that stand for no factor


class Term(NamedTuple):
    """A product in an equation: a number times factors, each with its power."""

    number: float
    factors: tuple[tuple[str, int], ...]

    def text(self) -> str:
        size = Fraction(abs(self.number)).limit_denominator(1000)
        exact = abs(float(size) - abs(self.number)) < 1e-12
        number = str(size) if exact else f"{abs(self.number):g}"
        above, below = list[str](), list[str]()
        for name, power in self.factors:
            (above if power > 0 else below).append(
                name + (f"^{abs(power)}" if abs(power) != 1 else "")
            )
        if number != "1" or not above:
            above = [number, *above]
        return "-" * (self.number < 0) + " / ".join([" ".join(above), *below])

    def times(self, number: float, name: str = "", power: int = 1) -> Term:
        """Return the product of this term, a number, and a power of a factor. Factors of power 0
        vanish.

        Args:
            number: The number.
            name: The factor; "" for none.
            power: The power of the factor.
        """
        powers = dict[str, int]()
        for factor, own_power in (*self.factors, (name, power)):
            powers[factor] = powers.get(factor, 0) + own_power
        kept = (item for item in powers.items() if item[0] not in _UNIT_FACTORS and item[1])
        return Term(self.number * number, tuple(kept))

    def with_factor_replaced(self, old: str, new: str, power: int) -> Term:
        """Return the term with some powers of one factor replaced by as many of another.

        Args:
            old: The factor that is replaced.
            new: The factor in its place.
            power: The number of powers that are replaced.
        """
        at = [name for name, _ in self.factors].index(old)
        factors = (*self.factors[:at], (new, power), *self.factors[at:])
        return Term(self.number, factors).times(1.0, old, -power)


Terms = tuple[Term, ...]
Definitions = Mapping[str, Terms]
#: The name of a definition, the index of one of its terms (None for all), and the new terms
Substitution = tuple[str, int | None, Terms]
#: In place of a missing term, so that the indices of the other terms stay
ZERO_TERM = Term(0.0, ())


_NESTED = r"[^()]*"  # text with parentheses in it, up to the depth that definitions have
for _depth in range(4):
    _NESTED = rf"(?:[^()]|\({_NESTED}\))*"
_WORD = re.compile(rf"(?:[^\s()]|\({_NESTED}\))+")


@cache
def parse_sum(text: str) -> Terms:
    """Return the terms of a sum that is written as text, such as ``m r^2 - e``."""
    terms, power, term = list[Term](), 1, Term(1.0, ())
    for word in _WORD.findall(re.sub(r"^-(?=\S)", "- ", text.strip())):
        if word in "+-":
            terms.append(term)
            term = Term(-1.0 if word == "-" else 1.0, ())
        elif word == "/":
            power = -1
        elif re.fullmatch(r"[\d.]+(/\d+)?", word):
            term, power = term.times(float(Fraction(word)) ** power), 1
        else:
            name, *exponent = re.split(r"\^(?=\d+$)", word)
            term, power = term.times(1.0, name, power * int(*exponent or [1])), 1
    terms.append(term)
    return tuple(terms[1:] if re.match(r"[+-]", text.strip()) else terms)


@cache
def sum_text(terms: Terms) -> str:
    """Write a sum of terms as text, in the notation that `parse_sum` reads, without ``given``."""
    text = " + ".join(term.text() for term in terms if term.number).replace("+ -", "- ")
    return re.sub(r"given\((\w+)\)", r"\1", text) or "0"


FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    "": lambda x: x,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "tanh": np.tanh,
    "arctan": np.arctan,
    "exp": np.exp,
    "sqrt": lambda x: np.sqrt(x + 0j) if np.iscomplexobj(x) else np.sqrt(x),
    "abs": lambda x: x * np.sign(x.real),
    "sgn": lambda x: np.sign(x.real),
    "first": lambda x: np.ravel(x)[0] + 0 * x,
    "previous": lambda x: np.roll(x, 1),
    "next": lambda x: np.roll(x, -1),
    "single": lambda x: x - x.real + np.asarray(x.real, dtype="f4").astype(float),
    "whole": lambda x: np.trunc(x.real),
    **{f"to{n}": lambda x, n=n: np.round(x.real, n) for n in range(1, 7)},  # type: ignore[misc]
}
_DERIVATIVE = re.compile(r"d\((.*)\)/d\((\w+)\)")
# The imaginary step for derivatives; it is so small that its square is lost in rounding
_IMAGINARY_STEP = 1e-30


@dataclass(eq=False)
class EquationValues:
    """The values of the definitions in a set of equations, for given inputs.

    Each is computed once, on demand.
    """

    definitions: Definitions
    inputs: Mapping[str, Any]
    #: The values computed so far, each with the names from which it is computed
    computed: dict[str, tuple[Any, frozenset[str]]] = field(default_factory=dict)

    def at_inputs(self, **inputs: Any) -> EquationValues:
        """Return the values of the same equations for other or additional inputs."""
        return EquationValues(self.definitions, {**self.inputs, **inputs})

    def with_inputs(self, **inputs: Any) -> EquationValues:
        """Return the values of the equations when some definitions are replaced by inputs of the
        same names.
        """
        return EquationValues(
            {name: terms for name, terms in self.definitions.items() if name not in inputs},
            {**self.inputs, **inputs},
        )

    def __getitem__(self, name: str) -> Any:
        if name not in self.computed:
            self.computed[name] = self._compute(name)
        return self.computed[name][0]

    def inputs_of(self, name: str) -> frozenset[str]:
        """Return the names of all definitions and inputs from which a value is computed, its own
        among them.
        """
        self[name]
        return self.computed[name][1]

    def terms_of(self, name: str) -> Terms:
        """Return the terms of a definition by its name, or those of a sum in parentheses; () for
        other names.
        """
        terms = self.definitions.get(name, ())
        return parse_sum(name[1:-1]) if name.startswith("(") and not terms else terms

    def total(self, terms: Terms) -> tuple[Any, frozenset[str]]:
        total: Any = np.float64(0.0)
        names = frozenset[str]()
        for term in terms:
            factors = (self[name] ** power for name, power in term.factors)
            total = total + math.prod(factors, start=term.number)
            names = names.union(*(self.inputs_of(name) for name, _ in term.factors))
        return total, names

    def _compute(self, name: str) -> tuple[Any, frozenset[str]]:
        if name in self.definitions:
            value, names = self.total(self.definitions[name])
        elif name.startswith("given("):
            return self.inputs[name[6:-1]], frozenset([name])
        elif slope := _DERIVATIVE.fullmatch(name):
            at = self.at_inputs(**{slope[2]: self.inputs[slope[2]] + _IMAGINARY_STEP * 1j})
            return np.imag(at[slope[1]]) / _IMAGINARY_STEP, at.inputs_of(slope[1]) | {name}
        elif name in self.inputs:
            return self.inputs[name], frozenset([name])
        else:
            function, _, argument = name[:-1].partition("(")
            value, names = self.total(parse_sum(argument))
            value = FUNCTIONS[function](value)
        return value, names | {name}

    def with_substitutions(self, substitutions: Sequence[Substitution]) -> EquationValues:
        """Return the values of the equations after a change of definitions; this object stays as it
        is.

        Values that do not depend on the changed definitions are not computed again.

        Args:
            substitutions: The parts of the change, each as a name, the index of a term or None, and
                new terms.
        """
        names, definitions = frozenset(name for name, *_ in substitutions), dict(self.definitions)
        for name, index, terms in substitutions:
            old = definitions.get(name) or self.terms_of(name)
            if index is not None:
                terms = (*old[:index], *terms, *old[index + 1 :])
            definitions[name] = terms
        return EquationValues(
            definitions,
            self.inputs,
            {name: item for name, item in self.computed.items() if not item[1] & names},
        )


def parse_definitions(lines: str) -> dict[str, Terms]:
    """Read definitions of equations from a text, one to a line: return their terms by name."""
    pairs = (line.split(" = ", 1) for line in lines.strip().splitlines() if line.strip())
    return {name.strip(): parse_sum(text) for name, text in pairs}
