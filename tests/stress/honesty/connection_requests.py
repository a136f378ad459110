"""Requests at and next to Omega_h, where the digits run away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from random import Random
from typing import Any

from tests.stress.honesty.comparison import Asked, Number, printed
from tests.stress.honesty.cycle_requests import NAMES, Truths, decimal_near
from tests.stress.honesty.draws import decay, decimal, disk, log_uniform, written
from tests.stress.honesty.motion_requests import asked_run
from tests.stress.honesty.truths import rough_omega_h, true_omega_h
from tippedisk_verify.flow.contract import Request
from tippedisk_verify.model.exact import PI, exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Friction, Parameters
from tippedisk_verify.orbits.heteroclinic import heteroclinic
from tippedisk_verify.orbits.near_connection import cycle_above, cycle_near
from tippedisk_verify.theory.equilibria import equilibrium

__all__ = ["connection", "cycle_closer", "cycle_next_to_it", "passage"]

_FAMILIES = ("named", "nearby", "nearby", "friction")
_STIFFEST = 2e3  # 1/s; the truth about a stiffer disk takes minutes


def _disk(random: Random, families: Sequence[str], friction: Friction) -> Parameters:
    family = random.choice(families)
    while decay(parameters := disk(random, family)) > _STIFFEST:
        pass
    return parameters.with_friction(friction)


def connection(
    random: Random, method: str, friction: Friction = "linear", families: Sequence[str] = _FAMILIES
) -> Asked:
    """Omega_h by one of its roads, with the saddle's eigenvalues there."""
    parameters = _disk(random, families, friction)
    digits = 12 if method in ("manifolds", "limit-cycles") else 6

    def compared(found: Any, beyond: int) -> list[Number]:
        truth = true_omega_h(parameters, 80 if beyond else 60)
        numbers = [printed("omega_h", found.omega_h, truth.omega_h)]
        saddle = equilibrium(parameters, truth.omega_h.value, "noninverted", 43).eigenvalues
        numbers += [
            printed(f"saddle_eigenvalue_{n}", claim, Measured(value.re.value, abs(value.re.value) / 10**42))
            for n, (claim, value) in enumerate(zip(found.saddle_eigenvalues, saddle, strict=True), start=1)
        ]
        value = saddle[0].re.value + saddle[1].re.value
        numbers.append(printed("saddle_value", found.saddle_value, Measured(value, abs(value) / 10**40)))
        if found.splitting_derivative is not None:
            numbers.append(printed("splitting_derivative", found.splitting_derivative, truth.derivative))
        return numbers

    return Asked(
        f"Omega_h ({friction}) by {method}, {written(parameters)}",
        lambda here: heteroclinic(parameters, here.engine, digits=digits, method=method),
        compared,
    )


def cycle_closer(random: Random, friction: Friction = "linear", families: Sequence[str] = _FAMILIES) -> Asked:
    """A cycle a named distance above Omega_h."""
    parameters = _disk(random, families, friction)
    above = decimal(log_uniform(random, 1e-12, 1e-2), 4)
    truths = Truths(parameters)

    def compared(found: Any, beyond: int) -> list[Number]:
        omega = true_omega_h(parameters, 50).omega_h.value + above
        at_true_speed = replace(found, omega=Measured(omega, Fraction(0)))
        return [printed("omega", found.omega, omega), *truths.compared(at_true_speed, beyond)]

    return Asked(
        f"cycle ({friction}) {float(above)!r} rad/s above Omega_h, {written(parameters)}",
        lambda here: cycle_above(parameters, above, here.engine),
        compared,
    )


def cycle_next_to_it(random: Random, friction: Friction = "linear", families: Sequence[str] = _FAMILIES) -> Asked:
    """A cycle at a speed that happens to lie next to Omega_h."""
    parameters = _disk(random, families, friction)
    above = decimal(log_uniform(random, 1e-9, 1e-2), 4)
    truths = Truths(parameters)

    def answer(here: Any) -> Any:
        omega_h = true_omega_h(parameters, 20).omega_h.value
        omega = decimal_near(omega_h + above, 16)
        return cycle_near(parameters, omega, omega_h, here.engine)

    return Asked(
        f"cycle ({friction}) at a speed {float(above)!r} rad/s above Omega_h, {written(parameters)}",
        answer,
        lambda found, beyond: truths.compared(found, beyond, None, NAMES),
    )


def passage(random: Random, friction: Friction = "linear", families: Sequence[str] = _FAMILIES) -> Asked:
    """Runs of seconds past the saddles, at a speed next to Omega_h and from next to a saddle."""
    parameters = _disk(random, families, friction)
    away, above = log_uniform(random, 1e-9, 1e-1), random.choice((-1, 1)) * log_uniform(random, 1e-12, 1e-1)
    lifted = decimal(random.choice((-1, 1)) * away, 4)
    duration = decimal(random.uniform(1, 10), 3)

    def wanted() -> Request:
        start = (PI * Fraction(1, 2), exact(lifted) - PI * Fraction(1, 2), exact(0))
        omega = decimal_near(rough_omega_h(parameters) + Fraction(above), 14)
        times = [duration * Fraction(n, 6) for n in range(1, 7)]
        return Request(parameters, omega, start, duration, times=times, error_estimate=True)

    text = f"passage ({friction}) of {float(duration)!r} s from {float(lifted)!r} rad beside the saddle,"
    return asked_run(f"{text} {above!r} rad/s beside Omega_h, {written(parameters)}", wanted)
