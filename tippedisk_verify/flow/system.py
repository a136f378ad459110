"""What heyoka compiles for a request: the field's expressions, their variations, and the event functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import FLAT, SLIDING_REVERSAL, Event, Variation
from tippedisk_verify.model.equations import field, jacobian, shifted
from tippedisk_verify.model.parameters import Constants
from tippedisk_verify.model.precision import heyoka_module

__all__ = ["PARAMETERS", "SMOOTH_PARAMETERS", "SWITCH", "TURN_OVER", "direction_of", "system_of"]

#: Runtime parameters of the compiled field, in this order; the smooth law has two of its own instead of k, and the
#: branch that it is on.
PARAMETERS = ("Omega", "r", "e", "a", "b", "g", "k")
SMOOTH_PARAMETERS = ("Omega", "r", "e", "a", "b", "g", "traction", "epsilon")
#: The smooth law's own events, where its branch changes, under names that requests cannot have.
SWITCH = Event("(switch)", SLIDING_REVERSAL.function)
TURN_OVER = Event("(turns over)", FLAT.function)


def system_of(
    variations: Sequence[Variation], divergence: bool, events: Sequence[Event], shift: bool, smooth: bool = False
) -> tuple[Any, dict[str, Any]]:
    """The heyoka system with what is asked for, and the event functions by name.

    With ``shift`` angles are measured from pi/2. After the state comes the integral of the divergence, then the
    derivatives, row by row. Raises InputError for a derivative that the field does not have.
    """
    hy = heyoka_module()
    ops = shifted(hy) if shift else hy
    state = hy.make_vars("beta", "gamma", "v")
    names = SMOOTH_PARAMETERS if smooth else PARAMETERS
    pars = dict(zip(names, (hy.par[index] for index in range(len(names))), strict=True))
    law: tuple[Any, ...] = ("smooth", hy.par[len(names)]) if smooth else ("linear",)
    omega = pars["Omega"]
    constants = Constants(**{name: pars.get(name) for name in Constants._fields})
    rates = field(ops, constants, omega, *law)(*state)
    system: Any = list(zip(state, rates, strict=True))
    if divergence:
        slope = jacobian(ops, constants, omega, *law)(*state)[2][2]
        system.append((hy.make_vars("divergence"), slope))
    if variations:
        known = dict(zip(("beta", "gamma", "v"), state, strict=True)) | pars
        unknown = [name for name in variations if name not in known]
        if unknown:
            raise InputError(f"no derivative with respect to '{unknown[0]}': use {', '.join(known)}")
        system = hy.var_ode_sys(system, [known[name] for name in variations])
    return system, {event.name: event.function(ops, constants, omega, *state) for event in events}


def direction_of(hy: Any, sign: int) -> Any:
    """heyoka's name for the sign of a crossing."""
    kinds = {-1: "negative", 0: "any", 1: "positive"}
    return getattr(hy.event_direction, kinds[sign])
