"""The paper's expansion, derived from the full equations in symbols."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import pytest
import sympy as sp

from tippedisk_verify.audit.local_expansion import derived_expansion, printed_expansion
from tippedisk_verify.model.equations import equation_terms
from tippedisk_verify.model.friction import LAWS

x, y, v, order = sp.symbols("x y v order")
r, e, m, g, A, Bbar, mu, epsilon, Omega = sp.symbols(
    "r e m g A Bbar mu epsilon Omega", positive=True
)
SYMBOLS = SimpleNamespace(r=r, e=e, m=m, g=g, A=A, Bbar=Bbar, mu=mu, epsilon=epsilon, b=Bbar / m)
PARTS = ("mass", "gyroscopic", "gravity", "friction")


@cache
def series() -> dict[str, sp.Poly]:
    """Return each part of the full equations to third order in (x, y, v).

    It comes from the Taylor expansion along a ray.
    """
    # sin(pi/2 + x) = cos(x) and cos(pi/2 + x) = -sin(x), as the ray's own series: exact to third
    # order.
    cut = {"sin": lambda z: z - z**3 / 6, "cos": lambda z: 1 - z**2 / 2}
    angles = {"beta": x, "gamma": y}
    ops = SimpleNamespace(
        sin=lambda name: cut["cos"](angles[name]), cos=lambda name: -cut["sin"](angles[name])
    )
    full = equation_terms(ops, SYMBOLS, Omega, "beta", "gamma", v)
    force = full.force_direction * LAWS["linear"](sp, full.sliding_velocity, SYMBOLS)
    exact = {
        "mass": full.mass,
        "gyroscopic": full.gyroscopic,
        "gravity": full.gravity,
        "friction": force,
    }
    found = {}
    for name, expression in exact.items():
        ray = sp.expand(
            expression.subs({x: order * x, y: order * y, v: order * v}, simultaneous=True)
        )
        found[name] = sp.Poly(sum(ray.coeff(order, n) for n in range(4)), x, y, v)
    return found


@pytest.mark.parametrize("part", PARTS)
def test_derived_expansion_term_by_term(part: str) -> None:
    stated = getattr(derived_expansion(SYMBOLS, Omega), part)
    found = {key: value for key, value in series()[part].terms() if value != 0}
    assert set(found) == set(stated)
    for key, value in found.items():
        assert sp.expand(value - stated[key]) == 0, key


def test_where_the_printed_expansion_is_wrong() -> None:
    claimed, follows = printed_expansion(SYMBOLS, Omega), derived_expansion(SYMBOLS, Omega)
    wrong = {
        (part, key): sp.expand(
            getattr(claimed, part).get(key, 0) - getattr(follows, part).get(key, 0)
        )
        for part in PARTS
        for key in {*getattr(claimed, part), *getattr(follows, part)}
    }
    wrong = {key: value for key, value in wrong.items() if value != 0}
    assert set(wrong) == {("gyroscopic", (1, 1, 1)), ("gravity", (1, 2, 0)), ("gravity", (1, 3, 0))}
    assert sp.expand(wrong["gyroscopic", (1, 1, 1)] + m * e * (r + e) * Omega) == 0
