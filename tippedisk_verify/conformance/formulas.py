"""Levels 3, 4, 5 and 8 with one thing changed in their formulas: conventions, factors, parts of the recursion.

A candidate is a rank, a sentence and a function from the questions of one entry to its answers. Lower ranks say less
and are named first. Factors are solved for: what a formula gives is affine in the factor of one of its terms, so that
two evaluations tell the factor that the worst wrong answer wants.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from types import SimpleNamespace
from typing import Any

from tippedisk_verify.conformance.alternatives import Alternative
from tippedisk_verify.conformance.factors import monomial, named_product
from tippedisk_verify.conformance.matrices import matrices
from tippedisk_verify.conformance.predictions import Model, eigenvalues
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.reference_values.store import Quantity
from tippedisk_verify.theory import harmonic_balance
from tippedisk_verify.theory.expansion import cubic_acceleration, derived
from tippedisk_verify.theory.hopf import trilinear
from tippedisk_verify.theory.jets import coordinate_sine

__all__ = ["LONG", "Candidate", "candidates", "conventions"]

Entries = Sequence[Sequence[Quantity]]
Answers = Mapping[str, float]
Numbers = dict[str, float]
Candidate = tuple[float, str, Callable[[Sequence[Quantity]], Numbers]]
LONG = 9.0  # the rank of a factor that is nothing but a number
_CLOSE = 0.01  # relative: how far off a search may end
_HALVES = (1, -1, 2, -2, 0.5, -0.5)
_BY_C_1 = ("first_lyapunov_coefficient", "amplitude_squared_slope", "period_slope")
_PLACES = 8  # for the constant and six powers
_EXACT = 1e-9  # relative
_HIGHEST = 5  # order of the slow manifold
_SIMPLE = {"": 1.0, "2": 2.0, "1/2": 0.5, "4": 4.0, "1/4": 0.25, "8": 8.0, "1/8": 0.125, "16": 16.0, "1/16": 0.0625}


def candidates(entries: Entries, answers: Answers, wrong: set[str]) -> Iterator[Candidate]:
    """What one change makes of the level's answers; ``entries`` are its questions."""
    by_kind = {
        "hopf": _other_speeds, "equilibrium": matrices, "harmonic-balance": _balances, "slow-manifold": _series_changes,
        "heteroclinic": _spectra,
    }  # fmt: skip
    if (make := by_kind.get(entries[0][0].kind)) is not None:
        yield from make(entries, answers, wrong)


@lru_cache
def _values(set_name: str) -> SimpleNamespace:
    p = Parameters.named(set_name)
    names = ("r", "e", "m", "A", "B", "g", "mu", "epsilon", "Bbar")
    return SimpleNamespace(**{name: float(getattr(p, name)) for name in names})


def _bases(p: SimpleNamespace) -> dict[str, float]:
    """What a factor of the closed forms may be made of."""
    return {
        "r": p.r, "e": p.e, "(r + e)": p.r + p.e, "(r - e)": p.r - p.e, "m": p.m, "g": p.g, "A": p.A, "Bbar": p.Bbar,
        "mu": p.mu, "epsilon": p.epsilon, "(B/Bbar)": p.B / p.Bbar, "pi": math.pi,
    }  # fmt: skip


def _said(factor: float, p: SimpleNamespace) -> tuple[float, str]:
    """A rank and words for a term's extra factor."""
    if abs(factor) < 1e-7:
        return 0.0, "is missing"
    if abs(factor + 1) < 1e-7:
        return 0.0, "has the wrong sign"
    found = named_product(factor, _bases(p), _HALVES)
    if found is None:
        return LONG, f"has the extra factor {factor:.8g}"
    text = f"has the extra factor {found}" + (", B in place of Bbar" if "B/Bbar" in found else "")
    return 1.0 + len(found.split()), text


# ------------------------------------------------------------------------------------------ level 3
@lru_cache
def _normal_form(set_name: str, speed: float) -> dict[str, Any]:
    """The normal form of the field's expansion about inverted spinning, in double, as if this were the Hopf point."""
    import numpy
    from mpmath import fp

    p = _values(set_name)
    parts = derived(p, speed)
    rest = parts.mass[0, 0, 0]
    last = [sum(part.get(one, 0.0) for part in parts[1:]) / rest for one in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    matrix = numpy.array([[0, 0, 1], [speed, 0, 0], last])
    values, vectors = numpy.linalg.eig(matrix)
    place = int(numpy.argmax(values.imag))
    left = numpy.linalg.inv(vectors)[place]
    q = [complex(part) for part in vectors[:, place]]
    size = math.sqrt(sum(abs(part) ** 2 for part in q))
    q, left = [part / size for part in q], left * size
    cubic = left[2] * sum(value * trilinear(powers, q, fp) for powers, value in cubic_acceleration(parts).items())
    c_1 = complex(cubic + left[1] * trilinear((3, 0, 0), q, fp) * -speed / 6) / 2
    drift = complex(left[1] * q[0] + left[2] * (-2 * speed * q[0] + last[1] / speed * q[1]))
    omega = float(values[place].imag)
    rest = {"omega": omega, "q": q, "turn": -2 * math.pi / omega**2, "omega_crit": speed, "period": 2 * math.pi / omega}
    return rest | _following(rest, c_1, drift)


def _following(n: Mapping[str, Any], c_1: complex, drift: complex) -> dict[str, Any]:
    """What follows from z' = (i omega + drift (Omega - Omega_crit)) z + c_1 |z|^2 z."""
    growth = drift.real / c_1.real
    return {
        "first_lyapunov_coefficient": c_1.real / n["omega"], "transversality": drift.real,
        "amplitude_squared_slope": 4 * abs(n["q"][0]) ** 2 * growth,
        "period_slope": n["turn"] * (c_1.imag * growth - drift.imag), "c_1": c_1, "drift": drift, "growth": growth,
    }  # fmt: skip


def conventions(quantity: Quantity) -> Iterator[tuple[str, float]]:
    """What other conventions and half-done formulas make of one number of the Hopf point."""
    right, name = quantity.for_doubles, quantity.name
    p, n = _values(quantity.set), _normal_form(quantity.set, _omega_crit(quantity.set))
    sizes = [abs(part) ** 2 for part in n["q"]]
    times = "times the right value"
    norms = {"": 1.0} | {
        f"those of an eigenvector q whose component {part} is 1": 1 / size
        for part, size in zip(("beta", "gamma", "v"), sizes, strict=True)
    }
    if name == "first_lyapunov_coefficient":
        yield "the imaginary part of c_1 divided by omega", n["c_1"].imag / n["omega"]
        yield "the modulus of c_1 divided by omega", abs(n["c_1"]) / n["omega"]
        frequencies = {"": 1.0, "omega, the critical frequency,": n["omega"], "1/omega": 1 / n["omega"]}
        products = itertools.product(frequencies.items(), norms.items(), _SIMPLE.items())
        for (one, power), (norm, size), (text, number) in products:
            factor = f"{text} {one}".strip()
            said = ", ".join(part for part in (factor and f"{factor} {times}", norm) if part)
            yield said, right * power * size * number
    if name == "transversality":
        yield "the derivative of the imaginary part", n["drift"].imag
        yield "the modulus of the eigenvalue's derivative", abs(n["drift"])
    if name == "amplitude_squared_slope":
        for part, size in zip(("gamma", "v"), sizes[1:], strict=True):
            yield f"those for {part} instead of beta", right * size / sizes[0]
        yield "the slope of |z|^2, without the eigenvector", n["growth"]
    if name == "period_slope":
        yield "those without the cubic terms, of the linear part alone", n["turn"] * -n["drift"].imag
        yield "those of the cubic terms alone, at a fixed speed", n["turn"] * n["c_1"].imag * n["growth"]
        yield "those of the angular frequency instead of the period", right / n["turn"]
    if name in ("transversality", "amplitude_squared_slope", "period_slope"):
        yield "those per Omega^2 instead of per Omega", right / (2 * n["omega_crit"])
    if name in ("omega_crit", "period"):
        for text, base in _bases(p).items():
            for power in (0.5, -0.5, 1, -1):
                yield f"{text}^{power:g} {times}", right * base**power


def _omega_crit(set_name: str) -> float:
    p = _values(set_name)
    return math.sqrt((p.r + p.e) ** 2 * p.m * p.g / (p.r * p.Bbar))


def _other_speeds(entries: Entries, answers: Answers, wrong: set[str]) -> Iterator[Candidate]:
    """Everything as it would be at the wrong Omega_crit that is answered."""
    for quantity in entries[0]:
        if quantity.name == "omega_crit" and quantity.id in wrong and answers[quantity.id] > 0:
            speed = answers[quantity.id]
            rank, text = _said(speed / quantity.for_doubles, _values(quantity.set))
            if rank < LONG:
                said = f"omega_crit {text}, and all else is taken there"
                yield rank, said, lambda here, speed=speed: _normal_form(here[0].set, speed)  # type: ignore[misc]
    yield from _other_coefficients(entries[0], answers, wrong)


def _other_coefficients(here: Sequence[Quantity], answers: Answers, wrong: set[str]) -> Iterator[Candidate]:
    """All that follows from another c_1, another slope of the eigenvalue, or another product with the adjoint.

    Two of the answers tell such a complex number; the others have to bear it out.
    """
    given = {quantity.name: answers[quantity.id] for quantity in here}
    bad = {quantity.name for quantity in here if quantity.id in wrong}
    n = _normal_form(here[0].set, _omega_crit(here[0].set))
    if not {*_BY_C_1, "transversality"} <= given.keys() or not given["first_lyapunov_coefficient"]:
        return
    c_1, drift, coefficients = n["c_1"], n["drift"], []
    real, speed = given["first_lyapunov_coefficient"] * n["omega"], given["transversality"]
    if bad == set(_BY_C_1):
        imaginary = (given["period_slope"] / n["turn"] + drift.imag) / (drift.real / real)
        coefficients.append(("c_1, the coefficient of |z|^2 z,", c_1, complex(real, imaginary), drift))
    elif bad == {"transversality", *_BY_C_1[1:]}:
        imaginary = c_1.imag * speed / c_1.real - given["period_slope"] / n["turn"]
        coefficients.append(("d lambda/d Omega", drift, c_1, complex(speed, imaginary)))
    elif bad >= {"transversality", *_BY_C_1[:1]} and "omega_crit" not in bad:
        share = (real * drift.imag - speed * c_1.imag) / (c_1.real * drift.imag - c_1.imag * drift.real)
        factor = complex(share, (c_1.real * share - real) / c_1.imag)
        text = "the factor of all products with the adjoint eigenvector"
        coefficients.append((text, complex(1), factor * c_1, factor * drift))
    for text, right, other, moved in coefficients:
        value = other if right is c_1 else moved if right is drift else factor
        said = f"{text} is {value.real:.9g} {value.imag:+.9g} i instead of {right.real:.9g} {right.imag:+.9g} i: "
        numbers = n | _following(n, other, moved)
        yield LONG - 1, said + "a mistake in it or rounding, and all else follows from it", lambda _, x=numbers: x  # type: ignore[misc]


# ------------------------------------------------------------------------------------------ level 8
def _spectra(entries: Entries, answers: Answers, wrong: set[str]) -> Iterator[Candidate]:
    """The eigenvalues at the connection, taken at another speed or at the other equilibrium."""
    from scipy.optimize import brentq

    here = {quantity.name: quantity for quantity in entries[0]}
    if not {"omega_h", "lambda_u", "lambda_s", "lambda_ss"} <= here.keys():
        return
    first = entries[0][0]
    model = Model(Alternative("", ""), first.set, first.friction)
    given, right = answers[here["omega_h"].id], float(here["omega_h"])

    def parts(omega: float, side: int) -> list[float]:
        return [value.real for value in eigenvalues(model, omega, side)]

    def spectrum(omega: float, side: int) -> Callable[[Sequence[Quantity]], Numbers]:
        found = dict(zip(("lambda_u", "lambda_s", "lambda_ss"), parts(omega, side), strict=True))
        return lambda _: {"omega_h": given if here["omega_h"].id in wrong else right, **found}

    if here["omega_h"].id in wrong:
        if abs(given / right - 1) < _CLOSE and wrong != {here["omega_h"].id}:
            text = f"the search for Omega_h alone is off, by {given - right:.2g} rad/s: the eigenvalues are right there"
            yield 1.0, text, spectrum(given, -1)
        return
    for side, name in ((-1, "noninverted"), (1, "inverted")):
        for omega, text in ((_omega_crit(first.set), "Omega_crit"), (right, "Omega_h")):
            yield 1.0, f"the eigenvalues of the {name} state at {text}", spectrum(omega, side)
    wanted = answers[here["lambda_u"].id]
    if (parts(1.0, -1)[0] - wanted) * (parts(1000.0, -1)[0] - wanted) < 0:
        omega = float(brentq(lambda omega: parts(omega, -1)[0] - wanted, 1.0, 1000.0, xtol=1e-12))
        yield 2.0, f"the eigenvalues at another speed than Omega_h, {omega:.9g} rad/s", spectrum(omega, -1)


# ------------------------------------------------------------------------------------------ level 4
_BALANCE = (
    "C^2", "chi", "the printed chi", "A (r - 2 e) in chi", "2 e of A (r - 2 e) in chi",
    "Bbar (2 r^2 + e (r + e)) / (2 (r + e)) in chi", "2 r^2 in chi", "e (r + e) in chi",
    "Bbar e^2 / (2 (r + e)) in chi", "Bbar r Omega^2 in C^2", "m g (r + e)^2 in C^2", "m g e (r + e) in C^2",
    "e Omega^2 / (r + e) in omega^2", "delta", "e of r - e in delta",
)  # fmt: skip


def _law(p: SimpleNamespace, omega: float, form: str, changed: str, factor: float) -> tuple[float, float, float, float]:
    """(numerator and denominator of C^2, e Omega^2 / (r + e), delta) with one term times a factor."""

    def term(name: str, value: float) -> float:
        return value * factor if name == changed else value

    reach, consistent = p.r + p.e, form == "consistent"
    bracket = term("2 r^2 in chi", 2 * p.r**2) + term("e (r + e) in chi", p.e * reach)
    chi = term("A (r - 2 e) in chi", p.A * (p.r - term("2 e of A (r - 2 e) in chi", 2 * p.e)))
    chi -= term("Bbar (2 r^2 + e (r + e)) / (2 (r + e)) in chi", p.Bbar * bracket / (2 * reach))
    chi = term("the printed chi", chi)
    if consistent:
        chi += term("Bbar e^2 / (2 (r + e)) in chi", p.Bbar * p.e**2 / (2 * reach))
    excess = term("Bbar r Omega^2 in C^2", p.Bbar * p.r * omega**2) - term("m g (r + e)^2 in C^2", p.m * p.g * reach**2)
    below = term("chi", chi) * omega**2 + term("m g e (r + e) in C^2", p.m * p.g * p.e * reach)
    stiffness = p.r - (0.0 if consistent else term("e of r - e in delta", p.e))
    delta = term("delta", -stiffness * omega**2 / (8 * reach))
    linear = term("e Omega^2 / (r + e) in omega^2", p.e / reach * omega**2)
    return term("C^2", -4 * p.e / reach * excess), below, linear, delta


def _balanced(p: SimpleNamespace, changed: str, factor: float, forms: set[str], here: Sequence[Quantity]) -> Numbers:
    factor = factor if here[0].inputs["form"] in forms else 1.0
    above, below, linear, delta = _law(p, float(here[0].inputs["Omega"]), here[0].inputs["form"], changed, factor)
    square = above / below
    if not (square >= 0 and linear + delta * square > 0):
        return {}
    frequency = math.sqrt(linear + delta * square)
    return {"amplitude": math.sqrt(square), "frequency": frequency, "period": 2 * math.pi / frequency}


def _balances(entries: Entries, answers: Answers, wrong: set[str]) -> Iterator[Candidate]:
    """One factor on a term of the one-harmonic law, from the wrong cycle farthest from the Hopf point."""
    bad = [here for here in entries if any(quantity.id in wrong for quantity in here)]
    forms = {here[0].inputs["form"] for here in bad}
    here = max(bad, key=lambda here: -float(here[0].inputs["Omega"]))
    p, omega, form = _values(here[0].set), float(here[0].inputs["Omega"]), here[0].inputs["form"]
    given = {quantity.name: answers[quantity.id] for quantity in here}
    frequency = given.get("frequency") or (2 * math.pi / given["period"] if given.get("period") else None)
    amplitude = given.get("amplitude")
    for name in _BALANCE:
        laws = [_law(p, omega, form, name, factor) for factor in (0.0, 1.0)]
        above, below, linear, delta = laws[1]
        square = amplitude**2 if amplitude is not None else None
        if frequency is not None and square is None:
            square = (frequency**2 - linear) / delta
        if laws[0][:2] != laws[1][:2] and square is not None:
            sides = [above - square * below for above, below, _, _ in laws]
        elif laws[0][2:] != laws[1][2:] and frequency is not None:
            sides = [linear + delta * above / below - frequency**2 for _, _, linear, delta in laws]
        else:
            continue
        if sides[0] != sides[1]:
            factor = sides[0] / (sides[0] - sides[1])
            squared = name == "C^2" and factor > 0
            rank, text = _said(math.sqrt(factor) if squared else factor, p)
            if name == "the printed chi":
                if rank < LONG:
                    continue
                right = harmonic_balance.chi(p, "printed")
                text = f"is {factor * right:.6g} instead of {right:.6g}"
            elif rank == LONG and name.endswith(" in chi"):
                rank += 1.0  # any part of chi might have an unknown number: only the sum is known
            yield rank, f"{'C' if squared else name} {text}", partial(_balanced, p, name, factor, forms)


# ------------------------------------------------------------------------------------------ level 5
@dataclass(frozen=True)
class _Change:
    """One change of the slow manifold's recursion."""

    term: str = ""
    factor: float = 1.0
    powers: tuple[tuple[str, int], ...] = ()  #: of functions of the place, which the factor has beside
    order: int = -1  #: the order that is times the factor, and passed on so
    advected: str = "all"  #: which products h_i dh_j/dbeta are kept: a key of `_KEPT`
    squared: str = "all"  #: which products h_i h_j
    alike: bool = False  #: whether the residual is formed with the same wrong terms and h_0, or with right ones


_KEPT: dict[str, Callable[[int, int], bool]] = {
    "all": lambda i, j: True,
    "with i = 0": lambda i, j: i == 0, "with j = 0": lambda i, j: j == 0, "with i = j": lambda i, j: i == j,
    "with i or j = 0": lambda i, j: i * j == 0, "with i = j = 0": lambda i, j: i == j == 0,
    "with i > 0": lambda i, j: i > 0, "with j > 0": lambda i, j: j > 0,
    "with i not j": lambda i, j: i != j, "with i <= j": lambda i, j: i <= j, "with i >= j": lambda i, j: i >= j,
}  # fmt: skip
_TERMS = (
    "f_G", "(A cos^2 gamma + Bbar sin^2 gamma) Omega^2 sin beta cos beta in h",
    "2 (A - Bbar) Omega v cos beta sin gamma cos gamma in h", "m rho^2 v^2 sin beta cos beta in h",
    "m e rho Omega^2 sin beta cos^3 beta sin gamma in h",
    "m e rho (3 sin^2 beta - 2) Omega v cos beta cos gamma in h", "A cos^2 gamma in M", "Bbar sin^2 gamma in M",
    "m rho^2 cos^2 beta in M", "M", "h", "friction's mu m g rho^2 sin^2 beta",
    "the derivative by gamma, Omega cos beta dh/dgamma,",
    "the sum of h_i dh_j/dbeta",
)  # fmt: skip


def _field(p: SimpleNamespace, place: tuple[float, float, float], change: _Change) -> dict[str, Any]:
    """M v' = free + linear v + square v^2 - (drag / epsilon) (v - h_0) as jets, with one term times a factor."""
    omega, beta, gamma = place

    def term(name: str, value: Any) -> Any:
        return _times(value, change, bases) if name == change.term else value

    (sb, cb), (sg, cg) = coordinate_sine(math, beta, _HIGHEST + 1, 0), coordinate_sine(math, gamma, _HIGHEST + 1, 1)
    h_1, h_2, h_3, h_4, h_5 = _TERMS[1:6]
    m_1, m_2, m_3 = _TERMS[6:9]
    rho = sg * p.e + p.r
    bases = {"sin beta": sb, "cos beta": cb, "sin gamma": sg, "cos gamma": cg, "rho": rho}
    bases["M"] = cg * cg * p.A + sg * sg * p.Bbar + rho * rho * cb * cb * p.m
    turning = cg * cg * p.A + sg * sg * p.Bbar
    free = term(h_1, turning * sb * cb * omega**2) + term(h_4, rho * sb * cb * cb * cb * sg * (p.m * p.e * omega**2))
    linear = term(h_2, cb * sg * cg * (-2 * (p.A - p.Bbar) * omega))
    linear += term(h_5, rho * (sb * sb * 3 + -2.0) * cb * cg * (-p.m * p.e * omega))
    mass = term(m_1, cg * cg * p.A) + term(m_2, sg * sg * p.Bbar) + term(m_3, rho * rho * cb * cb * p.m)
    return {
        "free": term("h", free) + term("f_G", rho * cb * (-p.m * p.g)),
        "linear": term("h", linear), "square": term("h", term(h_3, rho * rho * sb * cb * p.m)),
        "mass": term("M", mass), "drag": term(_TERMS[11], rho * rho * sb * sb * (p.mu * p.m * p.g)),
        "rolling": sb * cg * (p.e * omega) / rho, "drift": cb * omega, "bases": bases,
    }  # fmt: skip


@lru_cache(maxsize=64)
def _right_field(set_name: str, place: tuple[float, float, float]) -> dict[str, Any]:
    return _field(_values(set_name), place, _Change())


def _times(value: Any, change: _Change, bases: Mapping[str, Any]) -> Any:
    value = value * change.factor
    for name, power in change.powers:
        for _ in range(abs(power)):
            value = value * bases[name] if power > 0 else value / bases[name]
    return value


def _manifold(change: _Change, here: Sequence[Quantity]) -> Numbers:
    """The orders and residuals at one place."""
    inputs = here[0].inputs
    place = (float(inputs["Omega"]), float(inputs["beta"]), float(inputs["gamma"]))
    p, right = _values(here[0].set), _right_field(here[0].set, place)
    highest = max((int(q.name[-1]) for q in here), default=0)
    field = _field(p, place, change) if change.term in _TERMS[:12] else right
    turning = change.factor if change.term == _TERMS[12] else 1.0
    advecting = change.factor if change.term == _TERMS[13] else 1.0
    orders: list[Any] = []
    for n in range(highest + 1):
        if n == 0:
            new = right["rolling"]
        else:
            pairs = [(i, n - 1 - i) for i in range(n)]
            new = field["linear"] * orders[-1] + field["mass"] * field["drift"] * orders[-1].by_gamma() * turning
            new = new + field["free"] if n == 1 else new
            for i, j in pairs:
                if _KEPT[change.advected](i, j):
                    new = new - field["mass"] * orders[i] * orders[j].by_beta() * advecting
                if _KEPT[change.squared](i, j):
                    new = new + field["square"] * orders[i] * orders[j]
            new = new / field["drag"]
        orders.append(_times(new, change, right["bases"]) if n == change.order else new)
    numbers = {f"h_{n}": float(order.value) for n, order in enumerate(orders)}
    at = {name: jet.value for name, jet in (field if change.alike else right).items() if name != "bases"}
    rest = orders[0].value if change.alike else at["rolling"]
    total = by_beta = by_gamma = 0.0
    for n, order in enumerate(orders):
        total += p.epsilon**n * order.value
        by_beta += p.epsilon**n * order.by_beta().value
        by_gamma += p.epsilon**n * order.by_gamma().value
        force = p.epsilon * (at["free"] + at["linear"] * total + at["square"] * total**2) - at["drag"] * (total - rest)
        numbers[f"residual_{n}"] = p.epsilon * (by_beta * total - by_gamma * at["drift"]) - force / at["mass"]
    return numbers


def _series_changes(entries: Entries, answers: Answers, wrong: set[str]) -> Iterator[Candidate]:
    """Products left out, one order changed and passed on, one factor on a term of the recursion."""
    for kept in tuple(_KEPT)[1:]:
        text = f"{{}} only those {kept} are there"
        yield 1.0, text.format("of the products h_i dh_j/dbeta"), partial(_manifold, _Change(advected=kept))
        yield 1.0, text.format("of the products h_i h_j with v^2"), partial(_manifold, _Change(squared=kept))
    bad = [quantity for here in entries for quantity in here if quantity.id in wrong and quantity.name[0] == "h"]
    if not bad:
        return
    first = min(bad, key=lambda quantity: quantity.name)
    order, p = int(first.name[-1]), _values(first.set)
    like = [quantity for quantity in bad if quantity.name == first.name]
    for name in (f"h_{order}", *(_TERMS if order else ())):
        wanted = [_wanted(name, quantity, answers) for quantity in like]
        blank = _Change(order=order) if name == f"h_{order}" else _Change(name)
        changes = [(replace(blank, factor=wanted[0]), _said(wanted[0], p))] if math.isfinite(wanted[0]) else []
        found = [(factor, _bases_at(quantity)) for factor, quantity in zip(wanted, like, strict=True)]
        fit = None
        if name not in _TERMS[12:] and len(found) >= _PLACES and all(map(math.isfinite, wanted)):
            fit = monomial([(factor, list(bases.values())) for factor, bases in found])
        if fit is not None and any(fit[1]):
            powers = tuple((base, power) for base, power in zip(found[0][1], fit[1], strict=True) if power)
            rank, text = _said(fit[0], p) if abs(fit[0] - 1) > _EXACT else (1.0, "has the extra factor")
            if fit[0] < 0 and "sign" in text:
                text = "has the extra factor -1"
            text += "".join(f" {base}^{power}" if power != 1 else f" {base}" for base, power in powers)
            changes.append((replace(blank, factor=fit[0], powers=powers), (rank + len(powers), text)))
        for change, (rank, text) in changes:
            for alike in (False, True):
                yield rank, f"{name} {text}", partial(_manifold, replace(change, alike=alike))


def _wanted(name: str, quantity: Quantity, answers: Answers) -> float:
    """The factor of a term, or of an order, that the answer to this order wants; it is not finite if there is none."""
    given, order = answers[quantity.id], int(quantity.name[-1])
    if name not in _TERMS:
        return given / float(quantity) if float(quantity) else math.nan
    sides = [_manifold(_Change(name, factor), [quantity])[quantity.name] for factor in (0.5, 1.0)]
    if not order or abs(sides[0] - sides[1]) <= _EXACT * abs(sides[1]):
        return math.nan
    share = (given - sides[1]) / (sides[0] - sides[1])
    if name == _TERMS[11]:  # what is divided by
        return 1 / (1 + share) if share != -1 else math.nan
    return 1 - share / 2


def _bases_at(quantity: Quantity) -> dict[str, float]:
    place = tuple(float(quantity.inputs[name]) for name in ("Omega", "beta", "gamma"))
    return {name: float(jet.value) for name, jet in _right_field(quantity.set, place)["bases"].items()}
