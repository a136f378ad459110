"""Level 5 with one thing changed in the slow manifold's recursion: a term's factor, an order, parts of a sum."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from types import SimpleNamespace
from typing import Any

from tippedisk_verify.conformance.diagnosis.factors import model_values, monomial, said_factor
from tippedisk_verify.reference_values.store import Quantity
from tippedisk_verify.theory.jets import coordinate_sine

__all__ = ["series_changes"]

Entries = Sequence[Sequence[Quantity]]
Answers = Mapping[str, float]
Numbers = dict[str, float]
Candidate = tuple[float, str, Callable[[Sequence[Quantity]], Numbers]]
_PLACES = 8  # for the constant and six powers
_EXACT = 1e-9  # relative
_HIGHEST = 5  # order of the slow manifold


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
    "m rho^2 cos^2 beta in M", "M dh/dt", "h", "friction's mu m g rho^2 sin^2 beta",
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
        "mass": term("M dh/dt", mass), "drag": term(_TERMS[11], rho * rho * sb * sb * (p.mu * p.m * p.g)),
        "rolling": sb * cg * (p.e * omega) / rho, "drift": cb * omega, "bases": bases,
    }  # fmt: skip


@lru_cache(maxsize=64)
def _right_field(set_name: str, place: tuple[float, float, float]) -> dict[str, Any]:
    return _field(model_values(set_name), place, _Change())


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
    p, right = model_values(here[0].set), _right_field(here[0].set, place)
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


def series_changes(entries: Entries, answers: Answers, wrong: set[str]) -> Iterator[Candidate]:
    """Products left out, one order changed and passed on, one factor on a term of the recursion."""
    for kept in tuple(_KEPT)[1:]:
        text = f"{{}} only those {kept} are there"
        yield 1.0, text.format("of the products h_i dh_j/dbeta"), partial(_manifold, _Change(advected=kept))
        yield 1.0, text.format("of the products h_i h_j with v^2"), partial(_manifold, _Change(squared=kept))
    bad = [quantity for here in entries for quantity in here if quantity.id in wrong and quantity.name[0] == "h"]
    if not bad:
        return
    first = min(bad, key=lambda quantity: quantity.name)
    order, p = int(first.name[-1]), model_values(first.set)
    like = [quantity for quantity in bad if quantity.name == first.name]
    for name in (f"h_{order}", *(_TERMS if order else ())):
        wanted = [_wanted(name, quantity, answers) for quantity in like]
        blank = _Change(order=order) if name == f"h_{order}" else _Change(name)
        changes = [(replace(blank, factor=wanted[0]), said_factor(wanted[0], p))] if math.isfinite(wanted[0]) else []
        found = [(factor, _bases_at(quantity)) for factor, quantity in zip(wanted, like, strict=True)]
        fit = None
        if name not in _TERMS[12:] and len(found) >= _PLACES and all(map(math.isfinite, wanted)):
            fit = monomial([(factor, list(bases.values())) for factor, bases in found])
        if fit is not None and any(fit[1]):
            powers = tuple((base, power) for base, power in zip(found[0][1], fit[1], strict=True) if power)
            rank, text = said_factor(fit[0], p) if abs(fit[0] - 1) > _EXACT else (1.0, "has the extra factor")
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
