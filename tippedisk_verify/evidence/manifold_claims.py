"""Claims about the slow manifold and the flow on it."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction

from tippedisk_verify.evidence.claims import Audit, Claim, per_set, wording
from tippedisk_verify.model.equations import jacobian
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Constants
from tippedisk_verify.model.precision import DOUBLE, bits
from tippedisk_verify.theory.equilibria import EquilibriumName
from tippedisk_verify.theory.hopf import omega_crit
from tippedisk_verify.theory.slow_manifold import (
    POINTS,
    attraction_rate,
    first_correction,
    orders,
    reduced_equilibrium,
    reduced_omega_crit,
)

__all__ = ["MANIFOLD_CLAIMS"]

_CLOSED = ("closed form",)


def _rolling_correction(audit: Audit, name: str) -> tuple[str, bool]:
    """The paper's h_1 against the recursion's, at the twenty fixed points."""
    constants, speed = audit.sets[name].at(DOUBLE), 30.4
    worst = 0.0
    for beta, gamma in POINTS:
        formula = first_correction(math, constants, speed, float(beta), float(gamma))
        recursion = orders(math, constants, speed, float(beta), float(gamma), 1)[1]
        worst = max(worst, abs(formula - recursion) / (1 + abs(formula)))
    return f"within {worst:.0e}", worst < 1e-12  # round-off of terms up to 1e3 times the result


def _attraction(audit: Audit, name: str) -> tuple[str, bool]:
    constants = audit.sets[name].at(DOUBLE)
    rates = [attraction_rate(math, constants, 0.01 * k, 0.1 * n) for k in range(1, 314) for n in range(63)]
    return f"{min(rates):.4g} to {max(rates):.2g} 1/s", max(rates) < 0


def _order_0(which: EquilibriumName, wanted: bool) -> Callable[[Audit, str], tuple[str, bool]]:
    """Whether the flow on the critical manifold hides what the paper says it hides."""

    def one(audit: Audit, name: str) -> tuple[str, bool]:
        reduced = reduced_equilibrium(audit.sets[name], Fraction("30.4"), which, 0)
        saddle = reduced.determinant < 0
        return ("a saddle" if saddle else "a centre"), saddle != wanted

    return one


def _growing_series(audit: Audit, name: str) -> tuple[str, bool | None]:
    """|h_n|^(1/n) at (1.2, 0.3): bounded for a convergent series."""
    precision = bits(160)
    constants = Constants(*(precision.mpf(value) for value in audit.sets[name].at(precision)))
    ctx = precision.context
    terms = orders(ctx, constants, ctx.mpf("30.4"), ctx.mpf("1.2"), ctx.mpf("0.3"), 16)
    roots = [float(abs(term)) ** (1 / n) for n, term in enumerate(terms) if n]
    return f"|h_n|^(1/n): {roots[3]:.3g} at 4, {roots[7]:.3g} at 8, {roots[15]:.3g} at 16", None


def _order_1_hopf(audit: Audit, name: str) -> tuple[Measured, bool]:
    found = reduced_omega_crit(audit.sets[name], 1, 15)
    return found, found.holds(omega_crit(audit.sets[name], 30).value)


def _second_state(audit: Audit, name: str) -> tuple[str, bool]:
    """(3 pi/2, pi/2, 0): the equations vanish, but sin(beta) = -1."""
    row = jacobian(math, audit.sets[name].at(DOUBLE), 30.4, "linear")(1.5 * math.pi, math.pi / 2, 0.0)[2]
    growth = row[0] * 1.0  # a1 = -A31 there; it attracts where Routh-Hurwitz holds with Omega sin(beta) = -Omega
    a2, a1, a0 = -row[2], -growth, 30.4 * row[1]
    attracts = a2 > 0 and a0 > 0 and a2 * a1 > a0
    return "sin(beta) = -1" + (", and it attracts" if attracts else ""), False


#: In the order of the paper.
MANIFOLD_CLAIMS: tuple[Claim, ...] = (
    Claim(
        "convergent_series",
        "Section sec:basics_singularperturbation",
        "the slow manifold's series in epsilon converges",
        "convergent series",
        per_set(
            _growing_series,
            "no proof is given; bounded for a convergent series. Units of h_n as such, at (beta, gamma) = (1.2, 0.3)",
            ("jets",),
        ),
    ),
    Claim(
        "slow_manifold_h1",
        "below Eq. slow_manifold_tippdisk",
        "h_1 is the first-order term of the slow manifold",
        "formula",
        per_set(_rolling_correction, "against the recursion at twenty points", ("jets", "closed form")),
    ),
    Claim(
        "attraction",
        "below Eq. slow_manifold_tippdisk",
        "the attraction rate is strictly negative for beta in (0, pi)",
        "negative",
        per_set(_attraction, "but it tends to 0 at both ends, so attraction is not uniform", _CLOSED),
    ),
    Claim(
        "reduced_dimension",
        "end of Section sec:singular_tippedisk",
        "the asymptotic behaviour is governed by a reduced three-dimensional system",
        "three-dimensional",
        wording("two-dimensional", "the slow variables are beta and gamma: two"),
    ),
    Claim(
        "second_noninverted_state",
        "Section sec:dynamics",
        "(3 pi/2, pi/2, 0) is the second noninverted state",
        "(3 pi/2, pi/2, 0)",
        per_set(_second_state, "outside the model's domain; the cycle's other saddle is (pi/2, 3 pi/2, 0)", _CLOSED),
    ),
    Claim(
        "order_0_noninverted",
        "Section sec:discussion",
        "on the critical manifold noninverted spinning's instability cannot be seen",
        "cannot be seen",
        per_set(_order_0("noninverted", True), "the rolling flow already has it as a saddle", ("jets",)),
    ),
    Claim(
        "order_0_hopf",
        "Section sec:discussion",
        "on the critical manifold the Hopf bifurcation cannot be seen",
        "cannot be seen",
        per_set(
            _order_0("inverted", True), "the rolling flow conserves the height: a centre at every speed", ("jets",)
        ),
    ),
    Claim(
        "order_1_hopf",
        "Section sec:discussion",
        "the slow manifold up to O(epsilon) suffices to study the inversion",
        "up to O(epsilon)",
        per_set(
            _order_1_hopf, "the reduced flow's Hopf speed of order 1 is Omega_crit itself", ("jets", "closed form")
        ),
        unit="rad/s",
    ),
)
