"""The paper's expansion and one-harmonic constants, derived here from the full equations in symbols."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import pytest
import sympy as sp

from tippedisk_verify.model.equations import friction_force, terms
from tippedisk_verify.theory import harmonic_balance
from tippedisk_verify.theory.expansion import derived, printed

x, y, v, order = sp.symbols("x y v order")
r, e, m, g, A, Bbar, mu, epsilon, Omega, w, C, theta = sp.symbols(
    "r e m g A Bbar mu epsilon Omega omega C theta", positive=True
)
SYMBOLS = SimpleNamespace(r=r, e=e, m=m, g=g, A=A, Bbar=Bbar, mu=mu, epsilon=epsilon, b=Bbar / m)
PARTS = ("mass", "gyroscopic", "gravity", "friction")


@cache
def series() -> dict[str, sp.Poly]:
    """Each part of the full equations to third order in (x, y, v), by Taylor expansion along a ray."""
    # sin(pi/2 + x) = cos(x) and cos(pi/2 + x) = -sin(x), as the ray's own series: exact to third order.
    cut = {"sin": lambda z: z - z**3 / 6, "cos": lambda z: 1 - z**2 / 2}
    angles = {"beta": x, "gamma": y}
    ops = SimpleNamespace(sin=lambda name: cut["cos"](angles[name]), cos=lambda name: -cut["sin"](angles[name]))
    full = terms(ops, SYMBOLS, Omega, "beta", "gamma", v)
    force = full.direction * friction_force(SYMBOLS, full.sliding_velocity, "linear")
    exact = {"mass": full.mass, "gyroscopic": full.gyroscopic, "gravity": full.gravity, "friction": force}
    found = {}
    for name, expression in exact.items():
        ray = sp.expand(expression.subs({x: order * x, y: order * y, v: order * v}, simultaneous=True))
        found[name] = sp.Poly(sum(ray.coeff(order, n) for n in range(4)), x, y, v)
    return found


@pytest.mark.parametrize("part", PARTS)
def test_derived_expansion_term_by_term(part: str) -> None:
    stated = getattr(derived(SYMBOLS, Omega), part)
    found = {key: value for key, value in series()[part].terms() if value != 0}
    assert set(found) == set(stated)
    for key, value in found.items():
        assert sp.expand(value - stated[key]) == 0, key


def test_where_the_printed_expansion_is_wrong() -> None:
    claimed, follows = printed(SYMBOLS, Omega), derived(SYMBOLS, Omega)
    wrong = {
        (part, key): sp.expand(getattr(claimed, part).get(key, 0) - getattr(follows, part).get(key, 0))
        for part in PARTS
        for key in {*getattr(claimed, part), *getattr(follows, part)}
    }
    wrong = {key: value for key, value in wrong.items() if value != 0}
    assert set(wrong) == {("gyroscopic", (1, 1, 1)), ("gravity", (1, 2, 0)), ("gravity", (1, 3, 0))}
    assert sp.expand(wrong["gyroscopic", (1, 1, 1)] + m * e * (r + e) * Omega) == 0


def projected(with_cubic_kinematics: bool) -> tuple[sp.Expr, sp.Expr]:
    """The sine and cosine balances per amplitude: left side minus right side, to C^2, as the paper arranges them."""
    beta = C * sp.sin(theta)
    amplitude = 1 - C**2 / 8 if with_cubic_kinematics else 1
    gamma = -C * Omega / w * amplitude * sp.cos(theta)
    rate, change = C * w * sp.cos(theta), -C * w**2 * sp.sin(theta)
    parts = {name: poly.as_expr().subs({x: beta, y: gamma, v: rate}) for name, poly in series().items()}
    balance = sp.expand(parts["mass"] * change - parts["gyroscopic"] - parts["gravity"] - parts["friction"])
    found = []
    for wave in (sp.sin(theta), sp.cos(theta)):
        projection = sp.integrate(sp.expand(balance * wave), (theta, 0, 2 * sp.pi)) / sp.pi
        projection = sp.expand(projection / C)
        found.append(sum(projection.coeff(C, n) * C**n for n in (0, 2)))
    return found[0], found[1]


def test_projection_gives_the_balances() -> None:
    """The printed kappa_2 belongs to the printed kinematics; the printed kappa_1 to nothing."""
    for cubic, form in ((False, "printed"), (True, "consistent")):
        sine, cosine = projected(cubic)
        kappa = harmonic_balance.kappa_1(SYMBOLS, Omega, w**2, "consistent")
        stated = C**2 * kappa + Bbar * (Omega**2 - w**2) - m * g * (r + e)
        assert sp.simplify(sine - stated) == 0
        kappa = harmonic_balance.kappa_2(SYMBOLS, Omega, w**2, form)
        stated = C**2 * kappa / w / 4 + (r + e) * (e * Omega**2 / w - (r + e) * w)
        # The friction's own factor and sign stand before the paper's cosine balance.
        assert sp.simplify(cosine * epsilon / (mu * m * g) + stated) == 0
    wrong = harmonic_balance.kappa_1(SYMBOLS, Omega, w**2, "printed")
    right = harmonic_balance.kappa_1(SYMBOLS, Omega, w**2, "consistent")
    assert sp.simplify(right - wrong - m * e * (r + e) * Omega**2) == 0


@pytest.mark.parametrize("form", ["printed", "consistent"])
def test_delta_and_chi_follow_from_the_kappas(form) -> None:
    """chi follows from the derived kappa_1 in both forms: the printed chi does not come from the printed kappa_1."""
    square = e * Omega**2 / (r + e)
    delta = harmonic_balance.delta(SYMBOLS, Omega, form)
    kappa = harmonic_balance.kappa_2(SYMBOLS, Omega, square, form)
    assert sp.simplify(kappa / 4 / (r + e) ** 2 - delta) == 0
    first = harmonic_balance.kappa_1(SYMBOLS, Omega, square, "consistent")
    denominator = 4 * e / (r + e) * (first * (r + e) - Bbar * (r + e) * delta)
    stated = harmonic_balance.chi(SYMBOLS, form) * Omega**2 + m * g * e * (r + e)
    assert sp.simplify(denominator - stated) == 0
    # The law solves both balances, the kappas taken at the frequency of its birth.
    amplitude_squared, frequency_squared = harmonic_balance.squares(SYMBOLS, Omega, form)
    sine = amplitude_squared * first + Bbar * (Omega**2 - frequency_squared) - m * g * (r + e)
    cosine = amplitude_squared * kappa / 4 + (r + e) * (e * Omega**2 - (r + e) * frequency_squared)
    assert sp.simplify(sine) == sp.simplify(cosine) == 0
