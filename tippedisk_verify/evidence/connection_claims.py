"""Claims about the heteroclinic connection: what happens to the limit cycles at Omega_h."""

from __future__ import annotations

from fractions import Fraction

from tippedisk_verify.errors import NoConnectionError
from tippedisk_verify.evidence.claims import Audit, Claim, Finding, number, per_set
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import Request
from tippedisk_verify.orbits.bisection import unstable_branch
from tippedisk_verify.orbits.heteroclinic import heteroclinic
from tippedisk_verify.orbits.limit_of_cycles import Descent

__all__ = ["CONNECTION_CLAIMS"]

_SHARE = Fraction(1, 1000)  # of the branch, how far from Omega_h both sides are looked at


def _infinite_period(audit: Audit, name: str) -> tuple[str, bool]:
    """The local slope of T against log(Omega - Omega_h) at the end of the family in double, against the law."""
    descent = Descent(audit.sets[name], audit.engine)
    above, here = float(descent.above), descent.here
    growth = float(audit.connection(name).saddle_eigenvalues[0])
    # dT / d(log D) = 2 D / (d(Omega) / d(T / 2)).
    ratio = 2 * above / float(here.slopes[2]) * growth / -2
    # The law's remainder falls like a power of D as small as 0.2, which leaves about a hundredth at D = 1e-8.
    return (
        f"T = {2 * float(here.half_period):.2f} s at Omega_h + {above:.1e} rad/s, slope {ratio:.4f} of the law's",
        abs(ratio - 1) < 0.05,
    )


def _both_sides(audit: Audit, name: str) -> tuple[str, bool]:
    omega_h = audit.omega_h(name).value
    ends = []
    for sign in (-1, 1):
        result = unstable_branch(audit.sets[name], omega_h * (1 + sign * _SHARE), audit.engine)
        ends.append(result.events[-1].name if result.events else result.status.name.lower())
    return f"{ends[0]} below, {ends[1]} above", ends[0] != "turns back" and ends[1] == "turns back"


def _attracting(audit: Audit, name: str) -> tuple[str, bool | None]:
    value = audit.connection(name).saddle_value
    return f"{float(value):.6f} 1/s", float(value) < 0 if abs(value.value) > value.uncertainty else None


def _both_connections(audit: Audit, name: str) -> tuple[str, bool]:
    """An orbit and its image under the point symmetry, half a second on: equal to rounding."""
    omega = audit.omega_h(name).value
    ends = []
    for sign in (1, -1):
        start = [sign * Fraction(part) for part in ("0.01", "-3.1", "0.05")]
        request = Request(audit.sets[name], omega, start, 0.5, shifted=True, domain="none")
        ends.append(audit.engine(request).state)
    apart = float(abs(ends[0] + ends[1]).max())
    return f"images stay {apart:.0e} apart", apart < 1e-9


def _identified(audit: Audit, name: str) -> tuple[str, bool]:
    """The field at a state and a full turn of gamma on, in exact turns."""
    from math import cos, sin

    from tippedisk_verify.model.equations import field
    from tippedisk_verify.model.precision import DOUBLE

    class Turned:
        sin = staticmethod(lambda angle: sin(angle - round(angle / 6.283185307179586) * 6.283185307179586))
        cos = staticmethod(lambda angle: cos(angle - round(angle / 6.283185307179586) * 6.283185307179586))

    rates = field(Turned, audit.sets[name].at(DOUBLE), float(audit.omega_h(name)), audit.parameters.friction)
    here, turned = (rates(1.7, gamma, 0.3) for gamma in (-1.5, -1.5 + 6.283185307179586))
    apart = max(abs(a - b) for a, b in zip(here, turned, strict=True))
    return f"the field differs by {apart:.0e}", apart < 1e-11


def _two_roads(audit: Audit) -> Finding:
    """Omega_h as the zero of the splitting, and as the limit of the limit cycles."""
    name, parameters = audit.parameters.name, audit.parameters
    taylor = audit.engine if audit.engine.measures_error else default_engine()
    try:
        one, two = (
            heteroclinic(parameters, taylor, digits=digits, method=method).omega_h
            for digits, method in ((12, "manifolds"), (14, "limit-cycles"))
        )
    except NoConnectionError as reason:
        return Finding({name: "no connection"}, {name: True}, str(reason))
    apart = abs(one.value - two.value)
    agreed = apart <= one.uncertainty + two.uncertainty
    widths = f"{float(one.uncertainty):.1e} and {float(two.uncertainty):.1e}"
    note = (
        f"the manifolds' splitting and the limit of the limit cycles lie {float(apart):.1e} rad/s apart, with"
        f" half-widths of {widths}"
    )
    return Finding({name: one}, {name: agreed}, note, ("manifolds", "limit-cycles"))


#: In the order of the paper.
CONNECTION_CLAIMS: tuple[Claim, ...] = (
    Claim(
        "omega_h",
        "text below Figure Shooting",
        "the periodic solution vanishes at Omega_h = 30.07 rad/s",
        "30.07",
        number(
            "30.07",
            lambda audit, name: audit.omega_h(name),
            "where the saddles' unstable and stable manifolds meet",
            ("manifolds",),
        ),
        unit="rad/s",
    ),
    Claim(
        "infinite_period",
        "Section sec:discussion",
        "the period tends to infinity as Omega falls to Omega_h",
        "T_h = infinity",
        per_set(
            _infinite_period, "T ~ -(2 / lambda_u) log(Omega - Omega_h), its slope at the end of double", ("shooting",)
        ),
    ),
    Claim(
        "only_above_omega_h",
        "Section sec:discussion",
        "the periodic solution exists above Omega_h only: below, the saddle's unstable branch leaves the well",
        "existence above",
        per_set(_both_sides, "what the unstable branch does a thousandth off Omega_h", ("trajectories",)),
    ),
    Claim(
        "both_connections",
        "Section sec:discussion",
        "at Omega_h two heteroclinic connections form a cycle",
        "two connections",
        per_set(_both_connections, "the point symmetry maps one to the other", ("symmetry", "trajectories")),
    ),
    Claim(
        "homoclinic_identified",
        "Section sec:discussion",
        "with the noninverted equilibria identified the connections are homoclinic",
        "homoclinic",
        per_set(_identified, "the field has period 2 pi in gamma, and the two states are 2 pi apart", ("symmetry",)),
    ),
    Claim(
        "attracting_cycle",
        "Section sec:discussion",
        "the periodic orbit that arises at Omega_h is stable",
        "stable",
        per_set(_attracting, "saddle value lambda_u + lambda_s, negative: attracting", ("eigenvalues",)),
    ),
    Claim(
        "omega_h_two_roads",
        "own cross-check",
        "two roads to Omega_h agree",
        "",
        _two_roads,
        own_check=True,
        unit="rad/s",
    ),
)
