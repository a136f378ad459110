"""Requests without motion: the right-hand side, equilibria, the Hopf point, the closed laws, the slow manifold."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from random import Random
from typing import Any

from tests.stress.honesty.comparison import Asked, Number, printed, unlike
from tests.stress.honesty.draws import FAMILIES, decimal, disk, log_uniform, speed, state, written
from tippedisk_verify.model.equations import jacobian
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Constants, Friction, Parameters
from tippedisk_verify.model.precision import DOUBLE, bits, bits_for_digits
from tippedisk_verify.reference_values.entries import Case, Item, Method
from tippedisk_verify.reference_values.local_roads import BALANCE, HOPF, RHS
from tippedisk_verify.theory import slow_manifold
from tippedisk_verify.theory.equilibria import EquilibriumName, equilibrium
from tippedisk_verify.theory.harmonic_balance import Form, one_harmonic, slopes
from tippedisk_verify.theory.hopf import hopf_point, omega_crit
from tippedisk_verify.theory.melnikov import limit_period, limit_speed

__all__ = ["BY_NAME"]

_TRUE_BITS = 600  # 180 digits: a double eigenvalue costs half of them


def _case(parameters: Parameters, friction: str, inputs: dict[str, Any]) -> Case:
    law: Friction = "smooth" if friction == "smooth" else "linear"
    return Case(Item("drawn", "drawn", parameters.name, friction, {}), parameters.with_friction(law), inputs)


def _by_roads(first: Method, second: Method, case: Case, working_bits: int) -> list[Number]:
    claims = first.compute(case, {})
    truths = second.compute(case, claims)
    return [printed(name, claims[name], truths[name], working_bits) for name in claims if name in truths]


def right_hand_side(random: Random) -> Asked:
    """The equations' terms, the acceleration and its derivatives at a state, against the same in shifted angles."""
    parameters = disk(random, random.choice(FAMILIES))
    friction = random.choice(("both", "linear", "smooth"))
    angles = (decimal(float(DOUBLE.number(part)), 12) for part in state(random))  # rational: pi has no place there
    place = dict(zip(("Omega", "beta", "gamma", "v"), (speed(random, parameters), *angles), strict=True))
    where = ", ".join(f"{name} = {float(value)!r}" for name, value in place.items())
    case = _case(parameters, friction, place)
    return Asked.closed(
        f"right-hand side, {friction}, {written(parameters)}, {where}", lambda: _by_roads(RHS[0], RHS[1], case, 240)
    )


def equilibria(random: Random) -> Asked:
    """Eigenvalues and stability, against the QR algorithm on the full equations' Jacobian."""
    parameters = disk(random, random.choice(FAMILIES))
    omega = speed(random, parameters)
    name: EquilibriumName = random.choice(("inverted", "noninverted"))
    digits = random.choice((6, 12, 15))

    def numbers() -> list[Number]:
        found = equilibrium(parameters, omega, name, digits)
        ctx = bits(_TRUE_BITS).context
        constants = Constants(*(_mpf(ctx, value) for value in parameters.rational()))
        gamma = ctx.pi / 2 if name == "inverted" else -ctx.pi / 2
        rows = jacobian(ctx, constants, _mpf(ctx, omega), "linear")(ctx.pi / 2, gamma, ctx.mpf(0))
        truths = ctx.eig(ctx.matrix([list(row) for row in rows]), left=False, right=False)
        small = ctx.mpf(2) ** (-_TRUE_BITS // 3) * max(abs(value) for value in truths)
        compared = []
        for n, value in enumerate(found.eigenvalues, start=1):
            claimed = ctx.mpc(_mpf(ctx, value.re.value), _mpf(ctx, value.im.value))
            near = min(truths, key=lambda truth: abs(truth - claimed))
            imaginary = near.imag if abs(near.imag) > small else ctx.mpf(0)
            compared.append(printed(f"lambda_{n} re", value.re, Measured.of(near.real, small)))
            compared.append(printed(f"lambda_{n} im", value.im, Measured.of(imaginary, small if imaginary else 0)))
        if found.stable != all(truth.real < 0 for truth in truths):
            compared.append(unlike("stable"))
        return compared

    return Asked.closed(f"{name} at {float(omega)!r} rad/s to {digits} digits, {written(parameters)}", numbers)


def _mpf(ctx: Any, value: Any) -> Any:
    exact = Fraction(value)
    return ctx.mpf(exact.numerator) / exact.denominator


def hopf(random: Random) -> Asked:
    """The Hopf point's six numbers, against implicit differentiation and the consistent one-harmonic law."""
    parameters = disk(random, random.choice(FAMILIES))
    digits = random.choice((6, 12, 15))

    def numbers() -> list[Number]:
        found = hopf_point(parameters, digits)
        truths = HOPF[1].compute(_case(parameters, "linear", {}), {})
        return [
            printed(name, getattr(found, name), truth, bits_for_digits(digits + 15)) for name, truth in truths.items()
        ]

    return Asked.closed(f"Hopf point to {digits} digits, {written(parameters)}", numbers)


def harmonic(random: Random) -> Asked:
    """The one-harmonic law at a speed, and its slopes at the Hopf point."""
    parameters = disk(random, random.choice(FAMILIES))
    form: Form = random.choice(("printed", "consistent"))
    digits = random.choice((6, 12, 15))
    omega = speed(random, parameters)

    def numbers() -> list[Number]:
        compared = []
        working = bits_for_digits(digits + 15)
        names = ("amplitude_squared_slope", "period_slope")
        for name, claim, truth in zip(
            names, slopes(parameters, form, digits), slopes(parameters, form, 60), strict=True
        ):
            compared.append(printed(name, claim, truth, working))
        found = one_harmonic(parameters, omega, form, digits)
        truths = BALANCE[1].compute(_case(parameters, "linear", {"Omega": omega, "form": form}), {})
        compared += [
            printed(name, getattr(found, name), truth, bits_for_digits(digits + 5)) for name, truth in truths.items()
        ]
        return compared

    return Asked.closed(
        f"one-harmonic law ({form}) at {float(omega)!r} rad/s to {digits} digits, {written(parameters)}", numbers
    )


def melnikov(random: Random) -> Asked:
    """The limit epsilon -> 0 of a cycle's speed and period, against the quadrature at 40 digits."""
    parameters = disk(random, random.choice(FAMILIES))
    size = (
        None
        if random.random() < 0.3
        else decimal(random.choice((random.uniform(0.1, 3.1), log_uniform(random, 1e-4, 1))))
    )
    digits = random.choice((6, 12))

    def numbers() -> list[Number]:
        compared = [printed("omega", limit_speed(parameters, size, digits), limit_speed(parameters, size, 40))]
        if size is not None:
            compared.append(
                printed("period", limit_period(parameters, size, digits), limit_period(parameters, size, 40))
            )
        return compared

    return Asked.closed(
        f"limit of cycles of size {size and float(size)} to {digits} digits, {written(parameters)}", numbers
    )


def slow_manifold_study(random: Random) -> Asked:
    """Orders, residuals, exponents and the reduced Hopf speed, against the recursion at 120 digits."""
    parameters = disk(random, random.choice(FAMILIES))
    omega = decimal(float(omega_crit(parameters)) * random.uniform(0.5, 1.5))
    order = random.choice((0, 1, 2, 3))

    def numbers() -> list[Number]:
        found = slow_manifold.study(parameters, omega, order)
        ctx = bits(400).context
        constants = Constants(*(_mpf(ctx, value) for value in parameters.rational()))

        def at(function: Any, point: Any, highest: int) -> list[Any]:
            return list(function(ctx, constants, _mpf(ctx, omega), *(_mpf(ctx, part) for part in point), highest))

        here = at(slow_manifold.orders, (Fraction("1.2"), Fraction("0.3")), order)
        compared = [
            printed(f"h_{n}", claim, Measured.of(h, 0), bits_for_digits(17))
            for n, (claim, h) in enumerate(zip(found.h, here, strict=True))
        ]
        rows = [
            [abs(x) for x in at(slow_manifold.invariance_residuals, point, order)] for point in slow_manifold.POINTS
        ]
        for n, claim in enumerate(found.residual):
            compared.append(printed(f"residual_{n}", claim, Measured.of(max(row[n] for row in rows), 0), 53))
            compared.append(printed(f"residual_slope_{n}", found.residual_slope[n], Fraction(n + 1), 53))
        terms = [at(slow_manifold.orders, point, 10) for point in slow_manifold.POINTS]
        sizes = [max(abs(row[n]) for row in terms) * constants.epsilon**n for n in range(1, 11)]
        compared.append(printed("smallest_term", found.smallest_term, Measured.of(min(sizes), 0), 53))
        if found.best_order != 1 + sizes.index(min(sizes)):
            compared.append(unlike("best_order"))
        if found.reduced_omega_crit is not None:
            truth = slow_manifold.reduced_omega_crit(parameters, order, 40)
            compared.append(printed("reduced_omega_crit", found.reduced_omega_crit, truth, bits_for_digits(27)))
        return compared

    return Asked.closed(f"slow manifold of order {order} at {float(omega)!r} rad/s, {written(parameters)}", numbers)


#: Each of them under its kind's name.
BY_NAME: dict[str, Callable[[Random], Asked]] = {
    "right-hand side": right_hand_side,
    "equilibria": equilibria,
    "hopf": hopf,
    "one-harmonic": harmonic,
    "melnikov": melnikov,
    "slow-manifold": slow_manifold_study,
}
