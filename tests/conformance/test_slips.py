"""Slips in written formulas: which there are, how they are said, and that the formulas without them are right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal

import pytest

from tippedisk_verify.conformance.diagnosis.arithmetic import _Arithmetic, _names
from tippedisk_verify.conformance.diagnosis.slipped import slip_of
from tippedisk_verify.conformance.diagnosis.slips import Written, plain
from tippedisk_verify.conformance.diagnosis.written_theory import formulas_of
from tippedisk_verify.conformance.grading import digits_between, needed, scale_of
from tippedisk_verify.reference_values.store import Quantity, stored

KINDS = (
    ("rhs", "linear"), ("rhs", "smooth"), ("equilibrium", "both"), ("hopf", "linear"), ("harmonic-balance", "linear"),
    ("slow-manifold", "linear"),
)  # fmt: skip
_EVERY = 7  # entry of a kind: texts have no case that only some places reach


def said(source: str, *groups: Sequence[str]) -> list[str]:
    return [slip.says() for slip in Written(source, groups).slips()]


def test_a_difference_and_a_quotient() -> None:
    found = said("y = a - b / c", ("a", "b", "c"))
    assert {
        "in y: the sign of b / c in a - b / c", "in y: b / c is missing in a - b / c",
        "in y: a is missing in a - b / c",
        "in y: b / c - a for a - b / c", "in y: the division by c is missing in b / c in a - b / c",
        "in y: a - b c for a - b / c", "in y: a - c / b for a - b / c", "in y: a - b / a for a - b / c",
        "in y: b - b / c for a - b / c", "in y: a - b / c^2 for a - b / c", "in y: the sign of a - b / c",
    } <= set(found)  # fmt: skip


def test_each_slip_is_one_and_none_stays() -> None:
    text = Written("y = a * (b + c)\nz = sin(y)**2\n", (("a", "b"),))
    names = {"a": 2.0, "b": 3.0, "c": 5.0, "sin": lambda x: x + 0.25, "cos": lambda x: x - 0.25, "abs": abs}
    values = []
    for slip in text.slips():
        try:
            values.append(text.run(names, slip)["z"])
        except NameError:  # sqrt is not given
            continue
    # Lost parentheses, c and b missing, a missing, b for a, cos for sin.
    assert {11.25**2, 6.25**2, 10.25**2, 8.25**2, 24.25**2, 15.75**2} <= set(values)
    assert text.run(names)["z"] == 16.25**2


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("y = a * (b + c) / (d * e)", "in y: the parentheses of (b + c) are lost"),
        ("y = a * (b + c) / (d * e)", "in y: the parentheses of (d e) are lost"),
        ("for n in range(3):\n    if n == 1:\n        y += a\n", "in y: the condition n == 1 is lost"),
        ("for n in range(3):\n    y = h[n - 1]\n", "in y: h[0] for h[n - 1]"),
        ("y = r if printed else e", "in y: r always in r if printed else e"),
        ("y = cos(x)**2", "in y: cos(2 x)^2 for cos(x)^2"),
        ("y = cos(x)**2", "in y: sin(x)^2 for cos(x)^2"),
        ("y = cos(x)**2", "in y: cos(x) for cos(x)^2"),
        ("for n in range(3):\n    y += a\n", "y is not summed up: what is added last replaces the rest"),
        ("for n in range(3):\n    y += a\n", "in y: a only where n > 0"),
        ("y = [a, b]", "in y: [b, a] for [a, b]"),
        ("def f(x):\n    return 2 * x\n", "in f: the factor 2 is missing in 2 x"),
        ("Omega = given_Omega", "-Omega taken for Omega"),
    ],
)
def test_what_is_said(source: str, words: str) -> None:
    assert words in said(source)


def test_functions_and_ranges_stand_for_each_other() -> None:
    groups = (("f", "g"), ("range(n)", "range(n - 1)"))
    assert "in y: g(x) for f(x)" in said("y = f(x)", *groups)
    assert "in y: range(n - 1) for range(n)" in said("for i in range(n):\n    y += a\n", *groups)


def test_series_with_nothing_wrong_are_right_and_two_mistakes_are_not_named() -> None:
    store, right = stored(), _Arithmetic()
    entries: dict[str, list[Quantity]] = {}
    for quantity in store.matching("printed/linear/slow-manifold/"):
        if quantity.name.startswith("h_"):
            entries.setdefault(quantity.id.rsplit("/", 1)[0], []).append(quantity)
    formula = formulas_of("slow-manifold", "linear")[0]
    written = Written(formula.source, formula.groups)

    def answers(how: _Arithmetic) -> dict[str, Decimal]:
        found = {}
        for entry, here in entries.items():
            for numbers in formula.answers(lambda names: written.run(_names(how, names)), here):
                found |= {f"{entry}/{name}": Decimal(x) for name, x in numbers.items() if name.startswith("h_")}
        return found

    for id_, answer in answers(right).items():
        truth = Decimal(store[id_].for_doubles)
        assert digits_between(answer, truth, scale_of(store[id_], truth)) >= needed(store[id_])
    one = replace(right, divisor=lambda k: 1)
    for how, named in ((one, True), (replace(one, powers=1), False)):
        given = answers(how)
        wrong = {
            id_ for id_, x in given.items()
            if digits_between(x, (truth := Decimal(store[id_].for_doubles)), scale_of(store[id_], truth)) < 3
        }  # fmt: skip
        found = slip_of(list(entries.values())[:4], given, wrong, lambda text, steps: None)
        assert (found is not None) == named
        assert found is None or found[0] == (
            ("slip", "the series of sine and cosine lack the factor 1/k! of the power x^k"),
        )


def test_formulas_are_spelled_as_in_other_sentences() -> None:
    assert plain("2 * (A - Bbar) * Omega ** 2 / sin(given_beta) ** 1") == "2 (A - Bbar) Omega^2 / sin(beta)"


@pytest.mark.parametrize(("kind", "friction"), KINDS)
def test_the_texts_without_slips_are_right(kind: str, friction: str) -> None:
    """They and the reference values were written apart, so that each checks the other."""
    entries: dict[str, list[Quantity]] = {}
    for quantity in stored().values():
        if quantity.kind == kind and quantity.friction in (friction, "both"):
            entries.setdefault(quantity.id.rsplit("/", 1)[0], []).append(quantity)
    for formula in formulas_of(kind, friction):
        answered = set()
        run = Written(formula.source, formula.groups).run
        for here in list(entries.values())[::_EVERY]:
            asked = {quantity.name: quantity for quantity in here}
            for numbers in formula.answers(run, here):
                for name in numbers.keys() & asked.keys():
                    quantity, number = asked[name], numbers[name]
                    for one in number if isinstance(number, tuple) else (number,):
                        right = Decimal(quantity.for_doubles)
                        # What the level asks of anybody's answer.
                        assert digits_between(Decimal(one), right, scale_of(quantity, right)) >= needed(quantity)
                        answered.add(name)
        assert all(any(name.startswith(begin) for name in answered) for begin in formula.gives)
