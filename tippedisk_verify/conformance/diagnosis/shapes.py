"""What wrong answers have in common, where no model is needed: a factor, an offset, another question's answer.

A shape is a function from right answers to given ones. It is looked for by quantity, among the questions of one level,
and accepted only if it gives every answer to that quantity, with the digits that each needs, and comes much closer to
each wrong one than the truth does.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from decimal import Decimal

from tippedisk_verify.conformance.diagnosis.factors import LONG, named_product, named_values
from tippedisk_verify.conformance.diagnosis.formulas import candidates, conventions
from tippedisk_verify.conformance.diagnosis.places import place_shapes
from tippedisk_verify.conformance.diagnosis.relations import INSTEAD, ordered, relations, stem
from tippedisk_verify.conformance.diagnosis.sides import one_sided
from tippedisk_verify.conformance.grading import Grade, as_decimal, digits_between, needed, scale_of
from tippedisk_verify.conformance.sheet import questions
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["borne_out", "formula_of", "shape_of"]

Found = tuple[tuple[tuple[str, str], ...], frozenset[str]]  # causes, and the wrong answers that they were tried on
_CLOSER = 1.0  # digits by which what a cause expects must be nearer to an answer than the truth is
_BEYOND = 2.0  # digits beyond those needed that a right answer's error may have, whatever the cause
_LEAST_DIGITS = 3.0  # that a question must need before its answer speaks for a shape
_FREE = 4  # answers that must bear out a number that was read off one of them
_SOME = 3  # entries that are named
_MOST = 3  # different shapes at a level; more are several mistakes
_HUGE = 1e15  # answers beyond are no value's, whatever the function; sums with them lose all digits
_FINITE = 1e300  # what doubles hold, and products with factors of some size
_COVERED = 0.4  # of a quantity's wrong answers must have a counterpart, where the shape is another question's answer
_AT_STATES = (1, 2, 3, 4, 5)  # levels whose inputs are those of the formula; an orbit leaves its start's side
_SINGLE = 2.0**-24
_NUMBERS = {
    "2": 2.0, "1/2": 0.5, "4": 4.0, "1/4": 0.25, "-2": -2.0, "-1/2": -0.5, "3": 3.0, "1/3": 1 / 3, "6": 6.0,
    "1/6": 1 / 6, "8": 8.0, "1/8": 1 / 8, "3/2": 1.5, "2/3": 2 / 3, "3/4": 0.75, "4/3": 4 / 3,
    "(180/pi)^2 (degrees squared)": (180 / math.pi) ** 2, "2 pi": 2 * math.pi,
    "1/(2 pi)": 0.5 / math.pi, "pi": math.pi, "1/pi": 1 / math.pi, "180/pi (degrees)": 180 / math.pi,
    "pi/180": math.pi / 180, "1000": 1e3, "1/1000": 1e-3, "1e6": 1e6, "60": 60.0, "1/60": 1 / 60,
    "30/pi (turns per minute)": 30 / math.pi, "1/ln 10 (common logarithms)": 1 / math.log(10), "ln 10": math.log(10),
    "1/ln 2 (logarithms to base 2)": 1 / math.log(2),
    "sqrt 2": math.sqrt(2), "1/sqrt 2": math.sqrt(0.5), "0": 0.0,
}  # fmt: skip
_AS_OF = {
    2.0: "as of an eigenvector of length sqrt 2, or of c_1 without its 1/2",
    0.5: "as of an eigenvector of length sqrt 1/2",
    4.0: "as of an eigenvector of length 2", 0.25: "as of an eigenvector of length 1/2",
}  # fmt: skip
_OFFSETS = {
    "pi/2": math.pi / 2, "-pi/2": -math.pi / 2, "pi": math.pi, "-pi": -math.pi, "2 pi": 2 * math.pi,
    "-2 pi": -2 * math.pi,
}  # fmt: skip
_BY_OMEGA = ("dperiod_domega", "dgamma_bar_0_domega", "dv_0_domega")
_PRINTED = {"omega_crit": (30.92,), "omega_h": (30.07,), "period": (0.886,)}
_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "the square root of the right value, as of a half map for a whole one,": lambda x: math.copysign(
        math.sqrt(abs(x)), x
    ),
    "the square of the right value": lambda x: x * x,
    "the reciprocal of the right value": lambda x: 1 / x,
    "2 pi divided by the right value, frequency for period,": lambda x: 2 * math.pi / x,
    "the absolute value": abs,
    "minus the absolute value": lambda x: -abs(x),
    "the natural logarithm of the right value": math.log,
    "the exponential of the right value": math.exp,
    "the sine of the right value": math.sin,
    "the cosine of the right value": math.cos,
    "the tangent of the right value": math.tan,
    "1 minus the right value": lambda x: 1 - x,
    "pi minus the right value": lambda x: math.pi - x,
    "pi/2 minus the right value": lambda x: math.pi / 2 - x,
}


def shape_of(usable: Sequence[Grade], wrong: set[str], store: Store, by_place: bool) -> Found | None:
    """The causes that explain all wrong answers of a level by their shape, or None.

    With ``by_place``, factors and offsets may depend on the place. ``usable`` are the level's answers that are numbers.
    """
    here, answers = [store[grade.id] for grade in usable], {grade.id: as_decimal(grade.answer) for grade in usable}
    if any(abs(answer) > _HUGE for answer in answers.values()):
        return None
    return (
        _by_quantity(usable, wrong, store, by_place)
        or _by_order(here, answers, wrong)
        or _by_entry(here, answers, wrong, store)
        or _by_row(here, answers, wrong, store)
    )


def _by_row(here: Sequence[Quantity], answers: Mapping[str, Decimal], wrong: set[str], store: Store) -> Found | None:
    """Answers that stand in another row of the file than their questions, by a few rows."""
    rows = questions(store, sets=(here[0].set,))
    place = {quantity.id: n for n, quantity in enumerate(rows)}
    for by in (-1, 1, -2, 2):
        expected = {
            quantity.id: rows[place[quantity.id] + by].for_doubles
            for quantity in here
            if quantity.id in place and 0 <= place[quantity.id] + by < len(rows)
        }
        explained = _explained(expected, here, answers, wrong)
        if len(explained) >= _FREE:
            text = f"the answers to the question {abs(by)} row{'s' * (abs(by) > 1)} {'above' if by < 0 else 'below'}"
            return (("rows", text),), frozenset(explained)
    return None


def _by_order(here: Sequence[Quantity], answers: Mapping[str, Decimal], wrong: set[str]) -> Found | None:
    def fits(quantity: Quantity, expected: float) -> bool:
        return borne_out(answers[quantity.id], expected, quantity, quantity.id in wrong) is not None

    text = ordered(here, fits) if here[0].kind == "equilibrium" else None
    return ((("order", text),), frozenset(wrong)) if text else None


def _by_entry(here: Sequence[Quantity], answers: Mapping[str, Decimal], wrong: set[str], store: Store) -> Found | None:
    """Entries that have another entry's answers throughout."""
    entries: dict[str, list[Quantity]] = {}
    for quantity in here:
        entries.setdefault(quantity.id.rsplit("/", 1)[0], []).append(quantity)
    others = list(dict.fromkeys(q.id.rsplit("/", 1)[0] for q in store.matching(here[0].id.rsplit("/", 2)[0] + "/")))
    pairs: dict[str, str] = {}
    tried, differ = set[str](), set[str]()
    for entry, asked in entries.items():
        if wrong.isdisjoint(quantity.id for quantity in asked):
            continue
        for other in others:
            theirs = {quantity.id: store.get(quantity.id.replace(entry, other)) for quantity in asked}
            expected = {id_: found.for_doubles for id_, found in theirs.items() if found is not None}
            explained = _explained(expected, asked, answers, wrong) if other != entry else set()
            if len(explained) > 1:
                pairs[entry.rsplit("/", 1)[1]] = other.rsplit("/", 1)[1]
                tried |= explained
                for id_, found in theirs.items():
                    if found is not None and id_ in explained:
                        differ |= {name for name, x in store[id_].inputs.items() if found.inputs.get(name) != x}
                break
        else:
            return None
    text = "; ".join(f"{mine} has those to {other}" for mine, other in list(pairs.items())[:_SOME])
    if len(set(pairs.values())) == 1 < len(pairs):
        text = f"all have the same, those to {next(iter(pairs.values()))}"
    more = " and so on" if len(pairs) > _SOME and ";" in text else ""
    of = f", with another {' or '.join(sorted(differ))}" if here[0].kind == "trajectory" and differ else ""
    return (("entries", f"the answers to another entry of the same kind{of}: {text}{more}"),), frozenset(tried)


def _by_quantity(usable: Sequence[Grade], wrong: set[str], store: Store, by_place: bool) -> Found | None:
    answers = {grade.id: as_decimal(grade.answer) for grade in usable}
    if (text := _rounded([store[grade.id] for grade in usable], answers)) is not None:
        return (("rounded", f"the answers are {text}"),), frozenset(wrong)
    groups: dict[str, list[Quantity]] = {}
    for grade in usable:
        groups.setdefault(stem(store[grade.id]), []).append(store[grade.id])
    phrases: dict[str, list[str]] = {}
    tried: set[str] = set()
    for name, here in groups.items():
        if not any(quantity.id in wrong for quantity in here):
            continue
        if len(here) >= _FREE and (text := _rounded(here, answers)) is not None:
            phrases.setdefault(text, []).append(name)
            tried |= {quantity.id for quantity in here if quantity.id in wrong}
            continue
        for where, some, phrase, expected in _placed(here, answers, wrong, store, by_place):
            explained = _explained(expected, some, answers, wrong)
            if explained and (not phrase.startswith("~") or len(explained) >= _FREE):
                phrases.setdefault(f"{phrase.removeprefix('~')}{where and f' where {where}'}", []).append(name)
                tried |= explained
                break
        else:
            return None
    said = _named(phrases)
    return ((("shape", "; ".join(said)),), frozenset(tried)) if 0 < len(said) <= _MOST else None


def _placed(
    here: Sequence[Quantity], answers: Mapping[str, Decimal], wrong: set[str], store: Store, by_place: bool
) -> Iterator[tuple[str, list[Quantity], str, dict[str, float]]]:
    """(Where, the questions there, what the answers are, these answers), everywhere first."""
    sides = one_sided(here, wrong) if here[0].level in _AT_STATES else ()
    for where, some in (("", list(here)), *sides):
        for shape in itertools.chain(
            _shapes(some, answers, wrong, store),
            _conventions(some),
            place_shapes(some, answers, wrong, store) if by_place else (),
        ):
            yield where, some, *shape


def formula_of(entries: Sequence[Sequence[Quantity]], answers: Mapping[str, Decimal], wrong: set[str]) -> Found | None:
    """The simplest of the changed formulas of levels 3 to 5 that explain all answers; those as simple go with it."""
    given = {id_: float(answer) for id_, answer in answers.items() if abs(answer) < _FINITE}
    fits: dict[str, tuple[float, set[str]]] = {}
    if any(quantity.id not in given for here in entries for quantity in here):
        return None
    told = [[quantity for quantity in here if needed(quantity) >= _LEAST_DIGITS] for here in entries]
    blamed = {quantity.id for here in told for quantity in here if quantity.id in wrong}
    for rank, text, predict in candidates(entries, given, wrong):
        tried: set[str] = set()
        for here in told:
            try:
                numbers = predict(here) if here else {}
            except (ArithmeticError, ValueError):  # the changed formula has no value
                break
            known = [quantity for quantity in here if quantity.name in numbers]
            if any(borne_out(answers[q.id], numbers[q.name], q, q.id in wrong) is None for q in known):
                break
            tried |= {quantity.id for quantity in known if quantity.id in wrong}
        else:
            if tried and tried == blamed and (rank < LONG or len(tried) >= _FREE):
                fits.setdefault(text, (rank, tried))
    best = min((rank for rank, _ in fits.values()), default=0.0)
    causes = tuple(("formula", text) for text, (rank, _) in fits.items() if rank == best)
    return (causes, frozenset().union(*(tried for rank, tried in fits.values() if rank == best))) if causes else None


def _named(phrases: Mapping[str, list[str]]) -> list[str]:
    """What each quantity's answers are instead of right; two that stand for each other are exchanged."""
    groups: dict[str, list[str]] = {}
    for phrase, names in phrases.items():
        same_part = all(name[-3:] == phrase[-3:] for name in names)
        groups.setdefault(_whole(phrase) if same_part else phrase, []).extend(names)
    for phrase, names in groups.items():
        parts = {name[-3:] for name in names}
        if parts == {"_re", "_im"}:
            groups[phrase] = list(dict.fromkeys(map(_whole, names)))
    other = {
        names[0]: phrase.removeprefix(INSTEAD)
        for phrase, names in groups.items()
        if len(names) == 1 and phrase.startswith(INSTEAD)
    }
    said = []
    for phrase, names in groups.items():
        mine = names[0]
        if len(names) == 1 and other.get(other.get(mine, "")) == mine:
            text = " and ".join(sorted((mine, other[mine]))) + " are exchanged"
        else:
            text = f"{', '.join(names)}: the answers are {phrase.rstrip(',')}"
        if text not in said:
            said.append(text)
    return said


def _whole(text: str) -> str:
    """What ends in an eigenvalue's name, without the part that was asked for."""
    return re.sub(r"(lambda_\d)_(re|im)$", r"\1", text)


def _explained(
    expected: Mapping[str, float], here: Sequence[Quantity], answers: Mapping[str, Decimal], wrong: set[str]
) -> set[str]:
    """The wrong answers that are as expected; none if one is not, or too many have nothing to be held against."""
    explained: set[str] = set()
    mine = [quantity for quantity in here if needed(quantity) >= _LEAST_DIGITS]
    for quantity in mine:
        if quantity.id not in expected:
            continue
        if borne_out(answers[quantity.id], expected[quantity.id], quantity, quantity.id in wrong) is None:
            return set()
        if quantity.id in wrong:
            explained.add(quantity.id)
    return explained if len(explained) >= _COVERED * sum(quantity.id in wrong for quantity in mine) else set()


def borne_out(answer: Decimal, expected: float, quantity: Quantity, wrong: bool) -> float | None:
    """The digits by which an answer is as a cause expects, or None if the answer speaks against the cause.

    It has to have the digits that its question needs. A wrong one has to be much closer to what is expected than to the
    truth, and so has a right one where the cause moves the value by more than the last digits that matter.
    """
    right, digits = quantity.for_doubles, _digits(answer, expected, quantity)
    moved = _digits(Decimal(right), expected, quantity) + _CLOSER
    if digits < max(needed(quantity), min(moved, needed(quantity) + _BEYOND)):
        return None
    return None if wrong and digits < _digits(answer, right, quantity) + _CLOSER else digits


def _digits(answer: Decimal, expected: float, quantity: Quantity) -> float:
    """By the same measure as against the truth; what is expected has no more than sixteen digits."""
    if not math.isfinite(expected):
        return -99.0
    scale = max(scale_of(quantity, Decimal(expected)), scale_of(quantity, Decimal(quantity.for_doubles)))
    return digits_between(answer, Decimal(expected), scale, 16.0)


def _shapes(
    here: Sequence[Quantity], answers: Mapping[str, Decimal], wrong: set[str], store: Store
) -> Iterator[tuple[str, dict[str, float]]]:
    """(What the answers are, these answers); a number that was read off an answer is marked by ~."""
    right = {quantity.id: quantity.for_doubles for quantity in here}
    given = {id_: float(answers[id_]) for id_ in right}
    worst = max((id_ for id_ in right if id_ in wrong), key=lambda id_: abs(right[id_]))
    yield "of the wrong sign", {id_: -x for id_, x in right.items()}
    for text, number in _NUMBERS.items():
        as_of = f", {_AS_OF[number]}," if here[0].name == "first_lyapunov_coefficient" and number in _AS_OF else ""
        as_of = ", without the source by Omega, or never set," if not number and here[0].name in _BY_OMEGA else as_of
        yield f"{text} times the right value{as_of}", {id_: number * x for id_, x in right.items()}
    for text, number in _OFFSETS.items():
        yield f"the right value plus {text}", {id_: number + x for id_, x in right.items()}
    for number in _PRINTED.get(here[0].name, ()):
        yield f"{number}, as the paper prints it,", dict.fromkeys(right, number)
    if here[0].name == "dv_rate_dbeta":
        yield "1, which is d beta'/dv, the transposed entry of the Jacobian,", dict.fromkeys(right, 1.0)
    if here[0].name == "multiplier_slow":
        yield "1, the trivial multiplier of the whole monodromy matrix,", dict.fromkeys(right, 1.0)
    for text, function in _FUNCTIONS.items():
        yield text, _mapped(function, right)
    turns = {id_: x + 2 * math.pi * round((given[id_] - x) / (2 * math.pi)) for id_, x in right.items()}
    if here[0].unit == "rad" and len(right) >= _FREE:
        yield "off by whole turns, an angle modulo 2 pi,", turns
        halves = {id_: x + math.pi * round((given[id_] - x) / math.pi) for id_, x in right.items()}
        yield "off by half turns, an angle modulo pi,", halves
    yield from relations(here, store)
    kept = {given[id_] for id_ in right if id_ in wrong}
    if len(kept) == 1 and 0 < sum(id_ in wrong for id_ in right) < len(right):
        (number,) = kept
        for id_, x in right.items():
            if id_ not in wrong and given[id_] == number:
                text = f"those to {id_.split('/')[-2]} again, as of a variable that is not set anew,"
                yield text, dict.fromkeys(right, x)
        bound = abs(number)
        if bound == float(f"{bound:.2g}"):  # somebody's threshold
            yield f"cut off at +-{bound:.8g}", {id_: max(-bound, min(x, bound)) for id_, x in right.items()}
            yield f"{bound:.8g} for what is smaller", {id_: max(x, bound) for id_, x in right.items()}
        limit = max(abs(x) for id_, x in right.items() if id_ in wrong)
        if not bound:
            flushed = {id_: 0.0 if abs(x) <= limit else x for id_, x in right.items()}
            yield f"0 where the right value is at most {limit:.2g} in size", flushed
    same = set(given.values())
    if len(same) == 1 and len(set(right.values())) == len(right) > 1:
        known = (text for text, number in _OFFSETS.items() if abs(given[worst] - number) < 1e-12)
        yield f"the same for all questions, {next(known, f'{given[worst]:.8g}')},", given
    zeroed = max((abs(x) for id_, x in right.items() if not given[id_]), default=0.0)
    if zeroed and min((abs(right[id_]) for id_, x in given.items() if x), default=0.0) > zeroed:
        yield f"0 where their size is {zeroed:.2g} or less, as by a threshold,", {
            id_: x if abs(x) > zeroed else 0.0 for id_, x in right.items()
        }  # fmt: skip
    if "@" in here[0].name:
        from tippedisk_verify.conformance.diagnosis.flights import rates_at

        yield from ((f"{INSTEAD}{name}", rates) for name, rates in rates_at(here, store).items())
    if right[worst]:
        factor = given[worst] / right[worst]
        name = named_product(factor, named_values(here[0].set)) or ""
        said = f"{factor:.8g}" + f", which is {name}," * any(map(str.isalpha, name))
        yield f"~{said} times the right value", {id_: factor * x for id_, x in right.items()}
    offset = given[worst] - right[worst]
    yield f"~the right value plus {offset:.8g}", {id_: offset + x for id_, x in right.items()}


def _conventions(here: Sequence[Quantity]) -> Iterator[tuple[str, dict[str, float]]]:
    if here[0].kind == "hopf":
        yield from ((text, {here[0].id: number}) for text, number in conventions(here[0]))


def _mapped(function: Callable[[float], float], right: Mapping[str, float]) -> dict[str, float]:
    found = {}
    for id_, x in right.items():
        try:
            found[id_] = function(x)
        except (ArithmeticError, ValueError):
            found[id_] = math.nan
    return found


# ------------------------------------------------------------------------------------------ sizes
def _rounded(asked: Sequence[Quantity], answers: Mapping[str, Decimal]) -> str | None:
    """How all answers are rounded alike: to so many digits or decimals, or to single precision."""
    import struct

    pairs = [(answers[quantity.id], quantity.for_doubles) for quantity in asked]
    if not any(answer for answer, _ in pairs):
        return None
    for digits in range(2, 13):
        for what in ("significant digits", "decimals"):
            for answer, right in pairs:
                places = answer.adjusted() + 1 - digits if what[0] == "s" and answer else -digits
                step = Decimal(1).scaleb(places)
                # A unit's half, and what a program in doubles may be off beside it.
                near = Decimal("0.5001") * step + Decimal("1e-9") * abs(answer)
                if answer % step or abs(answer - Decimal(right)) > near:
                    break
            else:
                return f"rounded to {digits} {what}"
    for answer, right in pairs:
        x = float(answer)
        kept = abs(x) < 1e38 and struct.unpack("f", struct.pack("f", x))[0] == x
        if not kept or abs(x - right) > 2 * _SINGLE * abs(x):
            return None
    return "rounded to single precision" if len(pairs) >= _FREE else None
