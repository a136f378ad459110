"""Claims about the slow manifold and the flow on it."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import partial

from tippedisk_verify.audit.claims import Answer, Audit, Claim, Fault, printed_word
from tippedisk_verify.model.equations import jacobian, vector_field
from tippedisk_verify.numbers.exact import exact
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.numbers.precision import DOUBLE, precision_of_bits
from tippedisk_verify.theory.equilibria import (
    EquilibriumName,
    Linearization,
    equilibrium,
    is_stable,
)
from tippedisk_verify.theory.hopf import omega_crit
from tippedisk_verify.theory.slow_manifold import (
    RESIDUAL_POINTS,
    attraction_rate,
    first_correction,
    reduced_equilibrium,
    reduced_omega_crit,
    series_orders,
)

__all__ = ["MANIFOLD_CLAIMS"]


def _compare_first_correction(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    """Compare the paper's h_1 with the recursion's at the twenty fixed points."""
    constants, speed = audit.sets[set_name].constants_in(DOUBLE), 30.4
    worst = 0.0
    for beta, gamma in RESIDUAL_POINTS:
        formula = first_correction(math, constants, speed, float(beta), float(gamma))
        recursion = series_orders(math, constants, speed, float(beta), float(gamma), 1)[1]
        worst = max(worst, abs(formula - recursion) / (1 + abs(formula)))
    return f"within {worst:.0e}", worst < 1e-12  # round-off of terms up to 1e3 times the result


def _attraction_rates(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    constants = audit.sets[set_name].constants_in(DOUBLE)
    rates = [
        attraction_rate(math, constants, 0.01 * k, 0.1 * n)
        for k in range(1, 314)
        for n in range(63)
    ]
    return f"{min(rates):.4g} to {max(rates):.2g} 1/s", max(rates) < 0


def _kind_at_order_0(which: EquilibriumName, audit: Audit, set_name: str, printed: str) -> Answer:
    """Check that an equilibrium of the flow on the critical manifold is a centre.

    If it is a centre, the flow does not show that the equilibrium gains or loses stability.
    """
    reduced = reduced_equilibrium(audit.sets[set_name], Fraction("30.4"), which, 0)
    # A zero trace comes out as rounding of 120 bits; at order 1 it is a thirtieth of this size.
    centre = reduced.determinant > 0 and abs(reduced.trace) < 2.0**-80 * reduced.determinant**0.5
    return "a centre" if centre else "a saddle" if reduced.determinant < 0 else "a focus", centre


def _growth_of_series(audit: Audit, set_name: str, printed: str) -> tuple[str, bool | None]:
    """Check whether |h_n|^(1/n) grows at (1.2, 0.3). It is bounded if the series converges.

    Growth over twelve terms does not disprove convergence, so the claim is then undecided.
    """
    ctx = precision_of_bits(160).context
    terms = series_orders(
        ctx,
        audit.sets[set_name].constants_in_context(ctx),
        ctx.mpf("30.4"),
        ctx.mpf("1.2"),
        ctx.mpf("0.3"),
        12,
    )
    roots = [float(abs(term)) ** (1 / n) for n, term in enumerate(terms) if n]
    growing = roots[2] < roots[5] < roots[11]
    return (
        f"|h_n|^(1/n): {roots[2]:.3g} at 3, {roots[5]:.3g} at 6, {roots[11]:.3g} at 12",
        None if growing else True,
    )


def _hopf_speed_at_order_1(audit: Audit, set_name: str, printed: str) -> tuple[Measured, bool]:
    speed = reduced_omega_crit(audit.under_linear_law(set_name), 1, 15)
    return speed, speed.holds(omega_crit(audit.sets[set_name], 30).value)


def _slow_dimension(audit: Audit, set_name: str) -> str:
    """Return the number of slow variables in words, such as "two-dimensional".

    It is the number of eigenvalues that stay bounded as epsilon tends to 0. The others are fast.
    """
    large, small = (
        equilibrium(
            audit.sets[set_name].changed(epsilon=epsilon), "30.4", "inverted", 20
        ).eigenvalues
        for epsilon in ("1e-4", "1e-5")
    )
    sizes = [
        [math.hypot(float(value.re), float(value.im)) for value in values]
        for values in (large, small)
    ]
    slow = sum(after < 2 * before for before, after in zip(*sizes, strict=True))
    return f"{('zero', 'one', 'two', 'three')[slow]}-dimensional"


def _is_second_noninverted_state(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    """Check that the printed state is an equilibrium, in the model's domain, and noninverted."""
    constants = audit.sets[set_name].constants_in(DOUBLE)
    state = [DOUBLE.number(exact(part)) for part in printed.strip("()").split(", ")]
    sin_beta = math.sin(state[0])
    # Rounding of the angles, times the field's derivatives of up to 1e4.
    still = max(map(abs, vector_field(math, constants, 30.4, "linear")(*state))) < 1e-11
    attracts = is_stable(
        Linearization(30.4 * sin_beta, *jacobian(math, constants, 30.4, "linear")(*state)[2])
    )
    text = f"sin(beta) = {sin_beta:.0f}" + (", and it attracts" if attracts else "")
    return text if still else "no equilibrium", still and sin_beta > 0 and math.sin(state[1]) < 0


MANIFOLD_CLAIMS: tuple[Claim, ...] = (
    Claim(
        "convergent_series",
        "eq:slow_manifold+2",
        "the slow manifold's series in epsilon converges",
        "convergent series",
        _growth_of_series,
        note="the paper gives no proof; for a convergent series the values are bounded; h_n in its "
        "own unit, at"
        " (beta, gamma) = (1.2, 0.3)",
        methods=("jets",),
        formula=r"h(x;\varepsilon) = h_0(x) + \varepsilon\,h_1(x) + \varepsilon^2 h_2(x) + \dots",
    ),
    Claim(
        "slow_manifold_h1",
        "eq:slow_manifold_tippdisk+1",
        "h_1 is the first-order term of the slow manifold",
        "formula",
        _compare_first_correction,
        note="against the recursion at twenty points",
        methods=("jets", "closed form"),
        formula=(
            r"h_1 = \left(\frac{\partial g}{\partial y}\right)^{-1}\left[\frac{\partial "
            r"h_c}{\partial x}\,f(x,h_c)"
            r" - g_1(x,h_c)\right]"
        ),
    ),
    Claim(
        "attraction",
        "eq:slow_manifold_tippdisk+3",
        "the attraction rate is strictly negative for beta in (0, pi)",
        "negative",
        _attraction_rates,
        note="but it tends to 0 at both ends, so attraction is not uniform",
        methods=("closed form",),
        formula=(
            r"\frac{\partial g_0}{\partial y} = -\frac{\mu m g}{M}(r+e\,\sin\gamma)^2\,\sin^2\beta "
            r"< 0"
            r"\quad\text{for}\quad \beta\in(0,\pi)"
        ),
    ),
    Claim(
        "reduced_dimension",
        "eq:slow_manifold_tippdisk+4",
        "the asymptotic behaviour is governed by a reduced three-dimensional system",
        "three-dimensional",
        printed_word(_slow_dimension),
        methods=("eigenvalues at 20 digits",),
        fault=Fault(
            "slip",
            "'three' stands for 'two', as the discussion says",
            "the reduced system is two-dimensional: its variables are beta and gamma",
        ),
        formula=r"\dot{x} = f(x,h(x)),\quad x = (\beta,\gamma)",
    ),
    Claim(
        "second_noninverted_state",
        "sec:dynamics",
        "(3 pi/2, pi/2, 0) is the second noninverted state",
        "(3 pi/2, pi/2, 0)",
        _is_second_noninverted_state,
        methods=("closed form",),
        fault=Fault(
            "differs",
            "sin(beta) is negative there, where the contact model means nothing",
            "the heteroclinic cycle's other saddle is (pi/2, 3 pi/2, 0)",
        ),
        formula=r"x_\text{non} = (3\pi/2,\,\pi/2,\,0)",
    ),
    Claim(
        "order_0_noninverted",
        "sec:discussion",
        "on the critical manifold noninverted spinning's instability cannot be seen",
        "cannot be seen",
        partial(_kind_at_order_0, "noninverted"),
        methods=("jets",),
        fault=Fault(
            "differs",
            "the rolling flow conserves (r + e sin gamma) sin beta, which has a saddle there",
            "noninverted spinning is a saddle of the rolling flow, with eigenvalues +-Omega "
            "sqrt(e/(r - e))",
        ),
        formula=r"\dot{x} = f(x,h_c(x)) \quad\text{at}\quad (\pi/2,\,-\pi/2)",
    ),
    Claim(
        "order_0_hopf",
        "sec:discussion",
        "on the critical manifold the Hopf bifurcation cannot be seen",
        "cannot be seen",
        partial(_kind_at_order_0, "inverted"),
        note="the rolling flow conserves the height: a centre at every speed",
        methods=("jets",),
        formula=r"\dot{x} = f(x,h_c(x)) \quad\text{at}\quad (\pi/2,\,\pi/2)",
    ),
    Claim(
        "order_1_hopf",
        "sec:discussion",
        "the slow manifold up to O(epsilon) suffices to study the inversion",
        "up to O(epsilon)",
        _hopf_speed_at_order_1,
        note="the reduced flow's Hopf speed of order 1 is Omega_crit itself",
        methods=("jets", "closed form"),
        unit="rad/s",
        formula=r"\dot{x} = f(x,\,h_c(x) + \varepsilon h_1(x)) \;\Rightarrow\; \Omega_\text{crit}",
    ),
)
