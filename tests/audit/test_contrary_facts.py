"""Contrary facts: for each claim a fact that contradicts its verdict, and must change it.

The fact is another printed text, another disk, another formula, or another orbit than the true one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any, get_args

import pytest

from tippedisk_verify import PRINTED, Audit, Measured, Parameters, Taylor, Verdict, heteroclinic
from tippedisk_verify.audit import (
    balance_claims,
    claims,
    connection_claims,
    friction_claims,
    linear_claims,
    local_expansion,
    manifold_claims,
)
from tippedisk_verify.audit.claim_catalogue import CLAIMS
from tippedisk_verify.audit.claims import Claim, FaultKind, examine_claim
from tippedisk_verify.flow import scipy_engine
from tippedisk_verify.model import equations
from tippedisk_verify.motion.basins import OUTCOMES
from tippedisk_verify.theory import one_harmonic_law
from tippedisk_verify.theory.equilibria import linearization
from tippedisk_verify.theory.slow_manifold import (
    ReducedEquilibrium,
    reduced_equilibrium,
    reduced_omega_crit,
)

# Long computations that plants stand on, each done once.
true_connection = cache(heteroclinic)
true_descent = cache(claims.PeriodContinuation)
true_basins = cache(friction_claims.basins)
true_cycle = friction_claims._cycle_below_crit


class OneDisk(Audit):
    """An audit of its own disk only, which takes a third of the time."""

    @property
    def sets(self) -> dict[str, Parameters]:
        return {self.parameters.name: self.parameters}


#: Puts a contrary fact in place; what it returns is audited instead.
Plant = Callable[[pytest.MonkeyPatch, Audit, Claim], tuple[Audit, Claim]]


def prints(text: str) -> Plant:
    """Return a plant: another printed text."""
    return lambda patch, audit, claim: (audit, replace(claim, printed=text))


def follows(place: Any, name: str, function: Callable[..., Any]) -> Plant:
    """Return a plant: another formula, or another computation."""

    def plant(patch: pytest.MonkeyPatch, audit: Audit, claim: Claim) -> tuple[Audit, Claim]:
        patch.setattr(place, name, function)
        return audit, claim

    return plant


def linearizes(change: Callable[[Any, Parameters], Any]) -> Plant:
    """Return a plant: another linearisation."""
    return follows(
        linear_claims, "linearization", lambda p, *rest: change(linearization(p, *rest), p)
    )


def connects(change: Callable[[Any], dict[str, Any]]) -> Plant:
    """Return a plant: another heteroclinic connection."""

    def plant(patch: pytest.MonkeyPatch, audit: Audit, claim: Claim) -> tuple[Audit, Claim]:
        true = audit.connection("table1")
        patch.setitem(audit._results, ("connection", "table1"), replace(true, **change(true)))
        return audit, claim

    return plant


def ends(scene: str, kind: Any) -> Plant:
    """Return a plant: another end of the first of a scene's orbits."""

    def plant(patch: pytest.MonkeyPatch, audit: Audit, claim: Claim) -> tuple[Audit, Claim]:
        true = audit.computed_scene(scene, "table1")
        first, second = true.orbits
        contrary = replace(first, outcome=replace(first.outcome, kind=kind))
        patch.setitem(audit._results, (scene, "table1"), replace(true, orbits=(contrary, second)))
        return audit, claim

    return plant


def another_disk(**values: object) -> Plant:
    """Return a plant: another disk than the paper's."""
    return lambda patch, audit, claim: (OneDisk(PRINTED.changed(**values), audit.engine), claim)


def _a_longer_cycle(patch: pytest.MonkeyPatch, audit: Audit, claim: Claim) -> tuple[Audit, Claim]:
    first, *others = audit.family("table1")
    longer = replace(first, period=Measured(first.period.value * 10, first.period.uncertainty))
    patch.setitem(audit._results, ("family", "table1"), (longer, *others))
    return audit, claim


def _with(part: str, powers: tuple[int, int, int], factor: int) -> Callable[..., Any]:
    """Return the printed expansion with one coefficient multiplied."""

    def printed(constants: Any, omega: Any) -> Any:
        true = local_expansion.printed_expansion(constants, omega)
        entries = getattr(true, part)
        return true._replace(**{part: entries | {powers: factor * entries[powers]}})

    return printed


def _consistent(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function with the consistent form in place of the printed one."""
    return lambda *inputs: function(*inputs[:-1], "consistent")


def _turned_half(ops: Any, constants: Any, omega: Any, friction: Any) -> Callable[..., Any]:
    """Return a field that does not have the period 2 pi."""
    true = equations.vector_field(ops, constants, omega, friction)

    def rates(beta: Any, gamma: Any, v: Any) -> tuple[Any, Any, Any]:
        first, second, third = true(beta, gamma, v)
        return first, second, third + ops.cos(gamma / 2) / 10**9

    return rates


def _methods_apart(parameters: Parameters, engine: Any, *, digits: int, method: str) -> Any:
    """Compute Omega_h, with the second method off by a billionth of a rad/s."""
    found = true_connection(parameters, engine, digits=digits, method=method)
    moved = Measured(found.omega_h.value + Fraction(1, 10**9), found.omega_h.uncertainty)
    return replace(found, omega_h=moved) if method == "limit-cycles" else found


class _Drifting(scipy_engine.ScipyEngine):
    """An integrator with an error of a millionth."""

    def __call__(self, request: Any) -> Any:
        result = super().__call__(request)
        return result._replace(state=result.state + 1e-6)


def _all_inverted(*inputs: Any, **options: Any) -> Any:
    found = true_basins(*inputs, **options)
    return replace(found, outcome=0 * found.outcome + OUTCOMES.index("inverted spinning"))


PLANTS: dict[str, Plant] = {
    "table_1": prints("30.89, 0.887, -128.79, 1.18e-7"),
    "sliding_velocity": prints("(sin beta)^2"),
    "linearization": linearizes(
        lambda matrix, p: matrix._replace(A32=matrix.A32 * Fraction("1.000001"))
    ),
    "omega_crit": prints("30.89"),
    "omega_crit_friction": linearizes(lambda matrix, p: matrix._replace(A31=matrix.A31 + p.mu)),
    "lambda_3": prints("-128.79"),
    "lambda_3_order": linearizes(
        lambda matrix, p: matrix._replace(A33=matrix.A33 * Fraction("1.001"))
    ),
    "critical_pair": prints("complex conjugate"),
    "inverted_stable_above": linearizes(lambda matrix, p: matrix._replace(A33=-matrix.A33)),
    "inverted_unstable_below": linearizes(lambda matrix, p: matrix._replace(A31=-(10**6))),
    "noninverted_unstable": linearizes(
        lambda matrix, p: matrix._replace(A31=-(10**6), A32=-matrix.A32)
    ),
    "expansion_mass": follows(balance_claims, "printed_expansion", _with("mass", (2, 0, 0), 2)),
    "expansion_gyroscopic": follows(
        balance_claims, "printed_expansion", local_expansion.derived_expansion
    ),
    "expansion_gravity": follows(
        balance_claims, "printed_expansion", local_expansion.derived_expansion
    ),
    "expansion_friction": follows(
        balance_claims, "printed_expansion", _with("friction", (2, 0, 1), -1)
    ),
    "kappa_1": follows(one_harmonic_law, "kappa_1", _consistent(one_harmonic_law.kappa_1)),
    "kappa_2": follows(one_harmonic_law, "kappa_2", _consistent(one_harmonic_law.kappa_2)),
    "delta": follows(one_harmonic_law, "delta", _consistent(one_harmonic_law.delta)),
    "chi": prints("1.18e-7"),
    "amplitude_law": follows(
        one_harmonic_law, "hopf_slopes", _consistent(one_harmonic_law.hopf_slopes)
    ),
    "period_law": follows(
        one_harmonic_law, "hopf_slopes", _consistent(one_harmonic_law.hopf_slopes)
    ),
    "supercritical": another_disk(A=PRINTED.B),
    "period_crit": prints("0.887"),
    "convergent_series": follows(
        manifold_claims, "series_orders", lambda *inputs: [0.5**n for n in range(inputs[-1] + 1)]
    ),
    "slow_manifold_h1": follows(
        manifold_claims,
        "first_correction",
        lambda *inputs: 1.001 * manifold_claims.series_orders(*inputs, 1)[1],
    ),
    "attraction": follows(
        manifold_claims, "attraction_rate", lambda ops, constants, beta, gamma: math.sin(gamma)
    ),
    "reduced_dimension": prints("two-dimensional"),
    "second_noninverted_state": prints("(pi/2, 3 pi/2, 0)"),
    "order_0_noninverted": follows(
        manifold_claims, "reduced_equilibrium", lambda *inputs: ReducedEquilibrium(0, 1)
    ),
    "order_0_hopf": follows(
        manifold_claims,
        "reduced_equilibrium",
        lambda p, omega, which, order: reduced_equilibrium(p, omega, which, 1),
    ),
    "order_1_hopf": follows(
        manifold_claims,
        "reduced_omega_crit",
        lambda p, *rest: reduced_omega_crit(p.changed(g="9.82"), *rest),
    ),
    "omega_h": prints("30.05"),
    "infinite_period": connects(
        lambda true: {
            "saddle_eigenvalues": (Measured(2 * true.saddle_eigenvalues[0].value, Fraction(0)),) * 3
        }
    ),
    "only_above_omega_h": connects(
        lambda true: {"omega_h": Measured(true.omega_h.value + 1, Fraction(0))}
    ),
    "both_connections": connects(
        lambda true: {"omega_h": Measured(true.omega_h.value + Fraction(1, 1000), Fraction(0))}
    ),
    "homoclinic_identified": follows(connection_claims, "vector_field", _turned_half),
    "attracting_cycle": connects(lambda true: {"saddle_value": Measured(Fraction(1), Fraction(0))}),
    "omega_h_two_roads": follows(connection_claims, "heteroclinic", _methods_apart),
    "stable_branch": _a_longer_cycle,
    "table_2": prints("guess 0.1, -0.1, 1.10"),
    "scene_a": ends("a", "limit cycle"),
    "scene_b": ends("b", "flat"),
    "scene_c": ends("c", "inverted spinning"),
    "scene_d": ends("d", "flat"),
    "scene_e": ends("e", "inverted spinning"),
    "scene_f": ends("f", "limit cycle"),
    "permanent_contact": follows(
        equations,
        "normal_force_over_weight",
        lambda ops, constants, omega, state, rate: ops.cos(state[1]),
    ),
    "engines_agree": follows(scipy_engine, "ScipyEngine", _Drifting),
    "globally_attractive": follows(
        friction_claims,
        "jacobian",
        lambda *inputs: lambda beta, gamma, v: ((), (), (0, 0, -1 - beta)),
    ),
    "smooth_same_behaviour": follows(
        friction_claims, "criticality", lambda parameters: "subcritical"
    ),
    "smooth_same_asymptotics": follows(
        friction_claims,
        "_cycle_below_crit",
        lambda parameters, engine: true_cycle(parameters.with_friction("linear"), engine),
    ),
    "almost_all_trajectories": follows(friction_claims, "basins", _all_inverted),
}


@pytest.fixture(scope="module")
def audit(taylor: Taylor) -> Iterator[Audit]:
    """Make one audit for all tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(friction_claims, "heteroclinic", true_connection)
        patch.setattr(connection_claims, "heteroclinic", true_connection)
        patch.setattr(claims, "PeriodContinuation", true_descent)
        patch.setattr(friction_claims, "basins", true_basins)
        yield OneDisk(PRINTED, taylor)


@pytest.mark.parametrize(
    "claim",
    [
        pytest.param(claim, marks=pytest.mark.slow if claim.name == "engines_agree" else ())
        for claim in CLAIMS
    ],
    ids=lambda claim: claim.name,
)
def test_a_contrary_fact_changes_the_verdict(
    claim: Claim, audit: Audit, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert claim.name in PLANTS, "each claim has a fact that would change its verdict"
    before = examine_claim(audit, claim)
    after = examine_claim(*PLANTS[claim.name](monkeypatch, audit, claim))
    assert (
        claim.unit
        or claim.name in ("table_1", "convergent_series")
        or (before.verdict is Verdict.HOLDS) == (claim.fault is None)
    )
    assert after.verdict is not before.verdict
    assert after.verdict is not Verdict.UNDECIDED, after.note


def test_each_fault_has_its_class() -> None:
    """The paper shows what a slip means: chi follows from the right terms only (tests/theory)."""
    faults = {claim.name: claim.fault for claim in CLAIMS if claim.fault}
    kinds = {
        kind: {name for name, fault in faults.items() if fault.kind == kind}
        for kind in get_args(FaultKind)
    }
    assert kinds["slip"] == {
        "sliding_velocity",
        "critical_pair",
        "reduced_dimension",
        "expansion_gyroscopic",
        "expansion_gravity",
        "kappa_1",
    }
    assert kinds["follows-from"] == {"kappa_2", "delta", "amplitude_law", "period_law"}
    assert len({faults[name].cause for name in kinds["follows-from"]}) == 1
    assert all(fault.cause and fault.instead for fault in faults.values())
