"""One free factor on each parameter, input and term, solved for from the answers at level 1.

A mistake that is on no list is often one number or one factor: ``mu = 0.31``, a missing term, cos for sin in M. Where
M, h, f_G, w_y, gamma_y, gamma', lambda_Ty or v' are answered wrong, each of their terms T may carry the blame: the
answer wants T + (answer - truth) in its place. If that is T times c x^a y^b ... with whole powers of rho, the sines and
cosines, Omega, v and M, the powers follow from a linear fit of logarithms, and c from the rest. A parameter's or an
input's value is a root of one answer's error. What is found so is a guess: the diagnosis tries it on all answers, with
what follows from it for the quantities further on.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from decimal import Decimal
from functools import lru_cache, partial
from types import SimpleNamespace

from tippedisk_verify.conformance.diagnosis.alternatives import CORRECT, Alternative
from tippedisk_verify.conformance.diagnosis.predictions import Model, predicted
from tippedisk_verify.model.parameters import SYMBOLS, Parameters
from tippedisk_verify.reference_values.draws import parameters_of
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = [
    *(
        "LONG",
        "OF_ANOTHER",
        "changed_term",
        "critical_speed",
        "factor_said",
        "free_values",
        "model_bases",
        "model_values",
        "monomial",
    ),
    *("moved", "named_product", "named_values", "parameter", "said_factor", "scaled", "term_factors", "term_names"),
]

_TERMS = {
    "rho": {"rho": ""},
    "M": {"M 1": "A cos^2 gamma", "M 2": "Bbar sin^2 gamma", "M 3": "m rho^2 cos^2 beta"},
    "h": {
        "h 1": "(A cos^2 gamma + Bbar sin^2 gamma) Omega^2 sin beta cos beta",
        "h 1, A": "A cos^2 gamma Omega^2 sin beta cos beta",
        "h 1, Bbar": "Bbar sin^2 gamma Omega^2 sin beta cos beta",
        "h 2": "2 (A - Bbar) Omega v cos beta sin gamma cos gamma",
        "h 3": "m rho^2 v^2 sin beta cos beta",
        "h 4": "m e rho Omega^2 sin beta cos^3 beta sin gamma",
        "h 5": "m e rho (3 sin^2 beta - 2) Omega v cos beta cos gamma",
        "h 5, 3": "m e rho 3 sin^2 beta Omega v cos beta cos gamma",
        "h 5, 2": "m e rho 2 Omega v cos beta cos gamma",
    },
    "f_G": {"f_G": ""},
    "w_y": {"w_y": ""},
    "gamma_y": {"gamma_y 1": "rho v sin beta", "gamma_y 2": "e Omega sin^2 beta cos gamma"},
    "gamma_rate": {"gamma_rate": ""},
    "lambda_Ty": {"lambda_Ty": ""},
    "v_rate": {"v_rate": "", "v_rate h": "h", "v_rate f_G": "f_G", "v_rate friction": "w_y lambda_Ty"},
}
_INDEPENDENT = {
    "M": tuple(_TERMS["M"]), "h": ("h 1, A", "h 1, Bbar", "h 2", "h 3", "h 4", "h 5, 3", "h 5, 2"),
    "gamma_y": tuple(_TERMS["gamma_y"]),
}  # fmt: skip
_INERTIA = ("A", "Bbar")
_LINEAR = 1e-10  # of a row's largest term: what a linear fit may leave, of answers in doubles
_FACTORS = ("rho", "sin beta", "cos beta", "sin gamma", "cos gamma", "Omega", "v", "M")
_SOME_SIZE = 1e-3  # of the quantity's scale; a smaller term says little about its factor
_WHOLE = 0.02  # how far a fitted power may be from a whole number
_CONSTANT = 1e-6  # relative: the spread of what is left; the terms keep nine digits of their answers' fifteen
_SAME = 1e-9  # relative: how near a value is that of another parameter
_SMALL = ((1.0, ""), (-1.0, "-1"), (2.0, "2"), (0.5, "1/2"), (4.0, "4"), (0.25, "1/4"))
_PLAIN = tuple(  # rather than products that coincide: 3 is mu/epsilon too
    (sign * up / down, f"{'-' if sign < 0 else ''}{up}" + f"/{down}" * (down > 1))
    for up, down in (*((n, 1) for n in range(2, 10)), *((1, n) for n in range(2, 10)), (3, 2), (2, 3), (3, 4), (4, 3))
    for sign in (1, -1)
)
_LEAST_STATES = 12  # for at most nine unknowns
_ROOT = 1e-13  # of the largest error on the grid: the grid has hit the root
_HALVES = (1, -1, 2, -2, 0.5, -0.5)
OF_ANOTHER = ", the value of "  # a parameter that was taken for another
LONG = 9.0  # the rank of a factor that is nothing but a number
_GRID = sorted(
    {sign * 10 ** (k / 6) for k in range(-24, 25) for sign in (-1, 1)} | {0.0} | {1 + k / 40 for k in range(-20, 21)}
)


def term_factors(wrong: Sequence[Quantity], answers: Mapping[str, Decimal]) -> Iterator[Alternative]:
    """Alternatives with one term changed by a factor, one for each term that the wrong answers allow."""
    none = Alternative("", "")
    for component, terms in _TERMS.items():
        samples: dict[str, list[tuple[float, list[float]]]] = {name: [] for name in (*terms, f"{component} +")}
        for quantity in wrong:
            if quantity.name != ("f_G" if component == "rho" else component):
                continue
            model = Model(none, quantity.set, quantity.friction)
            given = model.inputs(quantity)
            parts = model.parts(math, given["Omega"], [given[name] for name in ("beta", "gamma", "v")])
            sines = [f(given[name]) for name in ("beta", "gamma") for f in (math.sin, math.cos)]
            rho = model.p.r + model.p.e * sines[2]
            places = [rho, *sines, given["Omega"], given["v"], parts["M"]]
            missing = float(answers[quantity.id]) - parts[quantity.name]
            if component == "rho":  # what f_G and all else has for it
                missing *= rho / parts["f_G"]
            if all(places):
                samples[f"{component} +"].append((missing, places))
            for name in terms:
                if abs(parts[name]) > _SOME_SIZE * max(abs(missing), abs(parts[component])) and all(places):
                    samples[name].append((1 + missing / parts[name], places))
        for name, found in samples.items():
            if len(found) < _LEAST_STATES:
                continue
            basis = _FACTORS if component == "v_rate" else _FACTORS[:-1]
            fit = monomial([(factor, places[: len(basis)]) for factor, places in found])
            if fit is None:
                continue
            constant, powers = fit
            factors = tuple((label, power) for label, power in zip(basis, powers, strict=True) if power)
            number, _, what = name.partition(" ")
            if what == "+":
                said, unknown = factor_said(constant, factors, named_values(wrong[0].set), "the extra term")
                extra = ((name, constant, factors),)
                yield Alternative("number-more" if unknown else "more", f"{number} {said}",
                                  replace(CORRECT, extra=extra))  # fmt: skip
                continue
            label = _term_said(name)
            said, unknown = factor_said(constant, factors, named_values(wrong[0].set))
            plain = not unknown and component != "rho"  # one factor of e says the same of rho, and more simply
            yield Alternative(
                f"{'term' if plain else 'number'}-{name}",
                f"{label} {said}",
                replace(CORRECT, extra=((name, constant, factors),)),
            )
    yield from _coefficients(wrong, answers)


def _term_said(name: str) -> str:
    component, _, what = name.partition(" ")
    text = _TERMS[component][name]
    if what[:1].isdigit():
        return f"{component}'s term {what}, {text},"
    return f"{text} in {component}" if text else component


def term_names() -> list[str]:
    """The terms of the equations that may have a factor each, `Spelling.extra`."""
    return [name for terms in _TERMS.values() for name in terms]


def changed_term(name: str, set_name: str, factor: float) -> Alternative:
    """A plain factor on one term throughout; a tiny one stands for a term that is missing."""
    constant = 0.0 if abs(factor) < _CONSTANT else factor
    said, _ = factor_said(constant, (), named_values(set_name))
    return Alternative(f"{name}-factor", f"{_term_said(name)} {said}", replace(CORRECT, extra=((name, constant, ()),)))


def _coefficients(wrong: Sequence[Quantity], answers: Mapping[str, Decimal]) -> Iterator[Alternative]:
    """Several terms with a factor each, where a linear fit of the answers to M, h and gamma_y gives all of them."""
    import numpy

    values, none = named_values(wrong[0].set), Alternative("", "")
    extra: list[tuple[str, float, tuple[tuple[str, int], ...]]] = []
    said, unknown = [], False
    for component, names in _INDEPENDENT.items():
        here = [quantity for quantity in wrong if quantity.name == component]
        if len(here) < _LEAST_STATES:
            continue
        rows = []
        for quantity in here:
            model = Model(none, quantity.set, quantity.friction)
            given = model.inputs(quantity)
            parts = model.parts(math, given["Omega"], [given[name] for name in ("beta", "gamma", "v")])
            rows.append([*(parts[name] for name in names), float(answers[quantity.id])])
        table = numpy.array(rows)
        table /= abs(table).max(axis=1)[:, None]
        found = numpy.linalg.lstsq(table[:, :-1], table[:, -1], rcond=None)[0]
        if max(abs(table[:, :-1] @ found - table[:, -1])) > _LINEAR:
            return
        for name, factor in zip(names, found.tolist(), strict=True):
            if abs(factor - 1) > _CONSTANT:
                constant = 0.0 if abs(factor) < _CONSTANT else factor
                text, number = factor_said(constant, (), values)
                extra.append((name, constant, ()))
                said.append(f"{_TERMS[component][name]} in {component} {text}")
                unknown = unknown or number
    inertia = {name.split()[1]: factor for name, factor, _ in extra if name in ("M 1", "M 2")}
    if len(inertia) == len(_INERTIA):
        exact = {"A": values["A"] * inertia["1"], "Bbar": values["Bbar"] * inertia["2"]}
        cause = ", ".join(f"{name} = {value:.9g} instead of {values[name]:.9g}" for name, value in exact.items())
        yield Alternative("term-inertia", f"both moments of inertia: {cause}", parameters=lambda p: exact)
    if len(extra) > 1:
        cause = "; ".join(said)
        yield Alternative("number-several" if unknown else "several", cause, replace(CORRECT, extra=tuple(extra)))


def named_values(set_name: str) -> dict[str, float]:
    """The parameters that a term's factor may be made of."""
    p = parameters_of(set_name)
    values = {name: float(getattr(p, name)) for name in ("r", "e", "m", "g", "mu", "epsilon", "A", "B")}
    bbar = values["B"] - values["m"] * values["e"] ** 2
    return values | {"Bbar": bbar, "(r + e)": values["r"] + values["e"], "pi": math.pi}


def monomial(found: Sequence[tuple[float, list[float]]]) -> tuple[float, list[int]] | None:
    """c and whole powers with factor = c x^a y^b ... at all places, if there are such; 0 if the factor vanishes."""
    import numpy

    factors = numpy.array([factor for factor, _ in found])
    places = numpy.array([place for _, place in found])
    if max(abs(factors)) < _CONSTANT:
        return 0.0, [0] * places.shape[1]
    if not all(factors):
        return None
    table = numpy.column_stack([numpy.ones(len(found)), numpy.log(abs(places))])
    fitted = numpy.linalg.lstsq(table, numpy.log(abs(factors)), rcond=None)[0][1:]
    powers = numpy.round(fitted)
    if max(abs(fitted - powers)) > _WHOLE or max(abs(powers)) > 4:
        return None
    rest = factors / numpy.prod(places**powers, axis=1)
    constant = float(numpy.median(rest))
    if max(abs(rest - constant)) > _CONSTANT * abs(constant):
        return None
    return constant, [int(power) for power in powers]


def factor_said(
    constant: float, factors: tuple[tuple[str, int], ...], values: Mapping[str, float], what: str = "the extra factor"
) -> tuple[str, bool]:
    """The factor in words, and whether it has a number that nothing is known of."""
    if constant == 0:
        return "is missing", False
    if not factors and abs(constant + 1) < _CONSTANT and what == "the extra factor":
        return "has the wrong sign", False
    powers = [label if power == 1 else f"{label}^{power}" for label, power in factors]
    number = named_product(constant, values)
    said = " ".join((*([f"{constant:.8g}"] if number is None else number.split()), *powers))
    return f"has {what} {said}", number is None


def named_product(
    constant: float, values: Mapping[str, float], exponents: Sequence[float] = (1, -1, 2, -2)
) -> str | None:
    """A number as a small one, or a product of at most two powers of ``values``, if it is one: the simplest."""
    powers = [(name, power) for name in values for power in exponents]
    single: list[tuple[tuple[str, float], ...]] = [(one,) for one in powers]
    pairs = itertools.combinations(powers, 2)
    # Round decimals coincide: 0.01 is epsilon^2 rather than 4 e.
    choices = itertools.chain(
        ((small, ()) for small in (*_SMALL, *_PLAIN)),
        itertools.product(_SMALL[:1], single),
        itertools.product(_SMALL[1:], single),
        itertools.product(_SMALL[:1], pairs),
    )
    for (simple, text), product in choices:
        size = math.prod(values[name] ** power for name, power in product)
        if abs(constant / (size * simple) - 1) < _CONSTANT:
            names = [name if power == 1 else f"{name}^{power:g}" for name, power in product]
            return " ".join(part for part in (text, *names) if part)
    return None


@lru_cache
def model_values(set_name: str) -> SimpleNamespace:
    p = Parameters.named(set_name)
    names = ("r", "e", "m", "A", "B", "g", "mu", "epsilon", "Bbar")
    return SimpleNamespace(**{name: float(getattr(p, name)) for name in names})


def critical_speed(set_name: str) -> float:
    p = model_values(set_name)
    return math.sqrt((p.r + p.e) ** 2 * p.m * p.g / (p.r * p.Bbar))


def model_bases(p: SimpleNamespace) -> dict[str, float]:
    """What a factor of the closed forms may be made of."""
    return {
        "r": p.r, "e": p.e, "(r + e)": p.r + p.e, "(r - e)": p.r - p.e, "m": p.m, "g": p.g, "A": p.A, "Bbar": p.Bbar,
        "mu": p.mu, "epsilon": p.epsilon, "(B/Bbar)": p.B / p.Bbar, "pi": math.pi,
    }  # fmt: skip


def said_factor(factor: float, p: SimpleNamespace) -> tuple[float, str]:
    """A rank and words for a term's extra factor."""
    if abs(factor) < 1e-7:
        return 0.0, "is missing"
    if abs(factor + 1) < 1e-7:
        return 0.0, "has the wrong sign"
    found = named_product(factor, model_bases(p), _HALVES)
    if not found:  # a factor so near to 1 has no other name
        return LONG, f"has the extra factor {factor:.8g}"
    text = f"has the extra factor {found}" + (", B in place of Bbar" if "B/Bbar" in found else "")
    if "epsilon" in found and abs(float(f"{factor:.1g}") / factor - 1) < _CONSTANT:  # perhaps the number is meant
        text += f" or {float(f'{factor:.1g}'):g}"
    return 1.0 + len(found.split()), text


def free_values(worst: Quantity, answers: Mapping[str, Decimal], store: Store) -> Iterator[Alternative]:
    """Alternatives with another value of one parameter or input, which all predict the answer to ``worst``."""
    exact = parameters_of(worst.set)
    known = {name: float(getattr(exact, name)) for name in SYMBOLS}
    known["Bbar"] = known["B"] - known["m"] * known["e"] ** 2
    makes: list[tuple[Callable[[float], Alternative], Sequence[float]]]
    makes = [(partial(parameter, name, x), [c * x for c in _GRID]) for name, x in known.items()]
    if worst.level in (2, 5):
        makes.append((partial(_fixed, "Omega"), [30 * c for c in _GRID if c > 0]))
    if worst.level == 1:
        turns = [k * math.pi / 12 + 0.01 for k in range(-13, 13)]  # one turn, its end within
        makes += [(partial(scaled, name), _GRID) for name in ("Omega", "v")]
        makes += [(partial(moved, name, sign), turns) for name in ("beta", "gamma") for sign in (1, -1)]
        makes.append((_eccentric, _GRID))
        makes.append((partial(_fixed, "Omega"), [30 * c for c in _GRID]))
    for make, grid in makes:
        for value in solved(make, worst, answers, store, grid):
            found = make(value)
            same = [
                name for name, x in known.items() if f"{name}-value" != found.name and x and abs(value / x - 1) < _SAME
            ]
            yield replace(found, cause=f"{found.cause}{OF_ANOTHER}{same[0]}") if same else found


def solved(
    make: Callable[[float], Alternative],
    worst: Quantity,
    answers: Mapping[str, Decimal],
    store: Store,
    grid: Sequence[float],
) -> Iterator[float]:
    """The numbers within ``grid`` with which an alternative gives the answer to ``worst``."""
    return _roots(partial(_error, make, worst, float(answers[worst.id]), store), grid)


def _error(make: Callable[[float], Alternative], quantity: Quantity, answer: float, store: Store, c: float) -> float:
    return predicted(make(c), [quantity], store, {}).get(quantity.id, math.nan) - answer


def _roots(error: Callable[[float], float], grid: Sequence[float]) -> Iterator[float]:
    from scipy.optimize import brentq

    errors = [error(c) for c in grid]
    scale = max((abs(e) for e in errors if math.isfinite(e)), default=0.0)
    for n, (c, e) in enumerate(zip(grid, errors, strict=True)):
        if abs(e) <= _ROOT * scale:
            yield c
        elif n and errors[n - 1] * e < 0:
            with suppress(ValueError, RuntimeError):  # the mistaken model says nothing, or jumps through zero
                yield float(brentq(error, grid[n - 1], c, xtol=1e-300, rtol=1e-15))


def parameter(name: str, right: float, value: float) -> Alternative:
    return Alternative(
        f"{name}-value", f"{name} = {value:.9g} instead of {right:.9g}", parameters=lambda p: {name: value}
    )


def _eccentric(factor: float) -> Alternative:
    return Alternative("rho-factor", f"rho = r + {factor:.9g} e sin gamma", replace(CORRECT, eccentricity=factor))


def _changed(name: str, cause: str, label: str, change: Callable[[float], float]) -> Alternative:
    return Alternative(label, cause, inputs=lambda inputs: {
        key: change(value) if key == name else value for key, value in inputs.items()})  # fmt: skip


def scaled(name: str, factor: float) -> Alternative:
    cause = f"the sign of {name}" if abs(factor + 1) < 1e-9 else f"{name} taken {factor:.9g} times as large"
    return _changed(name, cause, f"{name}-factor", lambda value: factor * value)


def moved(name: str, sign: int, by: float) -> Alternative:
    turns = round(math.remainder(by, 2 * math.pi) / math.pi * 2, 8)
    amounts = {0.0: "", 1.0: "pi/2", -1.0: "-pi/2", 2.0: "pi", -2.0: "pi"}
    amount = amounts.get(turns, f"{turns * math.pi / 2:.9g}")
    cause = f"{amount} {'-' if sign < 0 else '+'} {name} taken for {name}".strip()
    return _changed(name, cause, f"{name}-offset", lambda value: by + sign * value)


def _fixed(name: str, value: float) -> Alternative:
    return _changed(name, f"{name} = {value:.9g} throughout", f"{name}-fixed", lambda _: value)
