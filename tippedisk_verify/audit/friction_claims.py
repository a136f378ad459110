"""Claims about the two friction laws, and about attraction."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import lru_cache

from tippedisk_verify.audit.claims import Audit, Claim, Fault
from tippedisk_verify.cycles.cycle_at_speed import librating_cycle_at
from tippedisk_verify.cycles.limit_cycle import LimitCycle
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.equations import equation_terms, jacobian
from tippedisk_verify.model.friction import Friction
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.motion.basins import basins
from tippedisk_verify.numbers.precision import DOUBLE
from tippedisk_verify.omega_h.methods import heteroclinic
from tippedisk_verify.theory.hopf import criticality, omega_crit
from tippedisk_verify.theory.slow_manifold import critical_manifold

__all__ = ["FRICTION_CLAIMS"]

_LAWS: tuple[Friction, ...] = ("linear", "smooth")
_START_COUNT = 2048  # starts in the plane; the sampling error of a fraction is about 1 %


def _speed_below_crit(parameters: Parameters) -> Fraction:
    return omega_crit(parameters, 20).value - Fraction(1, 2)


@lru_cache(maxsize=16)
def _cycle_below_crit(parameters: Parameters, engine: Engine) -> LimitCycle:
    return librating_cycle_at(parameters, _speed_below_crit(parameters), engine, digits=12)


def _same_kinds_under_both_laws(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    """Compare the kind of Hopf point, the cycles' stability and the connection under both friction
    laws.
    """
    parameters, crit = audit.sets[set_name], float(omega_crit(audit.sets[set_name]))
    speeds = [
        float(heteroclinic(parameters.with_friction(law), audit.engine).omega_h) for law in _LAWS
    ]
    cycles = [_cycle_below_crit(parameters.with_friction(law), audit.engine) for law in _LAWS]
    constants = parameters.constants_in(DOUBLE)
    rows = [jacobian(math, constants, crit, law)(math.pi / 2, math.pi / 2, 0.0)[2] for law in _LAWS]
    kinds = [
        criticality(parameters),
        _smooth_kind(parameters.with_friction("smooth"), audit.engine),
    ]
    same = (
        kinds[0] == kinds[1]
        and all(map(math.isclose, *rows))  # pi/2 in double leaves a tiny sliding velocity
        and all(speed < crit for speed in speeds)
        and all(cycle.stable for cycle in cycles)
    )
    return f"Omega_h {speeds[0]:.6f} linear, {speeds[1]:.6f} smooth; {kinds[0]}, {kinds[1]}", same


def _smooth_kind(parameters: Parameters, engine: Engine) -> str:
    """Return the kind of the smooth law's Hopf point, determined from its cycles.

    The smooth field is only C^1, which is not enough for a Lyapunov coefficient. The point is
    supercritical if stable cycles below Omega_crit shrink towards it.
    """
    far, speed = (
        _cycle_below_crit(parameters, engine),
        omega_crit(parameters, 20).value - Fraction(1, 32),
    )
    near = librating_cycle_at(parameters, speed, engine, digits=12)
    shrinks = near.beta_max.value < far.beta_max.value / 2
    return "supercritical" if near.stable and far.stable and shrinks else "not supercritical"


def _same_cycle_under_both_laws(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    """Compare the cycles of both laws at one speed, and measure the sliding velocity on them."""
    import numpy

    parameters = audit.sets[set_name]
    linear, smooth = (
        _cycle_below_crit(parameters.with_friction(law), audit.engine) for law in _LAWS
    )
    _, states = linear.orbit(200, engine=audit.engine)
    constants = parameters.constants_in(DOUBLE)
    sliding = equation_terms(numpy, constants, float(linear.omega), *states).sliding_velocity
    share = float(numpy.abs(sliding).max()) / constants.epsilon
    difference = abs(float(smooth.period.value / linear.period.value) - 1)
    return (
        f"T differs by {100 * difference:.3f} %, |gamma_y| up to {share:.3f} epsilon",
        (smooth.period - linear.period).holds(0),
    )


def _attraction_rates(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    """Check that neighbours in v approach near rolling under both laws: the rates -d(v')/d(v) > 0."""
    import numpy

    parameters, ranges, falling = audit.sets[set_name], [], []
    constants, speed = parameters.constants_in(DOUBLE), float(_speed_below_crit(parameters))
    beta, gamma = numpy.mgrid[0.35 : math.pi - 0.35 : 24j, -math.pi / 2 : 3 * math.pi / 2 : 32j]
    v, distance = (
        critical_manifold(numpy, constants, speed, beta, gamma) + 0.25,
        abs(beta - math.pi / 2),
    )
    for law in _LAWS:
        rates = -jacobian(numpy, constants, speed, law)(beta, gamma, v)[2][2]
        falling.append(bool((rates > 0).all()))
        edge = distance[rates <= 0].min(initial=distance.max())
        inside = rates[distance < edge]
        ranges.append(
            f"{law}: {inside.min():.1f} to {inside.max():.1f} 1/s for |beta - pi/2| < {edge:.2f}"
        )
    return "; ".join(ranges), all(falling)


def _share_that_inverts(audit: Audit, set_name: str, printed: str) -> tuple[str, bool]:
    """Find where starts with v = 0 end above Omega_crit, and check that almost all end inverted."""
    parameters = audit.sets[set_name]
    omega = omega_crit(parameters, 20).value + Fraction(1, 2)
    plane = basins(parameters, omega, count=_START_COUNT)
    shares = plane.shares()
    flat, inverted = shares["lies flat"], shares["inverted spinning"]
    text = (
        f"at Omega_crit + 0.5 rad/s, of starts with v = 0, {100 * inverted[0]:.0f} % end inverted,"
        f" {100 * flat[0]:.0f} % lie flat"
    )
    return text, 1 - inverted[0] < inverted[1]


FRICTION_CLAIMS: tuple[Claim, ...] = (
    Claim(
        "globally_attractive",
        "sec:discussion",
        "the slow manifold is globally attractive, with the smooth law as well",
        "globally attractive",
        _attraction_rates,
        note="rates at which neighbours in v approach each other, slightly off rolling",
        methods=("closed form",),
        fault=Fault(
            "differs",
            "the attraction rate vanishes where the disk lies flat, and off rolling neighbours in "
            "v separate"
            " before that",
            "the slow manifold attracts at an angle from lying flat, by both laws",
        ),
        formula=r"\mathcal{M}_s \;\text{attracts}\; \{0 < \beta < \pi\}",
    ),
    Claim(
        "smooth_same_behaviour",
        "sec:discussion",
        "smooth Coulomb friction does not change the qualitative behaviour",
        "same qualitatively",
        _same_kinds_under_both_laws,
        note="stable cycles between a connection and the same Hopf point",
        methods=("shooting", "manifolds"),
        formula=(
            r"\lambda_{Ty} = -\frac{\mu m g}{\varepsilon}\gamma_y"
            r" \;\sim\; -\mu m g\,\frac{\gamma_y}{|\gamma_y|+\varepsilon}"
        ),
        cost=17,
    ),
    Claim(
        "smooth_same_asymptotics",
        "sec:discussion",
        "linear and smooth Coulomb friction describe the same asymptotic behaviour",
        "same",
        _same_cycle_under_both_laws,
        note="the limit cycles at Omega_crit - 0.5",
        methods=("shooting",),
        fault=Fault(
            "differs",
            "the sliding velocity does not vanish along the limit cycle, so the laws differ there",
            "the limit cycles of the two laws agree only where they shrink to the Hopf point",
        ),
        formula=r"|\gamma_y| \ll \varepsilon",
    ),
    Claim(
        "almost_all_trajectories",
        "sec:discussion",
        "above Omega_crit inverted spinning attracts almost all trajectories",
        "almost all",
        _share_that_inverts,
        note=f"{_START_COUNT} starts over the whole strip between noninverted states, 20 s",
        methods=("trajectories",),
        fault=Fault(
            "differs",
            "many starts lie flat before they invert",
            "inverted spinning attracts a neighbourhood, which an unstable rotating cycle's stable "
            "manifold bounds",
        ),
        formula=r"x(t) \to (\pi/2,\,\pi/2,\,0) \quad\text{for}\quad \Omega > \Omega_\text{crit}",
    ),
)
