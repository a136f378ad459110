"""Claims about the heteroclinic connection, where the limit cycles end at Omega_h."""

from __future__ import annotations

from fractions import Fraction

from tippedisk_verify.audit.claims import (
    Answer,
    Audit,
    Claim,
    ProofOffer,
    Theorem,
    measuring_engine,
    printed_number,
)
from tippedisk_verify.connection.bisection import follow_unstable_manifold
from tippedisk_verify.errors import NoConnectionError, NoSuchCycleError
from tippedisk_verify.flow.contract import Request
from tippedisk_verify.model.equations import vector_field
from tippedisk_verify.numbers.exact import Exact
from tippedisk_verify.numbers.precision import precision_of_bits
from tippedisk_verify.omega_h.methods import heteroclinic
from tippedisk_verify.theory.equilibria import linearization, right_eigenvector

__all__ = ["CONNECTION_CLAIMS", "FAMILY"]

FAMILY = Theorem("Theorem 5b", ("certify branch",), "linear")
_FAMILY_TO_ITS_END = Theorem(
    "Theorems 5b and 6", ("certify heteroclinic", "certify branch"), "linear"
)
_CONNECTION = Theorem("Theorem 6", ("certify heteroclinic",))
_STABILITY = Theorem("Theorem 7", ("certify heteroclinic",), "linear")

_RELATIVE_DISTANCE = Fraction(
    1, 1000
)  # relative distance from Omega_h of the speeds tried on both sides
# Distance of a start from the saddle [rad]. The field has no quadratic terms there, so the start
# misses the unstable manifold by the cube of this.
_START_DISTANCE = Fraction(1, 10**6)


def _period_slope(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    """Compare the slope of T against log(Omega - Omega_h) at the end of the family with the law."""
    above, period, ratio = audit.period_continuation(set_name).law_rows(
        float(audit.connection(set_name).saddle_eigenvalues[0])
    )[-1]
    # The law's remainder may fall as slowly as D^0.2, which is about a hundredth at D = 1e-8.
    return (
        f"T = {period:.2f} s at Omega_h + {above:.1e} rad/s, slope {ratio:.4f} of the law's",
        abs(ratio - 1) < 0.05,
    )


def _manifold_on_both_sides(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    omega_h = audit.omega_h(set_name).value
    ends = []
    for sign in (-1, 1):
        result = follow_unstable_manifold(
            audit.sets[set_name], omega_h * (1 + sign * _RELATIVE_DISTANCE), audit.engine
        )
        ends.append(result.events[-1].name if result.events else result.status.name.lower())
    holds = ends[0] in ("passes", "flat") and ends[1] == "turns back"
    return f"{ends[0]} below, {ends[1]} above", holds


def _sign_of_saddle_value(audit: Audit, set_name: str, printed: str) -> tuple[str, bool | None]:
    value = audit.connection(set_name).saddle_value
    return f"{float(value):.6f} 1/s", float(value) < 0 if abs(
        value.value
    ) > value.uncertainty else None


def _both_connections(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    """Check that each noninverted state's unstable manifold comes close to the other state at
    Omega_h.
    """
    import numpy

    parameters, omega = audit.sets[set_name], audit.omega_h(set_name).value
    growth = audit.connection(set_name).saddle_eigenvalues[0].value
    # Shifted angles: the states are (0, -pi, 0) and (0, pi, 0), and the symmetry is a change of
    # sign.
    direction = right_eigenvector(linearization(parameters, omega, "noninverted"), growth)
    times = numpy.arange(0, 12, 0.002)
    closest = []
    for sign in (1, -1):
        beta, gamma, v = (sign * part * _START_DISTANCE / omega for part in direction)
        start = (beta, Exact(gamma, Fraction(-sign)), v)
        request = Request(parameters, omega, start, 12, shifted=True, times=times, domain="none")
        distances = numpy.abs(
            audit.engine(request).samples - numpy.array([0, sign * numpy.pi, 0])
        ).max(axis=1)
        closest.append(float(distances.min()))
    # The distance is about 1e-8 rad at Omega_h, and 0.004 at a speed 1e-5 rad/s away.
    return f"branches within {closest[0]:.0e} and {closest[1]:.0e} of the other state", max(
        closest
    ) < 0.003


def _field_has_period_of_gamma(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    """Check that the field is the same at states a full turn of gamma apart, in 400 bits.

    Two of these are the noninverted states.
    """
    ctx = precision_of_bits(400).context
    rates = vector_field(
        ctx,
        audit.sets[set_name].constants_in_context(ctx),
        ctx.mpf("30.4"),
        audit.parameters.friction,
    )
    difference = ctx.mpf(0)
    for beta, gamma, v in (
        (ctx.pi / 2, -ctx.pi / 2, ctx.mpf(0)),
        (ctx.mpf("1.7"), ctx.mpf("-1.5"), ctx.mpf("0.3")),
    ):
        pairs = zip(rates(beta, gamma, v), rates(beta, gamma + 2 * ctx.pi, v), strict=True)
        difference = max(difference, *(abs(a - b) for a, b in pairs))
    # The bound leaves a factor 2^100 for the derivatives, which multiply the angles' rounding.
    return f"the field differs by {float(difference):.0e}", difference < 2.0**-300


def _omega_h_by_two_methods(audit: Audit, set_name: str, printed: str) -> Answer:
    """Check that two methods agree: Omega_h as the zero of the splitting and as the limit of the
    cycles.
    """
    ends, without = [], []
    for digits, method in ((12, "manifolds"), (14, "limit-cycles")):
        try:
            ends.append(
                heteroclinic(
                    audit.parameters, measuring_engine(audit), digits=digits, method=method
                ).omega_h
            )
        except (NoConnectionError, NoSuchCycleError) as reason:
            without.append(str(reason))
    if without:
        outcome = "one method finds a connection, the other none" if ends else "no connection"
        return outcome, not ends, "; ".join(without)
    splitting, limit = ends
    difference = splitting - limit
    note = (
        f"the manifolds' splitting and the limit of the limit cycles lie {abs(float(difference)):.1e} rad/s "
        f"apart, with"
        f" half-widths of {float(splitting.uncertainty):.1e} and {float(limit.uncertainty):.1e}"
    )
    return splitting, difference.holds(0), note


CONNECTION_CLAIMS: tuple[Claim, ...] = (
    Claim(
        "omega_h",
        "below fig:Shooting",
        "the periodic solution vanishes at Omega_h = 30.07 rad/s",
        "30.07",
        printed_number(Audit.omega_h),
        note=(
            "where the saddles' unstable and stable manifolds meet: for gamma in R the periodic "
            "solution ends there; on"
            " the cylinder, gamma modulo 2 pi, others may take over (claim only_above_omega_h)"
        ),
        methods=("manifolds",),
        unit="rad/s",
        formula=r"\Omega_\text{h}:\quad W^u(\pi/2,\,-\pi/2,\,0) \cap W^s(\pi/2,\,3\pi/2,\,0) \neq "
        r"\emptyset",
        proof=ProofOffer(
            _FAMILY_TO_ITS_END,
            "that one speed of a short interval, and no other there, has a connection, in which "
            "the family of limit "
            "cycles from Omega_crit ends; and whether that speed rounds to 30.07",
        ),
    ),
    Claim(
        "infinite_period",
        "sec:discussion",
        "the period tends to infinity as Omega falls to Omega_h",
        "T_h = infinity",
        _period_slope,
        note="T ~ -(2 / lambda_u) log(Omega - Omega_h), its slope at the end of double",
        methods=("shooting",),
        formula=r"T \to \infty \quad\text{as}\quad \Omega \downarrow \Omega_\text{h}",
        proof=ProofOffer(
            FAMILY,
            "that the family from Omega_crit has one cycle for each speed down to Omega_h, where "
            "the period tends to "
            "infinity",
        ),
    ),
    Claim(
        "only_above_omega_h",
        "sec:discussion",
        "the periodic solution exists above Omega_h only: below, the saddle's unstable manifold "
        "leaves the well",
        "existence above",
        _manifold_on_both_sides,
        note=(
            "what the unstable manifold does a thousandth off Omega_h, for gamma in R, where the "
            "cycle about inverted"
            " spinning ends at Omega_h; rotating cycles are periodic on the cylinder, gamma modulo "
            "2 pi"
        ),
        methods=("trajectories", "shooting"),
        formula=r"\Omega_\text{h} < \Omega < \Omega_\text{crit}",
        figures=("scenario",),
        proof=ProofOffer(
            FAMILY,
            "that the family from Omega_crit has cycles at the speeds above Omega_h and at no "
            "others; and that from a "
            "thousandth of a rad/s below Omega_h up to it no cycle crosses beta = pi/2 next to the "
            "saddles as its do",
            "that there is no other cycle below Omega_h, and what the saddle's unstable manifold "
            "does there",
        ),
    ),
    Claim(
        "both_connections",
        "sec:discussion",
        "at Omega_h two heteroclinic connections form a cycle",
        "two connections",
        _both_connections,
        note="each noninverted state's unstable manifold reaches the other; the point symmetry maps "
        "one to the other",
        methods=("trajectories",),
        formula=r"(\pi/2,\,-\pi/2,\,0) \rightleftarrows (\pi/2,\,3\pi/2,\,0)",
        proof=ProofOffer(_CONNECTION, "that both connections exist at one and the same speed"),
    ),
    Claim(
        "homoclinic_identified",
        "sec:discussion",
        "with the noninverted equilibria identified the connections are homoclinic",
        "homoclinic",
        _field_has_period_of_gamma,
        note=(
            "the field has period 2 pi in gamma, and the two states are 2 pi apart: on the "
            "cylinder both connections"
            " lead back to one saddle, as a figure of eight"
        ),
        methods=("symmetry",),
        formula=r"F(\beta,\,\gamma+2\pi,\,v) = F(\beta,\,\gamma,\,v)",
    ),
    Claim(
        "attracting_cycle",
        "sec:discussion",
        "the periodic orbit that arises at Omega_h is stable",
        "stable",
        _sign_of_saddle_value,
        note="saddle value lambda_u + lambda_s, negative: cycles next to the connection attract, "
        "rotating ones too",
        methods=("eigenvalues",),
        formula=r"\lambda_u + \lambda_s < 0",
        proof=ProofOffer(
            _STABILITY, "that the limit cycle next to the connection is asymptotically stable"
        ),
    ),
    Claim(
        "omega_h_two_roads",
        "",
        "two methods for Omega_h agree",
        "",
        _omega_h_by_two_methods,
        methods=("manifolds", "limit-cycles"),
        own_check=True,
        unit="rad/s",
    ),
)
