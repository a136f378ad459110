"""Level 2 with another matrix: linearised about another state, or with one of its entries changed.

The matrix of (beta, gamma, v)' has the rows (0, 0, 1), (a, 0, 0) and (b, c, d), so that its eigenvalues solve
x^3 - d x^2 - b x - a c = 0. What is answered for them tells d, b and a c. Where these are the right ones times a number
and a power of Omega, the eigenvalues of that matrix are tried.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

from tippedisk_verify.conformance.diagnosis.alternatives import Alternative
from tippedisk_verify.conformance.diagnosis.factors import factor_said, monomial, named_values
from tippedisk_verify.conformance.diagnosis.predictions import Model
from tippedisk_verify.reference_values.store import Quantity

__all__ = ["matrices"]

Numbers = dict[str, float]
Factors = Sequence[tuple[float, list[int]]]  # numbers, and powers of Omega
_NONE: Factors = ((1.0, [0]),) * 3
_ENTRIES = ("dv'/dv", "dv'/dbeta", "dgamma'/dbeta times dv'/dgamma")
_ANGLES = ("0", "pi/2", "pi", "3 pi/2")
_AROUND = 48  # parts of a turn in which an angle is sought
_TURNS = 30  # 180 is nearly 29 turns
_SHORT = 5  # characters of a number that somebody typed; its mirror image at pi/2 has the same matrix, and more digits
_LEAST = 4  # entries that tell a factor and a power
_PLAIN = 1e-7  # relative: how near to 1 a factor is none


def matrices(
    entries: Sequence[Sequence[Quantity]], answers: Mapping[str, float], wrong: set[str]
) -> Iterator[tuple[float, str, Callable[[Sequence[Quantity]], Numbers]]]:
    """(rank, what is wrong, the eigenvalues then) for each other matrix that the answers suggest."""
    bad = [here for here in entries if any(quantity.id in wrong for quantity in here)]
    kinds = {here[0].inputs["equilibrium"] for here in bad}
    which = " and ".join(sorted(kinds))
    for beta, gamma in itertools.product(range(4), range(4)):
        text = f"the matrix at beta = {_ANGLES[beta]}, gamma = {_ANGLES[gamma]} for the {which} state"
        yield 1.0, text, partial(_spectrum, kinds, (beta * math.pi / 2, gamma * math.pi / 2, 0.0), _NONE)
    for short in ("3.14", "3.142", "3.1416", "3.14159", "22/7"):
        quarter = (22 / 7 if "/" in short else float(short)) / 2
        yield 1.0, f"the matrix at pi/2 with pi = {short}", partial(_spectrum, kinds, (quarter, None, 0.0), _NONE)
    for place, name in enumerate(("beta", "gamma")):
        for angle in _angles(place, bad[0], answers):
            state = (angle, math.pi / 2, 0.0) if place == 0 else (math.pi / 2, angle, 0.0)
            side = "+-" if place and len(kinds) > 1 else ""
            shown = angle if place == 0 or side or "inverted" in kinds else -angle
            digits = _shortest(shown)
            text = f"the matrix at {name} = {side}{digits} for the {which} state"
            rank = 3.0 if len(digits) <= _SHORT else 4.0
            yield rank, text, partial(_spectrum, kinds, state, _NONE, signed=True)
    found: list[list[tuple[float, list[float]]]] = [[], [], []]
    for here in bad:
        names = {f"lambda_{n}_{part}" for n in (1, 2, 3) for part in ("re", "im")}
        given = {quantity.name: answers[quantity.id] for quantity in here}
        if given.keys() != names:
            continue
        values = [complex(given[f"lambda_{n}_re"], given[f"lambda_{n}_im"]) for n in (1, 2, 3)]
        rights = _invariants([complex(*pair) for pair in _pairs(here)])
        for place, (mine, right) in enumerate(zip(_invariants(values), rights, strict=True)):
            found[place].append((mine / right, [float(here[0].inputs["Omega"])]))
    fits = [monomial(one) if len(one) >= _LEAST else None for one in found]
    if any(fit is None for fit in fits):
        return
    factors = [fit for fit in fits if fit is not None]
    said, known = [], True
    for name, (number, powers) in zip(_ENTRIES, factors, strict=True):
        if powers[0] or abs(number - 1) > _PLAIN:
            power = (("Omega", powers[0]),) if powers[0] else ()
            text, unknown = factor_said(number, power, named_values(bad[0][0].set))
            said.append(f"{name} {text}")
            known = known and not unknown
    if 0 < len(said) < len(_ENTRIES):
        of = "" if len(kinds) > 1 else f" of the {which} state"
        yield 2.0 if known else 9.0, f"in the matrix{of} {', '.join(said)}", partial(_spectrum, kinds, None, factors)


def _angles(place: int, here: Sequence[Quantity], answers: Mapping[str, float]) -> list[float]:
    """Those of beta (place 0) or of gamma's size (1) at which dv'/dv is as the answers to one entry have it."""
    from scipy.optimize import brentq

    traces = [quantity for quantity in here if quantity.name.endswith("_re")]
    wanted = sum(answers[quantity.id] for quantity in traces)
    omega, model = float(here[0].inputs["Omega"]), Model(Alternative("", ""), here[0].set, here[0].friction)
    side = 1 if here[0].inputs["equilibrium"] == "inverted" else -1

    def off(angle: float) -> float:
        state = [math.pi / 2, side * math.pi / 2, 0.0]
        state[place] = angle if place == 0 else side * angle
        rows = model.jacobian(omega, state)
        return rows[0][1] + rows[1][2] - wanted

    grid = [2 * math.pi * n / _AROUND - 0.01 for n in range(_AROUND + 1)]
    values = [off(angle) for angle in grid]
    spans = itertools.pairwise(zip(grid, values, strict=True))
    return [float(brentq(off, a, b, xtol=1e-14)) for (a, at_a), (b, at_b) in spans if at_a * at_b < 0]


def _shortest(angle: float) -> str:
    """The angle with as many turns as leave it the fewest digits."""
    turned = [f"{angle + 2 * math.pi * turns:.7g}" for turns in range(-_TURNS, _TURNS + 1)]
    return min(turned, key=lambda text: (len(text.lstrip("-")), abs(float(text))))


def _pairs(here: Sequence[Quantity]) -> list[tuple[float, float]]:
    right = {quantity.name: quantity.for_doubles for quantity in here}
    return [(right[f"lambda_{n}_re"], right[f"lambda_{n}_im"]) for n in (1, 2, 3)]


def _invariants(values: Sequence[complex]) -> tuple[float, float, float]:
    """(d, b, a c) from the eigenvalues."""
    x, y, z = values
    return (x + y + z).real, -(x * y + y * z + z * x).real, (x * y * z).real


def _spectrum(
    kinds: set[str],
    state: tuple[float, float | None, float] | None,
    factors: Factors,
    here: Sequence[Quantity],
    signed: bool = False,
) -> Numbers:
    """The eigenvalues by their names; those of ``kinds`` at a state instead, or with factors on d, b and a c.

    Without gamma the state has beta for it. This, or gamma if ``signed``, is negative where the disk is noninverted.
    """
    import numpy

    omega, model = float(here[0].inputs["Omega"]), Model(Alternative("", ""), here[0].set, here[0].friction)
    side = 1 if here[0].inputs["equilibrium"] == "inverted" else -1
    if here[0].inputs["equilibrium"] not in kinds:
        state, factors = None, _NONE
    beta, gamma, v = state or (math.pi / 2, side * math.pi / 2, 0.0)
    (a, turned, _), (b, c, d) = model.jacobian(
        omega, (beta, side * beta if gamma is None else side * gamma if signed else gamma, v)
    )
    d, b, ac = (x * number * omega ** powers[0] for x, (number, powers) in zip((d, b, a * c), factors, strict=True))
    # a and c only matter by their product.
    found = numpy.linalg.eigvals(numpy.array([[0.0, 0.0, 1.0], [1.0, turned, 0.0], [b, ac, d]])).tolist()
    ordered = sorted(map(complex, found), key=lambda value: (-round(value.real, 7), -value.imag))
    return {
        f"lambda_{n}_{part}": getattr(value, name)
        for n, value in enumerate(ordered, start=1)
        for part, name in (("re", "real"), ("im", "imag"))
    }
