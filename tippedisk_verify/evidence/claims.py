"""The paper's claims, one by one, and what becomes of each.

A claim examines itself on every audited parameter set and returns a `Finding`. A claim that does not follow is a
result; only the suite's own cross-checks (``own_check``) can fail.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from enum import Enum
from fractions import Fraction
from functools import cached_property
from typing import Any

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.flow.contract import Build, Engine, Request
from tippedisk_verify.model.equations import Friction
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import NAMED_SETS, Parameters
from tippedisk_verify.orbits.heteroclinic import Connection, bisect_omega_h
from tippedisk_verify.orbits.scenes import INITIAL_STATES, SCENES, Panel, compute, scene_named
from tippedisk_verify.theory.equilibria import EquilibriumName, is_stable, linearization, stiff_eigenvalue_estimate
from tippedisk_verify.theory.hopf import omega_crit, omega_crit_squared, period_crit

__all__ = ["CLAIMS", "Audit", "Claim", "Finding", "Verdict", "audited", "rounds_to", "selected"]


class Verdict(Enum):
    """What becomes of a claim."""

    HOLDS = "holds"
    HOLDS_FOR = "holds-for"
    DOES_NOT_FOLLOW = "does-not-follow"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Finding:
    """The outcome of one claim: what was computed for each set, and for which sets it holds (None: undecided)."""

    computed: dict[str, Measured | str]
    holds: dict[str, bool | None]
    note: str = ""
    methods: tuple[str, ...] = ()

    @property
    def verdict(self) -> Verdict:
        answers = list(self.holds.values())
        if all(answers):
            return Verdict.HOLDS
        if any(answers):
            return Verdict.HOLDS_FOR
        return Verdict.UNDECIDED if None in answers else Verdict.DOES_NOT_FOLLOW

    @property
    def sets(self) -> tuple[str, ...]:
        """The sets for which it holds."""
        return tuple(name for name, answer in self.holds.items() if answer)


@dataclass(frozen=True)
class Claim:
    """One sentence, formula or number of the paper (or one cross-check of our own)."""

    name: str
    source: str  #: section, equation label or figure of the paper
    statement: str
    printed: str  #: what the paper prints
    examine: Callable[[Audit], Finding]
    own_check: bool = False


@dataclass
class Audit:
    """What the claims are examined on: the parameter sets, and what several claims share, computed once."""

    parameters: Parameters
    engine: Engine
    friction: Friction = "linear"
    digits: int = 12
    omega_h_builds: dict[Build, None] = field(default_factory=dict)
    _connections: dict[str, Connection] = field(default_factory=dict)
    _panels: dict[tuple[str, str], Panel] = field(default_factory=dict)

    @cached_property
    def sets(self) -> dict[str, Parameters]:
        """The selected set first, then the named ones.

        With the smooth law only the selected one: its trajectories cost a thousand times more.
        """
        chosen = {self.parameters.name: self.parameters}
        return chosen if self.friction == "smooth" else chosen | NAMED_SETS | chosen

    def omega_h(self, name: str) -> Measured:
        """Omega_h [rad/s] of a set. Raises Shortfall if there is no connection."""
        if name not in self._connections:
            self._connections[name] = bisect_omega_h(self.sets[name], self.engine, friction=self.friction)
            self.omega_h_builds |= dict.fromkeys(getattr(self.engine, "builds", ()))
        return self._connections[name].omega_h

    def panel(self, scene: str, name: str) -> Panel:
        """One of the six scenes of a set."""
        key = (scene, name)
        if key not in self._panels:
            panel = scene_named(scene)
            omega_h = self.omega_h(name) if panel.base == "Omega_h" else None
            self._panels[key] = compute(panel, self.sets[name], self.engine, omega_h=omega_h, friction=self.friction)
        return self._panels[key]


def rounds_to(measured: Measured, printed: str) -> bool | None:
    """Whether the true value rounds to the printed decimal; None if the half-width leaves that open."""
    target = Fraction(printed)
    exponent = Decimal(printed).as_tuple().exponent
    half_unit = Fraction(10) ** int(exponent) / 2
    distance = abs(measured.value - target)
    if distance + measured.uncertainty <= half_unit:
        return True
    return False if distance - measured.uncertainty > half_unit else None


def selected(names: Sequence[str]) -> tuple[Claim, ...]:
    """The claims of those names, in the table's order; all if none is named. Raises InputError for unknown names."""
    known = {claim.name for claim in CLAIMS}
    if unknown := [name for name in names if name not in known]:
        raise InputError(f"claim '{unknown[0][:40]}' is not known: use {', '.join(sorted(known))}")
    return tuple(claim for claim in CLAIMS if not names or claim.name in names)


def audited(audit: Audit, claims: Sequence[Claim]) -> Iterator[tuple[Claim, Finding]]:
    """Examine one claim after the other. A computation that falls short leaves its claim undecided, with the reason."""
    for claim in claims:
        try:
            finding = claim.examine(audit)
        except (Shortfall, ArithmeticError) as reason:
            answers: dict[str, bool | None] = dict.fromkeys(audit.sets, False if claim.own_check else None)
            finding = Finding(dict.fromkeys(audit.sets, "-"), answers, note=str(reason))
        yield claim, finding


# ----------------------------------------------------------------------------------------- how claims are examined
def _number(
    printed: str, compute_one: Callable[[Audit, str], Measured], note: str, methods: tuple[str, ...]
) -> Callable[[Audit], Finding]:
    def one(audit: Audit, name: str) -> tuple[Measured, bool | None]:
        value = compute_one(audit, name)
        return value, rounds_to(value, printed)

    return _per_set(one, note, methods)


def _per_set(
    one: Callable[[Audit, str], tuple[Measured | str, bool | None]], note: str, methods: tuple[str, ...]
) -> Callable[[Audit], Finding]:
    """Examine each set by itself: what cannot be had for one of them leaves the others' answers alone."""

    def examine(audit: Audit) -> Finding:
        computed: dict[str, Measured | str] = {}
        holds: dict[str, bool | None] = {}
        notes = [note] if note else []
        for name in audit.sets:
            try:
                computed[name], holds[name] = one(audit, name)
            except (Shortfall, ArithmeticError, InputError) as reason:
                computed[name], holds[name] = "-", None
                notes.append(f"{name}: {reason}")
        return Finding(computed, holds, "; ".join(notes), methods)

    return examine


def _stability(which: EquilibriumName, sides: tuple[int, ...], expected: bool) -> Callable[[Audit], Finding]:
    """Stability at eight speeds on each of the given sides of Omega_crit (-1 below, 1 above), exactly."""

    def one(audit: Audit, name: str) -> tuple[str, bool]:
        # A rational within 1e-30 of Omega_crit; the shifts are far larger, so the side is certain.
        crit = omega_crit(audit.sets[name], 30).value
        speeds = [crit * (1 + side * Fraction(1, 2**power)) for side in sides for power in range(1, 9)]
        answers = {is_stable(linearization(audit.sets[name], speed, which)) for speed in speeds}
        return " and ".join("stable" if answer else "unstable" for answer in sorted(answers)), answers == {expected}

    where = " and ".join({-1: "below", 1: "above"}[side] for side in sides)
    note = f"exact Routh-Hurwitz in rational arithmetic at eight speeds {where} Omega_crit, the nearest 0.4 % away"
    return _per_set(one, note, ("exact arithmetic",))


def _scene(name: str, expected: tuple[str, ...], note: str) -> Callable[[Audit], Finding]:
    def one(audit: Audit, set_name: str) -> tuple[str, bool | None]:
        endings = [orbit.ending for orbit in audit.panel(name, set_name).orbits]
        undecided = any(ending.kind == "undecided" for ending in endings)
        outcome = None if undecided else all(ending.kind in expected for ending in endings)
        return "; ".join(_said(ending) for ending in endings), outcome

    return _per_set(one, note, ("trajectories",))


def _said(ending: Any) -> str:
    if ending.time is not None:
        return f"flat at {float(ending.time):.3f} s after {ending.wells_passed} wells"
    if ending.amplitude is not None:
        return f"limit cycle, {float(ending.amplitude):.4f} rad"
    return str(ending.kind)


def _engines(audit: Audit) -> Finding:
    """The Taylor engine in double against itself in extended precision and against SciPy."""
    from tippedisk_verify.flow.baseline import Baseline
    from tippedisk_verify.flow.taylor import Taylor

    taylor = audit.engine if isinstance(audit.engine, Taylor) else Taylor()
    scipy = Baseline("DOP853")
    parameters = audit.parameters
    crit = omega_crit(parameters, 20).value
    worst = Fraction(0)
    claimed = Fraction(0)
    for share in ("0.98", "0.997", "1.016"):
        for start in INITIAL_STATES:
            request = Request(parameters, crit * Fraction(share), start, 10)
            mine = taylor(replace(request, error_estimate=True))
            theirs = scipy(request)
            if mine.status is not theirs.status or mine.error is None:
                note = f"at {share} Omega_crit: {mine.status.value} against {theirs.status.value}"
                return Finding({parameters.name: "the engines end differently"}, {parameters.name: False}, note)
            worst = max(worst, *(Fraction(abs(a - b)) for a, b in zip(mine.state, theirs.state, strict=True)))
            claimed = max(claimed, Fraction(mine.error.largest))
    # SciPy's local tolerance of 1e-13 grows over 10 s by the passages near the saddles, which cost up to three digits.
    agreed = worst <= Fraction(1, 10**10) and claimed <= Fraction(1, 10**11)
    note = (
        f"six orbits of 10 s: SciPy's DOP853 differs by at most {float(worst):.1e}; the Taylor engine's own estimate of"
        f" its error, from a run in extended precision, is at most {float(claimed):.1e}"
    )
    return Finding(
        {parameters.name: f"{float(worst):.1e}"}, {parameters.name: agreed}, note, ("taylor", "scipy-DOP853")
    )


def _crit(audit: Audit, name: str) -> Measured:
    return omega_crit(audit.sets[name], max(audit.digits, 12))


def _period(audit: Audit, name: str) -> Measured:
    return period_crit(audit.sets[name], max(audit.digits, 12))


def _stiff(audit: Audit, name: str) -> Measured:
    return Measured(stiff_eigenvalue_estimate(audit.sets[name]), Fraction(0))


def _friction_free(audit: Audit) -> Finding:
    """With friction changed by large factors, the linearisation loses stability at the same speed."""
    holds: dict[str, bool | None] = {}
    for name, parameters in audit.sets.items():
        square = omega_crit_squared(parameters)
        speed = omega_crit(parameters, 40).value
        nearby = Fraction(1, 10**30)
        others = [
            parameters.changed(mu=parameters.mu * factor, epsilon=parameters.epsilon * other)
            for factor, other in ((Fraction(1, 1000), 1), (10, 1), (1, Fraction(1, 1000)), (3, 7))
        ]
        holds[name] = all(
            omega_crit_squared(changed) == square
            and is_stable(linearization(changed, speed + nearby))
            and not is_stable(linearization(changed, speed - nearby))
            for changed in others
        )
    note = "with mu and epsilon changed a thousandfold, stability changes within 1e-30 rad/s of the same speed (exact)"
    return Finding(dict.fromkeys(audit.sets, "independent"), holds, note, ("exact arithmetic",))


_CLOSED = ("closed form",)

#: All claims, in the order of the paper.
CLAIMS: tuple[Claim, ...] = (
    Claim(
        "omega_crit",
        "Eq. approx_omega_crit",
        "Omega_crit = sqrt((r+e)^2/r * m g/Bbar) = 30.92 rad/s",
        "30.92",
        _number("30.92", _crit, "Table 1 as rounded gives less; a set inside its rounding gives it", _CLOSED),
    ),
    Claim(
        "omega_crit_friction",
        "text below Eq. approx_omega_crit",
        "the critical speed does not depend on the friction parameters mu and epsilon",
        "independent",
        _friction_free,
    ),
    Claim(
        "lambda_3",
        "Eq. closed_la3",
        "lambda_3 is about A_33 = -129.04 1/s",
        "-129.04",
        _number(
            "-129.04", _stiff, "the number is A_33, the leading term; the eigenvalue itself depends on Omega", _CLOSED
        ),
    ),
    Claim(
        "inverted_stable_above",
        "Section sec:linear_stab3DOF",
        "inverted spinning is stable above Omega_crit",
        "stable",
        _stability("inverted", (1,), True),
    ),
    Claim(
        "inverted_unstable_below",
        "Section sec:linear_stab3DOF",
        "inverted spinning is unstable below Omega_crit",
        "unstable",
        _stability("inverted", (-1,), False),
    ),
    Claim(
        "noninverted_unstable",
        "Section sec:linear_stab3DOF",
        "noninverted spinning is always unstable",
        "unstable",
        _stability("noninverted", (-1, 1), False),
    ),
    Claim(
        "period_crit",
        "text below Eq. omega_sol",
        "the period at the Hopf point is 0.886 s",
        "0.886",
        _number("0.886", _period, "0.8867 for Table 1 as rounded", _CLOSED),
    ),
    Claim(
        "omega_h",
        "text below Figure Shooting",
        "the periodic solution vanishes at Omega_h = 30.07 rad/s",
        "30.07",
        _number(
            "30.07",
            lambda audit, name: audit.omega_h(name),
            "where the saddle's unstable branch changes sides",
            ("bisection",),
        ),
    ),
    Claim(
        "scene_a",
        "Figure sub_hom",
        "below Omega_h solutions are repelled by inverted spinning",
        "repelled",
        _scene("a", ("flat",), "and go from well to well until the disk lies flat, where the model ends"),
    ),
    *(
        Claim(
            f"scene_{name}",
            f"Figure {label}",
            "the periodic solution attracts both orbits",
            "limit cycle",
            _scene(name, ("limit cycle",), "amplitude of gamma at beta = pi/2"),
        )
        for name, label in (("b", "hom"), ("c", "sup_hom"), ("d", "sup_hom_sub_crit"), ("e", "sub_crit"))
    ),
    Claim(
        "scene_f",
        "Figure sup_crit",
        "above Omega_crit inverted spinning attracts both orbits",
        "inverted spinning",
        _scene("f", ("inverted spinning",), ""),
    ),
    Claim(
        "engines_agree",
        "own cross-check",
        "two integrators that share only the equations agree",
        "",
        _engines,
        own_check=True,
    ),
)

assert len({claim.name for claim in CLAIMS}) == len(CLAIMS)
assert {claim.name.removeprefix("scene_") for claim in CLAIMS if claim.name.startswith("scene_")} == {
    scene.name for scene in SCENES
}
