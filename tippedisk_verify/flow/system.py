"""What heyoka compiles for a request, the field's expressions, variations and event functions; twins of its inputs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from random import Random
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import FLAT, SLIDING_REVERSAL, STATE_VARIATIONS, Event, Variation
from tippedisk_verify.model.equations import field, jacobian, shifted
from tippedisk_verify.model.parameters import Constants, Friction
from tippedisk_verify.model.precision import Precision, heyoka_module

__all__ = [
    "PARAMETERS",
    "SMOOTH_PARAMETERS",
    "SWITCH",
    "TURN_OVER",
    "constants_of",
    "direction_of",
    "nudged",
    "parameter_names",
    "system_of",
]

#: Runtime parameters of the compiled field, in this order; the smooth law has two of its own instead of k, and last the
#: branch that it is on.
PARAMETERS = ("Omega", "r", "e", "a", "b", "g", "k")
SMOOTH_PARAMETERS = ("Omega", "r", "e", "a", "b", "g", "traction", "epsilon")
#: The smooth law's own events, where its branch changes, under names that requests cannot have.
SWITCH = Event("(switch)", SLIDING_REVERSAL.function)
TURN_OVER = Event("(turns over)", FLAT.function)


#: In so many patterns each number moves up once and down once: none stays where it is in all twins of a cycle, and on
#: average they err by half a place, as rounding makes them.
_ROUND = 5


def parameter_names(friction: Friction) -> tuple[str, ...]:
    """The runtime parameters of a law's field, in their order."""
    return PARAMETERS if friction == "linear" else SMOOTH_PARAMETERS


def constants_of(pars: Any, friction: Friction) -> Constants:
    """The rows of the runtime parameters by name."""
    rows = dict(zip(parameter_names(friction), pars, strict=False))
    return Constants(**{name: rows.get(name) for name in Constants._fields})


def system_of(
    variations: Sequence[Variation], divergence: bool, events: Sequence[Event], shift: bool, friction: Friction
) -> tuple[Any, dict[str, Any]]:
    """The heyoka system with what is asked for, and the expressions of the events by name.

    With ``shift`` angles are measured from pi/2. After the state comes the integral of the divergence, then the
    derivatives, row by row. Raises InputError for a derivative that the field does not have.
    """
    hy = heyoka_module()
    ops = shifted(hy) if shift else hy
    state, names = hy.make_vars("beta", "gamma", "v"), parameter_names(friction)
    pars = [hy.par[index] for index in range(len(names))]
    constants, omega = constants_of(pars, friction), pars[0]
    side = hy.par[len(names)] if friction == "smooth" else None
    rates = field(ops, constants, omega, friction, side)(*state)
    system: Any = list(zip(state, rates, strict=True))
    if divergence:
        slope = jacobian(ops, constants, omega, friction, side)(*state)[2][2]
        system.append((hy.make_vars("divergence"), slope))
    if variations:
        variables = dict(zip((*STATE_VARIATIONS, *names), (*state, *pars), strict=True))
        unknown = [name for name in variations if name not in variables]
        if unknown:
            raise InputError(f"no derivative with respect to '{unknown[0]}': use {', '.join(variables)}")
        system = hy.var_ode_sys(system, [variables[name] for name in variations])
    return system, {event.name: event.function(ops, constants, omega, *state) for event in events}


def direction_of(event: Event) -> Any:
    """heyoka's name for the sign of its crossings."""
    directions = heyoka_module().event_direction
    return {-1: directions.negative, 0: directions.any, 1: directions.positive}[event.direction]


def nudged(values: Sequence[Any], pattern: int, precision: Precision) -> list[Any]:
    """A twin of some numbers: each moved by its last bit, up or down or not at all as the pattern 1, 2, ... says.

    Zero stays. Twins are for what is solved by many runs, such as a limit cycle: its equations amplify rounding, and no
    single run's error tells by how much. The spread of the results does.
    """
    return [value * factor for value, factor in zip(values, _factors(len(values), pattern, precision), strict=True)]


@lru_cache(maxsize=256)
def _factors(count: int, pattern: int, precision: Precision) -> tuple[Any, ...]:
    one, ulp = precision.number(1), precision.number(precision.epsilon)
    block, turn = divmod(pattern, _ROUND)
    random = Random(block)  # another one for each round of patterns, and the same on every machine
    moves = [random.sample(range(_ROUND), 2) for _ in range(count)]
    return tuple(one + ulp if turn == up else one - ulp if turn == down else one for up, down in moves)
