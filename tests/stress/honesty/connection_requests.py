"""Requests at and next to Omega_h, where the digits run away."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from random import Random
from typing import Any

from tippedisk_verify.evidence.stress.comparison import Asked, Number, printed
from tippedisk_verify.evidence.stress.cycle_requests import NAMES, compared_cycle, decimal_near
from tippedisk_verify.evidence.stress.draws import decimal, disk, log_uniform, written
from tippedisk_verify.evidence.stress.motion_requests import compared_runs
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.contract import Request
from tippedisk_verify.model.equations import Friction
from tippedisk_verify.model.exact import PI, exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.orbits.bisection import bisect_omega_h
from tippedisk_verify.orbits.heteroclinic import heteroclinic
from tippedisk_verify.orbits.near_connection import cycle_above, cycle_near
from tippedisk_verify.orbits.splitting import splitting_zero
from tippedisk_verify.theory.equilibria import equilibrium

__all__ = ["connection", "cycle_closer", "cycle_next_to_it", "passage"]

_FAMILIES = ("named", "nearby", "nearby", "friction")


def _true_omega_h(parameters: Parameters, friction: Friction, digits: int = 30) -> Any:
    engine = default_engine()
    near = bisect_omega_h(parameters, engine, friction=friction, confirm=False).omega_h.value
    return splitting_zero(parameters, near, engine, digits, friction)


def connection(random: Random, method: str, friction: Friction = "linear") -> Asked:
    """Omega_h by one of its roads, with the saddle's eigenvalues there."""
    parameters = disk(random, random.choice(_FAMILIES))
    digits = 12 if method in ("manifolds", "limit-cycles") else 6

    def numbers() -> list[Number]:
        found = heteroclinic(parameters, default_engine(), digits=digits, method=method, friction=friction)
        truth = _true_omega_h(parameters, friction)
        compared = [printed("omega_h", found.omega_h, truth.omega_h)]
        saddle = equilibrium(parameters, truth.omega_h.value, "noninverted", 28).eigenvalues
        compared += [
            printed(f"saddle_eigenvalue_{n}", claim, Measured(value.re.value, abs(value.re.value) / 10**27))
            for n, (claim, value) in enumerate(zip(found.saddle_eigenvalues, saddle, strict=True), start=1)
        ]
        value = saddle[0].re.value + saddle[1].re.value
        compared.append(printed("saddle_value", found.saddle_value, Measured(value, abs(value) / 10**25)))
        if found.splitting_derivative is not None:
            compared.append(printed("splitting_derivative", found.splitting_derivative, truth.derivative))
        return compared

    return Asked(f"Omega_h ({friction}) by {method}, {written(parameters)}", numbers)


def cycle_closer(random: Random, friction: Friction = "linear") -> Asked:
    """A cycle a named distance above Omega_h."""
    parameters = disk(random, random.choice(_FAMILIES))
    above = decimal(log_uniform(random, 1e-12, 1e-2), 4)

    def numbers() -> list[Number]:
        found = cycle_above(parameters, above, default_engine(), friction=friction)
        omega_h = _true_omega_h(parameters, friction, 50).omega_h.value
        true_speed = replace(found, omega=Measured(omega_h + above, Fraction(0)))
        return [printed("omega", found.omega, omega_h + above), *compared_cycle(parameters, true_speed, friction, None)]

    return Asked(f"cycle ({friction}) {float(above)!r} rad/s above Omega_h, {written(parameters)}", numbers)


def cycle_next_to_it(random: Random, friction: Friction = "linear") -> Asked:
    """A cycle at a speed that happens to lie next to Omega_h."""
    parameters = disk(random, random.choice(_FAMILIES))
    above = decimal(log_uniform(random, 1e-9, 1e-2), 4)

    def numbers() -> list[Number]:
        omega_h = _true_omega_h(parameters, friction, 20).omega_h.value
        omega = decimal_near(omega_h + above, 16)
        found = cycle_near(parameters, omega, omega_h, default_engine(), friction=friction)
        return compared_cycle(parameters, found, friction, None, NAMES)

    return Asked(f"cycle ({friction}) at a speed {float(above)!r} rad/s above Omega_h, {written(parameters)}", numbers)


def passage(random: Random, friction: Friction = "linear") -> Asked:
    """Runs of seconds past the saddles, at a speed next to Omega_h and from next to a saddle."""
    parameters = disk(random, random.choice(_FAMILIES))
    away, above = log_uniform(random, 1e-9, 1e-1), random.choice((-1, 1)) * log_uniform(random, 1e-12, 1e-1)
    lifted = decimal(random.choice((-1, 1)) * away, 4)
    duration = decimal(random.uniform(1, 10), 3)

    def numbers() -> list[Number]:
        near = bisect_omega_h(parameters, default_engine(), friction=friction, confirm=False).omega_h.value
        start = (PI * Fraction(1, 2), exact(lifted) - PI * Fraction(1, 2), exact(0))
        omega = decimal_near(near + Fraction(above), 14)
        times = [duration * Fraction(n, 6) for n in range(1, 7)]
        return compared_runs(
            Request(parameters, omega, start, duration, friction=friction, times=times, error_estimate=True)
        )

    text = f"passage ({friction}) of {float(duration)!r} s from {float(lifted)!r} rad beside the saddle,"
    return Asked(f"{text} {above!r} rad/s beside Omega_h, {written(parameters)}", numbers)
