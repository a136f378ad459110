"""The answers to other questions: other places, entries, quantities, and what is made of several of them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import permutations, product

from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["INSTEAD", "ordered", "relations", "stem"]

INSTEAD = "the answer for "
_WEIGHTS: dict[str, Callable[[int], float]] = {
    "n! (a factorial)": math.factorial, "1/n!": lambda n: 1 / math.factorial(n), "epsilon^n": lambda n: 0.1**n,
    "(-1)^n (a sign)": lambda n: (-1.0) ** n,
}  # fmt: skip
_PAIRS = (
    ("inverted-", "noninverted-", "equilibrium"), ("linear", "smooth", "friction law"),
    ("printed-", "consistent-", "law, printed one-harmonic and consistent one exchanged,"),
    ("stable-", "unstable-", "cycle, stable and unstable exchanged,"),
)  # fmt: skip
_LOGARITHMS = ("log_multiplier_slow", "log_multiplier_fast")
_SHARES = {
    0.0: "",
    1.0: "",
    -1.0: "minus ",
    0.5: "half of ",
    -0.5: "minus half of ",
    2.0: "twice ",
    -2.0: "minus twice ",
}
_DIVERGENCE = "the integral of the divergence, both logarithms together"
_AS_OF = {  # log_multiplier_fast is the integral of the divergence, less the slow logarithm
    (-0.5, 0.5): ", as of the divergence over half a period", (2.0, 1.0): ", the slow one added, not taken off",
    (0.5, 1.0): ", half of the slow one taken off", (-1.0, 1.0): ", the slow one taken off twice",
}  # fmt: skip
#: Sorting keys of eigenvalues; equal ones, and conjugates, by the sign of the imaginary part.
_ORDERS: dict[str, Callable[[complex], float]] = {
    "descending real parts": lambda x: -round(x.real, 7), "ascending real parts": lambda x: round(x.real, 7),
    "ascending moduli": lambda x: round(abs(x), 7), "descending moduli": lambda x: -round(abs(x), 7),
    "descending imaginary parts": lambda x: -round(x.imag, 7), "ascending imaginary parts": lambda x: round(x.imag, 7),
    "ascending moduli of the imaginary parts": lambda x: round(abs(x.imag), 7),
    "descending moduli of the imaginary parts": lambda x: -round(abs(x.imag), 7),
}  # fmt: skip


def stem(quantity: Quantity) -> str:
    plain, place = placed(quantity.name)
    return plain.rsplit("_", 1)[0] + "_n" if "order" in place else plain


def relations(here: Sequence[Quantity], store: Store) -> Iterator[tuple[str, dict[str, float]]]:
    """The answers to other questions: another place, another entry, another quantity of the same entry."""
    kind = here[0].id.rsplit("/", 2)[0]
    entries = list(dict.fromkeys(q.id.rsplit("/", 1)[0] for q in store.matching(kind + "/")))
    times = sorted({place["t"] for q in here if "t" in (place := placed(q.name)[1])}, key=float)

    def at(rename: Callable[[str], str]) -> dict[str, float]:
        other = {q.id: store.get(rename(q.id)) for q in here}
        return {id_: found.for_doubles for id_, found in other.items() if found is not None and found.id != id_}

    def numbered(mark: str, by: int, factor: int = 1) -> Callable[[str], str]:
        return lambda id_: re.sub(rf"(?<={mark})\d+$", lambda n: str(factor * int(n[0]) + by), id_)

    def listed(items: Sequence[str], by: int) -> Callable[[str], str]:
        moved = {items[n - by]: items[n] for n in range(max(0, by), min(len(items), len(items) + by))}
        # What has no neighbour has no other answer either.
        return lambda id_: re.sub(r"(?<=@)[\d.]+$|^.*(?=/)", lambda item: moved.get(item[0], item[0]), id_)

    for by, word in ((-1, "previous"), (1, "next"), (-2, "last but one"), (2, "next but one")):
        yield f"those to the {word} crossing", at(numbered("#", by))
        yield f"those to the {word} order", at(numbered("_", by)) if stem(here[0]).endswith("_n") else {}
        yield f"those to the {word} sample in time", at(listed(times, by))
        yield f"those to the {word} entry of its kind", at(listed(entries, by))
    for factor, word in ((0.5, "half"), (2.0, "twice")):
        later = partial(re.sub, r"(?<=@)[\d.]+$", lambda t, factor=factor: f"{factor * float(t[0]):g}")
        yield f"those to {word} the time", at(later)
    yield "those to every second crossing", at(numbered("#", 0, 2))
    for sign, word in ((1, "upward"), (-1, "downward")):
        yield f"those to every second crossing, the {word} ones alone", at(partial(_one_way, store, sign))
    for one, two, text in _PAIRS:
        yield f"those to the other {text}", at(partial(_exchanged, f"/{one}", f"/{two}"))
    if here[0].name == "flat_time":
        sampled = (placed(q.name)[1].get("t", "0") for q in store.matching(kind + "/"))
        last = max(map(float, sampled))
        yield f"{last:g} s, the last time that is asked of any orbit,", {q.id: last for q in here}
    before = at(numbered("#", -1))
    yield (
        "counted from the previous crossing, an interval,",
        {q.id: q.for_doubles - before.get(q.id, 0.0) for q in here},
    )
    first = at(lambda id_: re.sub(r"(?<=#)\d+$", "1", id_) if "#" in id_ else "")
    yield (
        "counted from the first crossing,",
        {q.id: q.for_doubles - first.get(q.id, q.for_doubles) for q in here if q.name.startswith("crossing_time#")},
    )
    mine = stem(here[0])
    law = f"/{here[0].friction}/"
    laws = ("/both/", "/linear/", "/smooth/") if here[0].kind == "rhs" else ()  # some columns are common to both
    for other_law in dict.fromkeys((law, *laws)):
        entry = here[0].id.rsplit("/", 1)[0].replace(law, other_law)
        for name in dict.fromkeys(stem(q) for q in store.matching(entry + "/")):
            theirs = at(lambda id_, name=name, to=other_law: _renamed(f"/{mine}", f"/{name}", id_).replace(law, to))  # type: ignore[misc]
            yield f"{INSTEAD}{name}", theirs if name != mine else {}
    for name in dict.fromkeys(stem(q) for q in store.matching(here[0].id.rsplit("/", 1)[0] + "/")):
        other = at(partial(_renamed, f"/{mine}", f"/{name}"))
        yield f"minus the answer for {name}", {id_: -x for id_, x in other.items()}
        if name.startswith("log_"):
            yield f"the exponential of the answer for {name}", {id_: math.exp(x) for id_, x in other.items()}
        if name == "period":
            rates = {q.id: q.for_doubles / other[q.id] for q in here if q.id in other}
            yield "those per unit of time, divided by the period,", rates
            turns = {q.id: 2 * math.pi / float(q.inputs["Omega"]) for q in here if q.inputs.get("Omega")}
            spans = {"unit of time": dict.fromkeys(turns, 1.0), "revolution of the disk, 2 pi/Omega,": turns}
            for text, span in spans.items() if mine == "multiplier_slow" else ():
                powers = {q.id: q.for_doubles ** (span[q.id] / other[q.id]) for q in here if q.id in other}
                yield f"multipliers per {text} not per period", powers
        if name == "dperiod_domega" and mine.endswith("_domega"):
            yield (
                "derivatives by the period, divided by dperiod_domega,",
                {q.id: q.for_doubles / other[q.id] for q in here if q.id in other},
            )
        if name == "period" and mine == "dperiod_domega":
            sums = {q.id: other[q.id] + float(q.inputs["Omega"]) * q.for_doubles for q in here}
            for text, x in (("Omega T", 1.0), ("Omega T/(2 pi)", 1 / (2 * math.pi))):
                yield f"those for the derivative of {text}", {id_: x * total for id_, total in sums.items()}
    if mine.endswith("_n"):
        for text, weight in _WEIGHTS.items():
            yield f"{text} times the right value", {q.id: weight(int(q.name[-1])) * q.for_doubles for q in here}
        for text, share in (("epsilon^k h_k", 0.1), ("h_k", 1.0)):
            sums = {}
            for q in here:
                orders = [store.get(re.sub(r"\d+$", str(k), q.id)) for k in range(int(q.name[-1]) + 1)]
                if all(order is not None for order in orders):
                    sums[q.id] = sum(share**k * float(order) for k, order in enumerate(orders) if order is not None)
            yield f"partial sums of {text} up to each order", sums
    yield from _combinations(here, store)


def _combinations(here: Sequence[Quantity], store: Store) -> Iterator[tuple[str, dict[str, float]]]:
    """What is made of two quantities of the same entry: a modulus, sums of the two logarithms of multipliers."""

    def of(name: str) -> dict[str, float]:
        other = {q.id: store.get(f"{q.id.rsplit('/', 1)[0]}/{name}") for q in here}
        return {id_: found.for_doubles for id_, found in other.items() if found is not None}

    mine = here[0].name
    if mine.endswith(("_re", "_im")) and here[0].kind == "equilibrium":
        parts = [of(mine[:-3] + part) for part in ("_re", "_im")]
        yield (
            "the modulus of the eigenvalue",
            {id_: math.hypot(x, parts[1].get(id_, 0.0)) for id_, x in parts[0].items()},
        )
        yield "the angle of the eigenvalue", {id_: math.atan2(parts[1].get(id_, 0.0), x) for id_, x in parts[0].items()}
    if mine.endswith("_re") and here[0].kind == "equilibrium":
        numbers = [of(f"lambda_{n}_re") for n in (1, 2, 3)]
        sums = {id_: sum(parts[id_] for parts in numbers if id_ in parts) for id_ in numbers[0]}
        yield "the sum of all eigenvalues, the trace of the matrix and its only diagonal entry,", sums
    if mine.startswith("lambda_") and here[0].kind == "heteroclinic":
        parts = [of(name) for name in ("lambda_u", "lambda_s", "lambda_ss")]
        sums = {id_: sum(part[id_] for part in parts) for id_ in parts[0] if all(id_ in part for part in parts)}
        if (omega := store.get(here[0].id.rsplit("/", 1)[0] + "/omega_h")) is not None:
            rates = {q.id: q.for_doubles / omega.for_doubles for q in here}
            yield "those divided by Omega_h, without units,", rates
        yield "the sum of the three eigenvalues, the trace of the matrix and its only diagonal entry,", sums
    if mine in _LOGARITHMS:
        slow, fast = map(of, _LOGARITHMS)
        for a, b in product(_SHARES, _SHARES):
            if a and b:
                text = f"{_SHARES[a]}{_LOGARITHMS[0]} plus {_SHARES[b]}{_LOGARITHMS[1]}"
                if a == b:
                    text = f"{_SHARES[a]}{_DIVERGENCE}"
                text += _AS_OF.get((a, b), "")
                yield text, {id_: a * x + b * fast[id_] for id_, x in slow.items() if id_ in fast}


def _one_way(store: Store, sign: int, id_: str) -> str:
    """The crossing that comes n-th among those in one direction."""
    name, _, number = id_.partition("#")
    entry, quantity = name.rsplit("/", 1)
    speeds = store.matching(f"{entry}/crossing_v#")
    kept = sorted(int(q.name.partition("#")[2]) for q in speeds if sign * q.for_doubles > 0)
    return f"{entry}/{quantity}#{kept[int(number) - 1]}" if number and int(number) <= len(kept) else ""


def _exchanged(one: str, two: str, id_: str) -> str:
    return id_.replace(one, two) if one in id_ else id_.replace(two, one)


def _renamed(old: str, new: str, id_: str) -> str:
    return new.join(id_.rsplit(old, 1))


def ordered(here: Sequence[Quantity], fits: Callable[[Quantity, float], bool]) -> str | None:
    """In which other order the right eigenvalues are answered, or None; ``fits`` holds an answer against a number."""
    entries: dict[str, dict[str, Quantity]] = {}
    for quantity in here:
        entries.setdefault(quantity.id.rsplit("/", 1)[0], {})[quantity.name] = quantity
    lists = []
    for entry in entries.values():
        count = len(entry) // 2
        if sorted(entry) != sorted(f"lambda_{n}_{part}" for n in range(1, count + 1) for part in ("re", "im")):
            return None
        names = [(entry[f"lambda_{n}_re"], entry[f"lambda_{n}_im"]) for n in range(1, count + 1)]
        lists.append((names, [complex(float(re_), float(im)) for re_, im in names]))

    def fit(names: Sequence[tuple[Quantity, Quantity]], values: Sequence[complex]) -> bool:
        return all(
            fits(re_, value.real) and fits(im, value.imag) for (re_, im), value in zip(names, values, strict=True)
        )

    for (text, key), sign, tie in product(_ORDERS.items(), (-1, 1), (-1, 1)):
        if all(
            fit(names, sorted(values, key=lambda x: (key(x), sign * x.imag, tie * x.real))) for names, values in lists
        ):
            first = f", {'positive' if sign < 0 else 'negative'} imaginary part first"
            first = "" if text.endswith("ing imaginary parts") else first
            return f"the right eigenvalues in another order: {text}{first}"
    if all(any(fit(names, other) for other in permutations(values)) for names, values in lists):
        return "the right eigenvalues, not sorted: the order differs from entry to entry"
    return None
