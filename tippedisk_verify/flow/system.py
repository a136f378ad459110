"""The systems that heyoka compiles for a request, and a run's inputs with moved last bits (twins).

A system consists of the field's expressions, the law's guard, the variations and the event
functions.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from random import Random
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import (
    FLAT,
    SLIDING_REVERSAL,
    STATE_VARIATIONS,
    Event,
    Variation,
)
from tippedisk_verify.flow.jit import heyoka_module
from tippedisk_verify.model.equations import STATE_NAMES, jacobian, shifted_ops, vector_field
from tippedisk_verify.model.friction import FrictionLaw
from tippedisk_verify.model.parameters import Constants, Parameters
from tippedisk_verify.numbers.precision import Precision

__all__ = [
    "FRICTION_SWITCH",
    "SIN_BETA_REVERSAL",
    "build_system",
    "constant_derivatives",
    "constants_of",
    "direction_of",
    "parameter_names",
    "perturb_last_bits",
]

# The runtime parameters of every law's compiled field, in this order. The law's own constants
# follow, and the side of a law that has two is the last one.
_COMMON_PARAMETERS = ("Omega", "r", "e", "a", "b", "g")
#: The events at which a law with two sides changes its side. Requests cannot have these names.
FRICTION_SWITCH = Event("(switch)", SLIDING_REVERSAL.function)
SIN_BETA_REVERSAL = Event("(turns over)", FLAT.function)


# The number of patterns in which each number moves up once and down once. So no number stays fixed
# in all twins of a cycle. On average a number errs by half a place, as rounding does.
_PATTERNS_PER_ROUND = 5


def parameter_names(law: FrictionLaw) -> tuple[str, ...]:
    """Return the names of the runtime parameters of the compiled equations of motion under a
    friction law, in their order.

    Args:
        law: The friction law.
    """
    return _COMMON_PARAMETERS + law.constants


def constant_derivatives(parameters: Parameters) -> dict[str, dict[Variation, Fraction]]:
    """Return the exact derivatives of the constants in the equations of motion with respect to each
    input of a motion.

    The inputs are the start's beta, gamma and v, omega, and the disk's parameters. The constants
    a = A / m, b = B / m - e^2, k = mu g / epsilon and mu g depend on several of these. The start
    and Omega count as constants of their own.

    Args:
        parameters: The disk and its friction law, which determines the constants.

    Returns:
        A row for each input: its nonzero derivatives, by the name of the constant.
    """
    c, one = parameters.rational_constants(), Fraction(1)
    table: dict[str, dict[Variation, Fraction]] = {
        "beta": {"beta": one},
        "gamma": {"gamma": one},
        "v": {"v": one},
        "omega": {"Omega": one},
        "r": {"r": one},
        "e": {"e": one, "b": -2 * c.e},
        "m": {"m": one, "a": -c.a / c.m, "b": -c.B / c.m**2},
        "A": {"a": 1 / c.m},
        "B": {"b": 1 / c.m},
        "g": {"g": one, "k": c.mu / c.epsilon, "traction": c.mu},
        "mu": {"mu": one, "k": c.g / c.epsilon, "traction": c.g},
        "epsilon": {"epsilon": one, "k": -c.k / c.epsilon},
    }
    has = {*STATE_VARIATIONS, *parameter_names(parameters.law)}
    if parameters.law.has_guard:
        has -= {"k", "traction"}  # which only its guard takes
    return {
        variable: {name: slope for name, slope in row.items() if name in has}
        for variable, row in table.items()
    }


def constants_of(pars: Any, law: FrictionLaw) -> Constants:
    """Return the disk's constants by name, from the runtime parameters of the compiled equations of
    motion.

    Constants that are not among the parameters are None.

    Args:
        pars: The runtime parameters or rows of them, in the order of `parameter_names`.
        law: The friction law.
    """
    rows = dict(zip(parameter_names(law), pars, strict=False))
    return Constants(**{name: rows.get(name) for name in Constants._fields})


def build_system(
    variations: Sequence[Variation],
    divergence: bool,
    events: Sequence[Event],
    shift: bool,
    law: FrictionLaw,
) -> tuple[Any, dict[str, Any]]:
    """Return the heyoka system of a request, and the expressions of the events by name.

    The variables are the state, then the integral of the divergence and the law's guard, then the
    derivatives row by row.

    Args:
        variations: The variables of the derivatives.
        divergence: True adds the integral of the divergence.
        events: The events.
        shift: True measures angles from pi/2.
        law: The friction law.

    Raises:
        InputError: If the field does not have such a derivative, or the law cannot be compiled.
    """
    hy = heyoka_module()
    ops = shifted_ops(hy) if shift else hy
    state, names = hy.make_vars(*STATE_NAMES), parameter_names(law)
    pars = [hy.par[index] for index in range(len(names))]
    constants, omega = constants_of(pars, law), pars[0]
    side = hy.par[len(names)] if law.two_sided else None
    try:
        rates = vector_field(ops, constants, omega, law, side)(*state)
    except (AttributeError, TypeError) as fault:
        raise InputError(
            f"the friction law '{law}' cannot be compiled: {fault}; an absolute value needs "
            f"two_sided=True"
        ) from fault
    system: Any = list(zip(state, rates, strict=True))
    if divergence:
        slope = jacobian(ops, constants, omega, law, side)(*state)[2][2]
        system.append((hy.make_vars("divergence"), slope))
    if law.has_guard:
        slip = SLIDING_REVERSAL.function(ops, constants, omega, *state)
        system.append(
            (hy.make_vars("guard"), law.guard_rate(hy, ops.sin(state[0]) * slip, constants))
        )
    if variations:
        variables = dict(zip((*STATE_VARIATIONS, *names), (*state, *pars), strict=True))
        unknown = [name for name in variations if name not in variables]
        if unknown:
            raise InputError(
                f"no derivative with respect to '{unknown[0]}': use {', '.join(variables)}"
            )
        system = hy.var_ode_sys(system, [variables[name] for name in variations])
    return system, {event.name: event.function(ops, constants, omega, *state) for event in events}


def direction_of(event: Event) -> Any:
    """Return the direction of an event's crossings as heyoka's enum member.

    Args:
        event: The event.
    """
    directions = heyoka_module().event_direction
    return {-1: directions.negative, 0: directions.any, 1: directions.positive}[event.direction]


def perturb_last_bits(values: Sequence[Any], pattern: int, precision: Precision) -> list[Any]:
    """Return a twin of some numbers: each moves by its last bit, up, down or not at all.

    Zero stays. Twins serve problems solved by many runs, such as a limit cycle. The equations of
    such a problem amplify rounding, and the error of a single run does not show by how much. The
    spread of the twins' results does.

    Args:
        values: The numbers, in ``precision``.
        pattern: The number of the twin, 1, 2, ..., which decides how each number moves.
        precision: Their arithmetic.
    """
    return [
        value * factor
        for value, factor in zip(values, _factors(len(values), pattern, precision), strict=True)
    ]


@lru_cache(maxsize=256)
def _factors(count: int, pattern: int, precision: Precision) -> tuple[Any, ...]:
    one, ulp = precision.number(1), precision.number(precision.epsilon)
    block, turn = divmod(pattern, _PATTERNS_PER_ROUND)
    random = Random(block)  # differs between rounds of patterns, is the same on every machine
    return tuple(
        one + ulp if turn == up else one - ulp if turn == down else one
        for up, down in (random.sample(range(_PATTERNS_PER_ROUND), 2) for _ in range(count))
    )
