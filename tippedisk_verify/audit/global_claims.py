"""Claims about trajectories: limit cycles, the six scenes, and the comparison of the engines."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from functools import partial
from itertools import pairwise

from tippedisk_verify.audit.claims import Answer, Audit, Claim, ProofOffer, measuring_engine
from tippedisk_verify.audit.connection_claims import FAMILY
from tippedisk_verify.cycles.cycle_at_speed import librating_cycle_at
from tippedisk_verify.cycles.shooting.shoot import shoot_limit_cycle
from tippedisk_verify.errors import NoSuchCycleError
from tippedisk_verify.flow.contract import Request
from tippedisk_verify.model import equations
from tippedisk_verify.motion.scenes import INITIAL_STATES, OrbitOutcome
from tippedisk_verify.numbers.precision import DOUBLE
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["GLOBAL_CLAIMS"]


def _scene_outcomes(scene: str, audit: Audit, set_name: str, printed: str) -> Answer:
    """Check that all orbits of a panel end as printed.

    Return their outcomes, and None if one is undecided. Orbits that are repelled from one well may
    also end on a rotating cycle.
    """
    outcomes = [orbit.outcome for orbit in audit.computed_scene(scene, set_name).orbits]
    expected = ("flat", "rotating limit cycle") if printed == "repelled" else (printed,)
    undecided = any(outcome.kind == "undecided" for outcome in outcomes)
    holds = None if undecided else all(outcome.kind in expected for outcome in outcomes)
    return "; ".join(_outcome_text(outcome) for outcome in outcomes), holds


def _outcome_text(outcome: OrbitOutcome) -> str:
    if outcome.time is not None:
        return f"flat at {float(outcome.time):.3f} s past {outcome.wells_passed} noninverted states"
    if outcome.amplitude is not None:
        return f"{outcome.kind}, {float(outcome.amplitude):.4f} rad"
    return outcome.kind


def _stable_and_monotone(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    """Check that all cycles on the branch are stable, and that amplitude and period fall as Omega
    rises.

    Return a summary and True if the check passes.
    """
    cycles = sorted(audit.family(set_name), key=lambda cycle: cycle.omega.value)
    steps = list(pairwise(cycles))
    falling = all(
        a.period.value > b.period.value and a.beta_max.value > b.beta_max.value for a, b in steps
    )
    largest = max(float(cycle.multiplier_slow) for cycle in cycles)
    stable = all(cycle.stable for cycle in cycles)
    return (
        f"largest multiplier {largest:.4f}, {'' if falling else 'not '}monotone",
        stable and falling,
    )


def _guess_converges(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    """Check that shooting from the printed guess (gamma_bar, v) ends on the family's cycle.

    The printed T_0 is not used: the period is not an unknown of this shooting.
    """
    speed = omega_crit(audit.sets[set_name], 40).value - Fraction(1, 2)
    truth = librating_cycle_at(audit.sets[set_name], speed, audit.engine)
    gamma_bar, v, _ = map(float, printed.removeprefix("guess ").split(", "))
    try:
        cycle = shoot_limit_cycle(audit.sets[set_name], speed, audit.engine, guess=(gamma_bar, v))
    except NoSuchCycleError as reason:
        return f"does not converge: {reason}", False
    pairs = (
        (cycle.gamma_bar_0, truth.gamma_bar_0),
        (cycle.v_0, truth.v_0),
        (cycle.period, truth.period),
    )
    same = all((found - true).holds(0) for found, true in pairs)
    return "converges to " + ", ".join(f"{float(found):.4f}" for found, _ in pairs), same


def _least_contact_force(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    """Check that lambda_N / (m g) is positive on the sampled orbits: below 0 the contact is lost.

    Return the smallest value as text, and the outcome.
    """
    import numpy

    constants, smallest = audit.sets[set_name].constants_in(DOUBLE), math.inf
    for panel in (audit.computed_scene(scene, set_name) for scene in "abcdef"):
        omega = float(panel.omega)
        for orbit in panel.orbits:
            beta, gamma, v = state = orbit.states.T
            rate = equations.vector_field(numpy, constants, omega, audit.parameters.friction)(
                beta, gamma, v
            )[2]
            forces = equations.normal_force_over_weight(numpy, constants, omega, state, rate)
            smallest = min(smallest, float(forces.min()))
    return f"at least {smallest:.3g} of the weight", smallest > 0


def _engines_agree(audit: Audit, set_name: str, printed: str) -> Answer:
    """Compare the Taylor engine in double with itself in extended precision and with SciPy."""
    from tippedisk_verify.flow.scipy_engine import ScipyEngine

    taylor = measuring_engine(audit)
    scipy = ScipyEngine("DOP853")
    # both engines have their full order under the linear law only
    parameters = audit.under_linear_law(set_name)
    crit = omega_crit(parameters, 20).value
    worst = claimed = Fraction(0)
    for share in ("0.98", "0.997", "1.016"):
        for start in INITIAL_STATES:
            request = Request(parameters, crit * Fraction(share), start, 10)
            by_taylor, by_scipy = taylor(replace(request, error_estimate=True)), scipy(request)
            if by_taylor.status is not by_scipy.status or by_taylor.error is None:
                note = f"at {share} Omega_crit: {by_taylor.status.value} against {by_scipy.status.value}"
                return "the engines end differently", False, note
            worst = max(
                worst,
                *(
                    Fraction(abs(a - b))
                    for a, b in zip(by_taylor.state, by_scipy.state, strict=True)
                ),
            )
            claimed = max(claimed, Fraction(by_taylor.error.largest))
    # The passages near the saddles within 10 s turn SciPy's local 1e-13 into up to 1e-10.
    agreed = worst <= Fraction(1, 10**10) and claimed <= Fraction(1, 10**11)
    note = (
        f"six orbits of 10 s: SciPy's DOP853 differs by at most {float(worst):.1e}; the Taylor "
        f"engine's own estimate of"
        f" its error, from a run in extended precision, is at most {float(claimed):.1e}"
    )
    return f"within {float(worst):.1e} rad, rad/s", agreed, note


_ON_THE_CYCLE = "the periodic solution attracts both orbits", "limit cycle"
_INVERTED = (
    "above Omega_crit inverted spinning attracts both orbits",
    "inverted spinning",
    "inversion",
)

GLOBAL_CLAIMS: tuple[Claim, ...] = (
    Claim(
        "stable_branch",
        "sec:shooting",
        "between Omega_h and Omega_crit the periodic solution is stable; amplitude and period fall "
        "with Omega",
        "stable, monotone",
        _stable_and_monotone,
        note="at 41 speeds each multiplier lies below 1 by more than its half-width",
        methods=("shooting",),
        formula=r"|\mu_\text{slow}| < 1,\quad \frac{d\bar{\beta}_\text{max}}{d\Omega} < 0,\quad "
        r"\frac{dT}{d\Omega} < 0",
        figures=("branch", "scenario"),
        proof=ProofOffer(
            FAMILY,
            "that the cycles of all speeds between Omega_h and Omega_crit are one curve, each "
            "asymptotically stable, "
            "along which the amplitudes gamma_bar_0 and beta_max and the period fall strictly as "
            "Omega grows",
        ),
    ),
    Claim(
        "table_2",
        "tab:initail",
        "the guess at Omega_crit - 0.5 converges",
        "guess 1.69, -1.72, 1.10",
        _guess_converges,
        note="the cycle found from the table's guess: gamma_bar_0, v_0 and T",
        methods=("shooting",),
        formula=r"(\bar{\beta}_0,\,\bar{\gamma}_0,\,\dot{\bar{\beta}}_0,\,T_0) = "
        r"(0,\;1.69,\;-1.72,\;1.10)",
    ),
    Claim(
        "scene_a",
        "fig:sub_hom",
        "below Omega_h solutions are repelled by inverted spinning",
        "repelled",
        partial(_scene_outcomes, "a"),
        note="orbits go on past noninverted states; the model ends where the disk lies flat",
        methods=("trajectories",),
        formula=r"\Omega = \Omega_\text{h} - 0.1",
        figures=("scenes_3d", "scenes_2d"),
    ),
    *(
        Claim(
            f"scene_{name}",
            f"fig:{label}",
            statement,
            outcome,
            partial(_scene_outcomes, name),
            note="where each orbit ends; for a cycle, gamma's amplitude at beta = pi/2",
            methods=("trajectories",),
            formula=formula,
            figures=(*figures, "scenes_3d", "scenes_2d"),
        )
        for name, label, (statement, outcome, *figures), formula in (
            ("b", "hom", _ON_THE_CYCLE, r"\Omega = \Omega_\text{h} + 0.01"),
            ("c", "sup_hom", _ON_THE_CYCLE, r"\Omega = \Omega_\text{h} + 0.1"),
            ("d", "sup_hom_sub_crit", _ON_THE_CYCLE, r"\Omega = \Omega_\text{crit} - 0.5"),
            ("e", "sub_crit", _ON_THE_CYCLE, r"\Omega = \Omega_\text{crit} - 0.2"),
            ("f", "sup_crit", _INVERTED, r"\Omega = \Omega_\text{crit} + 0.5"),
        )
    ),
    Claim(
        "permanent_contact",
        "sec:model",
        "the disk stays in contact with the support",
        "permanent contact",
        _least_contact_force,
        note="the smallest normal force along the six scenes' orbits",
        methods=("trajectories",),
        formula=r"\frac{\lambda_N}{m g} > 0",
    ),
    Claim(
        "engines_agree",
        "",
        "two integrators that share only the equations agree",
        "",
        _engines_agree,
        methods=("taylor", "scipy-DOP853"),
        own_check=True,
        figures=("race",),
    ),
)
